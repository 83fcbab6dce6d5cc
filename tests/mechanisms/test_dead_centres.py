"""Rigid bodies that guides and hinges stop where they stand are refused; those that move on, or are held, are not."""

import tracemalloc

from samples import refused

import anctmm as at
from anctmm.errors import DiscretisationError
from anctmm.system.system import System


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


def chain(bodies, joints, element="rigid"):
    return System(at.Scene("guided", bodies, joints), at.Discretisation(mesh=1, element=element))


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
