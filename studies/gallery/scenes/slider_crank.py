"""Engine: crank, rod and piston come to speed; the reaction of the piston's pin is nearly that of rigid bars."""

import numpy as np

import anctmm as at

CRANK, ROD, MASS, SPEED, START = 0.05, 0.15, 0.4, 300.0, 0.04  # m, m, kg, rad/s, s


def turning(t):
    """Angle, rate and acceleration: the speed grows until START and stays."""
    rate = SPEED * min(t / START, 1.0)
    return rate * t / 2 if t < START else SPEED * (t - START / 2), rate, SPEED / START if t < START else 0.0


steel = at.Material(E=2.1e11, density=7850.0, damping=3e-5)
bodies = [
    at.Beam("crank", (0, 0), (CRANK, 0), at.Rectangle(0.02, 0.02), steel),
    at.Beam("rod", (CRANK, 0), (CRANK + ROD, 0), at.Rectangle(0.01, 0.008), steel),
    at.PointMass("piston", mass=MASS, position=(CRANK + ROD, 0)),
]
pin = at.Pin("piston.center", "rod.end")  # the piston first: a reaction acts on the first place
drive = at.Clamp("crank.start", angle=at.History(turning, breaks=[START]))
joints = [drive, at.Pin("crank.end", "rod.start"), pin, at.Slider("piston.center", (1, 0))]
scene = at.Scene("engine", bodies, joints)
CASES = [at.Case(scene, ["piston.center", ("rod", 0.5)], t_end=0.0832, output_dt=0.0002)]
RUN = {"mesh": {"crank": 2, "rod": 4}, "dt": 5e-5}


def known(s):
    top = START / 2 + 6 * np.pi / SPEED  # the third time that the crank points to the piston
    force = -np.interp(top, s.t, s.reaction(pin)[:, 0])
    rigid = MASS * CRANK * SPEED**2 * (1 + CRANK / ROD)
    what = "pull of the rod at the dead centre"
    return what, force, rigid, 0.02 * rigid, "N", "m r ω² (1 + r/l), rigid bars"
