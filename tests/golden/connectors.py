"""Every connector and every load."""

from typing import Any

import numpy as np

import anctmm as at
from tests.golden.answers import Answer, Answers, group
from tests.golden.scenes import (
    ALPHA,
    ESDIRK,
    FIRM,
    PLAIN,
    ROD,
    ZHAI,
    A,
    B,
    Parabola,
    Ramp,
    beam,
    motion_of,
    reaction_of,
    scene,
    under,
    work_of,
)
from tests.golden.vary import Variation

START = at.Clamp("one.start")
ONE, TWO = beam("one", A, B), beam("two", (0.9, -0.1), (0.62, 0.05), FIRM, ROD)
PLATE = at.RigidBody("plate", 0.06, 3e-4, (0.5, 0.18), {"a": B, "b": (0.62, 0.05), "c": (0.55, 0.3)})
BALL = at.PointMass("ball", 0.03, (0.95, 0.2), (0.3, -0.2))


def stiffening(elongation: float, rate: float, t: float) -> float:
    """Tension of a spring that stiffens, with a damper and a force that grows, N."""
    return 12.0 * elongation + 90.0 * elongation**3 + 0.4 * rate + 2.0 * t + 0.2


def motor(error: float, rate: float, t: float) -> float:
    """Moment of a feedback that is switched on slowly, N m."""
    return (0.3 + 4.0 * t) * error + 0.004 * rate


CONNECTORS = {
    "spring": at.Spring("one.end", (0.5, 0.9), stiffness=60.0),
    "spring, damped": at.Spring("one.end", "ball.center", stiffness=30.0, damping=0.2, length=0.4),
    "spring, preloaded": at.Spring("plate.c", "ball.center", stiffness=30.0, preload=0.15),
    "spring, driven length": at.Spring("ball.center", (1.2, 0.8), stiffness=25.0, damping=0.1,
                                       length=Parabola(0.8, -3.0, 0.6, short=True)),
    "spring within a beam": at.Spring(("one", 0.3), "ball.center", stiffness=20.0),
    "spring, law": at.Spring("one.end", "ball.center", law=stiffening),
    "rotational spring": at.RotationalSpring("plate.a", stiffness=0.4, damping=1e-3, angle=0.1),
    "rotational spring, two places": at.RotationalSpring("one.end", "plate.a", stiffness=0.3, preload=0.02),
    "rotational spring, driven": at.RotationalSpring("one.end", "plate.a", stiffness=0.3, damping=2e-3,
                                                     angle=Parabola(2.0, 9.0, 0.1, short=True)),
    "rotational spring, law": at.RotationalSpring("one.end", "plate.a", law=motor),
}  # fmt: skip
LOADS = {
    "force": at.Force("one.end", (0.3, -0.5)),
    "force within a beam": at.Force(("one", 0.6), (0.1, 0.25)),
    "force of time": at.Force("ball.center", Ramp((0.1, 0.0), (3.0, -60.0))),
    "follower force": at.Force("plate.c", (0.4, -0.3), follower=True),
    "follower force of time": at.Force(("one", 0.7), Ramp((0.2, 0.3), (15.0, 90.0)), follower=True),
    "torque": at.Torque("plate.a", -0.02),
    "torque within a beam": at.Torque(("one", 0.35), 0.012),
    "torque of time": at.Torque("one.end", at.Pulse(0.03, 0.06)),
    "line load": at.LineLoad("one", (0.5, -0.4)),
    "line load of time": at.LineLoad("one", Ramp((0.0, 0.3), (9.0, 70.0))),
}


def moved(
    v: Variation, connectors: Any = (), loads: Any = (), kinds: Any = ("zhai", "generalized-alpha")
) -> Answers:
    """A beam, a plate and a ball, with whatever acts on them."""
    hinge = at.Pin("one.end", "plate.a")
    made = scene("acted on", [ONE, PLATE, BALL], [START, hinge], loads, connectors)
    found: Answers = {}
    runs = {"zhai": ZHAI, "generalized-alpha": ALPHA, "esdirk": ESDIRK}
    for kind in kinds:
        s = v.solve(made, mesh=2, **runs[kind])
        answers = motion_of(s, "one.end", "plate.b", "ball.center", angles=["plate.b"]) | work_of(s)
        if kind == "zhai":
            answers |= reaction_of(s, hinge)
        if connectors:
            tensions = np.stack([s.tension(c) for c in s.scene.connectors])
            answers["tension"] = Answer(tensions, scale=1.0)
        found |= under(kind, answers)
    return found


