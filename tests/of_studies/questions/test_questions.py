"""Convergence, fidelity and extremes of cases that nobody tuned for, and single runs."""

import numpy as np
import pytest
from typer.testing import CliRunner
from user_cases import ARM, DOUBLE_PENDULUM, FILES, PORTAL_FRAME

import anctmm as at
from studies import convergence, fidelity
from studies.cases import cases_in, find_case
from studies.cli import app
from studies.engine.runner import Runner
from studies.engine.study import Options, StudyError
from studies.extremes import study as extremes
from studies.fidelity import Choices
from studies.single_run import run_case, write_run

RUNNER = Runner(quick=True)
EVERY = [case for file in FILES for case in cases_in(file)]


def asked(case, **options):
    return Options(quick=True, cases=(case,), **options)


# --- convergence ------------------------------------------------------------------------------------------------


@pytest.mark.exhaustive
@pytest.mark.parametrize("case", EVERY, ids=lambda c: c.name)
def test_convergence_of_any_case(case):
    result = convergence.run(asked(case), RUNNER)
    assert result.good
    for name in ("mesh", "step"):
        frame = result.table(name).frame
        assert frame["status"].eq("ok").all()
        assert frame["error"].is_monotonic_decreasing or len(frame) < 3
    values = result.table("values").frame
    assert (values["uncertainty"] > 0.0).all()
    assert result.pictures
    assert result.answers


def test_equilibria_tend_to_exact_solutions():
    for name, element, continuum in (
        ("cantilever-moment-3.14", "cable", "elastica"),
        ("cantilever-force-3", "shear", "director"),
    ):  # fmt: skip
        result = convergence.run(asked(find_case(name), element=element, error=1e-3), RUNNER)
        (line,) = result.table("exact").frame.to_dict("records")
        assert line["continuum"] == continuum
        assert 0.0 < line["difference"] <= line["estimate"]


def test_meshes_and_steps_that_are_given_are_those_of_the_table():
    case = find_case(ARM)
    result = convergence.run(asked(case, meshes=((2,), (4,), (8,)), steps=(2e-3, 1e-3)), RUNNER)
    assert result.table("mesh").frame["elements"].tolist() == ["2", "4", "8"]
    assert result.table("step").frame["dt"].tolist() == [2e-3, 1e-3]


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        (DOUBLE_PENDULUM, {"meshes": ((2, 2), (4, 2))}, "finer everywhere"),
        (DOUBLE_PENDULUM, {"meshes": ((2, 2, 2),)}, "needs 1 or 2 numbers"),
        (DOUBLE_PENDULUM, {"meshes": ((2,),), "steps": (1e-3,)}, "nothing converges"),
        ("cantilever-force-1", {"steps": (1e-3,)}, "has no step"),
        ("cantilever-force-1", {"integrator": "zhai"}, "static equilibrium"),
    ],
)
def test_levels_that_do_not_fit_are_named(name, options, message):
    with pytest.raises(StudyError, match=message):
        convergence.run(asked(find_case(name), **options), RUNNER)


def test_a_solver_that_cannot_do_a_case_is_a_finding():
    result = convergence.run(asked(find_case(DOUBLE_PENDULUM), solvers=("pyelastica",)), RUNNER)
    assert not result.good
    assert "unsupported" in result.findings[0]


# --- fidelity ---------------------------------------------------------------------------------------------------


def test_a_stiff_beam_may_be_rigid_and_a_soft_one_not():
    soft, stiff = at.Material(E=5e6, density=1000.0), at.Material(E=1e10, density=1000.0)
    rod = at.Rectangle(0.02, 0.01)
    arm = at.Beam("arm", (0, 0), (0.3, 0), rod, stiff)
    tail = at.Beam("tail", (0.3, 0), (0.6, 0), rod, soft)
    scene = at.Scene(
        "arm", [arm, tail], [at.Pin("arm.start"), at.Pin("arm.end", "tail.start")], gravity=(0, -9.81)
    )
    result = fidelity.run(asked(at.Case(scene, ["tail.end", ("tail", 0.5)], t_end=0.1)), RUNNER)
    alone = result.table("beams").frame.set_index(["beam", "kind"])
    assert alone.loc[("arm", "rigid"), "enough_for"] <= 1e-2
    assert not alone.loc[("tail", "rigid"), "enough_for"] <= 1e-2
    cheapest = result.table("cheapest").frame
    assert cheapest["status"].eq("ok").any()
    assert (cheapest["error"] + cheapest["reference_error"] <= cheapest["target"]).all()


