"""Every joint, in explicit and implicit steps."""

from typing import Any

import anctmm as at
from tests.golden.answers import Answers, group
from tests.golden.scenes import (
    ALPHA,
    BLOCK,
    ESDIRK,
    FIRM,
    PLAIN,
    ROD,
    ZHAI,
    A,
    B,
    C,
    E,
    Parabola,
    beam,
    motion_of,
    reaction_of,
    scene,
    section_of,
    turning,
    under,
    work_of,
)
from tests.golden.vary import Variation

TURN = at.Quintic(0.9, 0.05)
ONE, TWO, SIDE = beam("one", A, B), beam("two", C, B, FIRM, ROD), beam("side", B, (0.8, -0.1), PLAIN, BLOCK)
PUSH = [at.Force("two.start", (0.7, -0.4))]
PLATE = at.RigidBody("plate", 0.06, 3e-4, (0.5, 0.18), {"a": B, "b": (0.62, 0.05), "c": (0.55, 0.3)})


def of_joints(name: str, bodies: Any, *joints: Any, loads: Any = (), **more: Any) -> None:
    """Register a scene with the joints in question first."""
    places: list[Any] = []
    for b in bodies:
        places += [(b.name, 0.0), (b.name, 0.7)] if isinstance(b, at.Beam) else [f"{b.name}.center"]
    made = scene(name.replace(" ", "-"), bodies, joints, loads, **more)
    group(moved, name=f"joint, {name}", made=made, places=places)


def moved(v: Variation, made: at.Scene, places: list[Any]) -> Answers:
    """Motion, work and reactions in explicit steps, the same in implicit ones."""
    found: Answers = {}
    for kind, steps in (("zhai", ZHAI), ("generalized-alpha", ALPHA)):
        s = v.solve(made, mesh=2, **steps)
        turns = [p for p in places if p != "ball.center"]
        answers = motion_of(s, *places, angles=turns[-1:]) | work_of(s) | reaction_of(s, *made.joints)
        found |= under(kind, answers)
    return found


START = at.Clamp("one.start")
of_joints("clamp", [ONE], START)
of_joints("clamp, driven", [ONE, TWO], at.Clamp("one.start", TURN), at.Pin("one.end", "two.end"), loads=PUSH)
of_joints("clamp, stretch free", [ONE], at.Clamp("one.start", stretch="free"))
of_joints("pin of one place", [ONE], at.Pin("one.start"))
of_joints("pin of two places", [ONE, TWO], at.Pin("one.end", "two.end"), START, loads=PUSH)
of_joints("pin of three places", [ONE, TWO, SIDE], at.Pin("one.end", "two.end", "side.start"), START)
of_joints("pin of two places, grounded", [ONE, TWO], at.Pin("one.end", "two.end", grounded=True))
of_joints("pin between the ends", [ONE, TWO], at.Pin(("one", 0.5)), at.Pin("one.end", "two.end"))
of_joints(
    "weld, straight", [ONE, beam("on", B, (0.8, 0.2), FIRM, ROD)], at.Weld("one.end", "on.start"), START
)
of_joints("weld at an angle", [ONE, TWO], at.Weld("one.end", "two.end"), START, loads=PUSH)
of_joints("weld of three places", [ONE, TWO, SIDE], at.Weld("one.end", "two.end", "side.start"), START)
of_joints("weld, grounded", [ONE, TWO], at.Weld("one.end", "two.end", grounded=True), loads=PUSH)
of_joints("weld, driven", [ONE, TWO], at.Weld("one.end", "two.end", angle=at.Quintic(0.5, 0.06)), START)
of_joints("weld, stretch free", [ONE, TWO], at.Weld("one.end", "two.end", stretch="free"), START)
of_joints("weld between the ends", [ONE, beam("twig", (0.2, 0.05), (0.3, 0.4), FIRM)],
          at.Weld(("one", 0.5), "twig.start"), START)  # fmt: skip
of_joints("weld of a rigid body", [ONE, PLATE], at.Weld("one.end", "plate.a"), START)
of_joints("weld of a rigid body, driven", [ONE, PLATE], at.Weld("one.end", "plate.a", angle=TURN), START)
of_joints("pins of a rigid body", [ONE, PLATE, beam("two", (0.9, -0.1), (0.62, 0.05), FIRM, ROD)],
          at.Pin("one.end", "plate.a"), at.Pin("plate.b", "two.end"), START)  # fmt: skip
