"""A parallelogram of several cranks through its change point, where all bars lie on one line and may go either way.

Its cranks stay parallel: with the angle θ of each, J θ'²/2 + G sin θ is constant.
"""

from math import cos, sin

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


@pytest.mark.parametrize("cranks", [2, 3, 5])
@pytest.mark.parametrize("dt", [5e-4, 2e-3])
def test_fourth_order_steps_pass_a_change_point_wherever_their_stages_lie(cranks, dt):
    table = DENSITY * (cranks - 1) * APART
    inertia = (cranks * DENSITY * ARM / 3.0 + table) * ARM**2
    lever = WEIGHT * (cranks * DENSITY * ARM / 2.0 + table) * ARM
    for part in np.linspace(1.5, 4.4, 30):  # of the way of a step
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