for name, connector in CONNECTORS.items():
    group(moved, name=f"connector, {name}", connectors=[connector])
for name, load in LOADS.items():
    group(moved, name=f"load, {name}", loads=[load])
group(moved, name="connectors and loads of all kinds", connectors=list(CONNECTORS.values()),
      loads=list(LOADS.values()), kinds=("generalized-alpha", "esdirk"))  # fmt: skip


@group(name="connector, many springs")
def lattice(v: Variation) -> Answers:
    """Masses and a beam with as many springs between them as there are pairs."""
    masses = [
        at.PointMass(
            f"m{k}", 0.02 + 0.003 * k, (0.3 * (k % 3) + 0.02 * k, 0.25 * (k // 3)), (0.1 * k, -0.2 * k)
        )
        for k in range(5)
    ]
    springs = [
        at.Spring(f"m{i}.center", f"m{k}.center", stiffness=20.0 + 3.0 * k, damping=0.02 * i, preload=0.1)
        for k in range(5)
        for i in range(k)
    ]
    springs.append(at.Spring("m2.center", "one.end", stiffness=35.0, damping=0.1))
    bodies = [*masses, beam("one", (1.3, 0.2), (0.95, 0.05))]
    made = scene("lattice", bodies, [START, at.Pin("m0.center")], connectors=springs)
    s = v.solve(made, mesh=1, **ALPHA)
    tensions = np.stack([s.tension(c) for c in s.scene.connectors])
    return motion_of(s, "m3.center", "m4.center", "one.end") | work_of(s) | {"tension": tensions}


@group
def damped_material(v: Variation) -> Answers:
    """Beams of damped materials in steps of each method."""
    soft = at.Material(E=2e5, density=1000.0, poisson=0.3, damping=3e-4)
    slightly = at.Material(E=4e5, density=1200.0, damping=1e-4)
    bodies = [beam("one", A, B, soft), beam("two", (0.7, 0.4), B, slightly, ROD)]
    made = scene("damped", bodies, [START, at.Pin("one.end", "two.end")], [at.Torque("two.start", 0.02)])
    found: Answers = {}
    for kind, steps in (("zhai", ZHAI), ("generalized-alpha", ALPHA), ("esdirk", ESDIRK)):
        s = v.solve(made, mesh=2, **steps)
        dissipated = Answer(s.energy.dissipated, coarse=kind != "zhai")
        found |= under(kind, motion_of(s, "one.end", "two.start") | work_of(s) | {"dissipated": dissipated})
    s = v.solve(made, mesh={"one": 2, "two": 1}, element="shear", **ALPHA)
    return found | under("shear", motion_of(s, "one.end", "two.start") | work_of(s))


@group
def energy_of_dampers(v: Variation) -> Answers:
    """What a damper and a law that resists the rate have taken."""
    connectors = [CONNECTORS["spring, damped"], at.RotationalSpring("plate.a", law=motor)]
    made = scene("taken", [ONE, PLATE, BALL], [START, at.Pin("one.end", "plate.a")], connectors=connectors)
    s = v.solve(made, mesh=2, **ZHAI)
    return work_of(s) | {"dissipated": s.energy.dissipated, "balance": Answer(s.energy.balance, 0.1)}


@group
def initial_velocities(v: Variation) -> Answers:
    """Beams that fly with a bending rate, a spin and a drift: momentum and angles."""
    flying = at.RigidVelocity(A, B, center=(0.1, 0.4), spin=5.0, velocity=(1.0, -2.0))
    bodies = [
        beam("one", A, B, velocity=flying),
        beam("two", (0.0, 1.0), (0.5, 1.0), PLAIN, velocity=_bending),
    ]
    s = v.solve(scene("flying", bodies), mesh=2, **ALPHA)
    return motion_of(s, "one.start", ("one", 0.5), "two.end", angles=["one.end"])


def _bending(fraction: float) -> tuple[float, float]:
    more = 2.0 * fraction * fraction * (1.0 - fraction)
    return 0.3 + more, 1.5 * fraction - 0.4 + 2.0 * more
