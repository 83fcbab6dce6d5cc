"""The study of extremes, quick: a number of each part beside its theory."""

from fractions import Fraction
from math import sqrt

import numpy as np
import pandas as pd
import pytest

from anctmm.errors import SolverError
from anctmm.integrators.stability import zhai_limit
from anctmm.integrators.statics.equilibrium_stability import DOUBTFUL
from studies.engine.measuring.setting import CABLES, SHEAR
from studies.engine.runner import Runner
from studies.engine.study import Options, Result, find
from studies.extremes.double_double import minus_products, plus, two_product, two_sum
from studies.extremes.length import CONDENSED, PAPER, PLAIN, SPARSE, SPLIT, Problem, growth
from studies.extremes.parameters import CHOLESKY, GLOBAL, INVERTED, NEWTON, RECURSION
from studies.extremes.places import FAR, TENS, TWOS
from studies.extremes.plane import limit, spectral_radius
from studies.extremes.time import FREE, OURS, PROJECTED
from studies.report.folder import write


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> Result:
    return find("extremes")(Options(quick=True), Runner(tmp_path_factory.mktemp("runs"), repeats=1))


@pytest.fixture(scope="module")
def frame(result):
    return lambda name: result.table(f"extremes_{name}").frame


def only(frame: pd.DataFrame, **wanted) -> pd.DataFrame:
    """Rows with these values; there must be some."""
    for column, value in wanted.items():
        frame = frame[frame[column] == value]
    assert len(frame) > 0
    return frame


# --- length --------------------------------------------------------------------------------------------------


def test_riccati_keeps_its_digits_at_every_length_and_the_plain_product_does_not(frame):
    rows = frame("length")
    for road in (PAPER, CONDENSED, SPLIT, SPARSE):
        mine = only(rows, road=road)
        assert mine["elements"].max() == 1000
        assert mine["measured"].max() < 1e-13
    assert rows["uncertainty"].max() < 1e-28
    plain = only(rows, road=PLAIN)
    assert only(plain, elements=10)["measured"].min() > 1.0
    early = plain[plain["elements"] <= 7]
    assert (early["measured"] < 30.0 * early["predicted"]).all()
    assert (early["measured"] > early["predicted"] / 30.0).all()


