"""Car on a bump: a rigid body on two springs and dampers, whose lower ends follow the road."""

from math import cos, pi, sin

import numpy as np

import anctmm as at

SPEED, FRONT, REAR, HEIGHT, LONG = 8.0, 1.2, 1.5, 0.08, 1.6  # m/s, m: axles, and the bump, that begins at 2 m


def over(axle):
    def length(t):  # of the spring, m, and its rate, m/s: it is longer where the road is higher
        x = 2 * pi * (SPEED * t + axle - 2.0) / LONG
        on = 0 < x < 2 * pi
        return (0.4 + HEIGHT * (1 - cos(x)) / 2, HEIGHT * sin(x) * pi * SPEED / LONG) if on else (0.4, 0.0)

    return at.History(length, breaks=[(2.0 - axle) / SPEED, (2.0 + LONG - axle) / SPEED])


points = {"front": (FRONT, 0.4), "rear": (-REAR, 0.4)}
car = at.RigidBody("car", mass=700.0, inertia=1100.0, center=(0, 0.6), points=points)
front = at.Spring("car.front", (FRONT, 0), stiffness=25e3, damping=1500.0, length=over(FRONT))
rear = at.Spring("car.rear", (-REAR, 0), stiffness=20e3, damping=1200.0, length=over(-REAR))
upright = at.Slider("car.center", direction=(0, 1))
scene = at.Scene("half-car", [car], [upright], connectors=[front, rear])
CASES = [at.Case(scene, ["car.front", "car.rear"], t_end=1.6, output_dt=0.01)]
RUN = {"dt": 5e-3}


def known(s):
    modes = at.modes(scene, count=2)
    bounce = min(modes.frequencies / np.sqrt(1 - modes.damping**2))
    exact = np.sqrt((front.stiffness + rear.stiffness) / car.mass) / (2 * pi)
    return "frequency of the bounce, undamped", bounce, exact, 1e-7, "Hz", "√((k₁ + k₂)/m)/2π, as k₁ a = k₂ b"
