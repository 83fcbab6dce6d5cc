"""Random trees and loops: order, direction, root and cuts of bodies do not matter; what floats keeps its momentum."""

from dataclasses import replace

import numpy as np
import pytest
from graphs import binary_tree, polygon
from hypothesis import given, settings
from hypothesis import strategies as st
from random_graphs import Kinds, random_graph
from samples import frequency_of

import anctmm as at
from anctmm.discretise.discretisation import Discretisation

#: How far rounding, or what Newton's iteration leaves, may lead two equal runs of 40 or 10 steps apart, relative.
ROUNDING = {"zhai": 1e-11, "generalized-alpha": 1e-9}
every_integrator = pytest.mark.parametrize("integrator", ROUNDING)


def stepped(scene, run, integrator):
    """A short run with a quarter of the stable step, or with Newton's iterations."""
    if integrator == "zhai":
        dt = min(0.5 / max(frequency_of(scene, mesh=run.mesh, element=run.element), 1.0), 1e-3)
        return Discretisation(run.mesh, run.element, integrator=integrator, dt=dt, t_end=40 * dt)
    return Discretisation(run.mesh, run.element, dt=1e-3, t_end=1e-2, newton_tolerance=1e-12)


def places(solution, names, turned=()):
    return np.stack([
        solution.displacement((n, 1.0 - s if n in turned else s)) for n in names for s in (0.0, 0.3, 1.0)
    ])  # fmt: skip


def same(one, two, integrator, turned=(), names=None):
    names = names or [b.name for b in one.scene.bodies]
    assert (one.status.ok, two.status.ok) == (True, True)
    first, second = places(one, names), places(two, names, turned)
    assert np.abs(first - second).max() < ROUNDING[integrator] * max(1e-3, np.abs(first).max())


def renamed(scene, name):
    """Joints and loads of a scene at ends of other names."""

    def joint(j):
        if isinstance(j, at.Clamp):
            return at.Clamp(name(j.end), j.angle)
        return type(j)(*map(name, j.ends), grounded=j.grounded)

    return [joint(j) for j in scene.joints], [replace(f, end=name(f.end)) for f in scene.loads]


def backwards(body):
    velocity = body.velocity and (lambda s: body.velocity(1.0 - s))
    return replace(body, start=body.end, end=body.start, velocity=velocity)


@every_integrator
@settings(max_examples=10)
@given(seed=st.integers(0, 10**6))
def test_order_direction_and_root_do_not_matter(integrator, seed):
    """Another order of bodies is another root, and other junctions that are kept."""
    scene, run = random_graph(seed, Kinds(bodies=(2, 12)))
    run, rng = stepped(scene, run, integrator), np.random.default_rng(seed)
    turned = {b.name for b in scene.bodies if rng.random() < 0.5}

    def name(end):
        body, side = end.split(".")
        return f"{body}.{'end' if (side == 'start') == (body in turned) else 'start'}"

    joints, loads = renamed(scene, name)
    bodies = [backwards(b) if b.name in turned else b for b in scene.bodies]
    bodies, joints, loads = (
        [things[i] for i in rng.permutation(len(things))] for things in (bodies, joints, loads)
    )
    other = replace(scene, bodies=bodies, joints=joints, loads=loads)
    same(at.solve(scene, run), at.solve(other, run), integrator, turned)


def spinning(scene, rate=2.0):
    """A scene that drifts and turns, under no loads."""

    def moving(b):
        def velocity(s):
            x, y = ((1.0 - s) * p + s * q for p, q in zip(b.start, b.end, strict=True))
            return 1.0 - rate * y, 0.5 + rate * x

        return replace(b, velocity=velocity)

    joints = [j for j in scene.joints if not isinstance(j, at.Clamp)]
    return at.Scene(scene.name, [moving(b) for b in scene.bodies], joints)


def test_the_energy_of_a_loop_balances_with_the_square_of_the_step():
    scene = polygon(at.Weld)
    run = stepped(scene, Discretisation(mesh=2), "zhai")
    errors = []
    for parts in (1, 2):
        fine = replace(run, dt=run.dt / parts, t_end=8 * run.t_end, output_dt=run.t_end)
        errors.append(np.abs(at.solve(scene, fine).energy.balance).max())
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)


@pytest.mark.parametrize("layout", ["tree", "loop"])
def test_welded_rigid_bodies_of_trees_and_loops_turn_as_one(layout):
    """Free of loads their centre moves straight on, and all turn at one rate."""
    base = binary_tree(at.Weld, levels=2) if layout == "tree" else polygon(at.Weld)
    scene = spinning(base, rate=3.0)
    s = at.solve(scene, mesh=1, element="rigid", integrator="zhai", dt=1e-4, t_end=0.2, output_dt=0.02)
    assert s.status.ok
    mass = np.array([b.length for b in scene.bodies])
    centre = np.einsum("b,bnc->nc", mass, [s.position(b.name, 0.5) for b in scene.bodies]) / mass.sum()
    drift = np.diff(centre, axis=0)
    assert np.ptp(drift, axis=0).max() < 1e-10
    for b in scene.bodies:
        span = (s.position(b.name, 1.0) - s.position(b.name, 0.0)) @ [1.0, 1.0j]
        assert np.abs(span / span[0] - np.exp(3.0j * s.t)).max() < 1e-6
