"""Small scenes, each with what the base scenes do not have: a few elements, a few dozen steps, milliseconds to run.

The base scenes are of undamped bodies without Poisson's ratio, drawn from inboard to outboard, joined by pins, driven
at the start, at rest at t = 0, with gravity along −y. Whatever else a scene may have stands here, with another value in
each place, so that no two mistakes cancel and no number that is read wrongly is the right one by chance. What must
be refused, or must diverge, stands here too; `watches` says how each is run, and how it must end.

Large loads on soft bodies: in few steps every term of the elements is large.
"""

from dataclasses import replace
from typing import Any

import anctmm as at
from anctmm.model.scene import Point

STRIP, ROD, BLOCK = at.Rectangle(0.02, 0.02), at.Circle(0.03), at.Rectangle(0.01, 0.03)
SOFT = at.Material(E=2e5, density=1000.0, poisson=0.3)
FIRM = at.Material(E=5e5, density=1300.0, poisson=0.2)
PLAIN = at.Material(E=3e5, density=900.0)
DAMPED = at.Material(E=2e5, density=1000.0, poisson=0.3, damping=3e-4)
SLIGHTLY = at.Material(E=4e5, density=1200.0, poisson=0.1, damping=1e-4)
A, B, C, D, E = (0.0, 0.0), (0.4, 0.1), (0.7, 0.4), (1.1, 0.3), (1.4, 0.5)
GRAVITY = (7.0, -11.0)


# --- what acts in time -----------------------------------------------------------------------------------------


def ramp(first: Point, rate: Point) -> Any:
    """A force that grows and turns, N."""
    return lambda t: (first[0] + rate[0] * t, first[1] + rate[1] * t * t)


def spin(speed: float, acceleration: float = 0.0) -> Any:
    """A driven angle or position that already changes at t = 0, with its rate and acceleration."""
    return lambda t: (
        (speed + 0.5 * acceleration * t) * t, speed + acceleration * t, acceleration + 0.0 * t,
    )  # fmt: skip


def drawn(first: float, rate: float, growth: float) -> Any:
    """A free length or angle that changes, and its rate."""
    return lambda t: (first + rate * t + growth * t * t, rate + 2.0 * growth * t)


def stiffening(elongation: float, rate: float, t: float) -> float:
    """Tension of a spring that stiffens, with a damper and a force that is there from the start and grows, N."""
    return 12.0 * elongation + 90.0 * elongation**3 + 0.4 * rate + 2.0 * t + 0.2


def motor(error: float, rate: float, t: float) -> float:
    """Moment of a feedback that is switched on slowly, N m."""
    return (0.3 + 4.0 * t) * error + 0.004 * rate


def body(name: str, start: Point, end: Point, material: at.Material = SOFT, section: Any = STRIP) -> at.Beam:
    """A beam at rest."""
    return at.Beam(name, start, end, section, material)


def moving(
    beam: at.Beam, speed: float = 0.0, centre: Point = A, drift: Point = (0.0, 0.0), bending: float = 0.0
) -> at.Beam:
    """The beam with an initial velocity: a rotation about a centre, a translation, and a bending rate along it."""

    def velocity(fraction: float) -> Point:
        x, y = beam.position_at(fraction)
        more = bending * fraction * fraction * (1.0 - fraction)
        return drift[0] - speed * (y - centre[1]) + more, drift[1] + speed * (x - centre[0]) + 2.0 * more

    return replace(beam, velocity=velocity)


# fmt: off
# --- rows of beams ---------------------------------------------------------------------------------------------

