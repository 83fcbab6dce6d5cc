"""Random graphs of 1 to 10,000 bodies: accelerations, reactions and tangent solves against direct sparse ones."""

from dataclasses import replace

import numpy as np
import pytest
from direct import (
    by_split,
    compatible,
    direct,
    elastic,
    error,
    mass_of,
    scales,
    stiffness_of,
    torque_stiffness,
)
from graphs import binary_tree, ladder
from odd_graphs import ODD
from random_graphs import Kinds, random_graph

import anctmm as at
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.joined import Joined
from anctmm.forces.actuation import Actuation, turn_clamps
from anctmm.forces.driving import drive_table
from anctmm.recursion.accelerations import by_blocks
from anctmm.recursion.riccati import block_factors, factorize, links, mass_factors, solve

#: When drives turn and pulses push, s.
TIME = 0.01


class Problem:
    """A scene about a bent state, its clamps in motion, under random loads."""

    def __init__(self, scene, run):
        self.chain = chain = Chain(scene, run)
        self.q = compatible(chain, 1e-3)
        self.f = np.random.default_rng(1).standard_normal(self.q.shape) * scales(chain)
        self.actuation = Actuation(scene, chain.bodies)
        self.clamps = self.turned()
        self.q[:, self.clamps.nodes] = self.clamps.motion[0].T

    def turned(self):
        clamps = self.actuation.clamps()
        turn_clamps(clamps, drive_table(self.chain, self.actuation, np.array([TIME]))[0])
        return clamps

    def acceleration_error(self):
        chain, q, f, M = self.chain, self.q, self.f, mass_of(self.chain)
        known = np.zeros_like(q)
        known[:, self.clamps.nodes] = self.clamps.motion[2].T
        load = f - elastic(chain, q) - (M @ known.ravel()).reshape(q.shape)
        exact, a = known + direct(chain, M, load), np.empty_like(q)
        by_blocks(q, f, chain.bodies.tables(), self.clamps, mass_factors(chain), np.empty_like(q), a)
        errors = [error(chain, a, exact)]
        if chain.split:
            clamps = self.turned()
            errors.append(error(chain, by_split(chain, q, f, clamps), exact))
            errors.append(self.reaction_error(clamps))
        return max(errors)

    def reaction_error(self, clamps):
        """Of reactions by scalars from those by blocks; a cable has no r_y that anything could act on."""
        used = clamps.reference != 0.0
        one, two = (np.where(used, h.reaction, 0.0) for h in (self.clamps, clamps))
        return np.abs(one - two).max() / np.abs(one).max() if one.size else 0.0

    def tangent_error(self, weight=1e7):
        """Of a solve with weight · M + K_T, and by how many the negative pivots miss the negative eigenvalues."""
        chain, q, factors = self.chain, self.q, block_factors(self.chain)
        values = self.actuation.load_table(np.array([TIME]))[0]
        pivots = factorize(
            q, chain.bodies.tables(), links(chain), weight, 1.0, self.actuation.loads(), values, factors
        )
        matrix = weight * mass_of(chain) + stiffness_of(chain, q) + torque_stiffness(chain, q, TIME)
        return error(chain, solve(factors, self.f.copy()), direct(chain, matrix, self.f)), pivots - negative(
            chain, matrix
        )


def negative(chain, matrix):
    """Number of negative eigenvalues of a matrix on the independent unknowns; 0 for large ones, by their mass."""
    T = Joined(chain).matrix
    return 0 if T.shape[1] > 600 else int((np.linalg.eigvalsh((T.T @ matrix @ T).toarray()) < 0.0).sum())


@pytest.mark.parametrize("seed", range(40))
def test_accelerations_and_tangent_solves_are_direct_ones(seed):
    p = Problem(*random_graph(seed))
    assert p.acceleration_error() < 1e-12
    wrong, miscounted = p.tangent_error()
    assert wrong < 1e-12
    assert miscounted == 0


@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("name", ODD)
def test_odd_graphs_are_solved_to_rounding(name, element):
    for mesh in (1, 2):
        p = Problem(ODD[name], Discretisation(mesh=mesh, element=element))
        if Joined(p.chain).size > 0:
            assert p.acceleration_error() < 1e-12
            assert p.tangent_error() == (pytest.approx(0.0, abs=1e-12), 0)
        else:  # nothing can move
            assert not solve(mass_factors(p.chain), p.f).any()


@pytest.mark.parametrize("loops", [False, True])
def test_graphs_of_a_thousand_bodies_are_solved_to_rounding(loops):
    large_graph_is_solved(1000, loops)


@pytest.mark.exhaustive
@pytest.mark.parametrize("loops", [False, True])
def test_graphs_of_ten_thousand_bodies_are_solved_to_rounding(loops):
    large_graph_is_solved(10_000, loops)


def large_graph_is_solved(bodies, loops):
    p = Problem(*random_graph(3, Kinds(bodies=(bodies, bodies), loops=loops)))
    assert len(p.chain.scene.bodies) == bodies
    assert bool(p.chain.plan.kept) == loops
    assert p.acceleration_error() < 1e-12
    assert p.tangent_error()[0] < 1e-12  # whatever its sign: a bent state of so many bodies may be unstable


@pytest.mark.exhaustive
@pytest.mark.parametrize("shape", ["tree", "ladder"])
def test_a_hundred_thousand_elements_stay_at_rounding(shape):
    """Few bodies of many elements: what one element hands on to the next is rounded a hundred thousand times."""
    scene = {"tree": binary_tree, "ladder": ladder}[shape](at.Weld)
    mesh = 100_000 // len(scene.bodies) + 1
    p = Problem(lengthened(scene, 0.05 * mesh), Discretisation(mesh=mesh))
    assert p.q.shape[1] > 100_000
    assert p.acceleration_error() < 1e-12
    # so much mass that the rounding of strains, of places hundreds of metres away, is not what is compared
    assert p.tangent_error(1e10)[0] < 1e-12


def lengthened(scene, factor):
    """A scene of so many times its size."""

    def point(place):
        return tuple(factor * x for x in place)

    return replace(scene, bodies=[replace(b, start=point(b.start), end=point(b.end)) for b in scene.bodies])
