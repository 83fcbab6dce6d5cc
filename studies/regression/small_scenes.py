"""Small scenes, each with what the base scenes do not have: a few elements, a few dozen steps, milliseconds to run.

The base scenes are of undamped bodies without Poisson's ratio, drawn from inboard to outboard, joined by pins, driven
at the start, at rest at t = 0, with gravity along −y. Whatever else a scene may have stands here, with another value in
each place, so that no two mistakes cancel and no number that is read wrongly is the right one by chance. What must
be refused, or must diverge, stands here too, with how it must end.

Large loads on soft bodies: in few steps every term of the elements is large.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import anctmm as at
from anctmm.model.scene import Joint, Load, Point

STRIP, ROD, BLOCK = at.Rectangle(0.02, 0.02), at.Circle(0.03), at.Rectangle(0.01, 0.03)
SOFT = at.Material(E=2e5, density=1000.0, poisson=0.3)
FIRM = at.Material(E=5e5, density=1300.0, poisson=0.2)
PLAIN = at.Material(E=3e5, density=900.0)
DAMPED = at.Material(E=2e5, density=1000.0, poisson=0.3, damping=3e-4)
SLIGHTLY = at.Material(E=4e5, density=1200.0, poisson=0.1, damping=1e-4)


# --- what acts in time ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Ramp:
    """A force that grows and turns, N; a function with a name, so that its text is the same in every process."""

    first: Point
    rate: Point

    def __call__(self, t: Any) -> tuple[Any, Any]:
        """Force at the time(s) t (s)."""
        return self.first[0] + self.rate[0] * t, self.first[1] + self.rate[1] * t * t


@dataclass(frozen=True)
class Spin:
    """The angle of a driven clamp that already turns at t = 0: θ = ωt + ½αt²."""

    speed: float
    acceleration: float

    def __call__(self, t: Any) -> tuple[Any, Any, Any]:
        """Angle, rate and acceleration at the time(s) t (s)."""
        return (
            self.speed * t + 0.5 * self.acceleration * t * t,
            self.speed + self.acceleration * t,
            self.acceleration + 0.0 * t,
        )


@dataclass(frozen=True)
class Carried:
    """Initial velocity of a body, m/s: a rotation about a centre, a translation, and a bending rate along it."""

    start: Point
    end: Point
    speed: float = 0.0
    centre: Point = (0.0, 0.0)
    drift: Point = (0.0, 0.0)
    bending: float = 0.0

    def __call__(self, fraction: float) -> Point:
        """Velocity at a fraction of the length."""
        x, y = ((1.0 - fraction) * a + fraction * b for a, b in zip(self.start, self.end, strict=True))
        more = self.bending * fraction * fraction * (1.0 - fraction)
        return (
            self.drift[0] - self.speed * (y - self.centre[1]) + more,
            self.drift[1] + self.speed * (x - self.centre[0]) + 2.0 * more,
        )


def body(name: str, start: Point, end: Point, material: at.Material = SOFT, section: Any = STRIP) -> at.Beam:
    """A body at rest."""
    return at.Beam(name, start, end, section, material)


def moving(beam: at.Beam, **motion: Any) -> at.Beam:
    """The body with an initial velocity, see `Carried`."""
    return replace(beam, velocity=Carried(beam.start, beam.end, **motion))


def _scene(
    name: str,
    bodies: Sequence[at.Beam],
    joints: Sequence[Joint] = (),
    loads: Sequence[Load] = (),
    gravity: Point = (0.0, 0.0),
) -> at.Scene:
    return at.Scene(name, tuple(bodies), tuple(joints), tuple(loads), gravity)


# --- scenes --------------------------------------------------------------------------------------------------

A, B, C, D = (0.0, 0.0), (0.4, 0.1), (0.7, 0.4), (1.1, 0.3)
GRAVITY = (7.0, -11.0)


def driven_row() -> at.Scene:
    """A driven clamp at the row's start, a body drawn backwards, one that floats beside, loads of every kind."""
    one, two = body("one", A, B), body("two", C, B, FIRM, ROD)  # two runs from its end to its start
    three = moving(
        body("beside", (0.0, 1.0), (0.5, 1.0), PLAIN, BLOCK), speed=3.0, centre=(0.1, 0.9), bending=2.0
    )
    joints: list[Joint] = [at.Clamp("one.start", at.Quintic(0.9, 0.05)), at.Pin("one.end", "two.end")]
    loads: list[Load] = [
        at.Force("two.start", (0.7, -0.4)),
        at.Force("one.end", Ramp((0.3, -0.5), (20.0, -400.0))),
        at.Torque("two.end", 0.02),
        at.Torque("beside.end", at.Pulse(0.03, 0.06)),
    ]
    return _scene("small-driven-row", [one, two, three], joints, loads, GRAVITY)


