"""Mechanisms: rigid bodies with offset centres, loops, branches, and the paper's four-bar."""

from math import pi, sqrt
from typing import Any

import numpy as np

import anctmm as at
from tests.golden.answers import Answer, Answers, group
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
    Parabola,
    Ramp,
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

METHODS = {"zhai": ZHAI, "generalized-alpha": ALPHA, "esdirk": ESDIRK}


def four_bar() -> at.Scene:
    """The paper's four-bar (Rong 2014, Table 1), whose crank turns once in 2 s."""
    places = (0.0, 0.0), (0.2, 0.0), (0.2 + 0.45 * sqrt(3.0), 0.45), (0.2 + 0.3 * sqrt(3.0), 0.0)
    data = ("crank", 0.04, 0.6811, 1e9), ("coupler", 0.05, 2.474, 5e6), ("follower", 0.03, 1.470, 5e8)
    bodies = []
    for (name, diameter, mass, E), start, end in zip(data, places, places[1:], strict=False):
        section = at.Circle(diameter)
        density = mass / (section.area * at.distance(start, end))
        bodies.append(at.Beam(name, start, end, section, at.Material(E=E, density=density)))
    joints = (
        at.Clamp("crank.start", angle=at.Quintic(2.0 * pi, 2.0)),
        at.Pin("crank.end", "coupler.start"),
        at.Pin("coupler.end", "follower.start"),
        at.Pin("follower.end"),
    )
    return at.Scene("four-bar", bodies, joints)


@group(
    name="four-bar, explicit shear", element="shear", integrator="zhai", dt=1e-5, t_end=0.1, output_dt=0.05
)
@group(name="four-bar, explicit", integrator="zhai", dt=4e-5, t_end=0.2, output_dt=0.1)
@group(name="four-bar, generalized-alpha", dt=5e-3, t_end=0.6, output_dt=0.1)
@group(name="four-bar, esdirk", integrator="esdirk", dt=1e-2, t_end=0.6, output_dt=0.1)
def paper(v: Variation, **options: Any) -> Answers:
    """Motion, work of the drive, and forces of the four-bar."""
    made = four_bar()
    s = v.solve(made, mesh={"crank": 2, "coupler": 4, "follower": 3}, **options)
    found = motion_of(s, "coupler.end", ("coupler", 0.5), angles=["follower.end"]) | work_of(s)
    return found | reaction_of(s, *made.joints) | section_of(s, ("coupler", 0.5))


def in_all(
    v: Variation, made: at.Scene, places: Any, turns: Any = (), mesh: Any = 2, **options: Any
) -> Answers:
    """Motion, work and reactions of a scene by every method."""
    found: Answers = {}
    for kind, steps in METHODS.items():
        s = v.solve(made, mesh=mesh, **steps, **options)
        answers = motion_of(s, *places, angles=turns) | work_of(s)
        if kind == "zhai":
            answers |= reaction_of(s, *made.joints)
        found |= under(kind, answers)
    return found


@group
def rigid_four_bar(v: Variation) -> Answers:
    """A loop of three rigid bodies with offset centres, a moment and a weight."""
    bodies = [
        at.RigidBody("crank", 0.2, 1e-3, (0.06, 0.09), {"o": (0.0, 0.0), "p": (0.1, 0.2)}),
        at.RigidBody(
            "coupler", 0.5, 8e-3, (0.35, 0.36), {"p": (0.1, 0.2), "q": (0.6, 0.4), "tip": (0.4, 0.6)}
        ),
        at.RigidBody("rocker", 0.3, 4e-3, (0.58, 0.22), {"q": (0.6, 0.4), "o": (0.5, 0.0)}),
    ]
    joints = [
        at.Pin("crank.o"),
        at.Pin("crank.p", "coupler.p"),
        at.Pin("coupler.q", "rocker.q"),
        at.Pin("rocker.o"),
    ]
    made = scene("rigid four-bar", bodies, joints, [at.Torque("crank.o", -0.7)])
    return in_all(v, made, ["coupler.tip", "rocker.q"], ["crank"], mesh=None)


@group
def slider_crank(v: Variation) -> Answers:
    """A driven rigid crank, an elastic rod and a piston on a slider with a spring."""
    rod = beam("rod", (0.1, 0.0), (0.4, 0.0), at.Material(E=5e6, density=1100.0), ROD)
    bodies = [beam("crank", A, (0.1, 0.0)), rod, at.PointMass("piston", 0.2, (0.4, 0.0))]
    joints = [
        at.Clamp("crank.start", at.Quintic(1.5, 0.08)),
        at.Pin("crank.end", "rod.start"),
        at.Pin("piston.center", "rod.end"),
        at.Slider("piston.center", (1.0, 0.0)),
    ]
    stay = at.Spring("piston.center", (0.6, 0.0), stiffness=40.0, damping=0.2)
    made = scene("slider-crank", bodies, joints, connectors=[stay])
    mesh, element = {"crank": 1, "rod": 2}, {"crank": "rigid", "rod": "cable"}
    return in_all(v, made, ["piston.center", ("rod", 0.5)], ["rod.start"], mesh=mesh, element=element)


