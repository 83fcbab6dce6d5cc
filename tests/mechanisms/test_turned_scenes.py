"""What must not depend on how a scene lies in the plane; the energy of preloaded springs at parts of the load."""

from math import cos, pi, sin

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

RUBBER, ROD = at.Material(E=5e6, density=1000.0), at.Circle(0.02)
ANGLE = 0.3
TURN = np.array([[cos(ANGLE), -sin(ANGLE)], [sin(ANGLE), cos(ANGLE)]])


def same(point):
    return tuple(point)


def turned(point):
    return tuple(TURN @ np.asarray(point, dtype=float))


def half_car(to):
    """A rigid body at rest on two springs, which a bump then moves."""

    def bump(t):
        x = 2.0 * pi * (t - 0.2) / 0.2
        on = 0.0 < x < 2.0 * pi
        return (0.4 + 0.04 * (1.0 - cos(x)), 0.4 * pi * sin(x)) if on else (0.4, 0.0)

    points = {"front": to((1.2, 0.4)), "rear": to((-1.5, 0.4))}
    car = at.RigidBody("car", 700.0, 1100.0, to((0.0, 0.6)), points)
    front = at.Spring(
        "car.front",
        to((1.2, 0.0)),
        stiffness=25e3,
        damping=1500.0,
        length=at.History(bump, breaks=[0.2, 0.4]),
    )
    rear = at.Spring("car.rear", to((-1.5, 0.0)), stiffness=20e3, damping=1200.0)
    return at.Scene("half-car", [car], [at.Slider("car.center", to((0.0, 1.0)))], connectors=[front, rear])


def test_a_scene_at_rest_on_springs_moves_as_the_turned_one():
    flat, oblique = (at.solve(half_car(to), dt=5e-3, t_end=0.6, output_dt=0.02) for to in (same, turned))
    assert flat.status.ok, flat.status
    assert oblique.status.ok, oblique.status
    assert len(oblique.t) == len(flat.t)
    assert np.abs(oblique.position("car.front") - flat.position("car.front") @ TURN.T).max() < 1e-9


@pytest.mark.parametrize("angle", [0.0, 0.3, pi / 4, pi / 2])
def test_mode_shapes_are_normalised_by_the_largest_displacement(angle):
    beam = at.Beam("beam", (0.0, 0.0), (cos(angle), sin(angle)), ROD, RUBBER)
    modes = at.modes(at.Scene("cantilever", [beam], [at.Clamp("beam.start")]), mesh=4, count=2)
    assert np.linalg.norm(modes.displacement("beam.end")[0]) == pytest.approx(1.0, rel=1e-9)


def test_reactions_of_a_driven_clamp_with_free_stretch_turn_with_the_scene():
    def scene(to):
        beam = at.Beam("arm", to((0.0, 0.0)), to((1.0, 0.0)), ROD, RUBBER)
        clamp = at.Clamp("arm.start", angle=at.Quintic(1.0, 0.4), stretch="free")
        return at.Scene("arm", [beam], [clamp], gravity=to((0.0, -9.81)))

    run = at.Discretisation(mesh=3, dt=2e-3, t_end=0.5, output_dt=0.01, newton_tolerance=1e-12)
    flat, oblique = (at.solve(scene(to), run) for to in (same, turned))
    one, two = (found.reaction(found.scene.joints[0]) for found in (flat, oblique))
    assert np.abs(two[:, :2] - one[:, :2] @ TURN.T).max() < 1e-7 * np.abs(one).max()
    assert np.abs(two[:, 2] - one[:, 2]).max() < 1e-7 * np.abs(one).max()


def test_energies_of_a_preloaded_spring_at_parts_of_the_load():
    beam = at.Beam("beam", (0.0, 0.0), (1.0, 0.0), ROD, RUBBER)
    spring = at.Spring("beam.end", (1.0, 0.5), stiffness=20.0, length=0.6, preload=1.0)
    scene = at.Scene("held", [beam], [at.Clamp("beam.start")], gravity=(0.0, -9.81), connectors=[spring])
    ours = at.solve_static(scene, mesh=4, load_steps=4)
    dae = global_dae.solve_static(scene, mesh=4, load_steps=4)
    assert ours.status.ok, ours.status
    assert ours.energy.strain == pytest.approx(dae.energy.strain, rel=1e-7)
