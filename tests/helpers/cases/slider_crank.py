"""A slider-crank: a driven crank, a soft rod, and a plate on a guide, with springs and a mass."""

import anctmm as at

STEEL = at.Material(E=2e8, density=1500.0)
crank = at.Beam("crank", (0.0, 0.0), (0.15, 0.0), at.Rectangle(0.02, 0.01), STEEL)
rod = at.Beam("rod", (0.15, 0.0), (0.6, 0.0), at.Rectangle(0.02, 0.008), STEEL)
plate = at.RigidBody(
    "plate",
    mass=0.5,
    inertia=3.3e-3,
    center=(0.7, 0.0),
    points={"a": (0.6, 0.0), "b": (0.8, 0.05), "c": (0.8, -0.05)},
)
load = at.PointMass("load", mass=0.05, position=(0.8, -0.3))
drive = at.Clamp("crank.start", angle=at.Quintic(turn=3.0, duration=0.4))
guide = at.Prismatic("plate.a", direction=(1, 0))
pin = at.Pin("crank.end", "rod.start")
wrist = at.Pin("rod.end", "plate.a")
spring = at.Spring("load.center", "plate.c", stiffness=50.0, damping=0.05)
back = at.Spring("plate.b", (1.2, 0.05), stiffness=80.0)
scene = at.Scene(
    "slider-crank",
    [crank, rod, plate, load],
    [drive, pin, wrist, guide],
    connectors=[spring, back],
    gravity=(0, -9.81),
)
CASES = [
    at.Case(
        scene,
        ["rod.end", ("rod", 0.5), "load.center"],
        t_end=0.4,
        output_dt=0.02,
        note="A plate is pushed by a soft rod.",
    )
]
