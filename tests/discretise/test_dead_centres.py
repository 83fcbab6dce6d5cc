"""Rigid bodies that guides and hinges stop where they stand are refused; those that move on, or are held, are not."""

import tracemalloc
from math import cos, pi, sin

import numpy as np
import pytest
from samples import refused

import anctmm as at
from anctmm.discretise.chain import Chain
from anctmm.discretise.singular_positions import dependence
from anctmm.errors import DiscretisationError


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


def chain(bodies, joints, element="rigid"):
    return Chain(at.Scene("guided", bodies, joints), at.Discretisation(mesh=1, element=element))


@pytest.fixture(params=["decomposition", "factors"])
def decided(request, monkeypatch):
    """What decides: a dense decomposition, or sparse factors."""
    monkeypatch.setattr(dependence, "FEW", np.inf if request.param == "decomposition" else 0)


@pytest.mark.parametrize("name", STOPPED)
def test_dead_centres_are_refused(name, decided):
    (bodies, joints), names = STOPPED[name]
    with refused(DiscretisationError, [*names, "dead centre", "another position", "'cable' or 'shear'"]):
        chain(bodies, joints)


@pytest.mark.parametrize("name", SOUND)
def test_bodies_that_move_on_or_are_held_are_not(name, decided):
    assert chain(*SOUND[name]).rigid


def test_masses_alone_have_no_dead_centre():
    """Their equations are linear: those that repeat each other strain nothing."""
    bodies = [
        at.PointMass("m", 1.0, (0.0, 0.0)),
        at.PointMass("n", 1.0, (0.0, 0.0)),
        body("bar", (0, 1), (1, 1)),
    ]
    joints = [
        at.Pin("m.center", "n.center"),
        at.Slider("m.center", (1.0, 0.0)),
        at.Slider("bar.a", (1.0, 0.0)),
    ]
    assert chain(bodies, joints).rigid


def test_many_bodies_on_a_guide_take_little_memory():
    """Second derivatives of all equations by all unknowns at once were hundreds of megabytes."""
    places = [(float(k), 0.1 * (k % 3)) for k in range(91)]
    bodies = [body(f"b{k}", *places[k : k + 2]) for k in range(90)]
    joints = [at.Pin("b0.a"), *(at.Pin(f"b{k}.b", f"b{k + 1}.a") for k in range(89))]
    tracemalloc.start()
    made = chain(bodies, [*joints, at.Slider("b89.b", (1.0, 0.0))])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(made.rigid) == 90
    assert peak < 5e7


@pytest.mark.parametrize("blocked", [True, False])
def test_dead_centres_of_many_bodies_are_refused(blocked, monkeypatch):
    """Of more than 1,000 constraints that are connected nothing was known: a decomposition of them takes too long."""
    places = [(float(k), 0.3 * (k % 3)) for k in range(302)]
    bodies = [body(f"b{k}", *places[k : k + 2]) for k in range(301)]
    joints = [at.Pin("b0.a"), *(at.Pin(f"b{k}.b", f"b{k + 1}.a") for k in range(300))]
    x, y = places[-1]
    bodies.append(body("bar", (x - 1.0, y), (x, y)))
    joints += [
        at.Pin("b300.b", "bar.b"),
        at.Pin("bar.a"),
        at.Slider("bar.b", (0.0, 1.0) if blocked else (1.0, 0.0)),
    ]
    monkeypatch.setattr(dependence, "_by_decomposition", None)
    if blocked:
        with refused(DiscretisationError, ["'bar'", "dead centre"]):
            chain(bodies, joints)
    else:
        assert chain(bodies, joints).rigid


def test_a_beam_that_bends_is_not_stopped():
    beam = at.Beam("bar", (0.0, 0.0), (1.0, 0.0), at.Rectangle(0.02, 0.02), at.Material(5e6, 1100.0))
    joints = [at.Pin("bar.start"), at.Slider("bar.end", (0.0, 1.0))]
    assert chain([beam], joints, "cable").kept
    with refused(DiscretisationError, ["'bar'", "dead centre"]):
        chain([beam], joints)


def test_equilibria_and_motions_are_refused_alike():
    """Steps of 1 ms and more let the body through by rounding; statics called it a mechanism that is free to move."""
    scene = at.Scene("guided", *hinged((0.0, 1.0)), gravity=(0.0, -1.0))
    for solve in (at.solve, at.solve_static):
        with refused(DiscretisationError, ["'bar'", "dead centre"]):
            solve(scene)
