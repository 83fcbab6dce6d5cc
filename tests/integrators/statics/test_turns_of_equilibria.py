"""Equilibria that are turned by more than half a turn against the one before, or wind springs along a path."""

import numpy as np
import pytest
from scipy.optimize import brentq

import anctmm as at

#: Of the rotational spring, N m/rad, and the moment, N m, that turns the wheel beyond the hold of the other spring.
SOFT, MOMENT = 0.1, 1.2


def _wheel(*loads, connectors=()):
    """A wheel on a pin; a spring of no free length, K r d = 1 N m, holds it by sin φ, a soft one by φ."""
    wheel = at.RigidBody("wheel", mass=1.0, inertia=0.5, center=(0, 0), points={"rim": (1.0, 0.0)})
    return at.Scene("wheel", [wheel], [at.Pin("wheel.center")], loads, connectors=connectors)


def _held(follower):
    springs = [
        at.Spring("wheel.rim", (2.0, 0.0), stiffness=0.5, length=lambda t: (0.0, 0.0)),
        at.RotationalSpring("wheel.center", stiffness=SOFT),
    ]
    load = at.Force("wheel.rim", (0.0, MOMENT), follower=True) if follower else at.Torque("wheel.rim", MOMENT)
    return _wheel(load, connectors=springs)


@pytest.mark.parametrize(
    ("follower", "options"),
    [
        (False, {}),
        (True, {}),
        (False, {"load_steps": 3}),
        (False, {"branch": "stable"}),
        (False, {"branch": "stable", "load_steps": 2}),
    ],
)
def test_an_equilibrium_beyond_a_jump_has_all_its_turns(follower, options):
    scene = _held(follower)
    s = at.solve_static(scene, **options)
    beyond = brentq(lambda x: np.sin(x) + SOFT * x - MOMENT, 2.0 * np.pi, 2.0 * np.pi + 1.0)
    assert s.status.ok
    assert s.angle("wheel")[-1] == pytest.approx(beyond, rel=1e-9)
    assert s.tension(scene.connectors[1])[-1] == pytest.approx(SOFT * beyond, rel=1e-9)
    motion = at.solve(scene, start=s, dt=1e-2, t_end=1.0)
    assert np.ptp(motion.angle("wheel")) < 1e-6


@pytest.mark.parametrize("options", [{}, {"load_steps": 3}, {"branch": "stable"}, {"path": "arclength"}])
def test_energy_of_springs_is_that_of_each_equilibrium(options):
    moment = 10.0
    spring = at.RotationalSpring("wheel.center", stiffness=1.0)
    s = at.solve_static(_wheel(at.Torque("wheel.rim", moment), connectors=[spring]), **options)
    assert s.status.ok
    assert s.angle("wheel") == pytest.approx(moment * s.t, abs=1e-6)
    assert s.energy.strain == pytest.approx(0.5 * (moment * s.t) ** 2, abs=1e-5)
