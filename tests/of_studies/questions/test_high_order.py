"""References of the base scenes by steps of fourth order: how far they are known in time, and what such steps cost."""

from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pandas as pd
import pytest

import anctmm as at
from anctmm.results.metrics import history_error
from reference import global_dae
from studies.engine.accuracy.dynamics import AS_GIVEN, fine_run, reference_of, with_stretch
from studies.engine.runner import Runner
from studies.engine.study import Options
from studies.scenes import base_of
from studies.trade.advice import advice
from studies.trade.choice import setting_of
from studies.trade.own_ladder import own_ladder
from studies.trade.plan import ladders
from studies.trade.recommendation import recommend
from studies.trade.second_road import second_roads
from studies.trade.step_orders import COLUMNS, step_orders
from studies.trade.tables import where_high_order_pays

MESHES = {"cantilever-fall": 8, "four-bar": {"crank": 2, "coupler": 8, "follower": 2}}


@cache
def run(name, dt, elements=None, solve=at.solve):
    case = base_of(name)
    found = solve(
        case.scene, mesh=elements or dict(mesh(name)), quadrature="lobatto", integrator="esdirk", dt=dt,
        t_end=case.t_end, output_dt=case.output_dt, newton_tolerance=1e-12,
    )  # fmt: skip
    assert found.status.ok
    return found


def mesh(name):
    given = MESHES[name]
    return given if isinstance(given, dict) else {"beam": given}


def apart(name, one, other):
    return at.compare(one, other, base_of(name).probes).error


@pytest.mark.parametrize(
    ("name", "dt", "gauss_dt"), [("cantilever-fall", 1.25e-4, 1e-3), ("four-bar", 2.5e-4, 2e-3)]
)
def test_two_roads_know_both_base_scenes_to_1e_9_in_time(name, dt, gauss_dt):
    """The recursion with five stages a step, and Gauss's points on independent coordinates: of the same mesh."""
    ours, other = run(name, dt), run(name, gauss_dt, solve=global_dae.solve)
    assert apart(name, run(name, 2.0 * dt), ours) / 15.0 < 1e-9
    assert apart(name, other, ours) < 1e-9


def order(name, dt, elements=None):
    """Observed order in time from steps 4 dt, 2 dt, dt, and the last difference."""
    four, two, one = (run(name, k * dt, elements) for k in (4, 2, 1))
    last = apart(name, two, one)
    return float(np.log2(apart(name, four, two) / last)), last


def test_the_drive_is_smooth_and_a_sudden_release_is_not():
    """Of a released beam mode k has the amplitude k⁻⁵ and a frequency ~ k²: what a step h does not resolve is ~ h².

    On coarse meshes all modes are resolved and the order is 4; on a fine one it is 2, whatever the method: there a
    reference is known to 1e-9 by steps of 0.03 ms only.
    """
    smooth, last = order("four-bar", 2.5e-4)
    assert smooth == pytest.approx(4.0, abs=0.1)
    assert last < 1e-9
    resolved, _ = order("cantilever-fall", 1.25e-4)
    assert resolved == pytest.approx(4.0, abs=0.1)
    released, last = order("cantilever-fall", 6.25e-5, 32)
    assert released == pytest.approx(2.0, abs=0.3)
    assert last < 1e-8


def test_the_trade_has_references_and_settings_of_fourth_order():
    for quick in (False, True):
        for ladder in ladders(quick):
            assert ladder.references["cable"].integrator == "esdirk"
            high = [s for s in ladder.plan(quick).schemes if s.integrator == "esdirk"]
            assert {s.solvers for s in high} == {("anctmm",)}
            assert {dict(s.options)["newton_tolerance"] for s in high} == {1e-3, 1e-5, 1e-7}


@pytest.mark.parametrize(("place", "uncertainty", "apart"), [(0, 1e-9, 2e-9), (1, 6e-9, 6e-9)])
def test_two_roads_know_the_references_of_the_trade_to_1e_8(place, uncertainty, apart):
    """Mesh and step together, by another solver and method, and by another element.

    The first is the four-bar, whose drive is smooth, the second the released cantilever.
    """
    ladder, runner = ladders(False)[place], Runner(None, repeats=1)
    fine = ladder.references["cable"]
    best = reference_of(ladder.base, "cable", fine, runner)
    assert best.uncertainty < uncertainty
    second = second_roads(ladder.base, ladder.second, {"cable": best}, runner)["cable"]
    assert second.name.startswith("global-dae quintic esdirk")
    assert second.apart < apart
    coarse, twice = (cubic(ladder.base, fine, k, runner) for k in CUBIC)
    for probe in ladder.base.probes:
        u, v = coarse.displacement(probe), twice.displacement(probe)
        off = history_error(v + (v - u) / 15.0, best.solution.displacement(probe))
        assert off < apart


#: Elements of cubic cables, over those of the reference: two meshes for Richardson's estimate.
CUBIC = Fraction(4, 3), Fraction(8, 3)


def cubic(base, fine, finer, runner):
    """By cubic cables, whose error is of fourth order in the mesh."""
    run = replace(fine_run(base, "cable", fine), element="cable", quadrature="lobatto")
    found = runner.solve(replace(run, mesh=tuple(int(n * finer) for n in fine.mesh))).solution
    assert found.status.ok
    return found


