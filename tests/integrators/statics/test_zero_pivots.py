"""Equilibria where a pivot of the elimination vanishes though the tangent is regular, as round numbers give, and others
whose tangent is singular though no rounding shows it.

Two bars of 1 m in one line on springs, a force along them that keeps its direction or follows the second bar.
"""

from itertools import product

import numpy as np
import pytest

import anctmm as at

LOADS, SPRINGS = (2.0, 10.0, 20.0, 30.0), ((5.0, 1.0), (10.0, 5.0), (10.0, 10.0))


def linkage(load, first, second, follower=False, damping=0.0):
    bars = [
        at.RigidBody(name, 1.0, 1.0 / 12.0, (x, 0.0), {"a": (x - 0.5, 0.0), "b": (x + 0.5, 0.0)})
        for name, x in (("one", 0.5), ("two", 1.5))
    ]
    springs = [
        at.RotationalSpring("one.a", stiffness=first, damping=damping),
        at.RotationalSpring("one.b", "two.a", stiffness=second, damping=damping),
    ]
    force = at.Force("two.b", (-load, 0.0), follower=follower)
    return at.Scene("linkage", bars, [at.Pin("one.a"), at.Pin("one.b", "two.a")], [force], connectors=springs)


def stiffness(load, first, second, follower):
    turns = np.array([[-1.0, 1.0], [0.0, 0.0]]) if follower else -np.eye(2)
    return np.array([[first + second, -second], [-second, second]]) + load * turns


@pytest.mark.parametrize("springs", SPRINGS)
def test_a_dead_load_that_balances_one_spring_is_judged_by_the_whole_tangent(springs):
    for load in LOADS:
        values = np.linalg.eigvalsh(stiffness(load, *springs, follower=False))
        wanted = "singular" if abs(values).min() < 1e-12 else "unstable" if values[0] < 0.0 else "ok"
        rest = at.solve_static(linkage(load, *springs))
        assert rest.status.code == wanted, (load, rest.status)


@pytest.mark.parametrize("damping", [0.0, 0.05])
def test_a_following_load_that_balances_one_spring_is_judged_by_small_motions(damping):
    mass = np.array([[4.0 / 3.0, 0.5], [0.5, 1.0 / 3.0]])
    seen = set()
    for load, springs in product(LOADS, SPRINGS):
        K, C = stiffness(load, *springs, follower=True), damping * np.array([[2.0, -1.0], [-1.0, 1.0]])
        lower = [-np.linalg.solve(mass, K), -np.linalg.solve(mass, C)]
        rates = np.linalg.eigvals(np.block([[np.zeros((2, 2)), np.eye(2)], lower]))
        wanted = "unstable" if rates.real.max() > 1e-6 else "ok"
        rest = at.solve_static(linkage(load, *springs, follower=True, damping=damping))
        assert rest.status.code == wanted, (load, springs, rest.status)
        seen.add(wanted)
    assert seen == {"ok", "unstable"}


def test_bodies_that_float_on_springs_are_singular_and_not_imprecise():
    """Free motions take no force: rounding along them leaves few digits of displacements, and means nothing."""
    bodies = [
        at.RigidBody(f"b{n}", 1.0 + n, 0.1 * (n + 1), (n, 0.3 * n * n), {"a": (n + 0.3, 0.3 * n * n)})
        for n in range(3)
    ]
    springs = [
        at.Spring("b0.a", "b1.center", stiffness=100.0),
        at.Spring("b1.a", "b2.center", stiffness=50.0, length=0.2),
        at.Spring("b0.center", "b2.a", stiffness=10.0),
        at.RotationalSpring("b0.center", "b1.center", stiffness=3.0),
        at.RotationalSpring("b1.center", "b2.center", stiffness=2.0),
    ]
    rest = at.solve_static(at.Scene("float", bodies, connectors=springs))
    assert rest.status.code == "singular", rest.status
    pull = np.zeros(2)
    for spring in springs[:3]:  # all of those on b1, in equilibrium
        ends = [rest.position(place)[-1] for place in (spring.first, spring.second)]
        along = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0])) * rest.tension(spring)[-1]
        pull += along * (spring.first.startswith("b1")) - along * (spring.second.startswith("b1"))
    assert pull == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("seed", [0, 110])
def test_bodies_that_slide_freely_are_singular_however_rounding_falls(seed):
    """Nothing holds them along the first guide: a pivot is rounding there, of either sign, and may seem a number."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0.0, 6.28)
    center, spot, other = rng.normal(size=2) * 0.1, rng.normal(size=2) * 0.1, rng.normal(size=2) * 0.3
    bodies = [
        at.RigidBody("one", 1.07, 0.136, center, {"p": (0.0, 0.0), "q": spot}),
        at.RigidBody("two", 0.56, 0.03, other),
    ]
    guides = [
        at.Slider("one.p", (np.cos(turn), np.sin(turn))),
        at.Slider("two.center", rng.normal(size=2), body="one"),
    ]
    springs = [
        at.RotationalSpring("one.q", stiffness=2.15, angle=0.45),
        at.RotationalSpring("two.center", stiffness=1.0),
        at.Spring("two.center", "one.q", stiffness=17.8, length=0.5),
    ]
    rest = at.solve_static(at.Scene("free", bodies, guides, connectors=springs))
    assert rest.status.code == "singular", rest.status
    assert not rest.stable.any()
