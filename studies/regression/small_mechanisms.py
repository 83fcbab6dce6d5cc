"""Small scenes of mechanisms: rigid bodies, masses, guides, driven hinges, connectors and the loads that need them.

As in `small_scenes`, each place has another value, and all that a feature may have is set.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, sin

import anctmm as at
from anctmm.model.bodies import Body
from anctmm.model.scene import Connector, Joint, Load, Point
from studies.regression.small_scenes import BLOCK, FIRM, GRAVITY, PLAIN, ROD, A, B, C, Ramp, Spin, body

D, E, F = (0.62, 0.05), (0.55, 0.3), (0.95, 0.2)


@dataclass(frozen=True)
class Drawn:
    """A free length or angle that changes, and its rate."""

    first: float
    rate: float
    growth: float

    def __call__(self, t: float) -> tuple[float, float]:
        """Value and rate at a time (s)."""
        return self.first + self.rate * t + self.growth * t * t, self.rate + 2.0 * self.growth * t


def stiffening(elongation: float, rate: float, t: float) -> float:
    """Tension of a spring that stiffens, with a damper and a force that is there from the start and grows, N."""
    return 12.0 * elongation + 90.0 * elongation**3 + 0.4 * rate + 2.0 * t + 0.2


def motor(error: float, rate: float, t: float) -> float:
    """Moment of a feedback that is switched on slowly, N m."""
    return (0.3 + 4.0 * t) * error + 0.004 * rate


def _mechanism(
    name: str,
    bodies: Sequence[Body],
    joints: Sequence[Joint],
    loads: Sequence[Load],
    gravity: Point,
    connectors: Sequence[Connector],
) -> at.Scene:
    return at.Scene(name, tuple(bodies), tuple(joints), tuple(loads), gravity, tuple(connectors))


def linkage() -> at.Scene:
    """Two beams, a plate between them and a ball on springs: connectors and loads of every kind."""
    plate = at.RigidBody("plate", 0.06, 3e-4, (0.5, 0.18), {"a": B, "b": D, "c": E})
    ball = at.PointMass("ball", 0.03, F, (0.3, -0.2))
    beside = at.RigidBody("beside", 0.05, 2e-4, (0.2, 0.8), {"a": (0.3, 0.9)}, (0.4, 0.7), 6.0)
    bodies: list[Body] = [body("one", A, B), plate, body("two", (0.9, -0.1), D, FIRM, ROD), ball, beside]
    joints: list[Joint] = [at.Clamp("one.start"), at.Pin("one.end", "plate.a"), at.Pin("plate.b", "two.end")]
    connectors: list[Connector] = [
        at.Spring("plate.c", "ball.center", stiffness=30.0, damping=0.2, preload=0.15),
        at.Spring("ball.center", (1.2, 0.8), stiffness=25.0, damping=0.1, length=Drawn(0.6, 0.8, -3.0)),
        at.Spring(("one", 0.3), "two.start", law=stiffening),
        at.RotationalSpring("one.end", "plate.a", stiffness=0.3, damping=2e-3, angle=Drawn(0.1, 2.0, 9.0)),
        at.RotationalSpring("two.start", law=motor),
        at.RotationalSpring(("two", 0.4), "plate.b", stiffness=0.1, preload=0.02),
    ]
    loads: list[Load] = [
        at.Force("plate.c", (0.4, -0.3), follower=True),
        at.Force(("one", 0.7), Ramp((0.2, 0.3), (15.0, 90.0)), follower=True),
        at.Torque(("one", 0.35), 0.012),
        at.Force(("two", 0.6), (0.1, 0.25)),
        at.Force("ball.center", Ramp((0.1, 0.0), (3.0, -60.0))),
        at.LineLoad("one", (0.5, -0.4)),
        at.LineLoad("two", Ramp((0.0, 0.3), (9.0, 70.0))),
        at.Torque("plate.center", -0.02),
    ]
    return _mechanism("small-linkage", bodies, joints, loads, GRAVITY, connectors)


def guided() -> at.Scene:
    """A plate on a driven guide, with slots for a beam that does not turn and for a ball; driven hinges; a branch."""
    base = at.RigidBody("base", 0.08, 5e-4, (-0.05, 0.06), {"p": (-0.15, 0.0), "q": (0.05, 0.2)})
    tool = at.RigidBody("tool", 0.02, 4e-5, (0.75, 0.45), {"a": C, "b": (0.8, 0.4)})
    side = body("side", (1.0, 0.8), (1.3, 0.6), PLAIN)
    twig = body("twig", (1.15, 0.7), (1.3, 0.9), FIRM, ROD)
    bodies: list[Body] = [
        base,
        side,
        twig,
        body("one", A, B),
        body("two", B, C, FIRM, ROD),
        tool,
        at.PointMass("ball", 0.04, (0.1, 0.1)),
    ]
    joints: list[Joint] = [
        at.Slider("base.p", (2.0, 1.0), position=at.Quintic(0.04, 0.05)),
        at.Prismatic("one.start", (1.0, 2.0), "base"),
        at.Prismatic("side.start", (1.0, -3.0), position=at.Quintic(0.05, 0.05)),
        at.Weld(("side", 0.5), "twig.start"),
        at.Weld("one.end", "two.start", angle=at.Quintic(0.5, 0.06)),
        at.Weld("two.end", "tool.a", angle=at.Quintic(-0.8, 0.04)),
        at.Slider("ball.center", (-1.0, 3.0), "base", position=at.Quintic(0.03, 0.045)),
    ]
    connectors: list[Connector] = [
        at.Spring("one.start", "base.q", stiffness=60.0),
        at.RotationalSpring("base.center", stiffness=0.4, damping=1e-3),
    ]
    return _mechanism("small-guided", bodies, joints, [at.Force("tool.b", (0.2, -0.1))], GRAVITY, connectors)


def stretched() -> at.Scene:
    """A driven clamp, a weld at an angle and a driven weld that leave the stretch free, and loads along the beams."""
    bodies: list[Body] = [
        body("one", A, B),
        body("two", B, C, FIRM, ROD),
        body("side", B, (0.8, -0.1), PLAIN),
    ]
    joints: list[Joint] = [
        at.Clamp("one.start", angle=at.Quintic(0.3, 0.05), stretch="free"),
        at.Weld("one.end", "side.start", stretch="free"),
        at.Weld("one.end", "two.start", angle=at.Quintic(-0.4, 0.06), stretch="free"),
    ]
    return _mechanism("small-stretched", bodies, joints, [at.Force("two.end", (6.0, 3.0))], GRAVITY, [])


def held() -> at.Scene:
    """The linkage with weaker loads: what it rests under, before those of time move it."""
    scene = linkage()
    bodies: list[Body] = [b for b in scene.bodies if b.name not in ("ball", "beside")]
    loads = [x for x in scene.loads if not getattr(x, "follower", False)]
    hold = at.RotationalSpring("two.end", stiffness=0.8)
    still = [
        replace(c, length=0.6) if isinstance(c, at.Spring) and callable(c.length) else c
        for c in scene.connectors
    ]
    return _mechanism(
        "small-held",
        [*bodies, at.PointMass("ball", 0.03, F)],
        scene.joints,
        loads,
        (0.7, -1.1),
        [*still, hold],
    )


def slack() -> at.Scene:
    """A weight that hangs from a clamped beam by a spring which lies level at first."""
    bodies: list[Body] = [body("one", A, B), at.PointMass("ball", 0.02, (0.8, 0.1))]
    hang = at.Spring("one.end", "ball.center", stiffness=15.0)
    return _mechanism("small-slack", bodies, [at.Clamp("one.start")], [], (0.6, -1.4), [hang])


def lattice() -> at.Scene:
    """Masses, a plate and a beam, with so many springs between them that their places are kept."""
    masses = [
        at.PointMass(
            f"m{k}", 0.02 + 0.003 * k, (0.3 * (k % 3) + 0.02 * k, 0.25 * (k // 3)), (0.1 * k, -0.2 * k)
        )
        for k in range(5)
    ]
    plate = at.RigidBody("plate", 0.06, 3e-4, (0.9, 0.3), {"a": (0.8, 0.25), "b": (0.95, 0.42)})
    pairs = [("m0", "m1"), ("m1", "m2"), ("m3", "m4"), ("m0", "m3"), ("m1", "m4"), ("m1", "m3"), ("m2", "m4")]
    connectors: list[Connector] = [
        *(
            at.Spring(
                f"{one}.center", f"{two}.center", stiffness=20.0 + 3.0 * k, damping=0.02 * k, preload=0.1
            )
            for k, (one, two) in enumerate(pairs)
        ),
        at.Spring("m4.center", "plate.a", stiffness=25.0, length=Drawn(0.1, 0.8, -3.0)),
        at.Spring("m2.center", "one.end", stiffness=35.0, damping=0.1),
        at.Spring("plate.b", "one.end", law=stiffening),
        at.RotationalSpring("one.end", "plate.a", stiffness=0.3, damping=2e-3, angle=0.1),
    ]
    joints: list[Joint] = [at.Clamp("one.start"), at.Pin("m0.center"), at.Slider("m3.center", (1.0, -2.0))]
    bodies: list[Body] = [*masses, plate, body("one", (1.3, 0.2), (0.95, 0.05))]
    pull = at.Force("one.end", (0.2, 0.4), follower=True)
    return _mechanism("small-lattice", bodies, joints, [pull], GRAVITY, connectors)


def truss() -> at.Scene:
    """Two bars that snap through, and a spring that holds their hinge to one side."""
    bodies: list[Body] = [body("left", (-1.0, 0.0), (0.0, 0.3)), body("right", (0.0, 0.3), (1.0, 0.0), PLAIN)]
    joints: list[Joint] = [at.Pin("left.start"), at.Pin("left.end", "right.start"), at.Pin("right.end")]
    stay = at.Spring("left.end", (0.6, 1.4), stiffness=0.8)
    return _mechanism("small-truss", bodies, joints, [at.Force("left.end", (0.4, -6.0))], (0.0, 0.0), [stay])


def sliding() -> at.Scene:
    """A driven crank, its rod, whose end slides with a weight, and a beam on a prismatic joint; all on the ground."""
    side = body("side", (0.9, 0.6), (1.2, 0.7), PLAIN)
    bodies: list[Body] = [
        body("one", A, B),
        body("two", B, C, FIRM, ROD),
        side,
        at.PointMass("ball", 0.03, C),
    ]
    joints: list[Joint] = [
        at.Clamp("one.start", angle=at.Quintic(0.4, 0.05)),
        at.Pin("one.end", "two.start"),
        at.Pin("two.end", "ball.center"),
        at.Slider("two.end", (3.0, 1.0)),
        at.Prismatic("side.start", (1.0, -2.0)),
    ]
    stay = at.Spring("side.start", (0.8, 0.9), stiffness=40.0, damping=0.1, length=0.2)
    return _mechanism("small-sliding", bodies, joints, [at.Force("side.end", (0.3, 0.2))], GRAVITY, [stay])


def guides() -> at.Scene:
    """Guides inside and at both ends of trees, all on the ground, and a driven clamp where one of the trees ends."""
    bodies: list[Body] = [body("arm", A, B), body("bar", C, E, PLAIN), body("foot", E, F, FIRM, ROD)]
    joints: list[Joint] = [
        at.Slider(("arm", 0.5), (-1.0, 2.0)),
        at.Clamp("arm.end", angle=at.Quintic(0.2, 0.05)),
        at.Slider("bar.start", (2.0, 1.0)),
        at.Pin("bar.end", "foot.start"),
        at.Prismatic("foot.end", (1.0, 3.0)),
    ]
    stay = at.Spring("bar.end", (0.3, 0.9), stiffness=30.0, damping=0.05, length=0.4)
    return _mechanism("small-guides", bodies, joints, [at.Force("arm.start", (0.3, -0.1))], GRAVITY, [stay])


def parallel() -> at.Scene:
    """Three parallel rigid cranks under a coupler, one more than it needs, which go through the line of their feet."""
    feet, (x, y), rate = (0.0, 0.35, 0.8), (0.3 * cos(0.12), 0.3 * sin(0.12)), -8.0
    cranks = [
        at.RigidBody(
            f"crank{k}",
            0.02 + 0.004 * k,
            2e-4,
            (foot + 0.5 * x, 0.5 * y),
            {"foot": (foot, 0.0), "top": (foot + x, y)},
            (-0.5 * rate * y, 0.5 * rate * x),
            rate,
        )
        for k, foot in enumerate(feet)
    ]
    tops = {f"p{k}": (foot + x, y) for k, foot in enumerate(feet)}
    coupler = at.RigidBody("coupler", 0.06, 3e-4, (0.4 + x, 0.05 + y), tops, (-rate * y, rate * x))
    joints: list[Joint] = [at.Pin(f"crank{k}.foot") for k in range(3)]
    joints += [at.Pin(f"crank{k}.top", f"coupler.p{k}") for k in range(3)]
    push = at.Force("coupler.p1", (0.3, -0.2))
    return _mechanism("small-parallel", [*cranks, coupler], joints, [push], GRAVITY, [])


def wheel() -> at.Scene:
    """A disc that turns by more than half a turn against a rotational spring, and a car that a driven beam pushes."""
    disc = at.RigidBody("disc", 0.2, 3e-4, (0.0, 0.0), {"rim": (0.04, 0.03)}, spin=200.0)
    car = at.RigidBody("car", 0.1, 2e-4, (0.4, 0.1), {"a": (0.35, 0.12), "b": (0.45, 0.1)})
    tail, crank = (
        body("tail", (0.45, 0.1), (0.8, 0.2), FIRM, ROD),
        body("crank", (0.2, -0.3), (0.35, 0.12), PLAIN),
    )
    bodies: list[Body] = [disc, car, tail, crank]
    joints: list[Joint] = [
        at.Pin("disc.center"),
        at.Pin("car.b", "tail.start"),
        at.Clamp("crank.start", angle=at.Quintic(0.1, 0.05)),
        at.Pin("crank.end", "car.a"),
        at.Slider("car.center", (4.0, 1.0)),
    ]
    connectors: list[Connector] = [
        at.RotationalSpring("disc.center", stiffness=0.1, damping=5e-4, angle=0.3),
        at.Spring("disc.rim", "car.a", stiffness=80.0),
    ]
    return _mechanism("small-wheel", bodies, joints, [], GRAVITY, connectors)


def driven_plate() -> at.Scene:
    """A rigid plate on a driven clamp that already turns, with a beam on it by a driven weld, and a tip mass."""
    speed = -1.5
    plate = at.RigidBody(
        "plate", 0.07, 4e-4, (0.1, 0.05), {"hub": A, "a": (0.2, 0.1)}, (-0.05 * speed, 0.1 * speed), speed
    )

    def carried(fraction: float) -> Point:
        return -speed * (0.1 + 0.3 * fraction), speed * (0.2 + 0.2 * fraction)

    arm = replace(body("arm", (0.2, 0.1), (0.4, 0.4), FIRM, BLOCK), velocity=carried)
    bodies: list[Body] = [plate, arm, at.PointMass("ball", 0.02, (0.4, 0.4), carried(1.0))]
    joints: list[Joint] = [
        at.Clamp("plate.hub", angle=Spin(speed, 25.0)),
        at.Weld("plate.a", "arm.start", angle=at.Quintic(0.6, 0.05)),
        at.Pin("arm.end", "ball.center"),
    ]
    return _mechanism("small-driven-plate", bodies, joints, [at.Torque("arm.end", 0.01)], GRAVITY, [])


def held_up(stiffness: float) -> at.Scene:
    """A column above Euler's load whose top a spring holds to that of a stiff one, far from it in every order."""
    names = ("column", "between", "post")
    columns = [
        body(name, (0.5 * k, 0.0), (0.5 * k, 0.5), FIRM if k else PLAIN) for k, name in enumerate(names)
    ]
    joints: list[Joint] = [at.Clamp(f"{name}.start") for name in names]
    stay = at.Spring("column.end", "post.end", stiffness=stiffness)
    load = at.Force("column.end", (1e-4, -0.06))
    name = f"small-held-up-{stiffness:g}"
    return _mechanism(name, columns, joints, [load], (0.0, 0.0), [stay])