def test_orders_of_the_references_steps_are_shown():
    """A drive keeps order 4; a release does on a coarse mesh, whose modes the steps resolve, and not on a fine one."""
    runner = Runner(None, repeats=1)
    meshes = {0: [(1, 3, 1)], 1: [(8,), (48,)]}
    for place, ladder in enumerate(ladders(False)):
        fine = replace(ladder.references["cable"], dt=1.25e-4 if place else 2.5e-4)
        rows = pd.DataFrame(step_orders(ladder.base, "cable", fine, meshes[place], runner))
        assert set(rows["status"]) == {"ok"}
        assert list(rows.columns) == list(COLUMNS)
        last = rows.groupby("elements", sort=False)["order"].last()
        assert last.iloc[0] == pytest.approx(4.0, abs=0.2)
        if place:
            assert last.iloc[1] == pytest.approx(2.0, abs=0.4)


def test_references_of_the_trade_free_the_stretch():
    for ladder in ladders(False):
        fine = ladder.references["cable"]
        assert (fine.element, fine.integrator, fine.stretch) == ("quintic", "esdirk", "free")
        run = fine_run(ladder.base, "cable", fine)
        assert {j.stretch for j in run.scene.joints if isinstance(j, at.Clamp)} == {"free"}
        free = [s for s in ladder.plan(False).schemes if s.stretch == "free"]
        assert {(s.element, s.integrator) for s in free} == {
            ("quintic", "esdirk"),
            ("quintic", "generalized-alpha"),
        }
        assert ladder.targets[-1] == 1e-7
    assert with_stretch(ladder.base.scene, AS_GIVEN) is ladder.base.scene
    with pytest.raises(at.errors.UnknownOptionError, match="stretch is 'loose'"):
        with_stretch(ladder.base.scene, "loose")


def test_a_setting_that_frees_the_stretch_is_written_out():
    line = {
        "scene": "four-bar", "solver": "anctmm", "element": "quintic", "family": "quintic", "quadrature": "-",
        "integrator": "esdirk", "elements": "1/4/1", "dt": 1e-3, "tolerance": np.nan, "newton_tolerance": 1e-7,
    }  # fmt: skip
    assert recommend.case_of(line, base_of("four-bar")).scene == base_of("four-bar").scene  # tables of before
    free = line | {"stretch": "free"}
    assert "clamps free the stretch" in setting_of(free)
    assert "clamps" not in setting_of(line)
    assert 'stretch="free"' in recommend.script(free)
    assert 'stretch="free"' not in recommend.script(line)


def test_quintic_settings_are_measured_against_the_reference_of_their_continuum():
    case = base_of("cantilever-fall")
    found = at.solve(case.scene, mesh=1, element="quintic", dt=1e-2, t_end=2e-2)
    u = found.displacement("beam.end")
    about = {"scene": "s", "element": "cable", "body": "beam", "fraction": 1.0}
    kept = pd.DataFrame(about | {"t": found.t, "u_x": u[:, 0], "u_y": u[:, 1]})
    assert recommend.error_against(found, kept, "s", "quintic") == 0.0


def test_small_targets_of_users_cases_have_references_of_high_order():
    """Where the target asks for it; above, as before."""
    beam = at.Beam("rod", (0.0, 0.0), (1.0, 0.0), at.Rectangle(0.1, 0.1), at.Material(E=1e6, density=1000.0))
    scene = at.Scene("swing", [beam], [at.Pin("rod.start")], gravity=(0.0, -9.81))
    case = at.Case(scene, probes=["rod.end"], t_end=0.2, output_dt=0.02)
    for error, kind, integrator in ((1e-7, "quintic", "esdirk"), (1e-4, "cable", "generalized-alpha")):
        ladder = own_ladder(case, Options(quick=True, error=error, element="cable"), Runner(None, repeats=1))
        found = ladder.references["cable"]
        assert found.uncertainty < error
        assert (found.solution.run.element, found.solution.run.integrator) == (kind, integrator)
        assert ladder.targets[-1] == error


def rival(target, stepping, cost, status="ok"):
    about = {
        "scene": "s",
        "target_error": target,
        "solver": "anctmm",
        "element": "cable",
        "stepping": stepping,
    }
    return about | {"cpu_s_at_error": cost, "status": status}


def test_the_sentence_on_high_order_is_that_of_the_table():
    costs = [(1e-3, 1.0, 2.0), (1e-4, 4.0, 3.0), (1e-5, 16.0, 4.0)]
    rows = [rival(t, "implicit", a) for t, a, _ in costs] + [
        rival(t, "implicit, fourth order", b) for t, _, b in costs
    ]
    rows.append(rival(1e-6, "implicit, fourth order", 8.0))
    (said,) = where_high_order_pays(pd.DataFrame(rows))
    assert "pays from a target error of 0.0001 on" in said
    assert "4 at 1e-05" in said.replace("4.0", "4")
    assert "it alone meets 1e-06" in said
    assert where_high_order_pays(pd.DataFrame(rows[:3])) == []
    (never,) = where_high_order_pays(pd.DataFrame([rows[0], rows[3]]))
    assert "does not pay at the target errors" in never


def test_advice_says_that_steps_are_of_fourth_order():
    """And of steps that a tolerance drives nothing but the tolerance."""
    line = {
        "scene": "s", "target_error": 1e-6, "solver": "anctmm", "element": "quintic", "quadrature": "-",
        "integrator": "esdirk", "elements": "2/6/2", "dt": 1e-3, "tolerance": np.nan, "error": 1e-7, "cpu_s": 0.1,
        "error_from": "step", "mesh_error": 1e-8, "step_error": 1e-7, "status": "ok",
    }  # fmt: skip
    controlled = line | {"integrator": "generalized-alpha", "tolerance": 1e-3}
    rivals = pd.DataFrame([rival(1e-6, "implicit, fourth order", 1.0) | {"ratio": 1.0}])
    said = advice(pd.DataFrame([line, controlled]), rivals).frame["step"]
    assert list(said) == ["implicit, fourth order, 1 ms", "implicit, tolerance 0.001"]
