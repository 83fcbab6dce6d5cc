"""References of the base scenes by steps of fourth order: how far they are known in time, and what such steps cost."""

from functools import cache

import numpy as np
import pandas as pd
import pytest

import anctmm as at
from reference import global_dae
from studies.scenes import base_of
from studies.trade.plan import lacks_of_high_order, ladders
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
    plate = at.RigidBody("plate", 1.0, 0.1, (1.0, 0.0))
    rigid = at.Case(at.Scene("rigid", [plate], gravity=(0.0, -9.81)), probes=["plate.center"], t_end=1.0)
    assert lacks_of_high_order(rigid) == ["rigid bodies of any mass, inertia and points"]


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
    assert "does not pay at the errors asked for" in never
