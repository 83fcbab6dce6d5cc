"""A motor with feedback lifts a soft arm with a load; its moment is limited."""

from math import exp, tanh

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
