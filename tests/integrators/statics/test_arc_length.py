"""Paths of equilibria by their arc length: past limit points, with the load falling and growing again."""

from math import hypot, sqrt

import numpy as np
import pytest
from samples import KINDS, SOFT, SQUARE, bar
from scipy.optimize import minimize_scalar

from anctmm.errors import DiscretisationError, UnknownOptionError
from anctmm.model.scene import Beam, Clamp, Force, Pin, Scene, Torque
from anctmm.model.sections import Rectangle
from anctmm.solve import solve_static

RISE = 0.1
#: So deep that the bars of the truss do not buckle: a cable has no shear.
DEEP = Rectangle(1e-4, 1.0)


def truss(load):
    """Two hinged bars that stay straight, pushed down where they meet."""
    return Scene(
        "truss",
        [
            Beam("a", (0.0, 0.0), (1.0, RISE), DEEP, SOFT),
            Beam("b", (1.0, RISE), (2.0, 0.0), DEEP, SOFT),
        ],
        [Pin("a.start", grounded=True), Pin("a.end", "b.start"), Pin("b.end", grounded=True)],
        [Force("a.end", (0.0, -load))],
    )


def push(height):
    """Force that holds the truss's apex at a height: twice the vertical part of a bar's force."""
    long, now = hypot(1.0, RISE), np.hypot(1.0, height)
    return -2.0 * SOFT.E * DEEP.area * (now / long - 1.0) * height / now


#: Largest force, and the apex's height there.
PEAK = minimize_scalar(lambda y: -push(y), bounds=(0.0, RISE), method="bounded", options={"xatol": 1e-12})


def test_a_truss_snaps_through_as_its_equation_says():
    limit = -PEAK.fun
    found = solve_static(truss(1.5 * limit), mesh=2, path="arclength", newton_tolerance=1e-12)
    assert found.status.ok, found.status
    assert "limit points at load factors 0.666667, -0.666667" in found.status.message
    heights = found.position("a", 1.0)[:, 1]
    assert found.t * 1.5 * limit == pytest.approx(push(heights), abs=1e-9 * limit)
    assert (np.diff(found.t) < 0.0).any()  # the path turns back at the first limit point
    assert np.isclose(found.t, 1.0 / 1.5, rtol=1e-10).any()
    assert np.isclose(found.t, -1.0 / 1.5, rtol=1e-10).any()
    assert found.t[-1] == 1.0
    assert heights[-1] < -RISE
    between = (heights < PEAK.x - 1e-6) & (heights > -PEAK.x + 1e-6)
    assert not found.stable[between].any()
    assert found.stable[(heights > PEAK.x + 1e-6) | (heights < -PEAK.x - 1e-6)].all()


def test_a_path_below_its_limit_point_ends_at_the_whole_load():
    """At the equilibrium that growing loads lead to."""
    scene = truss(-0.99 * PEAK.fun)
    one, two = solve_static(scene, mesh=1, path="arclength"), solve_static(scene, mesh=1)
    assert one.status.message == ""
    assert one.t[-1] == 1.0
    assert (np.diff(one.t) > 0.0).all()
    assert np.abs(one.position("a", 1.0)[-1] - two.position("a", 1.0)[-1]).max() < 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_a_moment_rolls_up_along_the_path(kind):
    scene = bar([Clamp("bar.start")], [Torque("bar.end", 0.5)])
    one = solve_static(scene, mesh=4, element=kind, path="arclength")
    two = solve_static(scene, mesh=4, element=kind)
    assert one.status.ok, one.status
    assert np.abs(one.position("bar", 1.0)[-1] - two.position("bar", 1.0)[-1]).max() < 1e-8


def test_an_unstable_end_is_unstable():
    """A perfect column beyond Euler's load: the path is the straight one."""
    euler = SOFT.E * SQUARE.second_moment * np.pi**2 / 4.0
    beam, push = Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT), Force("bar.end", (-1.2 * euler, 0.0))
    column = Scene("column", [beam], [Clamp("bar.start")], [push])
    found = solve_static(column, mesh=4, path="arclength", load_steps=10)
    assert found.status == "unstable"
    assert np.array_equal(found.stable, found.t < 1.0 / 1.2)


def test_a_mechanism_has_no_path_and_keeps_its_start():
    found = solve_static(bar([Pin("bar.start")], gravity=(0.0, -9.81)), mesh=2, path="arclength")
    assert found.status == "diverged"
    assert "path of equilibria ends at load factor 0" in found.status.message
    assert found.t.tolist() == [0.0]


def test_paths_are_named():
    scene = bar([Clamp("bar.start")])
    with pytest.raises(UnknownOptionError, match=r"path is 'arc'; allowed are"):
        solve_static(scene, mesh=1, path="arc")
    with pytest.raises(DiscretisationError, match=r"path is 'arclength' beside branch 'stable'"):
        solve_static(scene, mesh=1, path="arclength", branch="stable")


def test_no_load_is_a_path_of_one_shape():
    found = solve_static(bar([Clamp("bar.start")]), mesh=1, path="arclength")
    assert found.status.ok
    assert found.t[-1] == 1.0
    assert np.abs(found.displacement("bar.end")).max() < sqrt(np.finfo(float).eps)