@pytest.mark.parametrize("variant", [SHEAR, CABLES[0]], ids=["shear", "cable"])
def test_the_reference_is_the_exact_rational_solution(variant):
    problem = Problem(variant, 2)
    k, m, load = len(problem.load) // 2, problem.mass, problem.load[::2]
    n = 3 * k
    M = [[Fraction(0)] * n for _ in range(n)]
    for e in range(2):
        for i in range(2 * k):
            for j in range(2 * k):
                M[k * e + i][k * e + j] += Fraction(float(m[i, j]))
    rows = [[*M[i][1:], Fraction(float(load[i % k, i // k]))] for i in range(1, n)]  # r of the pin is known
    for i in range(n - 1):
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for j in range(n - 1):
            if j != i:
                factor = rows[j][i]
                rows[j] = [x - factor * y for x, y in zip(rows[j], rows[i], strict=True)]
    (high, low), uncertainty = problem.exact
    for i in range(1, n):
        exact = rows[i - 1][-1]
        found = Fraction(float(high[2 * (i % k), i // k])) + Fraction(float(low[2 * (i % k), i // k]))
        size = float(np.abs(high[2 * (i % k)]).max())
        assert abs(float(found - exact)) < 1e-28 * size
    assert uncertainty < 1e-28


def test_pairs_of_numbers_keep_what_one_number_loses():
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((2, 50)) * 10.0 ** rng.integers(-12, 12, (2, 50))
    for x, y, s, p in zip(
        a, b, zip(*two_sum(a, b), strict=True), zip(*two_product(a, b), strict=True), strict=True
    ):
        assert sum(map(Fraction, s)) == Fraction(x) + Fraction(y)
        assert sum(map(Fraction, p)) == Fraction(x) * Fraction(y)
    big = (np.array([1e16]), np.array([0.25]))
    high, low = minus_products(plus(big, np.array([-1e16])), 0.5, (np.array([0.5]), np.array([1e-20])))
    assert (float(high[0]), float(low[0])) == (-5e-21, 0.0)


def test_growth_of_the_plain_product_is_the_eigenvalue_of_68():
    assert growth(SHEAR) == pytest.approx(68.17228516, abs=1e-7)
    assert growth(CABLES[0]) == pytest.approx(68.17228516, abs=1e-7)


# --- step ----------------------------------------------------------------------------------------------------


def test_measured_limits_are_those_of_theory_within_a_percent(frame):
    rows = frame("step")
    assert set(rows["status"]) == {"ok"}
    assert set(rows["solver"]) == {"anctmm", "global-dae", "exudyn-cable"}
    assert set(rows["what"]) == {"solver", "mesh", "psi = phi", "stiffness", "slenderness", "state"}
    assert set(zip(rows["element"], rows["quadrature"], strict=True)) == {
        ("cable", "full"), ("cable", "reduced"), ("cable", "lobatto"), ("shear", "-"),
    }  # fmt: skip
    assert rows["difference"].abs().max() < 0.01
    np.testing.assert_allclose(rows["predicted"] * rows["omega_max"], np.sqrt(2.0 / rows["psi"]), rtol=1e-12)
    assert rows["solver_omega_off"].abs().max() < 0.005  # the stiffness of torques, which it leaves out
    straight = rows[rows["state"] == "at rest"]
    assert straight["solver_omega_off"].abs().max() < 1e-7


def test_pairs_of_the_plane_are_stable_where_jury_says_so(frame):
    rows = frame("plane")
    stable = rows[rows["limit"] > 0.0]
    assert len(rows) == 9
    assert len(stable) == 5
    assert stable["difference"].abs().max() < 0.01
    assert stable["difference_limit"].abs().max() < 0.01
    unstable = rows[rows["limit"] == 0.0]  # growth at small steps is slow, and as slow as predicted
    assert unstable["difference"].abs().max() < 0.15
    assert unstable["measured"].max() < 0.5


PAIRS = [(psi, phi) for psi in (0.0, 0.3, 0.5, 0.7, 1.2) for phi in (0.3, 0.5, 0.6, 0.75, 1.5)]


@pytest.mark.parametrize(("psi", "phi"), [pair for pair in PAIRS if limit(*pair) == 0.0])
def test_pairs_without_a_limit_grow_at_a_small_step(psi, phi):
    assert spectral_radius(psi, phi, np.array([0.05]))[0] > 1.0 + 1e-8


@pytest.mark.parametrize(("psi", "phi"), [pair for pair in PAIRS if limit(*pair) > 0.0])
def test_limit_of_a_pair_is_where_its_spectral_radius_passes_one(psi, phi):
    bound = limit(psi, phi)
    inside = np.linspace(0.02, 0.999, 40) * bound
    assert spectral_radius(psi, phi, inside).max() < 1.0 + 1e-12
    assert spectral_radius(psi, phi, np.array([1.001 * bound]))[0] > 1.0
    if psi == phi:
        assert bound == pytest.approx(zhai_limit(psi, phi)) == pytest.approx(sqrt(2.0 / psi))


def test_damping_lowers_the_limit_as_theory_says(frame):
    rows = frame("damping")
    assert rows["difference"].abs().max() < 0.01
    np.testing.assert_allclose(rows["spectral_radius"], rows["predicted"], rtol=1e-5)
    for ratio, bound in ((0.1, 1.64), (1.0, 0.472)):
        assert only(rows, damping_ratio=ratio)["measured_omega"].to_numpy() == pytest.approx(bound, abs=5e-3)


# --- parameters ----------------------------------------------------------------------------------------------


def test_cables_at_rest_keep_their_digits_over_stiffness_and_slenderness(frame):
    cables = only(frame("parameters"), element="cable", road=NEWTON)
    known = cables["rounding"] < DOUBTFUL
    assert set(cables.loc[known, "status"].str[:2]) == {"ok"}
    assert (cables["difference"].abs() < cables["rounding"] + 1e-11).all()
    # a stiff beam on a soft one: what rounding of its stiffness leaves of the soft one's may be that of a mechanism
    (hidden,) = cables.loc[~known, "status"]
    assert hidden.startswith("singular")
    assert "rounding hides its stiffness, as body 'outer' is 1e+09 times stiffer than 'inner'" in hidden
    assert only(cables, what="Poisson's ratio")["difference"].abs().max() < 1e-12


def test_shear_elements_lock_as_theory_says(frame):
    locked = only(frame("parameters"), element="shear", what="Poisson's ratio", road=NEWTON)
    assert locked["value"].max() == 0.4999
    assert (locked["difference"].abs() < 0.1 * locked["uncertainty"]).all()


def test_slender_shear_elements_keep_what_rounding_leaves_on_every_road(frame):
    """With inverted blocks the fourth power of l/h is lost, and at 1e5 all digits."""
    slender = only(frame("parameters"), element="shear", what="slenderness l/h")
    for road in (RECURSION, CHOLESKY):
        mine = only(slender, road=road)
        assert mine["value"].max() == 1e5
        assert (mine["difference"].abs() < 3.0 * (mine["rounding"] + mine["uncertainty"])).all()
    assert abs(only(slender, road=INVERTED, value=1e5)["difference"].iloc[0]) > 0.5
    for road in (NEWTON, GLOBAL):
        assert abs(only(slender, road=road, value=1e5)["difference"].iloc[0]) < 1e-3
    carried = only(frame("parameters"), element="shear", what="stiffness ratio, soft inside", road=NEWTON)
    assert carried["value"].max() == 1e9
    assert carried["difference"].abs().max() < 1e-4


def test_place_and_units_change_only_what_rounding_may(frame):
    rows = frame("places")
    assert set(rows["status"]) == {"ok"}
    twos, tens, far = (only(rows, what=what) for what in (TWOS, TENS, FAR))
    assert twos["same_bits"].all()
    assert (twos["measured"] == 0.0).all()
    assert tens["measured"].max() < 1e-12
    explicit = only(far, integrator="zhai", place=1e6)
    assert (explicit["measured"] < 5.0 * explicit["predicted"]).all()
    assert (explicit["measured"] > explicit["predicted"] / 5.0).all()
    assert far["measured"].max() < 1e-5


# --- time ----------------------------------------------------------------------------------------------------


def test_energy_of_a_small_swing_does_not_drift(frame):
    small = only(frame("energy"), motion="small swing", integrator="zhai")
    assert set(small["status"]) == {"ok"}
    assert small["measured"].max() < 1e-8


def test_joints_and_drive_drift_by_nothing_but_in_the_dae_as_its_recursion_predicts(frame):
    rows = frame("joints")
    assert set(rows["status"]) == {"ok"}
    ours = only(rows, solver=OURS)
    assert (ours["gap"] == 0.0).all()
    assert (ours["measured"] == 0.0).all()
    assert only(rows, solver=PROJECTED)["measured"].max() < 1e-15
    (free,) = only(rows, solver=FREE).to_dict("records")
    assert free["measured"] == pytest.approx(free["predicted"], rel=0.01)
    assert free["measured"] > 1e-9


# --- deformation ---------------------------------------------------------------------------------------------


def test_two_circles_close_with_order_four(frame):
    cables = only(frame("rolled"), element="cable")
    assert cables["order"].iloc[-1] == pytest.approx(4.0, abs=0.2)
    assert cables["measured"].iloc[-1] < 1e-5
    assert only(frame("rolled"), element="shear")["measured"].iloc[-1] < 5e-3


def test_a_disturbance_grows_only_where_motions_cannot_be_compared(frame):
    rows = frame("growth").set_index("scene")
    fast, falling = rows.loc["four-bar, T = 1 s"], rows.loc["pair of pinned beams, falling"]
    assert fast["verdict"] == "comparable to the end"
    assert fast["growth"] < 200.0
    assert 1e-3 < fast["measured"] == fast["whole_run"] < 0.1
    assert fast["uncertainty"] < 0.2 * fast["measured"]
    assert falling["growth"] > 1e4
    assert falling["comparable_until"] < falling["t_end"]
    assert falling["verdict"].startswith("not comparable beyond t = ")


def test_an_element_turned_inside_out_is_named_when_it_happens(frame):
    shear = only(frame("inside_out"), element="shear")
    assert (np.abs(shear["measured"] - shear["predicted"]) <= shear["uncertainty"]).all()
    assert (shear["body"] == "bar").all()
    assert shear["status"].str.contains("is turned inside out").all()


# --- the whole -----------------------------------------------------------------------------------------------


def test_every_table_tells_what_it_is_measured_against(result, tmp_path):
    assert len(result.findings) == 14
    for table in result.tables:
        assert {"measured", "reference", "uncertainty", "status"} <= set(table.frame.columns), table.name
    folder = write(result, tmp_path)
    assert {p.stem for p in folder.glob("*.svg")} == {shown.name for shown in result.pictures}
    assert len(result.pictures) >= 9
    for sentence in result.findings:
        assert "nan" not in sentence


def test_finished_parts_are_not_repeated(result, tmp_path):
    told = []
    runner = Runner(tmp_path, on_job=lambda label, done, total: told.append((label, done, total)))

    def failing():
        raise SolverError("no such luck")

    def job(label, compute):
        return label, compute, lambda error: f"{label}: {error}"

    first = [job("one", lambda: 1), job("two", failing)]
    assert runner.jobs(first, "code") == [1, "two: no such luck"]
    assert told == [("one", 1, 2), ("two", 2, 2)]
    again = [job("one", failing), job("two", lambda: 2)]
    assert runner.jobs(again, "code") == [1, 2]  # what failed was not kept
    assert runner.jobs(again, "other code") == ["one: no such luck", 2]
    with pytest.raises(ZeroDivisionError):
        runner.jobs([job("bug", lambda: 1 / 0)], "code")