def blade() -> at.Scene:
    """A clamped beam that turns about its clamp."""
    return _mechanism("small-blade", [body("blade", A, B)], [at.Clamp("blade.start")], [], (0.0, 0.0), [])


def started() -> at.Scene:
    """A rigid crank that already turns drives a rod, whose end slides on a line; a swing hangs from the rod."""
    bar = at.RigidBody("bar", 0.05, 2e-4, (0.5, 0.2), {"a": B, "b": (0.6, 0.3)})
    bodies: list[Body] = [
        body("crank", A, B),
        bar,
        at.PointMass("ball", 0.02, (0.6, 0.3)),
        body("swing", D, C),
    ]
    joints: list[Joint] = [
        at.Clamp("crank.start", angle=Spin(3.0, 4.0)),
        at.Pin("crank.end", "bar.a"),
        at.Pin("bar.b", "ball.center"),
        at.Slider("ball.center", (2.0, -1.0)),
        at.Slider("swing.start", (1.0, 1.0), position=Sliding(0.4)),
    ]
    return at.consistent_velocities(name="small-started", bodies=bodies, joints=joints)


@dataclass(frozen=True)
class Sliding:
    """A position that already changes at t = 0."""

    speed: float

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Position, velocity and acceleration at a time (s)."""
        return self.speed * t, self.speed, 0.0
