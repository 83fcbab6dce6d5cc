"""Scenes of the tests of the reference solvers: one with everything, and random ones that follow from a seed."""

from itertools import pairwise

import numpy as np

import anctmm as at

ROD, RUBBER = at.Circle(0.02), at.Material(E=5e6, density=1100.0)
DAMPED = at.Material(E=5e6, density=1100.0, poisson=0.2, damping=2e-3)
DOWN = (0.0, -9.81)


def law(elongation, rate, t):
    """A spring that grows stiff, with friction like a liquid's and a motor that swings."""
    return 30.0 * elongation + 8.0 * elongation**3 + 0.7 * rate * abs(rate) + 0.3 * np.sin(5.0 * t)


def length(t):
    """A driven length, m."""
    return 0.6 + 0.1 * np.sin(3.0 * t), 0.3 * np.cos(3.0 * t)


def swing(t):
    """A drive that starts at rest."""
    return 0.3 * np.sin(2.0 * t) ** 2, 0.6 * np.sin(4.0 * t), 2.4 * np.cos(4.0 * t)


def bar(joints=(), loads=(), **options):
    """One beam."""
    velocity = options.pop("velocity", None)
    material = options.pop("material", RUBBER)
    return at.Scene(
        "bar", [at.Beam("bar", (0, 0), (0.6, 0.8), ROD, material, velocity)], joints, loads, **options
    )


def everything(**options):
    """All bodies, joints, connectors and loads at once."""
    bodies = [
        at.Beam("one", (0, 0), (0.5, 0.1), ROD, DAMPED),
        at.Beam("two", (0.5, 0.1), (0.9, 0.0), ROD, RUBBER),
        at.RigidBody("plate", 0.2, 1e-3, (1.0, 0.15), {"a": (0.9, 0.0), "b": (1.2, 0.1)}),
        at.RigidBody("rider", 0.1, 5e-4, (1.25, 0.2), {"in": (1.2, 0.1)}),
        at.RigidBody("block", 0.3, 2e-3, (-0.3, 0.0), {"c": (-0.2, 0.1)}),
        at.PointMass("ball", 0.05, (0.4, -0.4)),
        at.PointMass("bead", 0.05, (1.0, 0.4)),
    ]
    joints = [
        at.Clamp("one.start", angle=swing),
        at.Weld("one.end", "two.start", angle=swing),
        at.Weld("two.end", "plate.a"),
        at.Prismatic("rider.in", (1.0, 0.5), body="plate"),
        at.Slider("block.c", (0.0, 1.0), position=swing),
        at.Slider("bead.center", (0.0, 2.0), body="plate"),
    ]
    connectors = [
        at.Spring("ball.center", (0.1, -0.9), stiffness=20.0, damping=0.05, length=0.5),
        at.Spring("ball.center", ("one", 0.37), stiffness=5.0, damping=0.1, length=length, preload=0.2),
        at.Spring("plate.b", "block.center", law=law),
        at.RotationalSpring("plate.a", "rider.in", stiffness=0.4, damping=2e-3, angle=0.1),
        at.RotationalSpring(("two", 0.6), stiffness=0.1, preload=0.02, angle=lambda t: (0.2 * t, 0.2)),
        at.RotationalSpring("block.center", damping=1e-3),
        at.Spring("rider.center", "bead.center", stiffness=4.0),
    ]
    loads = [
        at.Force(("one", 0.3), (0.1, -0.2)),
        at.Force("plate.b", (0.2, 0.1), follower=True),
        at.Force(("two", 0.55), lambda t: (0.1 * t, 0.2), follower=True),
        at.Force("ball.center", lambda t: (np.sin(t), 0.0)),
        at.Torque("rider.in", 0.01),
        at.Torque(("two", 0.25), lambda t: 0.01 * t),
        at.LineLoad("one", (0.3, -0.4)),
        at.LineLoad("two", lambda t: (0.1, t)),
    ]
    given = {"joints": joints, "loads": loads, "gravity": (0.5, -9.0), "connectors": connectors}
    return at.Scene("everything", bodies, **(given | options))


