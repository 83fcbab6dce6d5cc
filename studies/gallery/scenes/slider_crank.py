"""An engine: a crank that comes to speed, a rod and a piston. What does the pin of the piston carry?"""

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