# A driven clamp at the row's start, a body drawn backwards, one that floats beside, loads of every kind.
DRIVEN_ROW = at.Scene(
    "small-driven-row",
    [body("one", A, B), body("two", C, B, FIRM, ROD),
     moving(body("beside", (0.0, 1.0), (0.5, 1.0), PLAIN, BLOCK), speed=3.0, centre=(0.1, 0.9), bending=2.0)],
    [at.Clamp("one.start", angle=at.Quintic(0.9, 0.05)), at.Pin("one.end", "two.end")],
    [at.Force("two.start", (0.7, -0.4)), at.Force("one.end", ramp((0.3, -0.5), (20.0, -400.0))),
     at.Torque("two.end", 0.02), at.Torque("beside.end", at.Pulse(0.03, 0.06))], GRAVITY,
)
# The driven clamp holds the end of the row and already turns at t = 0; two bodies welded at an angle with it.
DRIVEN_END = at.Scene(
    "small-driven-end",
    [moving(body("one", A, B, FIRM, BLOCK), speed=2.0, centre=C), moving(body("two", B, C), speed=2.0, centre=C)],
    [at.Weld("one.end", "two.start"), at.Clamp("two.end", spin(2.0, 30.0))],
    [at.Force("one.start", (0.2, 0.6)), at.Torque("one.start", -0.01)],
    (-3.0, 4.0),
)
# Welds at angles, one of them held at the ground, backwards bodies, a grounded pin, a clamp at the far end.
ANGLED_ROW = at.Scene(
    "small-angled-row",
    [body("one", A, B), body("two", C, B, FIRM, ROD), body("three", C, D, PLAIN, BLOCK), body("four", E, D)],
    [at.Weld("one.end", "two.end", grounded=True), at.Weld("two.start", "three.start"),
     at.Pin("three.end", "four.end", grounded=True), at.Clamp("four.start")],
    [at.Force("one.start", (0.4, 0.9)), at.Torque("three.start", 0.03),
     at.Force("two.start", ramp((0.0, -1.0), (30.0, 100.0)))], GRAVITY,
)
# The angled row under a load that it can bear.
ANGLED_STILL = replace(
    ANGLED_ROW, name="small-angled-still", gravity=(0.6, -0.9),
    loads=(at.Force("one.start", (0.01, 0.02)), at.Torque("three.start", 0.003)),
)
# Cables and shear elements in one scene, joined by pins, with an angled weld; two chains; all damped.
MIXED_ROW = at.Scene(
    "small-mixed-row",
    [body("one", A, B, DAMPED), body("two", C, B, SLIGHTLY, ROD), body("three", C, D, SLIGHTLY, BLOCK),
     body("four", D, (1.5, 0.6), FIRM),
     moving(body("beside", (0.3, 0.9), (0.8, 1.1), DAMPED, BLOCK),
            speed=2.0, centre=(0.3, 0.9), drift=(0.1, -0.3), bending=3.0)],
    [at.Clamp("one.start", angle=at.Quintic(0.6, 0.04)), at.Pin("one.end", "two.end"),
     at.Weld("two.start", "three.start"), at.Pin("three.end", "four.start")],
    [at.Torque("two.end", 0.02), at.Torque("four.end", lambda t: 0.01 + 0.4 * t),
     at.Force("four.end", ramp((0.2, -0.6), (10.0, 200.0))), at.Force("beside.start", (0.1, 0.2))], GRAVITY,
)
MIXED = {"one": "shear", "two": "cable", "three": "cable", "four": "shear", "beside": "shear"}
MIXED_MESH = {"one": 2, "two": 1, "three": 2, "four": 1, "beside": 2}
# Rigid bodies: a driven crank, one drawn backwards and welded at an angle to a cable, one that flies beside.
RIGID_ROW = at.Scene(
    "small-rigid-row",
    [body("crank", A, B), body("bar", C, B, FIRM, ROD), body("strip", C, D, PLAIN, BLOCK), body("tail", D, (1.3, 0.6)),
     moving(body("beside", (0.0, 1.0), (0.5, 1.2), PLAIN, BLOCK), speed=5.0, centre=(0.3, 0.9), drift=(1.0, -2.0))],
    [at.Clamp("crank.start", angle=at.Quintic(1.2, 0.06)), at.Pin("crank.end", "bar.end"),
     at.Weld("bar.start", "strip.start"), at.Pin("strip.end", "tail.start")],
    [at.Torque("bar.start", 0.03), at.Force("tail.end", ramp((0.5, -0.3), (30.0, 300.0))),
     at.Torque("beside.end", -0.02)], GRAVITY,
)
RIGID = {"crank": "rigid", "bar": "rigid", "strip": "cable", "tail": "rigid", "beside": "rigid"}
RIGID_MESH = {"crank": 1, "bar": 1, "strip": 2, "tail": 1, "beside": 1}
# Two bodies for the options of the integrators: a turning clamp, a torque, a force that varies.
OPTIONS = at.Scene(
    "small-options",
    [body("one", A, B), body("two", C, B, FIRM, ROD)],
    [at.Clamp("one.start", angle=at.Quintic(0.9, 0.05)), at.Pin("one.end", "two.end")],
    [at.Torque("two.start", 0.02), at.Force("one.end", ramp((0.3, -0.5), (20.0, -400.0)))], GRAVITY,
)
# One chain with a driven start, a pin and a body drawn backwards.
DRIVEN_CHAIN = replace(OPTIONS, name="small-driven-chain")


# --- one clamped beam, and beams alone ---------------------------------------------------------------------------


def stick(name: str, force: Point, torque: float = 0.0, gravity: Point = (0.0, 0.0)) -> at.Scene:
    """A clamped body under a force and a torque at its end."""
    loads = [at.Force("stick.end", force), at.Torque("stick.end", torque)]
    return at.Scene(name, [body("stick", A, (0.4, 0.3))], [at.Clamp("stick.start")], loads, gravity)


