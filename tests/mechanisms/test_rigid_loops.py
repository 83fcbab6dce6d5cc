"""Joints of rigid bodies that only repeat each other are sound."""

from itertools import pairwise

import pytest
from samples import beam

import anctmm as at
from anctmm.model.drives import Quintic
from anctmm.model.scene import Clamp, Pin, Scene, Weld

O = (0.0, 0.0)  # noqa: E741


def line(*corners, name="abcdefgh"):
    """Bodies from corner to corner."""
    return [beam(n, p, q) for n, p, q in zip(name, corners, corners[1:], strict=False)]


def row(bodies, kind=Pin):
    """Each body joined to the next."""
    names = [b.name for b in bodies]
    return [kind(f"{one}.end", f"{two}.start") for one, two in pairwise(names)]


def held(bodies):
    """A row of bodies between two hinges at the ground."""
    return bodies, [Pin(f"{bodies[0].name}.start"), *row(bodies), Pin(f"{bodies[-1].name}.end")]


def ring(kind, corners):
    bodies = line(*corners, corners[0])
    return bodies, [*row(bodies, kind), kind(f"{bodies[-1].name}.end", f"{bodies[0].name}.start")]


def cranks():
    """A parallelogram with three cranks."""
    bodies = [
        beam("a", O, (0.0, 0.5)),
        beam("b", (0.0, 0.5), (1.0, 0.5)),
        beam("c", (1.0, 0.5), (1.0, 0.0)),
        beam("d", (1.0, 0.5), (2.0, 0.5)),
        beam("e", (2.0, 0.5), (2.0, 0.0)),
    ]
    joints = [Pin("a.start"), Pin("a.end", "b.start"), Weld("b.end", "d.start"), Pin("b.end", "c.start")]
    return bodies, [*joints, Pin("c.end"), Pin("d.end", "e.start"), Pin("e.end")]


STRAIGHT = line(O, (1.0, 0.0), (2.0, 0.0))
SOUND = {
    "taut between a clamp and a hinge": (STRAIGHT, [Clamp("a.start"), Pin("a.end", "b.start"), Pin("b.end")]),
    "one between two hinges": held(line(O, (1.0, 0.0))),
    "one clamped and hinged": (line(O, (1.0, 0.0)), [Clamp("a.start"), Pin("a.end")]),
    "a driven four-bar": (
        line(O, (0.0, 0.5), (1.0, 0.7), (1.0, 0.0)),
        [Clamp("a.start", Quintic(1.0, 1.0)), *held(line(O, (0.0, 0.5), (1.0, 0.7), (1.0, 0.0)))[1][1:]],
    ),
    "a triangle of hinges": ring(Pin, [O, (1.0, 0.0), (0.5, 0.8)]),
    "a welded triangle": ring(Weld, [O, (1.0, 0.0), (0.5, 0.8)]),
    "a parallelogram of three cranks": cranks(),
    "a straight pendulum": (STRAIGHT, [Pin("a.start"), Pin("a.end", "b.start")]),
    "a straight row welded and held": (STRAIGHT, [Pin("a.start"), Weld("a.end", "b.start"), Pin("b.end")]),
}


def moved(bodies, joints, element="rigid"):
    """A few steps."""
    return at.solve(Scene("loop", bodies, joints), mesh=1, element=element, dt=1e-4, t_end=2e-4)


@pytest.mark.parametrize("name", SOUND)
def test_joints_that_repeat_each_other_are_not(name):
    bodies, joints = SOUND[name]
    assert moved(bodies, joints).status.ok


def test_one_body_that_bends_makes_a_taut_row_sound():
    bodies, joints = held(STRAIGHT)
    assert moved(bodies, joints, {"a": "rigid", "b": "cable"}).status.ok
