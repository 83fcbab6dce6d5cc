"""Frequencies, damping and shapes of small motions; Campbell diagrams."""

from typing import Any

import numpy as np

import anctmm as at
from tests.golden.answers import Answer, Answers, group
from tests.golden.scenes import FIRM, PLAIN, ROD, STEEL, A, B, C, beam, scene
from tests.golden.vary import Variation

ONE, TWO = beam("one", A, B), beam("two", C, B, FIRM, ROD)
START = at.Clamp("one.start")


def modes_of(m: at.Modes, places: Any) -> Answers:
    """Frequencies, damping, rates, and shapes of unit length at the place that moves farthest."""
    found = {
        "frequencies": m.frequencies,
        "growth rates": Answer(m.growth_rates, 2 * np.pi * m.frequencies[-1]),
    }
    shapes = np.stack([m.displacement(p) for p in places], axis=1)
    rows = []
    for shape in shapes:
        first = shape.ravel()[np.abs(shape).argmax()]
        turned = shape * np.abs(first) / first
        lengths = np.sqrt((np.abs(turned) ** 2).sum(axis=1))
        rows.append(turned / lengths.max())
    complex_ = np.array(rows)
    return found | {
        "damping": Answer(m.damping, 1.0),
        "shapes": np.stack([complex_.real, complex_.imag]),
        "unstable": str(m.unstable.tolist()),
    }


@group(name="modes, cable", element="cable")
@group(name="modes, quintic", element="quintic")
@group(name="modes, shear", element="shear")
def chain(v: Variation, **options: Any) -> Answers:
    """A clamp, a pin and a weld."""
    bodies = [ONE, TWO, beam("on", C, (1.1, 0.3), PLAIN)]
    joints = [START, at.Pin("one.end", "two.end"), at.Weld("two.start", "on.start")]
    hold = [at.RotationalSpring("two.start", stiffness=0.05)]
    m = v.modes(scene("chain", bodies, joints, connectors=hold), mesh=2, count=5, **options)
    return modes_of(m, ["one.end", ("two", 0.3), "on.end"])


@group(name="modes of a mechanism")
def mechanism(v: Variation) -> Answers:
    """A beam, a plate, a ball on springs and a slider, with dampers."""
    plate = at.RigidBody("plate", 0.06, 3e-4, (0.5, 0.18), {"a": B, "c": (0.55, 0.3)})
    ball = at.PointMass("ball", 0.03, (0.95, 0.2))
    connectors = [
        at.Spring("plate.c", "ball.center", stiffness=30.0, damping=0.02),
        at.Spring("ball.center", (1.2, 0.8), stiffness=25.0, damping=0.01),
        at.RotationalSpring("one.end", "plate.a", stiffness=0.3, damping=1e-4),
    ]
    joints = [START, at.Pin("one.end", "plate.a"), at.Slider("ball.center", (1.0, 0.5))]
    m = v.modes(scene("mechanism", [ONE, plate, ball], joints, connectors=connectors), mesh=2, count=4)
    return modes_of(m, ["one.end", "plate.c", "ball.center"])


@group(name="modes of a damped material")
def damped(v: Variation) -> Answers:
    """A clamped steel beam with Kelvin-Voigt damping."""
    steel = at.Material(E=2.1e11, density=7850.0, damping=1e-4)
    bar = at.Beam("bar", (0, 0), (1, 0), at.Rectangle(0.05, 0.02), steel)
    m = v.modes(at.Scene("damped", [bar], [at.Clamp("bar.start")]), mesh=6, count=4)
    return modes_of(m, [("bar", 0.5), "bar.end"])


@group(name="modes of a loop")
def loop(v: Variation) -> Answers:
    """A welded triangle, grounded at one corner by a pin."""
    bodies = [ONE, TWO, beam("three", C, A, PLAIN)]
    joints = [
        at.Pin("one.start", "three.end", grounded=True),
        at.Weld("one.end", "two.end"),
        at.Weld("two.start", "three.start"),
    ]
    m = v.modes(scene("loop", bodies, joints), mesh=2, count=4)
    return {"frequencies": Answer(m.frequencies[1:], allowed=1e-9 * m.frequencies[-1])}


@group(name="modes about an equilibrium")
def bent(v: Variation) -> Answers:
    """A beam bent by a force, whose frequencies differ from those of the straight one."""
    made = scene("bent", [ONE], [START], [at.Force("one.end", (0.02, 0.06))], gravity=(0.0, -1.0))
    rest = v.static(made, mesh=3)
    m = v.modes(made, about=rest, mesh=3, count=4)
    return modes_of(m, ["one.end", ("one", 0.4)])


@group(name="flutter of Beck's column")
def beck(v: Variation) -> Answers:
    """Below and above the critical follower force."""
    section = at.Rectangle(0.03, 0.003)
    unit = STEEL.E * section.second_moment
    found: Answers = {}
    for load in (19.0, 21.0):
        push = at.Force("one.end", (-load * unit, 0.0), follower=True)
        made = at.Scene("Beck", [at.Beam("one", A, (1.0, 0.0), section, STEEL)], [START], [push])
        m = v.modes(made, about=v.static(made, mesh=8), mesh=8, count=2)
        found[f"frequencies at {load:g}"] = m.frequencies
        found[f"growth at {load:g}"] = Answer(m.growth_rates, float(2 * np.pi * m.frequencies.max()))
        found[f"unstable at {load:g}"] = str(m.unstable.tolist())
    return found


@group(name="Campbell diagram")
def campbell(v: Variation) -> Answers:
    """Lag frequencies of a blade clamped to a hub without a radius."""
    blade = at.Beam("blade", A, (1.0, 0.0), at.Rectangle(0.05, 0.004), STEEL)
    made = v.scene(at.Scene("blade", [blade], [at.Clamp("blade.start")]))
    c = at.campbell(made, [0.0, 20.0, 60.0], mesh=6, count=3)
    found = {"frequencies": c.frequencies, "damping": Answer(c.damping, 1.0)}
    return found | {"resonances": np.array(c.resonances(1))[:2]}


@group(name="modes, spring in a turning hub")
def hub(v: Variation) -> Answers:
    """A mass at the end of a blade that turns."""
    blade = beam("one", A, (0.5, 0.0), FIRM)
    made = scene(
        "hub",
        [blade, at.PointMass("tip", 0.05, (0.5, 0.0))],
        [START, at.Pin("one.end", "tip.center")],
        gravity=(0.0, 0.0),
    )
    return {"frequencies": v.modes(made, mesh=3, count=3, spin=8.0).frequencies}