def driven_end() -> at.Scene:
    """The driven clamp holds the end of the row and already turns at t = 0; two bodies welded at an angle with it."""
    turn = {"speed": 2.0, "centre": C}
    bodies = [moving(body("one", A, B, FIRM, BLOCK), **turn), moving(body("two", B, C), **turn)]
    joints: list[Joint] = [at.Weld("one.end", "two.start"), at.Clamp("two.end", Spin(2.0, 30.0))]
    loads: list[Load] = [at.Force("one.start", (0.2, 0.6)), at.Torque("one.start", -0.01)]
    return _scene("small-driven-end", bodies, joints, loads, (-3.0, 4.0))


def driven_tail() -> at.Scene:
    """One body whose last end is driven."""
    tail = moving(body("tail", A, B, FIRM, BLOCK), speed=-3.0, centre=B)
    return _scene(
        "small-driven-tail",
        [tail],
        [at.Clamp("tail.end", Spin(-3.0, 20.0))],
        [at.Force("tail.start", (0.2, 0.6))],
        (2.0, 5.0),
    )


def angled_row() -> at.Scene:
    """Welds at angles, one of them held at the ground, backwards bodies, a grounded pin, a clamp at the far end."""
    E = (1.4, 0.5)
    bodies = [
        body("one", A, B),
        body("two", C, B, FIRM, ROD),
        body("three", C, D, PLAIN, BLOCK),
        body("four", E, D),
    ]
    joints: list[Joint] = [
        at.Weld("one.end", "two.end", grounded=True),
        at.Weld("two.start", "three.start"),
        at.Pin("three.end", "four.end", grounded=True),
        at.Clamp("four.start"),
    ]
    loads: list[Load] = [
        at.Force("one.start", (0.4, 0.9)),
        at.Torque("three.start", 0.03),
        at.Force("two.start", Ramp((0.0, -1.0), (30.0, 100.0))),
    ]
    return _scene("small-angled-row", bodies, joints, loads, GRAVITY)


def straight_row() -> at.Scene:
    """A continuous beam over a support: aligned welds, one held at the ground, and a pinned start."""
    places = [(0.3 * i, 0.1 * i) for i in range(4)]
    bodies = [
        body(name, p, q, m)
        for name, p, q, m in zip(
            ("one", "two", "three"), places, places[1:], (SOFT, FIRM, SOFT), strict=False
        )
    ]
    joints: list[Joint] = [
        at.Pin("one.start"),
        at.Weld("one.end", "two.start"),
        at.Weld("two.end", "three.start", grounded=True),
    ]
    loads: list[Load] = [at.Force("three.end", (0.3, -0.5)), at.Torque("one.end", 0.02)]
    return _scene("small-straight-row", bodies, joints, loads, GRAVITY)


def mixed_row() -> at.Scene:
    """Cables and shear elements in one scene, joined by pins, with an angled weld; two chains; all damped."""
    E, F = (1.5, 0.6), (0.3, 0.9)
    bodies = [
        body("one", A, B, DAMPED),
        body("two", C, B, SLIGHTLY, ROD),
        body("three", C, D, SLIGHTLY, BLOCK),
        body("four", D, E, FIRM),
        moving(
            body("beside", F, (0.8, 1.1), DAMPED, BLOCK), speed=2.0, centre=F, drift=(0.1, -0.3), bending=3.0
        ),
    ]
    joints: list[Joint] = [
        at.Clamp("one.start", at.Quintic(0.6, 0.04)),
        at.Pin("one.end", "two.end"),
        at.Weld("two.start", "three.start"),
        at.Pin("three.end", "four.start"),
    ]
    loads: list[Load] = [
        at.Torque("two.end", 0.02),
        at.Torque("four.end", Ramped(0.01, 0.4)),
        at.Force("four.end", Ramp((0.2, -0.6), (10.0, 200.0))),
        at.Force("beside.start", (0.1, 0.2)),
    ]
    return _scene("small-mixed-row", bodies, joints, loads, GRAVITY)