@group
def rigid_bars(v: Variation) -> Answers:
    """Bars of element "rigid": a driven one, one welded to a cable, one that flies; joints at a fraction."""
    crank, bar, strip = (
        beam("crank", A, B),
        beam("bar", C, B, FIRM, ROD),
        beam("strip", C, (1.1, 0.3), PLAIN, BLOCK),
    )
    beside = turning(beam("beside", (0.0, 1.0), (0.5, 1.2), PLAIN), (0.3, 0.9), 5.0, (1.0, -2.0))
    joints = [
        at.Clamp("crank.start", at.Quintic(1.2, 0.06)),
        at.Pin("crank.end", "bar.end"),
        at.Weld("bar.start", "strip.start"),
        at.Pin("strip.end", ("tail", 0.3)),
    ]
    tail = beam("tail", (1.1 - 0.3 * 0.4, 0.3 - 0.3 * 0.2), (1.1 + 0.7 * 0.4, 0.3 + 0.7 * 0.2), FIRM)
    bodies = [crank, bar, strip, tail, beside]
    loads = [at.Torque("bar.start", 0.03), at.Force("tail.end", Ramp((0.5, -0.3), (30.0, 300.0)))]
    rigid = {b.name: "rigid" for b in bodies} | {"strip": "cable"}
    mesh = {b.name: 1 for b in bodies} | {"strip": 2}
    made = scene("rigid bars", bodies, joints, loads)
    return in_all(v, made, ["bar.start", "tail.end", ("beside", 0.3)], ["tail.end"], mesh=mesh, element=rigid)


@group
def tree(v: Variation) -> Answers:
    """Three beams in one hinge, one of them driven at its other end, one with a beam welded at an angle."""
    bodies = [beam("trunk", A, B), beam("left", C, B, FIRM, ROD), beam("right", B, (0.6, -0.3), PLAIN),
              beam("twig", C, (0.9, 0.7))]  # fmt: skip
    joints = [
        at.Clamp("trunk.start", at.Quintic(0.7, 0.05)),
        at.Pin("trunk.end", "left.end", "right.start"),
        at.Weld("left.start", "twig.start"),
    ]
    return in_all(v, scene("tree", bodies, joints), ["right.end", "twig.end"], ["twig.end"])


@group
def loop(v: Variation) -> Answers:
    """A triangle of beams that swings about one corner; another corner is welded at its angle."""
    bodies = [beam("one", A, B), beam("two", C, B, FIRM, ROD), beam("three", C, A, PLAIN, BLOCK)]
    joints = [
        at.Pin("one.start", "three.end", grounded=True),
        at.Pin("one.end", "two.end"),
        at.Weld("two.start", "three.start"),
    ]
    return in_all(v, scene("loop", bodies, joints), ["one.end", "two.start"], ["three.start"])


@group
def ladder(v: Variation) -> Answers:
    """Two clamped posts with rungs welded between them, and with hinged ones."""
    found: Answers = {}
    for kind, joint in (("welded", at.Weld), ("hinged", at.Pin)):
        posts = [
            beam(f"{s}{k}", (x, 0.2 * k), (x, 0.2 * k + 0.2))
            for s, x in (("l", 0.0), ("r", 0.3))
            for k in range(3)
        ]
        rungs = [beam(f"rung{k}", (0.0, 0.2 * k + 0.2), (0.3, 0.2 * k + 0.2), FIRM) for k in range(3)]
        joints: list[Any] = [at.Clamp("l0.start"), at.Clamp("r0.start")]
        for side, end in (("l", "start"), ("r", "end")):
            for k in range(3):
                on = [f"{side}{k + 1}.start"] if k < 2 else []
                joints += [at.Weld(f"{side}{k}.end", *on)] if on else []
                joints.append(joint(f"{side}{k}.end", f"rung{k}.{end}"))
        s = v.solve(scene("ladder", [*posts, *rungs], joints), mesh=1, **ALPHA)
        found |= under(kind, motion_of(s, "l2.end", ("rung1", 0.5)))
    return found


