"""Rigid bodies that guides and hinges stop where they stand are refused; those that move on, or are held, are not."""

from math import cos, pi, sin

import pytest

import anctmm as at


def body(name, a, b):
    """From a place to another, its centre between them."""
    center = tuple((x + y) / 2.0 for x, y in zip(a, b, strict=True))
    return at.RigidBody(name, 1.0, 0.1, center, points={"a": a, "b": b})


def hinged(direction, kind=at.Slider, **options):
    """A body hinged at one place, the other one on a line."""
    return [body("bar", (0.0, 0.0), (1.0, 0.0))], [
        at.Pin("bar.a"),
        kind("bar.b", direction, **options),
    ]


def crank_slider(angle, drive=None, rod=1.0):
    """A crank of 0.3 m, a rod and what its end moves on; the line goes through the crank's hinge."""
    knee = 0.3 * cos(angle), 0.3 * sin(angle)
    end = knee[0] + (rod**2 - knee[1] ** 2) ** 0.5, 0.0
    bodies = [body("crank", (0.0, 0.0), knee), body("rod", knee, end)]
    return bodies, [
        at.Pin("crank.a"),
        at.Pin("crank.b", "rod.a"),
        at.Slider("rod.b", (1.0, 0.0), position=drive),
    ]


def trammel(angle):
    """A bar with its ends on two lines across each other."""
    ends = (cos(angle), 0.0), (0.0, sin(angle))
    return [body("bar", *ends)], [at.Slider("bar.a", (1.0, 0.0)), at.Slider("bar.b", (0.0, 1.0))]


def on_a_body(turn):
    """A hinged bar whose end is on a line of a hinged plate, across the bar or not."""
    bodies, joints = hinged((cos(turn), sin(turn)), body="plate")
    return [*bodies, body("plate", (2.0, 0.0), (2.0, 1.0))], [*joints, at.Clamp("plate.a")]


def large_and_far(bodies, joints):
    def place(p):
        return 1e3 * p[0] + 5e3, 1e3 * p[1] - 2e3

    return [body(b.name, place(b.position_at("a")), place(b.position_at("b"))) for b in bodies], joints


PUSH = at.Quintic(0.1, 1.0)
STOPPED = {
    "hinged, and guided across": (hinged((0.0, 1.0)), ["'bar'"]),
    "on a line of a body": (on_a_body(pi / 2), ["'bar'"]),
    "a driven slider at the outer dead centre": (crank_slider(0.0, PUSH), ["'crank'", "'rod'"]),
    "a driven slider at the inner dead centre": (crank_slider(pi, PUSH), ["'crank'", "'rod'"]),
    "a crank as long as the rod, across": (crank_slider(pi / 2, rod=0.3), ["'crank'", "'rod'"]),
    "large and far": (large_and_far(*hinged((0.0, 1.0))), ["'bar'"]),
}
SOUND = {
    "simply supported": hinged((1.0, 0.0)),
    "hinged, and guided at an angle": hinged((1.0, 1e-3)),
    "on a line of a body": on_a_body(0.3),
    "a slider-crank at its dead centre": crank_slider(0.0),
    "a slider-crank across": crank_slider(pi / 2),
    "a driven slider between dead centres": crank_slider(1.0, PUSH),
    "a trammel": trammel(1.0),
    "a trammel along one of its lines": trammel(0.0),
    "two guides on one line": (
        [body("bar", (0.0, 0.0), (1.0, 0.0))],
        [at.Slider("bar.a", (1.0, 0.0)), at.Slider("bar.b", (1.0, 0.0))],
    ),
    "a prismatic joint and a guide on its line": (
        [body("bar", (0.0, 0.0), (1.0, 0.0))],
        [at.Prismatic("bar.a", (1.0, 0.0)), at.Slider("bar.b", (1.0, 0.0))],
    ),
    "large and far": large_and_far(*crank_slider(0.0)),
    "two hinged bars, one on a line beside it": (
        [body("bar", (0.0, 0.0), (1.0, 0.0)), body("far", (0.0, 2.0), (1.0, 2.0))],
        [at.Pin("bar.a"), at.Slider("bar.b", (1.0, 0.0)), at.Pin("far.a")],
    ),
}


def moved(bodies, joints, element="rigid", gravity=(0.3, -1.0)):
    """A few steps."""
    scene = at.Scene("guided", bodies, joints, gravity=gravity)
    return at.solve(scene, mesh=1, element=element, dt=1e-3, t_end=2e-3)


@pytest.mark.parametrize("name", SOUND)
def test_bodies_that_move_on_or_are_held_are_not(name):
    assert moved(*SOUND[name]).status.ok


def test_bodies_on_which_nothing_acts_rest():
    for what in SOUND.values():
        assert moved(*what, gravity=(0.0, 0.0)).status.ok