def on_a_plate():
    """A beam, a plate hinged to it, and a mass that springs hold."""
    bodies = [
        at.Beam("a", (0.0, 0.0), (1.0, 0.0), ROD, RUBBER),
        at.RigidBody("plate", 0.5, 3e-3, center=(1.1, 0.1), points={"p": (1.0, 0.0), "q": (1.2, 0.2)}),
        at.PointMass("load", 0.2, position=(1.5, 0.5)),
    ]
    loads = [
        at.Force("plate.q", (0.1, 0.3), follower=True),
        at.Torque("plate.center", 0.01),
        at.Force("load.center", lambda t: (0.0, 0.1 * t)),
        at.Torque(("a", 0.3), 0.02),
        at.Force(("a", 0.7), (0.0, -0.2), follower=True),
        at.LineLoad("a", (0.0, 0.3)),
    ]
    connectors = [
        at.Spring("plate.q", "load.center", stiffness=30.0, damping=0.05),
        at.Spring("load.center", (1.5, 1.5), stiffness=20.0, length=length, preload=0.3),
        at.RotationalSpring("a.end", "plate.p", stiffness=0.3, damping=1e-3, angle=lambda t: (0.2 * t, 0.2)),
        at.RotationalSpring("plate.center", stiffness=0.2, preload=0.1),
        at.Spring(("a", 0.4), "plate.q", stiffness=10.0),
    ]
    joints = [at.Clamp("a.start"), at.Pin("a.end", "plate.p")]
    return at.Scene("on a plate", bodies, joints, loads, (0.0, -1.0), connectors=connectors)


def parallelogram(cranks):
    """A coupler on equal cranks: of three, one holds nothing that the others do not; it turns at once."""
    bars = [
        at.RigidBody(c, 1.0, 0.1, (k, 0.5), {"o": (k, 0.0), "p": (k, 1.0)}, (-0.5, 0.0), 1.0)
        for k, c in enumerate("xyz"[:cranks])
    ]
    points = {c: (float(k), 1.0) for k, c in enumerate("xyz")}
    coupler = at.RigidBody("q", 3.0, 1.0, (1.0, 1.0), points, (-1.0, 0.0))
    joints = [*(at.Pin(f"{b.name}.o") for b in bars), *(at.Pin(f"{b.name}.p", f"q.{b.name}") for b in bars)]
    return at.Scene("parallelogram", [*bars, coupler], joints, gravity=(2.0, -9.81))


def random_beams(seed, inside=True):
    """Beams in a tree: pins, welds, a clamp that may turn, a support `inside`, and loads of all kinds but followers."""
    rng = np.random.default_rng(seed)
    points, bodies, ends = [np.zeros(2)], [], [[]]
    for number in range(int(rng.integers(2, 6))):
        first = int(rng.integers(len(points)))
        angle = rng.uniform(-np.pi, np.pi)
        points.append(points[first] + rng.uniform(0.2, 0.5) * np.array([np.cos(angle), np.sin(angle)]))
        ends.append([])
        material = (RUBBER, at.Material(E=5e6, density=1100.0, damping=1e-4))[int(rng.integers(2))]
        bodies.append(at.Beam(f"b{number}", tuple(points[first]), tuple(points[-1]), ROD, material))
        ends[first].append(f"b{number}.start")
        ends[-1].append(f"b{number}.end")
    joints = [at.Clamp(ends[0][0], angle=swing if rng.random() < 0.5 else None)]
    for place in ends:
        for pair in pairwise(place):
            joints.append(at.Weld(*pair) if rng.random() < 0.4 else at.Pin(*pair))
    if rng.random() < 0.5 and inside:
        joints.append(at.Pin((f"b{len(bodies) - 1}", float(rng.uniform(0.2, 0.8)))))
    last = bodies[-1].name
    loads = [
        at.Torque(f"{last}.end", lambda t: 0.01 * np.sin(9.0 * t)),
        at.Force((last, 0.3), lambda t: (0.2 * t, 0.1)),
        at.LineLoad("b0", (0.2, 0.1)),
        at.Force("b0.end", (0.1, 0.2)),
    ]
    chosen = [load for load in loads if rng.random() < 0.6]
    element = {body.name: "cable" for body in bodies}
    if rng.random() < 0.5:
        element = dict.fromkeys(element, "shear")
    return at.Scene(f"random {seed}", bodies, joints, chosen, (1.0, -9.81)), element
