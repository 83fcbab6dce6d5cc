"""Rigid bodies in singular positions are refused; joints that only repeat each other are not."""

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


def cranks(third):
    """A parallelogram with three cranks; the last one may have another length."""
    bodies = [
        beam("a", O, (0.0, 0.5)),
        beam("b", (0.0, 0.5), (1.0, 0.5)),
        beam("c", (1.0, 0.5), (1.0, 0.0)),
        beam("d", (1.0, 0.5), (2.0, 0.5)),
        beam("e", (2.0, 0.5), (2.0, third)),
    ]
    joints = [Pin("a.start"), Pin("a.end", "b.start"), Weld("b.end", "d.start"), Pin("b.end", "c.start")]
    return bodies, [*joints, Pin("c.end"), Pin("d.end", "e.start"), Pin("e.end")]


def far(bodies, joints):
    """The same, elsewhere and a thousand times as large."""

    def place(p):
        return 1e3 * p[0] + 5e3, 1e3 * p[1] - 2e3

    return [beam(b.name, place(b.start), place(b.end)) for b in bodies], joints


STRAIGHT = line(O, (1.0, 0.0), (2.0, 0.0))
SINGULAR = {
    "two taut": (held(STRAIGHT), ["'a'", "'b'"]),
    "three taut at an angle": (held(line(O, (0.5, 0.25), (1.0, 0.5), (2.0, 1.0))), ["'a'", "'b'", "'c'"]),
    "two folded": (held(line(O, (1.0, 0.0), (0.5, 0.0))), ["'a'", "'b'"]),
    "a folded parallelogram": (held(line(O, (1.0, 0.0), (3.0, 0.0), (2.0, 0.0))), ["'a'", "'b'", "'c'"]),
    "a flat ring": (ring(Pin, [O, (1.0, 0.0), (2.0, 0.0)]), ["'a'", "'b'", "'c'"]),
    "three cranks of two lengths": (cranks(-0.3), ["'a'", "'c'", "'e'"]),
    "large and far": (far(*held(line(O, (1.0, 0.5), (2.0, 1.0)))), ["'a'", "'b'"]),
}
SOUND = {
    "taut between a clamp and a hinge": (STRAIGHT, [Clamp("a.start"), Pin("a.end", "b.start"), Pin("b.end")]),
    "one between two hinges": held(line(O, (1.0, 0.0))),
    "one clamped and hinged": (line(O, (1.0, 0.0)), [Clamp("a.start"), Pin("a.end")]),
    "one clamped at both ends": (line(O, (1.0, 0.0)), [Clamp("a.start"), Clamp("a.end")]),
    "two that hold each other": held(line(O, (0.5, 0.8), (1.0, 0.0))),
    "a four-bar": held(line(O, (0.0, 0.5), (1.0, 0.7), (1.0, 0.0))),
    "a driven four-bar": (
        line(O, (0.0, 0.5), (1.0, 0.7), (1.0, 0.0)),
        [Clamp("a.start", Quintic(1.0, 1.0)), *held(line(O, (0.0, 0.5), (1.0, 0.7), (1.0, 0.0)))[1][1:]],
    ),
    "a triangle of hinges": ring(Pin, [O, (1.0, 0.0), (0.5, 0.8)]),
    "a welded triangle": ring(Weld, [O, (1.0, 0.0), (0.5, 0.8)]),
    "a square of hinges": ring(Pin, [O, (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]),
    "a parallelogram of three cranks": cranks(0.0),
    "a straight pendulum": (STRAIGHT, [Pin("a.start"), Pin("a.end", "b.start")]),
    "a straight row welded and held": (STRAIGHT, [Pin("a.start"), Weld("a.end", "b.start"), Pin("b.end")]),
    "large and far": far(*cranks(0.0)),
}


def moved(bodies, joints, element="rigid"):
    """A few steps."""
    return at.solve(Scene("loop", bodies, joints), mesh=1, element=element, dt=1e-4, t_end=2e-4)


@pytest.mark.parametrize("name", SOUND)
def test_joints_that_repeat_each_other_are_not(name):
    bodies, joints = SOUND[name]
    assert moved(bodies, joints).status.ok


def test_one_body_that_bends_makes_a_taut_row_sound():
    bodies, joints = SINGULAR["two taut"][0]
    assert moved(bodies, joints, {"a": "rigid", "b": "cable"}).status.ok
