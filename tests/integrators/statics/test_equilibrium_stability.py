"""Stability of equilibria: Euler's load by several roads, unstable and singular ones named, the stable branch found."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from samples import KINDS, bar, row_scene
from scipy.optimize import brentq

import anctmm as at
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene
from anctmm.model.sections import Rectangle
from anctmm.solve import solve_static
from reference import exact, global_dae

SLENDER, STIFF = Rectangle(0.01, 0.01), Material(E=1e9, density=1000.0)
EA, EI = STIFF.E * SLENDER.area, STIFF.E * SLENDER.second_moment
EULER = pi**2 * EI / 4.0
every_kind = pytest.mark.parametrize("kind", KINDS)


def column(load, side=0.0, angle=0.0):
    """A clamped column of 1 m under forces (N) against its direction and towards its left."""
    c, s = cos(angle), sin(angle)
    beam = Beam("bar", (0.0, 0.0), (c, s), SLENDER, STIFF)
    force = (-load * c - side * s, -load * s + side * c)
    return Scene("column", [beam], [Clamp("bar.start")], [Force("bar.end", force)])


@pytest.mark.parametrize("load", [1.5, 9.2])
def test_a_column_is_unstable_beyond_eulers_load(load):
    """By both roads, from the first step beyond it."""
    for solver in (solve_static, global_dae.solve_static):
        found = solver(column(load * EULER), mesh=8, load_steps=4)
        assert found.status == "unstable"
        assert found.status.time == 0.25 * (int(4.0 / load) + 1)


# --- the stable branch -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("load", "side"), [(1.05, 1e-3), (4.0, -1e-3)])
def test_the_stable_branch_does_not_depend_on_load_steps_and_is_exact(load, side):
    """The column bends to the side of the small force, by the extensible elastica."""
    scene = column(load * EULER, side * EULER)
    one, five = (solve_static(scene, mesh=24, load_steps=n, branch="stable") for n in (1, 5))
    assert (one.status.ok, five.status.ok) == (True, True)
    path = five.position("bar", 1.0)
    assert np.array_equal(one.position("bar", 1.0)[-1], path[-1])
    assert path[-1, 1] * side > 0.0
    assert np.abs(path[-1] - exact.cantilever_static(scene, "elastica").position(1.0)).max() < 5e-5
    assert (np.diff(path[:, 0]) < 0.0).all()  # it bends more and more, and does not jump to and fro


def arch(load):
    """Two stocky bars of a shallow roof, pinned at the ground and to each other, under a force at the ridge."""
    section, material = Rectangle(0.2, 0.2), Material(E=1e7, density=1000.0)
    bodies = [
        Beam("one", (0.0, 0.0), (1.0, 0.1), section, material),
        Beam("two", (1.0, 0.1), (2.0, 0.0), section, material),
    ]
    joints = [Pin("one.start"), Pin("one.end", "two.start"), Pin("two.end")]
    return Scene("arch", bodies, joints, [Force("one.end", (0.0, -load))])


def ridge(load):
    """Height of the ridge of the arch below ground, by the force of two straight bars; and its greatest load."""
    area, length = 0.04 * 1e7, sqrt(1.01)

    def force(h):
        now = sqrt(1.0 + h * h)
        return 2.0 * area * (1.0 - now / length) * h / now

    heights = np.linspace(0.0, 0.1, 2001)
    return brentq(lambda h: force(h) - load, -0.5, -0.1), max(map(force, heights))


def test_a_roof_snaps_through_beyond_its_limit_load():
    """By the exact force of two straight bars (von Mises 1923)."""
    _, limit = ridge(1.0)
    for load, above in ((0.98 * limit, True), (1.02 * limit, False)):
        found = solve_static(arch(load), mesh=2, branch="stable", load_steps=2)
        assert found.status.ok
        height = found.position("one", 1.0)[-1, 1]
        assert (height > 0.0) == above
        if not above:
            assert height == pytest.approx(ridge(load)[0], abs=1e-9)
            assert found.position("one", 1.0)[1, 1] > 0.0  # under half of the load it still stands


# --- singular ones -----------------------------------------------------------------------------------------------


@every_kind
@pytest.mark.parametrize(
    "scene",
    [
        bar(),
        row_scene("pin", [("pin", 0.3), ("pin", 0.2)], "pin"),
        row_scene("clamp", [("weld", 0.3), ("pin", 0.2)], "free"),
    ],
    ids=["free", "four-bar", "hanging part"],
)
def test_mechanisms_without_loads_are_singular_and_named(kind, scene):
    found = solve_static(scene, mesh=2, element=kind)
    assert found.status == "singular", found.status
    assert found.status.body in {b.name for b in scene.bodies}
    assert "mechanism" in found.status.message
    assert found.t.tolist() == [0.0, 1.0]


@pytest.mark.parametrize("solve", [solve_static, global_dae.solve_static], ids=["anctmm", "dae"])
@pytest.mark.parametrize(("mass", "height"), [(1.0, 1.0), (1e6, 10.0), (1e-6, 1e-3)])
def test_a_body_above_its_joint_stands_where_a_spring_outweighs_it(solve, mass, height):
    """Of a rotational spring at the joint: k > m g h."""
    body = at.RigidBody("body", mass, 0.1 * mass * height**2, (0.0, height), points={"foot": (0.0, 0.0)})
    for part in (0.99, 1.01, 8.3):
        spring = at.RotationalSpring("body.foot", stiffness=part * mass * 9.81 * height)
        scene = Scene("top-heavy", [body], [Pin("body.foot")], gravity=(0.0, -9.81), connectors=[spring])
        assert solve(scene).status.code == ("ok" if part > 1.0 else "unstable"), part


@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_a_body_that_a_damper_alone_holds_is_singular_in_any_unit_of_length(unit):
    """A damper has no stiffness: rounding told the sign of nothing."""
    center, hinge = (0.3 * unit, -0.4 * unit), (0.0, 0.0)
    bar = at.RigidBody("bar", 1.0, 0.1 * unit**2, center, {"hinge": hinge})
    damper = at.RotationalSpring("bar.center", damping=0.1 * unit**2)
    found = at.solve_static(at.Scene("held", [bar], [at.Pin("bar.hinge")], connectors=[damper]))
    assert found.status.code == "singular", found.status
    assert not found.stable.any()
