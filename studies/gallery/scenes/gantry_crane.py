"""Crane: a trolley carries a load on a rope; it speeds up and brakes in one period each, and leaves no swing."""

from math import pi

import anctmm as at

LENGTH, MASS, ACCELERATION = 4.0, 50.0, 0.6  # m, kg, m/s²
PERIOD = 2 * pi * (LENGTH / 9.81) ** 0.5  # s
JUMPS = [(0.0, 1), (PERIOD, -1), (2 * PERIOD, -1), (3 * PERIOD, 1)]  # of the acceleration: when, and its sign


def travelled(t):
    """Position, velocity and acceleration of the trolley."""
    since = [(t - start, ACCELERATION * sign) for start, sign in JUMPS if t >= start]
    return sum(a * s**2 / 2 for s, a in since), sum(a * s for s, a in since), sum(a for _, a in since)


steel = at.Material(E=2e11, density=7850.0, damping=2e-3)
rope = at.Beam("rope", (0, 0), (0, -LENGTH), at.Circle(0.008), steel)
load = at.PointMass("load", mass=MASS, position=(0, -LENGTH))
trolley = at.Slider("rope.start", (1, 0), position=at.History(travelled, [start for start, _ in JUMPS]))
hook = at.Pin("rope.end", "load.center")
scene = at.Scene("gantry-crane", [rope, load], [trolley, hook], gravity=(0, -9.81))
CASES = [at.Case(scene, ["load.center", ("rope", 0.5)], t_end=16.0, output_dt=0.05)]
RUN = {"mesh": 4, "dt": 1e-2}


def ahead(s):
    return (s.position("load.center") - s.position("rope.start"))[:, 0]


def known(s):
    swing = abs(ahead(s)[s.t > s.t[-1] - PERIOD / 2]).max()
    return "swing of the load at the end", swing, 0.0, 2e-3, "m", "none after a whole period"