@group
def half_car(v: Variation) -> Answers:
    """A body on two damped springs, whose free lengths vary, guided upright."""
    points = {"front": (1.2, 0.4), "rear": (-1.5, 0.4)}
    car = at.RigidBody("car", 700.0, 1100.0, (0.0, 0.6), points)
    springs = [
        at.Spring("car.front", (1.2, 0.0), stiffness=25e3, damping=1500.0,
                  length=Parabola(0.5, -4.0, 0.4, short=True)),
        at.Spring("car.rear", (-1.5, 0.0), stiffness=20e3, damping=1200.0),
    ]  # fmt: skip
    made = at.Scene("half-car", [car], [at.Slider("car.center", (0.0, 1.0))], connectors=springs)
    return in_all(v, made, ["car.front", "car.rear"], ["car"], mesh=None)


@group
def released(v: Variation) -> Answers:
    """Motions from an equilibrium: nothing moves under the same loads, and what moves when one is let go."""
    bodies, joints = [beam("one", A, B), at.PointMass("ball", 0.02, (0.8, 0.1))], [at.Clamp("one.start")]
    hang = at.Spring("one.end", "ball.center", stiffness=15.0)
    loaded, free = (
        scene("released", bodies, joints, loads, [hang], (0.6, -1.4))
        for loads in ([at.Force("ball.center", (0.1, 0.03))], [])
    )
    rest = v.static(loaded, mesh=2)
    still = v.solve(loaded, start=rest, mesh=2, **ALPHA)
    moving = v.solve(free, start=rest, mesh=2, **ALPHA)
    found = under("still", {"displacement": Answer(still.displacement("ball.center"), 1.0)})
    return found | under("let go", motion_of(moving, "one.end", "ball.center"))


@group
def consistent_start(v: Variation) -> Answers:
    """Velocities of a linkage whose crank is driven from the start, found and then followed."""
    bodies = [
        at.RigidBody("crank", 0.2, 1e-3, (0.06, 0.09), {"o": A, "p": (0.1, 0.2)}),
        at.RigidBody("coupler", 0.5, 8e-3, (0.35, 0.36), {"p": (0.1, 0.2), "q": (0.6, 0.4)}),
        at.RigidBody("rocker", 0.3, 4e-3, (0.58, 0.22), {"q": (0.6, 0.4), "o": (0.5, 0.0)}),
        at.RigidBody("hanging", 0.1, 2e-3, (0.7, 0.3), {"q": (0.6, 0.4)}),
    ]
    joints = [
        at.Clamp("crank.o", angle=Parabola(3.0, 5.0)),
        at.Pin("crank.p", "coupler.p"),
        at.Pin("coupler.q", "rocker.q", "hanging.q"),
        at.Pin("rocker.o"),
    ]
    parts: dict[str, Any] = {"name": "driven", "bodies": bodies, "joints": joints, "gravity": (0.0, -9.81)}
    made = at.consistent_velocities(**parts)
    first: list[Any] = [made.body(b.name) for b in bodies]
    s = v.solve(made, **ALPHA)
    velocity = np.array([(*b.velocity, b.spin) for b in first])
    return {"velocity at the start": velocity} | motion_of(
        s, "rocker.q", "hanging.center", angles=["coupler"]
    )


@group
def n_four_bar(v: Variation) -> Answers:
    """Four loops of rigid bars whose uprights turn: all move as one, and the energy is that of the start."""
    uprights = [
        at.RigidBody(f"p{i}", 1.0, 1 / 12, (i, 0.5), {"a": (i, 0.0), "b": (i, 1.0)}, (-0.5, 0.0), 1.0)
        for i in range(5)
    ]
    levels = [
        at.RigidBody(f"g{i}", 1.0, 1 / 12, (i + 0.5, 1.0), {"a": (i, 1.0), "b": (i + 1, 1.0)}, (-1.0, 0.0))
        for i in range(4)
    ]
    joints = [at.Pin(f"p{i}.a") for i in range(5)]
    joints += [
        at.Pin(f"p{i}.b", *[f"g{k}.{'ba'[k == i]}" for k in (i - 1, i) if 0 <= k < 4]) for i in range(5)
    ]
    made = at.Scene("n-four-bar", [*uprights, *levels], joints, gravity=(0.0, -9.81))
    found: Answers = {}
    for kind, options in (("generalized-alpha", {"spectral_radius": 0.8}), ("zhai", {"integrator": "zhai"})):
        s = v.solve(made, dt=2e-3, t_end=0.4, output_dt=0.1, **options)
        balance = Answer(s.energy.balance, 100.0)
        found |= under(kind, motion_of(s, "p0.b", "g3.center", angles=["p4"]) | {"balance": balance})
    return found
