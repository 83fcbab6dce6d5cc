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
