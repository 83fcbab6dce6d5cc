"""A motor with a feedback law (PD) turns a flexible arm to a set-point and holds it there: by three codes.

The law sees the angle less the driven set-point and its rate. Explicit steps, implicit ones and Exudyn, which calls the
law as a user function, are taken to their limits by Richardson's rule, and these are one motion.
"""

from itertools import pairwise

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

STIFFNESS, DAMPING, GOAL = 8.0, 0.4, 0.8
GRAVITY = 9.81
PLACES = (("arm", 0.5), "tool.center")
RUN = {"mesh": 2, "t_end": 0.4, "output_dt": 0.02}
IMPLICIT = {"spectral_radius": 1.0}


def motor(error, rate, t):
    return STIFFNESS * error + DAMPING * rate


def goal(t):
    return at.Quintic(GOAL, 0.2)(t)[:2]


def arm(damping=0.0):
    """A pinned arm with a tool at its end, and the motor between the ground and its start."""
    material = at.Material(E=1e8, density=1000.0, damping=damping)
    beam = at.Beam("arm", (0, 0), (0.5, 0), at.Rectangle(0.01, 0.01), material)
    tool = at.PointMass("tool", 0.02, (0.5, 0))
    joints = [at.Pin("arm.start"), at.Pin("arm.end", "tool.center")]
    connectors = [at.RotationalSpring("arm.start", law=motor, angle=goal)]
    return at.Scene("arm", [beam, tool], joints, (), (0, -GRAVITY), connectors)


def limit(solve, steps, powers, **options):
    """Places at the outputs, (places, n, 2), as steps become shorter; errors are of these powers of the step."""
    found = []
    for count in steps:
        s = solve(arm(), **RUN, dt=RUN["t_end"] / count, **options)
        assert s.status.ok, s.status
        found.append(np.stack([s.position(place) for place in PLACES]))
    for power in powers:
        found = [(2.0**power * b - a) / (2.0**power - 1.0) for a, b in pairwise(found)]
    return found[-1]


@pytest.fixture(scope="module")
def implicit():
    return limit(at.solve, (400, 800, 1600), (2, 4), **IMPLICIT, newton_tolerance=1e-13)


def test_explicit_steps_tend_to_the_same_motion(implicit):
    assert np.ptp(implicit[1], axis=0).max() > 0.3
    explicit = limit(at.solve, (20_000, 40_000), (2,), integrator="zhai")
    assert np.abs(explicit - implicit).max() < 1e-6


def test_exudyns_user_function_tends_to_the_same_motion(implicit):
    pytest.importorskip("exudyn")
    from reference import exudyn_cable

    exudyn = limit(exudyn_cable.solve, (800, 1600), (2,), **IMPLICIT, tolerances=(1e-10, 1e-9))
    assert np.abs(exudyn - implicit).max() < 1e-6


def test_the_global_solver_tends_to_the_same_motion(implicit):
    dae = limit(global_dae.solve, (200, 400), (2,), **IMPLICIT, newton_tolerance=1e-13)
    assert np.abs(dae - implicit).max() < 4e-5