def test_shear_elements_are_no_measure_with_thickness_locking():
    assert fidelity.kinds_of(find_case(PORTAL_FRAME, "portal-frame").scene) == ("cable", "rigid")
    assert fidelity.kinds_of(find_case(DOUBLE_PENDULUM).scene) == ("shear", "cable", "rigid")


def test_of_many_beams_equal_ones_are_chosen_together():
    rod, steel = at.Circle(0.01), at.Material(E=1e9, density=1000.0)
    beams = [at.Beam(f"b{k}", (k, 0), (k + 1, 0), rod, steel) for k in range(10)]
    pins = [at.Pin(f"b{k}.end", f"b{k + 1}.start") for k in range(9)]
    choices = Choices.of(at.Scene("chain", beams, [at.Pin("b0.start"), *pins]), ("cable", "rigid"))
    assert choices.units == (tuple(range(10)),)
    assert choices.first() == [("cable",) * 10, ("rigid",) * 10]


def test_units_are_simplified_together_up_to_a_target():
    choices = Choices(("a", "b", "c"), ((0,), (1,), (2,)), ("cable", "rigid"))
    error = {(0, "rigid"): 1e-3, (1, "rigid"): 5e-3, (2, "rigid"): 0.5}
    assert choices.best(error, (1e-2, 2e-3)) == [("rigid", "rigid", "cable"), ("rigid", "cable", "cable")]
    assert choices.words(("rigid", "rigid", "cable")) == "rigid, but c cable"


# --- extremes ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def limits():
    return extremes.run(asked(find_case(ARM)), RUNNER)


def test_a_fixed_step_below_the_limit_holds_and_one_above_does_not(limits):
    steps = limits.table("stable_step").frame
    assert (steps[steps["factor"] < 0.95]["status"] == "ok").all()
    assert not (steps[steps["factor"] > 1.2]["balance"].fillna(np.inf) < 1.0).any()


def test_far_from_the_origin_only_rounding_changes(limits):
    places = limits.table("places").frame
    assert (places["difference"] <= places["predicted"]).all()


def test_stiff_beams_tend_to_rigid_bars(limits):
    stiff = limits.table("stiffness").frame
    assert stiff["difference"].iloc[-1] < 1e-2 * stiff["difference"].iloc[0]


def test_two_solvers_can_be_compared_where_a_disturbance_hardly_grows(limits):
    growth = limits.table("growth").frame
    assert growth["status"].eq("ok").all()
    assert growth["comparable_until"].iloc[-1] == pytest.approx(0.1)
    assert {"many_elements", "loads", "time"} <= {table.name for table in limits.tables}


def test_equilibria_have_limits_too():
    result = extremes.run(asked(find_case("cantilever-force-3")), RUNNER)
    assert {t.name for t in result.tables} == {"places", "many_elements", "stiffness", "loads"}
    assert result.table("loads").frame["largest"].is_monotonic_increasing


# --- single runs ------------------------------------------------------------------------------------------------


def test_a_run_meets_its_target_and_its_files_are_there(tmp_path):
    done = run_case(asked(find_case(ARM), error=1e-2, solvers=("anctmm", "global-dae")), RUNNER)
    assert done.found.reached
    assert not done.missed
    assert write_run(done, tmp_path)
    files = {path.name for path in tmp_path.iterdir()}
    assert files > {"values.csv", "solution.npz", "probes.csv", "plot.png", "animation.html"}
    assert at.load(tmp_path / "solution.npz").status.ok


def test_a_refused_run_leaves_the_files_of_an_earlier_one(tmp_path):
    case = find_case(ARM)
    write_run(run_case(asked(case, error=1e-1), RUNNER), tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    refused = run_case(asked(case, meshes=((2,),), steps=(0.01,), solvers=("pyelastica",)), RUNNER)
    assert not write_run(refused, tmp_path)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(("dt", "code"), [("1e-2", 1), ("5e-3", 0)])
def test_another_solver_that_differs_too_much_is_exit_code_1(dt, code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    setting = ["--elements", "4", "--dt", dt, "--solvers", "anctmm,global-dae"]
    line = ["run", ARM, *setting, "--error", "0.2" if code == 0 else "1e-15"]
    assert CliRunner().invoke(app, line).exit_code == code
