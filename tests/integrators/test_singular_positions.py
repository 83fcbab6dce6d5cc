"""Runs that end at a singular position say so, and which bodies are there; others do not."""

from math import acos, cos, hypot, pi, sin, sqrt

import numpy as np
import pytest

import anctmm as at

SECTION, MATERIAL = at.Rectangle(0.02, 0.02), at.Material(E=2e11, density=7800.0)
CRANK, COUPLER, ROCKER, GROUND = 0.5, 0.4, 0.5, 0.6
#: Angle of the crank at which coupler and rocker lie on one line: it turns no further.
LIMIT = acos((CRANK**2 + GROUND**2 - (COUPLER + ROCKER) ** 2) / (2.0 * CRANK * GROUND))


def four_bar(angle, drive=None):
    """A four-bar whose crank stands at an angle, and is driven or not."""
    x, y = CRANK * cos(angle), CRANK * sin(angle)
    dx, dy = GROUND - x, -y
    way = hypot(dx, dy)
    along = (COUPLER**2 - ROCKER**2 + way**2) / (2.0 * way)
    aside = sqrt(max(COUPLER**2 - along**2, 0.0))
    middle = x + (along * dx - aside * dy) / way, y + (along * dy + aside * dx) / way
    ends = {"crank": ((0.0, 0.0), (x, y)), "coupler": ((x, y), middle), "rocker": (middle, (GROUND, 0.0))}
    bodies = [at.Beam(name, *places, SECTION, MATERIAL) for name, places in ends.items()]
    joints = [
        at.Pin("crank.start") if drive is None else at.Clamp("crank.start", angle=drive),
        at.Pin("crank.end", "coupler.start"),
        at.Pin("coupler.end", "rocker.start"),
        at.Pin("rocker.end"),
    ]
    return at.Scene("four", bodies, joints)


def turning(t):
    """Once round within a second."""
    return 2.0 * pi * t, 2.0 * pi + 0.0 * t, 0.0 * t


@pytest.mark.slow
def test_a_run_that_ends_there_says_so():
    start = at.consistent_velocities(
        name="four", bodies=four_bar(LIMIT - 0.1).bodies, joints=four_bar(LIMIT - 0.1, turning).joints
    )
    steps = {"t_end": 0.02, "output_dt": 0.01, "tolerance": 1e-3, "integrator": "generalized-alpha"}
    found = at.solve(start, mesh=1, element="rigid", **steps)
    assert found.status.code in ("diverged", "failed")
    assert "load that does not jump" not in found.status.message
    assert found.status.time == pytest.approx(0.1 / (2.0 * pi), rel=0.05)


def three_cranks(angle):
    """A parallelogram of three cranks, whose pins repeat each other, that gravity sets in motion."""
    x, y = cos(angle), sin(angle)
    bodies = [at.RigidBody("table", 1.0, 0.3, (1.0 + x, y), {f"p{i}": (i + x, y) for i in range(3)})]
    joints = []
    for i in range(3):
        points = {"foot": (float(i), 0.0), "top": (i + x, y)}
        bodies.append(at.RigidBody(f"crank {i}", 1.0, 0.1, (i + 0.5 * x, 0.5 * y), points))
        joints += [at.Pin(f"crank {i}.foot"), at.Pin(f"table.p{i}", f"crank {i}.top")]
    return at.Scene("cranks", bodies, joints, gravity=(0.0, -9.81))


@pytest.mark.parametrize("tolerance", [1e-10, 1e-5, 1e-3, 1e-2])
def test_a_parallelogram_of_three_cranks_passes_its_change_point(tolerance):
    """With 1e-3 and more, joints that were apart made the third crank's pin no repetition, and the run ended there."""
    steps = {"dt": 1e-2, "t_end": 0.5}
    found = at.solve(three_cranks(0.4), newton_tolerance=tolerance, **steps)
    assert found.status.ok
    alike = at.solve(three_cranks(0.4), **steps)
    assert np.abs(found.angle("crank 0") - alike.angle("crank 0")).max() < 1e-3