of_joints("clamp of a rigid body, driven", [PLATE, beam("two", (0.9, -0.1), (0.62, 0.05))],
          at.Clamp("plate.c", angle=TURN), at.Pin("plate.b", "two.end"))  # fmt: skip
of_joints("slider", [ONE, TWO], at.Slider("one.start", (2.0, 1.0)), at.Pin("one.end", "two.end"))
of_joints("slider, driven", [ONE], at.Slider("one.start", (2.0, 1.0), position=at.Quintic(0.06, 0.05)))
of_joints("prismatic", [ONE], at.Prismatic("one.start", (1.0, -3.0)))
of_joints("prismatic, driven", [ONE], at.Prismatic("one.start", (1.0, -3.0), position=at.Quintic(0.05, 0.05)))
BASE = at.RigidBody("base", 0.08, 5e-4, (-0.05, 0.06), {"p": (-0.15, 0.0), "q": (0.05, 0.2)})
BALL = at.PointMass("ball", 0.04, (0.1, 0.1))
HOLD = at.Pin("base.p")
of_joints("slider on a body", [BASE, BALL], at.Slider("ball.center", (-1.0, 3.0), "base"), HOLD)
of_joints("slider on a body, driven", [BASE, BALL],
          at.Slider("ball.center", (-1.0, 3.0), "base", at.Quintic(0.03, 0.045)), HOLD)  # fmt: skip
of_joints(
    "slider of a rigid body, driven", [BASE], at.Slider("base.p", (2.0, 1.0), position=at.Quintic(0.04, 0.05))
)
of_joints("prismatic on a body", [BASE, ONE], at.Prismatic("one.start", (1.0, 2.0), "base"), HOLD)


@group(name="joint, weld at an angle, shear")
def shear_frame(v: Variation) -> Answers:
    """A frame of shear elements with a weld at an angle and one that is straight."""
    bodies = [ONE, TWO, beam("on", C, (1.0, 0.7), PLAIN)]
    made = scene("frame", bodies, [START, at.Weld("one.end", "two.end"), at.Weld("two.start", "on.start")])
    s = v.solve(made, mesh=2, element="shear", **ALPHA)
    return motion_of(s, "two.start", "on.end", angles=["on.end"]) | section_of(s, ("two", 0.5))


@group(name="joint, driven clamp and weld, esdirk")
def driven_by_esdirk(v: Variation) -> Answers:
    """A driven clamp that turns at the start, a driven weld and a driven slider, by Runge-Kutta steps."""
    drive = at.Clamp("one.start", Parabola(2.0, 15.0))
    weld = at.Weld("one.end", "two.end", angle=at.Quintic(0.5, 0.06))
    bodies = [turning(ONE, A, 2.0), turning(TWO, A, 2.0), at.PointMass("ball", 0.04, E)]
    guide = at.Slider("ball.center", (-1.0, 3.0), position=at.Quintic(0.03, 0.045))
    s = v.solve(scene("driven", bodies, [drive, weld, guide]), mesh=2, **ESDIRK)
    found = motion_of(s, "one.end", "two.start", "ball.center", angles=["two.start"])
    return found | work_of(s) | reaction_of(s, drive, weld, guide)


@group(name="joint, stretch free and driven")
def stretched(v: Variation) -> Answers:
    """A driven clamp, a weld at an angle and a driven weld that leave the stretch free."""
    bodies = [ONE, beam("two", B, C, FIRM, ROD), SIDE]
    joints = [
        at.Clamp("one.start", angle=at.Quintic(0.3, 0.05), stretch="free"),
        at.Weld("one.end", "side.start", stretch="free"),
        at.Weld("one.end", "two.start", angle=at.Quintic(-0.4, 0.06), stretch="free"),
    ]
    made = scene("stretched", bodies, joints, [at.Force("two.end", (6.0, 3.0))])
    return motion_of(v.solve(made, mesh=2, **ALPHA), "two.end", "side.end", angles=["two.end"])