@dataclass(frozen=True)
class Ramped:
    """A moment that grows, N m."""

    first: float
    rate: float

    def __call__(self, t: Any) -> Any:
        """Moment at the time(s) t (s)."""
        return self.first + self.rate * t


MIXED = {"one": "shear", "two": "cable", "three": "cable", "four": "shear", "beside": "shear"}
MIXED_MESH = {"one": 2, "two": 1, "three": 2, "four": 1, "beside": 2}


def rigid_row() -> at.Scene:
    """Rigid bodies: a driven crank, one drawn backwards and welded at an angle to a cable, one that flies beside."""
    E = (1.3, 0.6)
    bodies = [
        body("crank", A, B),
        body("bar", C, B, FIRM, ROD),
        body("strip", C, D, PLAIN, BLOCK),
        body("tail", D, E),
        moving(
            body("beside", (0.0, 1.0), (0.5, 1.2), PLAIN, BLOCK),
            speed=5.0,
            centre=(0.3, 0.9),
            drift=(1.0, -2.0),
        ),
    ]
    joints: list[Joint] = [
        at.Clamp("crank.start", at.Quintic(1.2, 0.06)),
        at.Pin("crank.end", "bar.end"),
        at.Weld("bar.start", "strip.start"),
        at.Pin("strip.end", "tail.start"),
    ]
    loads: list[Load] = [
        at.Torque("bar.start", 0.03),
        at.Force("tail.end", Ramp((0.5, -0.3), (30.0, 300.0))),
        at.Torque("beside.end", -0.02),
    ]
    return _scene("small-rigid-row", bodies, joints, loads, GRAVITY)


RIGID = {"crank": "rigid", "bar": "rigid", "strip": "cable", "tail": "rigid", "beside": "rigid"}
RIGID_MESH = {"crank": 1, "bar": 1, "strip": 2, "tail": 1, "beside": 1}


def rigid_pendulum() -> at.Scene:
    """Rigid bodies in a row that swing from a pin and spin at the start; two are welded, so that one shape follows."""
    turn = {"speed": 4.0, "centre": A}
    bodies = [
        moving(body("upper", B, A, FIRM, ROD), **turn),
        moving(body("lower", B, C, PLAIN, BLOCK), **turn),
        moving(body("arm", C, D, FIRM, STRIP), **turn),
    ]
    joints: list[Joint] = [
        at.Pin("upper.end"),
        at.Pin("upper.start", "lower.start"),
        at.Weld("lower.end", "arm.start"),
    ]
    return _scene("small-rigid-pendulum", bodies, joints, [at.Force("arm.end", (0.5, 0.2))], (5.0, -9.0))


def long_strip() -> at.Scene:
    """A body of more nodes than the kernels take at once, bent by its weight and a torque at its end."""
    joints: list[Joint] = [at.Clamp("strip.start")]
    strip = moving(body("strip", A, (2.0, 1.0), SOFT), bending=5.0)
    tail = body("tail", (2.4, 1.0), (2.0, 1.0), FIRM)
    loads: list[Load] = [at.Torque("strip.end", 0.03), at.Force("tail.start", Ramp((0.1, 0.5), (10.0, 50.0)))]
    return _scene(
        "small-long-strip",
        [replace(strip, velocity=None), tail],
        [*joints, at.Pin("strip.end", "tail.end")],
        loads,
        GRAVITY,
    )


def options_row() -> at.Scene:
    """Two bodies for the options of the integrators: a turning clamp, a torque, a force that varies."""
    bodies = [body("one", A, B), body("two", C, B, FIRM, ROD)]
    joints: list[Joint] = [at.Clamp("one.start", at.Quintic(0.9, 0.05)), at.Pin("one.end", "two.end")]
    loads: list[Load] = [at.Torque("two.start", 0.02), at.Force("one.end", Ramp((0.3, -0.5), (20.0, -400.0)))]
    return _scene("small-options", bodies, joints, loads, GRAVITY)


