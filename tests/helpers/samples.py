"""Small scenes and helpers that several tests share; the base scenes are in `studies.scenes`."""

from contextlib import contextmanager
from math import cos, pi, sin

import numpy as np
import pytest

from anctmm.discretise.discretisation import Discretisation
from anctmm.integrators.stability import highest_frequency
from anctmm.model.connectors import RotationalSpring, Spring
from anctmm.model.drives import Pulse, Quintic
from anctmm.model.joints import Joint
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque, Weld
from anctmm.model.sections import Rectangle
from anctmm.system.system import System

SOFT = Material(E=1e7, density=1000.0)
SQUARE = Rectangle(0.02, 0.02)
A, B, C = (0.0, 0.0), (1.0, 0.0), (2.0, 0.0)
KINDS = ("cable", "shear")
INTEGRATORS = ("zhai", "generalized-alpha")
SUPPORTS = {"free": lambda end: (), "pin": lambda end: (Pin(end),), "clamp": lambda end: (Clamp(end),)}


class RigidLink(Joint):
    """Massless rigid link between two places: a kind of joint that the package does not have."""

    def equations(self, a, b):
        d = b.position - a.position
        return [d @ d - float(d.start @ d.start)]


def beam(name="a", start=A, end=B, section=SQUARE, material=SOFT, velocity=None):
    """A body along the x axis, 1 m long."""
    return Beam(name, start, end, section, material, velocity)


def scene_of(*joints, bodies=None, loads=(), gravity=(0.0, 0.0)):
    """Bodies "a" and "b" in a row along the x axis, or others."""
    return Scene("s", bodies or [beam(), beam("b", B, C)], joints, loads, gravity)


def run_of(**options):
    """A discretisation with two elements a body."""
    return Discretisation(**{"mesh": 2, **options})


def bar(joints=(), loads=(), velocity=None, gravity=(0.0, 0.0), material=SOFT):
    """One oblique bar of length 1 m."""
    beam = Beam("bar", (0.0, 0.0), (0.6, 0.8), SQUARE, material, velocity)
    return Scene("bar", [beam], joints, loads, gravity)


def linkage(duration):
    """A driven crank, a coupler under a torque that lasts so long (s), a third beam to the ground: a loop."""
    ends = {"crank": ((0, 0), (0.3, 0)), "coupler": ((0.3, 0), (0.9, 0.3)), "last": ((0.9, 0.3), (0.8, 0))}
    bodies = [Beam(name, *places, SQUARE, SOFT) for name, places in ends.items()]
    joints = [
        Clamp("crank.start", angle=Quintic(pi / 3, 0.4)),
        Pin("crank.end", "coupler.start"),
        Pin("coupler.end", "last.start"),
        Pin("last.end"),
    ]
    loads = [
        Torque("coupler.end", Pulse(0.02, duration)),
        Force("coupler.end", lambda t: (0.1 * t, 0.2 * t * t)),
    ]
    return Scene("linkage", bodies, joints, loads, (0.0, -9.81))


def acted_on():
    """Damped material, a spring with a damper to the ground, one of a driven length, a rotational one, a follower."""
    body = Beam("bar", (0, 0), (0.6, 0), SQUARE, Material(E=1e6, density=1000.0, damping=2e-3))
    connectors = [
        Spring("bar.end", (0.6, -0.4), stiffness=20.0, damping=0.5),
        Spring(("bar", 0.5), (0.3, 0.4), stiffness=30.0, length=lambda t: (0.4 + 0.1 * t * t, 0.2 * t)),
        RotationalSpring("bar.end", stiffness=0.1, damping=1e-3),
    ]
    loads = [Force("bar.end", (0.0, -0.3), follower=True)]
    return Scene("acted on", [body], [Pin("bar.start")], loads, (0.0, -9.81), connectors=connectors)


def row_scene(start, links, end, lengths=None, turned=(), loads=(), gravity=(0.0, 0.0)):
    """Bodies "b0", "b1", … in a row from a support to a support.

    `links` has a pair (kind of joint, angle by which the direction turns there) between each two bodies; bodies in
    `turned` are drawn from their far end.
    """
    joined = {"pin": Pin, "weld": Weld}
    corner, angle, bodies, joints = (0.0, 0.0), 0.4, [], []
    lengths = lengths or [0.3 + 0.1 * i for i in range(len(links) + 1)]
    for i, length in enumerate(lengths):
        angle += links[i - 1][1] if i else 0.0
        tip = (corner[0] + length * cos(angle), corner[1] + length * sin(angle))
        ends = (tip, corner) if i in turned else (corner, tip)
        bodies.append(Beam(f"b{i}", *ends, SQUARE, SOFT))
        corner = tip
    for i, (kind, _) in enumerate(links):
        joints.append(joined[kind](outer(i, turned), inner(i + 1, turned)))
    last = len(links)
    joints = [*SUPPORTS[start](inner(0, turned)), *joints, *SUPPORTS[end](outer(last, turned))]
    return Scene("row", bodies, joints, loads, gravity)


def inner(i, turned=()):
    """Name of the inboard end of body i of a row."""
    return f"b{i}.{'end' if i in turned else 'start'}"


def outer(i, turned=()):
    """Name of the outboard end of body i of a row."""
    return f"b{i}.{'start' if i in turned else 'end'}"


def system_of(scene, **options):
    """The equations of a scene as discretised."""
    return System(scene, Discretisation(**{"mesh": 2, **options}))


def frequency_of(scene, **options):
    """Highest frequency of a scene as discretised, rad/s."""
    system = system_of(scene, **options)
    return highest_frequency(system, system.mesh.reference)


def gap(one, two, fraction=1.0, body=None, other=None, mirrored=False):
    """Largest distance of a point of two solutions, over the whole history, m."""
    body = body or one.scene.bodies[0].name
    there = 1.0 - fraction if mirrored else fraction
    return np.abs(one.position(body, fraction) - two.position(other or body, there)).max()


class Trap:
    """Runs code when it is unpickled."""

    sprung = False

    def __reduce__(self):
        return setattr, (Trap, "sprung", True)


@contextmanager
def refused(error, words, exactly=False):
    """What is done in the context is refused by an error whose message has all the words."""
    with pytest.raises(error) as caught:
        yield
    assert [word for word in words if word not in str(caught.value)] == []
    assert not exactly or type(caught.value) is error