STICK = stick("small-stick", (0.02, 0.06), 0.004, (0.5, -0.8))
COLUMN = stick("small-column", (-0.03164, -0.02363))  # one and a half times Euler's load, and a small side force
PULLED = stick("small-pulled", (2e7, 0.0))  # a force that no beam can bear
CRUSHED = stick("small-crushed", (-40.0, -30.0))  # along the axis: turns shear elements inside out
# A free body: on one element its highest frequency is the element's own.
BARE = at.Scene("small-bare", [body("bare", A, C, FIRM, BLOCK)], gravity=GRAVITY)
# A stiff bar that turns fast about a pin: implicit steps that are too long for it make energy.
SPUN = at.Scene(
    "small-spun",
    [moving(body("bar", A, (0.8, 0.6), at.Material(E=2e11, density=7800.0)), speed=50.0, centre=A)],
    [at.Pin("bar.start")],
)
# A rigid crank that is driven where the rigid coupler, pinned to the ground, cannot follow.
LOCKED = at.Scene(
    "small-locked",
    [body("crank", A, (0.3, 0.0)), body("coupler", (0.3, 0.0), (0.9, 0.3), FIRM, ROD)],
    [at.Clamp("crank.start", angle=at.Quintic(2.0, 0.05)), at.Pin("crank.end", "coupler.start"), at.Pin("coupler.end")],
)
BLADE = at.Scene("small-blade", [body("blade", A, B)], [at.Clamp("blade.start")])

# --- trees, loops, free stretches ----------------------------------------------------------------------------------

# Three bodies in one hinge, one of them driven at its other end, one with a body welded at an angle.
TREE = at.Scene(
    "small-tree",
    [body("trunk", A, B), body("left", C, B, FIRM, ROD), body("right", B, (0.6, -0.3), PLAIN, BLOCK),
     body("twig", C, (0.9, 0.7))],
    [at.Clamp("trunk.start", angle=at.Quintic(0.7, 0.05)), at.Pin("trunk.end", "left.end", "right.start"),
     at.Weld("left.start", "twig.start")],
    [at.Torque("right.end", 0.02), at.Force("twig.end", ramp((0.1, -0.3), (10.0, 90.0)))], GRAVITY,
)
# A triangle of bodies that swings about one corner; another corner is welded at its angle.
LOOP = at.Scene(
    "small-loop",
    [body("one", A, B), body("two", C, B, FIRM, ROD), body("three", C, A, PLAIN, BLOCK)],
    [at.Pin("one.start", "three.end", grounded=True), at.Pin("one.end", "two.end"),
     at.Weld("two.start", "three.start")],
    [at.Torque("two.end", 0.02), at.Force("three.start", (0.3, -0.4))], GRAVITY,
)
# A driven clamp, a weld at an angle and a driven weld that leave the stretch free, and loads along the beams.
STRETCHED = at.Scene(
    "small-stretched",
    [body("one", A, B), body("two", B, C, FIRM, ROD), body("side", B, (0.8, -0.1), PLAIN)],
    [at.Clamp("one.start", angle=at.Quintic(0.3, 0.05), stretch="free"),
     at.Weld("one.end", "side.start", stretch="free"),
     at.Weld("one.end", "two.start", angle=at.Quintic(-0.4, 0.06), stretch="free")],
    [at.Force("two.end", (6.0, 3.0))], GRAVITY,
)

# --- mechanisms: rigid bodies, masses, guides, driven hinges, connectors -------------------------------------------

