"""Equilibria that plain Newton's iteration does not find: slack cables, mechanisms, masses on slack springs, jumps."""

import numpy as np
import pytest
from samples import KINDS, SOFT, SQUARE
from scipy.optimize import brentq

import anctmm as at
from anctmm.model.scene import Beam, Material, Pin, Scene
from anctmm.model.sections import Rectangle
from anctmm.solve import solve_static
from reference import exact, global_dae

SPAN, WEIGHT, AXIAL = 80.0, 10.0, 1e7


def slack_cable(bending, low=(40.0, -30.0), end=(SPAN, 0.0)):
    """Two straight cables hinged to each other at a low point."""
    height = float(np.sqrt(12.0 * bending / AXIAL))
    section = Rectangle(1.0 / height, height)
    material = Material(AXIAL, WEIGHT / 9.81)
    ends = {"left": ((0.0, 0.0), low), "right": (low, end)}
    bodies = [Beam(name, *places, section, material) for name, places in ends.items()]
    joints = [
        Pin("left.start", grounded=True),
        Pin("left.end", "right.start"),
        Pin("right.end", grounded=True),
    ]
    return Scene("slack", bodies, joints, gravity=(0.0, -9.81))


def miss(scene, rest):
    """Largest distance of either cable from the catenary, relative to the span."""
    left, right = scene.bodies
    whole = left.length + right.length
    shape = exact.Catenary(right.end, whole, WEIGHT, AXIAL)
    apart = []
    for body, before in ((left, 0.0), (right, left.length)):
        for fraction in (0.0, 0.13, 0.5, 0.77, 1.0):
            there = shape.position((before + fraction * body.length) / whole)
            apart.append(np.abs(rest.position(body.name, fraction)[-1] - there).max())
    return max(apart) / SPAN


@pytest.mark.parametrize("bending", [1e2, 1e-2])
def test_a_slack_cable_hangs_in_a_catenary(bending):
    """Its bending stiffness keeps it away by a part that falls with it."""
    scene = slack_cable(bending)
    rest = solve_static(scene, mesh=32)
    assert rest.status.ok, rest.status
    assert rest.stable.tolist()[-1]
    assert miss(scene, rest) < 1.2e-6 * max(bending, 0.1)


@pytest.mark.xfail(strict=True, reason="two load steps of a slack cable end without an equilibrium")
def test_supports_at_different_heights():
    """Twenty metres apart, a low point that is not the middle, and load steps."""
    scene = slack_cable(1e-3, low=(20.0, -30.0), end=(SPAN, 20.0))
    rest = solve_static(scene, mesh=64, load_steps=2)
    assert rest.status.ok, rest.status
    assert rest.t.tolist() == [0.0, 0.5, 1.0]
    assert miss(scene, rest) < 1e-6


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("count", [1, 3])
def test_what_hangs_on_hinges_swings_down(kind, count):
    """A row of bars that starts horizontally: all hang below each other, stretched by their weight."""
    bodies = [Beam(f"b{i}", (float(i), 0.0), (i + 1.0, 0.0), SQUARE, SOFT) for i in range(count)]
    joints = [Pin("b0.start", grounded=True)]
    joints += [Pin(f"b{i}.end", f"b{i + 1}.start") for i in range(count - 1)]
    rest = solve_static(Scene("row", bodies, joints, gravity=(0.0, -9.81)), mesh=2, element=kind)
    assert rest.status.ok, rest.status
    assert "stabilised path" in rest.status.message
    tip = rest.position(f"b{count - 1}", 1.0)[-1]
    stretch = 0.5 * SOFT.density * 9.81 * count**2 / SOFT.E
    assert abs(tip[0]) < 1e-9
    assert tip[1] == pytest.approx(-count - stretch, rel=1e-5)


def hung(follower):
    """A plate on a clamped beam, a mass on a spring that is level at first, and a force on the plate."""
    bodies = [
        Beam("v", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT),
        at.RigidBody("plate", 0.5, 3e-3, center=(1.1, 0.1), points={"p": (1.0, 0.0), "q": (1.2, 0.2)}),
        at.PointMass("load", 0.2, position=(1.5, 0.0)),
    ]
    joints, force = (
        [at.Clamp("v.start"), at.Weld("v.end", "plate.p")],
        at.Force("plate.q", (0.0, 0.5), follower),
    )
    springs = [at.Spring("v.end", "load.center", stiffness=20.0)]
    return Scene("hung", bodies, joints, [force], (0.0, -9.81), springs)


@pytest.mark.parametrize("follower", [False, True])
def test_a_mass_that_hangs_by_a_slack_spring_is_found(follower):
    """Also where the force turns with the plate, and has no potential energy."""
    ours, theirs = (
        solve(hung(follower), mesh=2, newton_tolerance=1e-12)
        for solve in (solve_static, global_dae.solve_static)
    )
    assert (ours.status.ok, theirs.status.ok) == (True, True)
    assert "a stabilised path leads" in ours.status.message
    for place in ("v.end", "plate.q", "load.center"):
        assert np.abs(ours.position(place)[-1] - theirs.position(place)[-1]).max() < 1e-9
    below = ours.position("load.center")[-1] - ours.position("v.end")[-1]
    assert below == pytest.approx([0.0, -(0.5 + 0.2 * 9.81 / 20.0)], abs=1e-9)


#: Of the rotational spring, N m/rad, and the moment, N m, that turns the wheel beyond the hold of the other spring.
WEAK, MOMENT = 0.1, 1.2


def wheel(load, *springs):
    """A wheel on a pin, with springs."""
    body = at.RigidBody("wheel", mass=1.0, inertia=0.5, center=(0, 0), points={"rim": (1.0, 0.0)})
    return Scene("wheel", [body], [Pin("wheel.center")], [load], connectors=springs)


@pytest.mark.parametrize(("follower", "options"), [(False, {}), (True, {}), (False, {"branch": "stable"})])
def test_an_equilibrium_beyond_a_jump_has_all_its_turns(follower, options):
    """A spring of no free length, K r d = 1 N m, holds the wheel by sin φ, a soft one by φ."""
    load = at.Force("wheel.rim", (0.0, MOMENT), follower=True) if follower else at.Torque("wheel.rim", MOMENT)
    hold = at.Spring("wheel.rim", (2.0, 0.0), stiffness=0.5, length=lambda t: (0.0, 0.0))
    scene = wheel(load, hold, at.RotationalSpring("wheel.center", stiffness=WEAK))
    s = solve_static(scene, **options)
    beyond = brentq(lambda x: np.sin(x) + WEAK * x - MOMENT, 2.0 * np.pi, 2.0 * np.pi + 1.0)
    assert s.status.ok
    assert s.angle("wheel")[-1] == pytest.approx(beyond, rel=1e-9)
    assert s.tension(scene.connectors[1])[-1] == pytest.approx(WEAK * beyond, rel=1e-9)
    motion = at.solve(scene, start=s, dt=1e-2, t_end=1.0)
    assert np.ptp(motion.angle("wheel")) < 1e-6


@pytest.mark.parametrize("options", [{"load_steps": 3}, {"branch": "stable"}, {"path": "arclength"}])
def test_energy_of_wound_springs_is_that_of_each_equilibrium(options):
    spring = at.RotationalSpring("wheel.center", stiffness=1.0)
    s = solve_static(wheel(at.Torque("wheel.rim", 10.0), spring), **options)
    assert s.status.ok
    assert s.angle("wheel") == pytest.approx(10.0 * s.t, abs=1e-6)
    assert s.energy.strain == pytest.approx(50.0 * s.t**2, abs=1e-5)