def driven_chain(damping: float = 0.0) -> at.Scene:
    """One chain with a driven start, a pin and a body drawn backwards."""
    name = "small-driven-damped" if damping else "small-driven-chain"
    row = options_row()
    bodies = [replace(b, material=replace(b.material, damping=damping)) for b in row.beams]
    return _scene(name, bodies, row.joints, row.loads, row.gravity)


def held_chain() -> at.Scene:
    """One chain pinned at its start and clamped at its end, with a weld and two pins."""
    E = (1.4, 0.5)
    bodies = [
        body("one", A, B),
        body("two", C, B, FIRM, ROD),
        body("three", C, D, PLAIN, BLOCK),
        body("four", E, D),
    ]
    joints: list[Joint] = [
        at.Pin("one.start"),
        at.Pin("one.end", "two.end"),
        at.Weld("two.start", "three.start"),
        at.Pin("three.end", "four.end"),
        at.Clamp("four.start"),
    ]
    loads: list[Load] = [at.Torque("three.end", 0.02), at.Force("two.start", (0.4, -0.7))]
    return _scene("small-held-chain", bodies, joints, loads, GRAVITY)


def standing() -> at.Scene:
    """The mixed row, held where it would fall."""
    row = mixed_row()
    loads: list[Load] = [
        at.Torque("two.end", 0.01),
        at.Force("four.end", (0.2, -0.3)),
        at.Torque("beside.end", 0.005),
    ]
    joints = [at.Clamp("one.start"), *row.joints[1:], at.Clamp("four.end"), at.Clamp("beside.start")]
    bodies = [replace(b, velocity=None) for b in row.beams]
    return _scene("small-standing", bodies, joints, loads, (1.5, -2.5))


def stick(
    name: str = "small-stick",
    force: Point = (0.02, 0.06),
    torque: float = 0.004,
    gravity: Point = (0.5, -0.8),
) -> at.Scene:
    """A clamped body under a force and a torque at its end."""
    loads: list[Load] = [at.Force("stick.end", force), at.Torque("stick.end", torque)]
    return _scene(name, [body("stick", A, (0.4, 0.3))], [at.Clamp("stick.start")], loads, gravity)


def long_stick() -> at.Scene:
    """A clamped body of more nodes than the kernels take at once."""
    return stick("small-long-stick", (0.01, 0.03), 0.002, (0.3, -0.4))


def angled_still() -> at.Scene:
    """The angled row under a load that it can bear."""
    row = angled_row()
    loads: list[Load] = [at.Force("one.start", (0.01, 0.02)), at.Torque("three.start", 0.003)]
    return _scene("small-angled-still", row.beams, row.joints, loads, (0.6, -0.9))


def column() -> at.Scene:
    """A clamped column under one and a half times Euler's load, with a small force to the side."""
    return stick("small-column", (-0.03164, -0.02363), 0.0, (0.0, 0.0))


def rolled() -> at.Scene:
    """A torque in whose first steps Newton's iteration hardly converges: with a new matrix at each correction."""
    return stick("small-rolled", (0.0, 0.0), 0.12, (0.0, 0.0))


def wound() -> at.Scene:
    """A torque that winds a body up further than a coarse mesh can follow."""
    return stick("small-wound", (0.0, 0.0), 0.3, (0.0, 0.0))


def pulled() -> at.Scene:
    """A force that no beam can bear."""
    return stick("small-pulled", (2e7, 0.0), 0.0, (0.0, 0.0))


def pushed() -> at.Scene:
    """A force that turns elements inside out."""
    return stick("small-pushed", (-20.0, 15.0), 0.0, (0.0, 0.0))


def crushed() -> at.Scene:
    """A force along the axis that turns shear elements inside out."""
    return stick("small-crushed", (-40.0, -30.0), 0.0, (0.0, 0.0))


def bare() -> at.Scene:
    """A free body: on one element its highest frequency is the element's own."""
    return _scene("small-bare", [body("bare", A, C, FIRM, BLOCK)], gravity=GRAVITY)


