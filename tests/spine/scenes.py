"""Scenes with every feature, for the comparison of the new equations with the old ones."""

from collections.abc import Callable
from math import pi

import numpy as np

import anctmm as at

ROD, RUBBER = at.Circle(0.02), at.Material(E=5e6, density=1100.0)
DOWN = (0.0, -9.81)
BEAM = at.Beam("b", (0, 0), (1, 0), ROD, RUBBER)
SCENES: dict[str, Callable[[], at.Scene]] = {}


def scene(build: Callable[[], at.Scene]) -> Callable[[], at.Scene]:
    """Register a scene by the name of its function."""
    SCENES[build.__name__] = build
    return build


@scene
def cantilever() -> at.Scene:
    """A clamped beam."""
    return at.Scene("cantilever", [BEAM], [at.Clamp("b.start")], gravity=DOWN)


@scene
def pendulum() -> at.Scene:
    """A beam on a pin."""
    return at.Scene("pendulum", [BEAM], [at.Pin("b.start")], gravity=DOWN)


@scene
def fork() -> at.Scene:
    """A driven beam that branches into two."""
    trunk = at.Beam("trunk", (0, 0), (0, 0.3), ROD, RUBBER)
    arms = [at.Beam(n, (0, 0.3), (x, 0.5), ROD, RUBBER) for n, x in (("left", -0.2), ("b", 0.2))]
    joints = [
        at.Clamp("trunk.start", angle=at.Quintic(pi / 2, 0.1)),
        at.Weld("trunk.end", "left.start", "b.start"),
    ]
    return at.Scene("fork", [trunk, *arms], joints, gravity=DOWN)


@scene
def rigid_four_bar() -> at.Scene:
    """A closed loop of rigid bodies with offset centres, turned by a torque."""
    bodies = [
        at.RigidBody("crank", 1.0, 0.02, (0, 0.25), {"a": (0, 0), "b": (0, 0.5)}),
        at.RigidBody("b", 2.0, 0.1, (0.5, 0.6), {"b": (0, 0.5), "end": (1, 0.6)}),
        at.RigidBody("rocker", 1.0, 0.02, (1, 0.2), {"c": (1, 0.6), "d": (1, 0)}),
    ]
    joints = [
        at.Pin("crank.a"), at.Pin("crank.b", "b.b"), at.Pin("b.end", "rocker.c"), at.Pin("rocker.d"),
    ]  # fmt: skip
    return at.Scene("four-bar", bodies, joints, [at.Torque("crank.a", 1.0)], gravity=DOWN)


@scene
def springs_and_loads() -> at.Scene:
    """All connectors and loads, at ends and within elements."""
    loads = [
        at.Force("b.end", lambda t: (np.sin(9 * t), 0 * t)),
        at.Force(("b", 0.5), (0.3, 0.1), follower=True),
        at.Torque("b.end", lambda t: 0.01 * np.cos(t)),
        at.LineLoad("b", lambda t: (0 * t, 0.2 * t)),
    ]
    connectors = [
        at.Spring("b.end", "m.center", stiffness=100.0, damping=1.0),
        at.Spring("m.center", (1.3, 0.5), stiffness=50.0, preload=1.0),
        at.Spring(
            ("b", 0.3), (0.3, 0.5), stiffness=30.0,
            length=lambda t: (0.5 + 0.1 * np.sin(5 * t), 0.5 * np.cos(5 * t)),
        ),
        at.RotationalSpring("b.start", stiffness=1.0, damping=0.01),
    ]  # fmt: skip
    bodies = [BEAM, at.PointMass("m", 0.5, (1.2, 0.1))]
    return at.Scene("springs", bodies, [at.Pin("b.start")], loads, DOWN, connectors)


@scene
def damped() -> at.Scene:
    """A damped beam at a driven clamp."""
    beam = at.Beam("b", (0, 0), (1, 0), ROD, at.Material(E=5e6, density=1100.0, damping=1e-3))
    return at.Scene("damped", [beam], [at.Clamp("b.start", angle=at.Quintic(0.5, 0.1))], gravity=DOWN)


@scene
def cart() -> at.Scene:
    """A beam on a cart that is driven along a line."""
    cart = at.RigidBody("cart", 1.0, 0.1, (0, 0), {"p": (0.1, 0)})
    beam = at.Beam("b", (0.1, 0), (0.1, -0.5), ROD, RUBBER)
    drive = at.Prismatic("cart.p", (1, 0), position=lambda t: (0.1 * t**2, 0.2 * t, 0.2 + 0 * t))
    return at.Scene("cart", [cart, beam], [drive, at.Pin("cart.p", "b.start")], gravity=DOWN)


def _two(joints: list[at.Clamp | at.Weld]) -> at.Scene:
    bodies = [at.Beam("a", (0, 0), (0.5, 0), ROD, RUBBER), at.Beam("b", (0.5, 0), (0.9, 0.3), ROD, RUBBER)]
    return at.Scene("two", bodies, joints, gravity=DOWN)


@scene
def driven_weld() -> at.Scene:
    """A driven hinge between two beams."""
    return _two([at.Clamp("a.start"), at.Weld("a.end", "b.start", angle=at.Quintic(0.5, 0.1))])


@scene
def free_stretch() -> at.Scene:
    """A clamp and a weld that hold directions alone."""
    return _two([at.Clamp("a.start", stretch="free"), at.Weld("a.end", "b.start", stretch="free")])


@scene
def welded_body() -> at.Scene:
    """A rigid body welded to a beam."""
    body = at.RigidBody("b", 0.1, 0.001, (0.6, 0.1), {"p": (0.5, 0), "end": (0.7, 0.1)})
    beam = at.Beam("a", (0, 0), (0.5, 0), ROD, RUBBER)
    return at.Scene("welded", [beam, body], [at.Clamp("a.start"), at.Weld("a.end", "b.p")], gravity=DOWN)


@scene
def moving_guide() -> at.Scene:
    """A mass that slides along a turning rigid body."""
    body = at.RigidBody("arm", 1.0, 0.1, (0.5, 0), {"o": (0, 0), "end": (1, 0)})
    bead = at.PointMass("b", 0.2, (0.4, 0))
    return at.Scene(
        "guide", [body, bead], [at.Pin("arm.o"), at.Slider("b.center", (1, 0), "arm")], gravity=DOWN
    )
