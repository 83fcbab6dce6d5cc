"""Singular positions: parallelograms pass their change points, a four-bar that can turn no further ends its run."""

from math import acos, cos, hypot, pi, sin, sqrt

import numpy as np
import pytest

import anctmm as at

ARM, APART, DENSITY, WEIGHT, SPEED = 0.5, 0.4, 2.0, 9.81, -6.5


def parallelogram(cranks, angle):
    """Uniform bars (2 kg/m): cranks at an angle, on pins 0.4 m apart, that carry a table and turn at −6.5 rad/s."""
    x, y = ARM * cos(angle), ARM * sin(angle)
    tip = (-SPEED * y, SPEED * x)
    bodies, joints, points = [], [], {}
    for n in range(cranks):
        a, name, mass = n * APART, f"crank {n}", DENSITY * ARM
        b = points[f"p{n}"] = (a + x, y)
        center = ((a + b[0]) / 2.0, y / 2.0)
        bodies.append(
            at.RigidBody(
                name, mass, mass * ARM**2 / 12.0, center, {"a": (a, 0.0), "b": b},
                velocity=(tip[0] / 2.0, tip[1] / 2.0), spin=SPEED,
            )
        )  # fmt: skip
        joints += [at.Pin(f"{name}.a"), at.Pin(f"{name}.b", f"table.p{n}")]
    length = (cranks - 1) * APART
    mass = DENSITY * length
    center = (x + length / 2.0, y)
    bodies.append(at.RigidBody("table", mass, mass * length**2 / 12.0, center, points, velocity=tip))
    return at.Scene("parallelogram", bodies, joints, gravity=(0.0, -WEIGHT))


@pytest.mark.parametrize(("cranks", "dt"), [(2, 2e-3), (5, 5e-4)])
def test_fourth_order_steps_pass_a_change_point_wherever_their_stages_lie(cranks, dt):
    """Cranks stay parallel: with the angle θ of each, J θ'²/2 + G sin θ is constant."""
    table = DENSITY * (cranks - 1) * APART
    inertia = (cranks * DENSITY * ARM / 3.0 + table) * ARM**2
    lever = WEIGHT * (cranks * DENSITY * ARM / 2.0 + table) * ARM
    for part in np.linspace(1.5, 4.4, 12):  # of the way of a step
        start = -part * dt * SPEED
        s = at.solve(parallelogram(cranks, start), dt=dt, t_end=8.0 * dt, integrator="esdirk")
        assert s.status.ok, s.status
        angle = start + s.angle("crank 0")
        assert angle[-1] < -0.5 * start / part
        spin = -np.sqrt(SPEED**2 + 2.0 * lever / inertia * (sin(start) - np.sin(angle)))
        for body in s.fields:
            wanted = 0.0 if body == "table" else spin
            assert s.spin(f"{body}.center") == pytest.approx(wanted, abs=2e-3)
        assert np.abs(s.energy.balance).max() < 1e-3 * inertia * SPEED**2
        p = s.position("table.p0")
        assert np.hypot(*p.T) == pytest.approx(ARM, abs=1e-8)


@pytest.mark.parametrize("tolerance", [1e-10, 1e-2])
def test_a_change_point_is_passed_with_any_tolerance_of_newtons_iteration(tolerance):
    """Joints that were apart made the third crank's pin no repetition, and runs ended there."""
    steps = {"dt": 2e-3, "t_end": 0.5}
    found, fine = (at.solve(parallelogram(3, 0.4), newton_tolerance=e, **steps) for e in (tolerance, 1e-11))
    assert found.status.ok
    assert found.angle("crank 0")[-1] < -1.0
    assert np.abs(found.angle("crank 0") - fine.angle("crank 0")).max() < 1e-3


SECTION, MATERIAL = at.Rectangle(0.02, 0.02), at.Material(E=2e11, density=7800.0)
CRANK, COUPLER, ROCKER, GROUND = 0.5, 0.4, 0.5, 0.6
#: Angle of the crank at which coupler and rocker lie on one line: it turns no further.
LIMIT = acos((CRANK**2 + GROUND**2 - (COUPLER + ROCKER) ** 2) / (2.0 * CRANK * GROUND))


def four_bar(angle, drive):
    """A four-bar whose driven crank stands at an angle."""
    x, y = CRANK * cos(angle), CRANK * sin(angle)
    dx, dy = GROUND - x, -y
    way = hypot(dx, dy)
    along = (COUPLER**2 - ROCKER**2 + way**2) / (2.0 * way)
    aside = sqrt(max(COUPLER**2 - along**2, 0.0))
    middle = x + (along * dx - aside * dy) / way, y + (along * dy + aside * dx) / way
    ends = {"crank": ((0.0, 0.0), (x, y)), "coupler": ((x, y), middle), "rocker": (middle, (GROUND, 0.0))}
    bodies = [at.Beam(name, *places, SECTION, MATERIAL) for name, places in ends.items()]
    joints = [
        at.Clamp("crank.start", angle=drive),
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
    driven = four_bar(LIMIT - 0.1, turning)
    start = at.consistent_velocities(name="four", bodies=driven.bodies, joints=driven.joints)
    steps = {"t_end": 0.02, "output_dt": 0.01, "tolerance": 1e-3, "integrator": "generalized-alpha"}
    found = at.solve(start, mesh=1, element="rigid", **steps)
    assert found.status.code in ("diverged", "failed")
    assert found.status.time == pytest.approx(0.1 / (2.0 * pi), rel=0.05)
