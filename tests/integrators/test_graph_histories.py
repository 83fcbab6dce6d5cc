"""Random graphs of bodies: ANC-TMM makes the histories of the global DAE, whatever the topology."""

from dataclasses import replace

import numpy as np
import pytest
from random_graphs import Kinds, random_graph

from anctmm import solve, solve_static
from anctmm.discretise.discretisation import Discretisation
from reference import global_dae
from reference.global_dae.layout import Layout
from reference.global_dae.stability import highest
from reference.global_dae.system import System

GRAPHS = {
    "trees": Kinds(loops=False),
    "loops": Kinds(loops=True),
    "floating": Kinds(supports=False),
    "of pins": Kinds(welds=False),
    "of welds": Kinds(hinges=False, loops=True),
}
every_graph = pytest.mark.parametrize("name", GRAPHS)


def gap(one, two):
    """Largest distance of points of two solutions, m."""
    assert (one.status.code, two.status.code) == ("ok", "ok")
    assert len(one.t) == len(two.t)
    places = [(b.name, s) for b in one.scene.bodies for s in (0.0, 0.5, 1.0)]
    return max(np.abs(one.position(*p) - two.position(*p)).max() for p in places)


def explicit(scene, run) -> Discretisation:
    """The same mesh in explicit steps, at most half the stable one."""
    steps = int(np.ceil(run.t_end * max(highest(System(Layout(scene, run)))[0], 1.0)))
    return replace(run, integrator="zhai", dt=run.t_end / steps)


@every_graph
@pytest.mark.parametrize("seed", range(4))
def test_explicit_histories_are_those_of_the_global_dae(name, seed):
    scene, run = random_graph(seed, GRAPHS[name])
    run = explicit(scene, run)
    assert gap(solve(scene, run), global_dae.solve(scene, run)) < 1e-9


@every_graph
@pytest.mark.parametrize("seed", range(4, 8))
def test_implicit_histories_are_those_of_the_global_dae(name, seed):
    scene, run = random_graph(seed, GRAPHS[name], dt=1e-3, newton_tolerance=1e-12)
    assert gap(solve(scene, run), global_dae.solve(scene, run)) < 1e-8


@pytest.mark.parametrize("seed", range(8))
def test_equilibria_are_those_of_the_global_dae(seed):
    scene, run = random_graph(seed, Kinds(structure=True), newton_tolerance=1e-12)
    assert gap(solve_static(scene, run), global_dae.solve_static(scene, run)) < 1e-8


def test_a_graph_follows_from_its_seed():
    for kinds in GRAPHS.values():
        assert random_graph(5, kinds) == random_graph(5, kinds)
        assert random_graph(5, kinds)[0] != random_graph(6, kinds)[0]