def bare_damped() -> at.Scene:
    """The same with damping, beside a body that vibrates ten times slower: a place for elements of the other kind."""
    bare, slow = replace(FIRM, damping=2e-4), replace(FIRM, E=3e3)
    return _scene(
        "small-bare-damped",
        [body("bare", A, C, bare, BLOCK), body("beside", A, C, slow, BLOCK)],
        gravity=GRAVITY,
    )


#: Elements of both kinds: the kernels that take them both with damping are compiled for another scene anyhow.
BARE_CABLE = {"bare": "cable", "beside": "shear"}
BARE_SHEAR = {"bare": "shear", "beside": "cable"}


def pulse() -> at.Scene:
    """A stick that rests until a force pushes it, while its clamp swings and returns."""
    beam = body("stick", A, (0.4, 0.3), PLAIN)
    push = at.Pulse(0.4, 0.04)
    drive = at.Quintic(0.3, 0.08)
    return _scene(
        "small-pulse",
        [beam],
        [at.Clamp("stick.start", drive)],
        [at.Torque("stick.end", push), at.Force("stick.end", Ramp((0.0, 0.0), (3.0, 20.0)))],
    )


def spun() -> at.Scene:
    """A stiff bar that turns fast about a pin: implicit steps that are too long for it make energy."""
    steel = at.Material(E=2e11, density=7800.0)
    bar = moving(body("bar", A, (0.8, 0.6), steel), speed=50.0, centre=A)
    return _scene("small-spun", [bar], [at.Pin("bar.start")])


def locked() -> at.Scene:
    """A rigid crank that is driven where the rigid coupler, pinned to the ground, cannot follow."""
    bodies = [body("crank", A, (0.3, 0.0)), body("coupler", (0.3, 0.0), (0.9, 0.3), FIRM, ROD)]
    joints: list[Joint] = [
        at.Clamp("crank.start", at.Quintic(2.0, 0.05)),
        at.Pin("crank.end", "coupler.start"),
        at.Pin("coupler.end"),
    ]
    return _scene("small-locked", bodies, joints)


def tree() -> at.Scene:
    """Three bodies in one hinge, one of them driven at its other end, one with a body welded at an angle."""
    E, F = (0.6, -0.3), (0.9, 0.7)
    bodies = [
        body("trunk", A, B),
        body("left", C, B, FIRM, ROD),
        body("right", B, E, PLAIN, BLOCK),
        body("twig", C, F),
    ]
    joints: list[Joint] = [
        at.Clamp("trunk.start", at.Quintic(0.7, 0.05)),
        at.Pin("trunk.end", "left.end", "right.start"),
        at.Weld("left.start", "twig.start"),
    ]
    loads: list[Load] = [at.Torque("right.end", 0.02), at.Force("twig.end", Ramp((0.1, -0.3), (10.0, 90.0)))]
    return _scene("small-tree", bodies, joints, loads, GRAVITY)


def loop() -> at.Scene:
    """A triangle of bodies that swings about one corner; another corner is welded at its angle."""
    bodies = [body("one", A, B), body("two", C, B, FIRM, ROD), body("three", C, A, PLAIN, BLOCK)]
    joints: list[Joint] = [
        at.Pin("one.start", "three.end", grounded=True),
        at.Pin("one.end", "two.end"),
        at.Weld("two.start", "three.start"),
    ]
    loads: list[Load] = [at.Torque("two.end", 0.02), at.Force("three.start", (0.3, -0.4))]
    return _scene("small-loop", bodies, joints, loads, GRAVITY)


def freed() -> at.Scene:
    """Two bodies welded at an angle on a driven clamp that leaves the stretch free, with a third one on a fixed one."""
    bodies = [body("one", B, A), body("two", C, B, PLAIN, BLOCK), body("three", D, C, FIRM, ROD)]
    joints: list[Joint] = [
        at.Clamp("one.start", at.Quintic(0.6, 0.04), "free"),
        at.Weld("one.start", "two.end"),
        at.Clamp("three.start", stretch="free"),
        at.Pin("three.end", "two.start"),
    ]
    loads: list[Load] = [at.Torque("one.end", 0.01), at.Force("two.start", Ramp((0.1, -0.3), (10.0, 90.0)))]
    return _scene("small-freed", bodies, joints, loads, GRAVITY)