P, Q, R = (0.62, 0.05), (0.55, 0.3), (0.95, 0.2)
# Two beams, a plate between them and a ball on springs: connectors and loads of every kind.
LINKAGE = at.Scene(
    "small-linkage",
    [body("one", A, B), at.RigidBody("plate", 0.06, 3e-4, (0.5, 0.18), {"a": B, "b": P, "c": Q}),
     body("two", (0.9, -0.1), P, FIRM, ROD), at.PointMass("ball", 0.03, R, (0.3, -0.2)),
     at.RigidBody("beside", 0.05, 2e-4, (0.2, 0.8), {"a": (0.3, 0.9)}, (0.4, 0.7), 6.0)],
    [at.Clamp("one.start"), at.Pin("one.end", "plate.a"), at.Pin("plate.b", "two.end")],
    [at.Force("plate.c", (0.4, -0.3), follower=True),
     at.Force(("one", 0.7), ramp((0.2, 0.3), (15.0, 90.0)), follower=True),
     at.Torque(("one", 0.35), 0.012), at.Force(("two", 0.6), (0.1, 0.25)),
     at.Force("ball.center", ramp((0.1, 0.0), (3.0, -60.0))), at.LineLoad("one", (0.5, -0.4)),
     at.LineLoad("two", ramp((0.0, 0.3), (9.0, 70.0))), at.Torque("plate.center", -0.02)], GRAVITY,
    [at.Spring("plate.c", "ball.center", stiffness=30.0, damping=0.2, preload=0.15),
     at.Spring("ball.center", (1.2, 0.8), stiffness=25.0, damping=0.1, length=drawn(0.6, 0.8, -3.0)),
     at.Spring(("one", 0.3), "two.start", law=stiffening),
     at.RotationalSpring("one.end", "plate.a", stiffness=0.3, damping=2e-3, angle=drawn(0.1, 2.0, 9.0)),
     at.RotationalSpring("two.start", law=motor),
     at.RotationalSpring(("two", 0.4), "plate.b", stiffness=0.1, preload=0.02)],
)
# The linkage with weaker loads: what it rests under, before those of time move it.
HELD = at.Scene(
    "small-held",
    [*LINKAGE.bodies[:3], at.PointMass("ball", 0.03, R)],
    LINKAGE.joints, LINKAGE.loads[2:], (0.7, -1.1),
    [LINKAGE.connectors[0], replace(LINKAGE.connectors[1], length=0.6), *LINKAGE.connectors[2:],  # type: ignore[call-arg, arg-type]
     at.RotationalSpring("two.end", stiffness=0.8)],
)
# A plate on a driven guide, with slots for a beam that does not turn and for a ball; driven hinges; a branch.
GUIDED = at.Scene(
    "small-guided",
    [at.RigidBody("base", 0.08, 5e-4, (-0.05, 0.06), {"p": (-0.15, 0.0), "q": (0.05, 0.2)}),
     body("side", (1.0, 0.8), (1.3, 0.6), PLAIN), body("twig", (1.15, 0.7), (1.3, 0.9), FIRM, ROD),
     body("one", A, B), body("two", B, C, FIRM, ROD),
     at.RigidBody("tool", 0.02, 4e-5, (0.75, 0.45), {"a": C, "b": (0.8, 0.4)}), at.PointMass("ball", 0.04, (0.1, 0.1))],
    [at.Slider("base.p", (2.0, 1.0), position=at.Quintic(0.04, 0.05)), at.Prismatic("one.start", (1.0, 2.0), "base"),
     at.Prismatic("side.start", (1.0, -3.0), position=at.Quintic(0.05, 0.05)), at.Weld(("side", 0.5), "twig.start"),
     at.Weld("one.end", "two.start", angle=at.Quintic(0.5, 0.06)),
     at.Weld("two.end", "tool.a", angle=at.Quintic(-0.8, 0.04)),
     at.Slider("ball.center", (-1.0, 3.0), "base", position=at.Quintic(0.03, 0.045))],
    [at.Force("tool.b", (0.2, -0.1))], GRAVITY,
    [at.Spring("one.start", "base.q", stiffness=60.0),
     at.RotationalSpring("base.center", stiffness=0.4, damping=1e-3)],
)
# A driven crank, its rod, whose end slides with a weight, and a beam on a prismatic joint; all on the ground.
SLIDING = at.Scene(
    "small-sliding",
    [body("one", A, B), body("two", B, C, FIRM, ROD), body("side", (0.9, 0.6), (1.2, 0.7), PLAIN),
     at.PointMass("ball", 0.03, C)],
    [at.Clamp("one.start", angle=at.Quintic(0.4, 0.05)), at.Pin("one.end", "two.start"),
     at.Pin("two.end", "ball.center"), at.Slider("two.end", (3.0, 1.0)), at.Prismatic("side.start", (1.0, -2.0))],
    [at.Force("side.end", (0.3, 0.2))], GRAVITY,
    [at.Spring("side.start", (0.8, 0.9), stiffness=40.0, damping=0.1, length=0.2)],
)
# A rigid crank that already turns drives a rod, whose end slides on a line; a swing hangs from the rod.
STARTED = at.consistent_velocities(
    name="small-started",
    bodies=[body("crank", A, B), at.RigidBody("bar", 0.05, 2e-4, (0.5, 0.2), {"a": B, "b": (0.6, 0.3)}),
            at.PointMass("ball", 0.02, (0.6, 0.3)), body("swing", P, C)],
    joints=[at.Clamp("crank.start", angle=spin(3.0, 4.0)), at.Pin("crank.end", "bar.a"),
            at.Pin("bar.b", "ball.center"), at.Slider("ball.center", (2.0, -1.0)),
            at.Slider("swing.start", (1.0, 1.0), position=spin(0.4))],
)
# fmt: on
