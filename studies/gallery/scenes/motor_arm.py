"""Arm with a motor: a law of three lines is a motor with feedback; the weight keeps the arm below its target."""

from math import exp, tanh

import numpy as np

import anctmm as at

TARGET, GAIN, RATE_GAIN, LIMIT = 1.2, 60.0, 12.0, 8.0  # rad, N m/rad, N m s/rad, N m


def law(turn, rate, t):
    """Moment against the turn (N m): of the error and of its rate, never more than the limit."""
    wanted = TARGET * (1 - exp(-4 * t))  # rad: a smooth start
    return LIMIT * tanh((GAIN * (turn - wanted) + RATE_GAIN * rate) / LIMIT)


plastic = at.Material(E=3e9, density=1200.0, damping=2e-3)
motor = at.RotationalSpring("arm.start", law=law)
arm = at.Beam("arm", (0, 0), (0.8, 0), at.Rectangle(0.03, 0.016), plastic)
load = at.PointMass("load", mass=0.4, position=(0.8, 0))
joints = [at.Pin("arm.start"), at.Pin("arm.end", "load.center")]
scene = at.Scene("motor-arm", [arm, load], joints, connectors=[motor], gravity=(0, -9.81))
CASES = [at.Case(scene, ["load.center"], t_end=2.5, output_dt=0.01)]
RUN = {"mesh": 4, "dt": 1e-3}


def known(s):
    middle = s.position("arm", np.linspace(0, 1, 41))[-1, :, 0].mean()
    weights = 9.81 * (load.mass * s.position("load.center")[-1, 0] + arm.mass * middle)
    moment = -s.tension(motor)[-1]
    return "moment of the motor at the end", moment, weights, 5e-3 * weights, "N m", "moment of the weights"
