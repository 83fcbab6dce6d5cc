"""Loads and connectors of all kinds at once beside the global DAE: beams, a rigid body and a point mass."""

from dataclasses import replace

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

SQUARE, SOFT = at.Rectangle(0.02, 0.02), at.Material(1e7, 1000.0)


def cubic(elongation, rate, t):
    return 3.0 * elongation + 5.0 * elongation**3 + 0.01 * rate + 0.1 * t


def wavy(t):
    return 0.9 + 0.1 * np.sin(2.0 * t), 0.2 * np.cos(2.0 * t)


def on_a_plate():
    """A beam, a plate hinged to it, and a mass that springs hold."""
    bodies = [
        at.Beam("a", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT),
        at.RigidBody("plate", 0.5, 3e-3, center=(1.1, 0.1), points={"p": (1.0, 0.0), "q": (1.2, 0.2)}),
        at.PointMass("load", 0.2, position=(1.5, 0.5)),
    ]
    loads = [
        at.Force("plate.q", (0.1, 0.3), follower=True),
        at.Torque("plate.center", 0.01),
        at.Force("load.center", lambda t: (0.0, 0.1 * t)),
        at.Torque(("a", 0.3), 0.02),
        at.Force(("a", 0.7), (0.0, -0.2), follower=True),
        at.LineLoad("a", (0.0, 0.3)),
    ]
    connectors = [
        at.Spring("plate.q", "load.center", stiffness=30.0, damping=0.05),
        at.Spring("load.center", (1.5, 1.5), stiffness=20.0, length=wavy, preload=0.3),
        at.RotationalSpring("a.end", "plate.p", stiffness=0.3, damping=1e-3, angle=lambda t: (0.2 * t, 0.2)),
        at.RotationalSpring("plate.center", law=cubic),
        at.Spring(("a", 0.4), "plate.q", stiffness=10.0),
        at.RotationalSpring(("a", 0.35), stiffness=0.1),
    ]
    joints = [at.Clamp("a.start"), at.Pin("a.end", "plate.p")]
    return at.Scene("on a plate", bodies, joints, loads, (0.0, -1.0), connectors=connectors)


PLACES = (("a", 1.0), ("a", 0.37), ("plate", "q"), ("load", "center"))


@pytest.mark.parametrize(
    ("options", "level"),
    [
        ({"integrator": "zhai", "dt": 2e-4}, 1e-9),
        ({"spectral_radius": 0.9, "dt": 1e-3, "newton_tolerance": 1e-12}, 1e-8),
    ],
    ids=["explicit", "implicit"],
)
def test_histories_are_those_of_the_global_dae(options, level):
    """And energies: the same formulas of work, found twice."""
    options = {"mesh": 2, "t_end": 0.1, "output_dt": 0.01} | options
    ours, theirs = at.solve(on_a_plate(), **options), global_dae.solve(on_a_plate(), **options)
    assert ours.status.ok, ours.status
    assert theirs.status.ok, theirs.status
    for body, place in PLACES:
        apart = ours.fields[body].position(place) - theirs.fields[body].position(place)
        assert np.abs(apart).max() < level
    assert np.abs(ours.energy.strain - theirs.energy.strain).max() < level * np.abs(ours.energy.strain).max()


def test_equilibria_are_those_of_the_global_dae():
    scene = on_a_plate()
    scene = replace(scene, loads=[load for load in scene.loads if not getattr(load, "follower", False)])
    rests = [
        solve(scene, mesh=2, newton_tolerance=1e-12) for solve in (at.solve_static, global_dae.solve_static)
    ]
    assert all(rest.status.ok for rest in rests), [rest.status for rest in rests]
    for body, place in PLACES:
        ours, theirs = (rest.fields[body].position(place)[-1] for rest in rests)
        assert np.abs(ours - theirs).max() < 1e-9


def test_runs_from_an_equilibrium_of_all_kinds_of_bodies_stand_still():
    scene = on_a_plate()
    scene = replace(
        scene,
        connectors=[c for c in scene.connectors if c.law is None and not callable(getattr(c, "angle", 0))],
    )
    scene = replace(scene, loads=[load for load in scene.loads if not callable(load.value)])
    still = [replace(c, length=0.9) if callable(getattr(c, "length", None)) else c for c in scene.connectors]
    scene = replace(scene, connectors=still)
    rest = at.solve_static(scene, mesh=2, newton_tolerance=1e-13, load_steps=4)
    assert rest.status.ok, rest.status
    found = at.solve(scene, mesh=2, dt=1e-3, t_end=0.02, start=rest, newton_tolerance=1e-12)
    for body, place in PLACES:
        moved = found.fields[body].position(place) - rest.fields[body].position(place)[-1]
        assert np.abs(moved).max() < 1e-10
