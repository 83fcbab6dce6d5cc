"""Kinds of joint that the package does not have, each a class of a few lines."""

from typing import Any

import numpy as np
import pytest
from samples import RigidLink

import anctmm as at

ROD, RUBBER = at.Circle(0.02), at.Material(E=5e6, density=1100.0)
STEPS: dict[str, dict[str, Any]] = {
    "zhai": {"dt": 2e-5, "t_end": 0.1, "output_dt": 0.01},
    "generalized-alpha": {"dt": 1e-3, "t_end": 0.1, "output_dt": 0.01, "newton_tolerance": 1e-12},
    "esdirk": {"dt": 4e-3, "t_end": 0.1, "output_dt": 0.02},
}


class HalfWay(at.Joint):
    """A point that stays half-way between two others."""

    def equations(self, point, a, b):
        return [point.position - 0.5 * (a.position + b.position)]


class Lift(at.Joint):
    """A place whose height a history prescribes."""

    def equations(self, a):
        up = at.signal(lambda t: (0.1 * t**2, 0.2 * t, 0.2 + 0.0 * t), "lift")
        return [a.position @ np.array([0.0, 1.0]) - float(a.position.start[1]) - up]


@pytest.mark.parametrize("integrator", STEPS)
def test_a_link_to_the_ground_makes_a_pendulum(integrator):
    """A mass on a link moves as the centre of a mass that Lagrange's equation turns."""
    mass = at.PointMass("m", 1.0, (1.0, 0.0))
    scene = at.Scene("pendulum", [mass], [RigidLink("m.center", (0.0, 0.0))], gravity=(0.0, -9.81))
    found = at.solve(scene, integrator=integrator, **STEPS[integrator])
    assert found.status.ok, found.status
    path = found.position("m.center")
    assert np.abs(np.hypot(*path.T) - 1.0).max() < 1e-12
    # the first terms of the fall of a pendulum from the horizontal: φ = −½ g t² + g³ t⁶/240
    t, g = found.t, 9.81
    angle = -0.5 * g * t**2 + g**3 * t**6 / 240.0
    assert np.abs(np.arctan2(path[:, 1], path[:, 0]) - angle).max() < 2e-5
    assert np.abs(found.energy.balance).max() < 1e-4


@pytest.mark.parametrize("integrator", STEPS)
def test_a_point_stays_half_way(integrator):
    beams = [at.Beam("a", (0, 0), (0.5, 0), ROD, RUBBER), at.Beam("b", (0, 0.2), (0.5, 0.2), ROD, RUBBER)]
    mass = at.PointMass("m", 0.1, (0.5, 0.1))
    joints = [at.Clamp("a.start"), at.Clamp("b.start"), HalfWay("m.center", "a.end", "b.end")]
    scene = at.Scene("half-way", [*beams, mass], joints, gravity=(0.0, -9.81))
    found = at.solve(scene, mesh=4, integrator=integrator, **STEPS[integrator])
    assert found.status.ok, found.status
    middle = 0.5 * (found.position("a.end") + found.position("b.end"))
    assert np.abs(found.position("m.center") - middle).max() < 1e-12


@pytest.mark.parametrize("integrator", STEPS)
def test_a_driven_equation_does_the_work_of_what_it_moves(integrator):
    body = at.RigidBody("body", 2.0, 0.1, (0.0, 0.0), {"p": (0.3, 0.0)})
    scene = at.Scene("lift", [body], [at.Pin("body.p"), Lift("body.center")], gravity=(0.0, -9.81))
    found = at.solve(scene, integrator=integrator, **STEPS[integrator])
    assert found.status.ok, found.status
    np.testing.assert_allclose(found.position("body.center")[:, 1], 0.1 * found.t**2, atol=1e-10)
    gained = found.energy.kinetic + found.energy.potential
    assert np.abs(found.energy.work - (gained - gained[0])).max() < 1e-3


def hanging():
    mass = at.PointMass("m", 1.0, (0.0, -1.0))
    return at.Scene("hanging", [mass], [RigidLink("m.center", (0.0, 0.0))], gravity=(0.0, -9.81))


def test_statics_and_modes_take_them():
    """A mass on a link hangs at rest, and swings with √(g/l)."""
    rest = at.solve_static(hanging())
    np.testing.assert_allclose(rest.position("m.center")[-1], (0.0, -1.0), atol=1e-12)
    found = at.modes(hanging(), about=rest, count=1)
    np.testing.assert_allclose(found.frequencies[0], np.sqrt(9.81) / (2.0 * np.pi), rtol=1e-9)


def test_a_tolerance_takes_them():
    mass = at.PointMass("m", 1.0, (1.0, 0.0))
    scene = at.Scene("pendulum", [mass], [RigidLink("m.center", (0.0, 0.0))], gravity=(0.0, -9.81))
    loose, fine = (at.solve(scene, tolerance=e, t_end=1.0, output_dt=0.1) for e in (1e-3, 1e-6))
    assert all(s.status.ok for s in (loose, fine))
    assert at.compare(loose, fine, ["m.center"]).error < 1e-2


def test_reactions_follow_from_its_equations(tmp_path):
    scene = hanging()
    path = at.solve(scene, dt=0.01, t_end=0.05).save(tmp_path / "hanging")
    found = at.load(path, scene)
    np.testing.assert_array_equal(at.load(path).position("m.center"), found.position("m.center"))
    np.testing.assert_allclose(found.reaction(scene.joints[0]), [[0.0, 9.81, 0.0]] * len(found.t), atol=1e-9)


def test_a_place_that_the_scene_does_not_have_is_refused():
    with pytest.raises(at.errors.UnknownNameError, match="other"):
        at.Scene("none", [at.PointMass("m", 1.0, (1.0, 0.0))], [RigidLink("m.center", "other.end")])
