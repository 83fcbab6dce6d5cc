"""Trees and loops: accelerations and tangent solves against a direct solution of all unknowns."""

import numpy as np
import pytest
from direct import direct, elastic, mass_of, stiffness_of
from graphs import SCENES, ladder

import anctmm as at
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.joined import Joined
from anctmm.forces.actuation import Actuation
from anctmm.recursion.accelerations import by_scalars
from anctmm.recursion.riccati import block_factors, factorize, links, mass_factors, solve
from anctmm.recursion.split import split_factors

every_scene = pytest.mark.parametrize("name", SCENES)
#: Roundings of the mass of quintic cables, whose functions are more alike, are larger by so much.
ROUNDING = {"cable": 1.0, "shear": 1.0, "quintic": 20.0}
every_element = pytest.mark.parametrize("element", ["cable", "shear", "quintic"])


class Direct:
    """A scene with matrices of its independent unknowns, about a random bent state."""

    def __init__(self, scene, element, mesh=2):
        rng = np.random.default_rng(len(scene.bodies))
        self.chain = Chain(scene, Discretisation(mesh=mesh, element=element))
        bodies = self.bodies = self.chain.bodies
        self.T = Joined(self.chain).matrix
        self.q = bodies.reference() + (self.T @ (1e-2 * rng.standard_normal(self.T.shape[1]))).reshape(
            bodies.rows, -1
        )
        self.f = rng.standard_normal(self.q.shape)

    def mass(self):
        return mass_of(self.chain)

    def stiffness(self):
        return stiffness_of(self.chain, self.q)

    def solved(self, matrix, load):
        return direct(self.chain, matrix, load)

    def elastic(self):
        return elastic(self.chain, self.q)


def error(found, exact):
    return np.abs(found - exact).max() / np.abs(exact).max()


@every_element
@every_scene
def test_accelerations_of_any_topology(name, element):
    d = Direct(SCENES[name], element)
    exact = d.solved(d.mass(), d.f - d.elastic())
    assert error(solve(mass_factors(d.chain), d.f - d.elastic()), exact) < 1e-12 * ROUNDING[element]
    if d.chain.split:
        clamps, a = Actuation(d.chain.scene, d.bodies).clamps(), np.zeros_like(d.q)
        by_scalars(d.bodies.tables(), clamps, split_factors(d.chain), d.q, d.f, a)
        assert error(a, exact) < 1e-12


@every_element
@every_scene
def test_tangent_solves_of_any_topology_count_negative_eigenvalues(name, element):
    d = Direct(SCENES[name], element)
    loads = Actuation(at.Scene(name, d.chain.scene.bodies), d.bodies).loads()
    T, factors = d.T, block_factors(d.chain)
    for weight in (1e7, 1e3):
        matrix = weight * d.mass() + d.stiffness()
        pivots = factorize(
            d.q, d.bodies.tables(), links(d.chain), weight, 1.0, loads, np.empty((0, 2)), factors
        )
        assert pivots == (np.linalg.eigvalsh((T.T @ matrix @ T).toarray()) < 0.0).sum()
        allowed = 1e-12 * ROUNDING[element] if pivots == 0 else 1e-9
        assert error(solve(factors, d.f.copy()), d.solved(matrix, d.f)) < allowed


@pytest.mark.parametrize("name", SCENES)
def test_a_loop_keeps_as_few_junctions_as_close_it(name):
    kept = len(Chain(SCENES[name], Discretisation(mesh=1)).plan.kept)
    wanted = {"y_frame": 0, "binary_tree": 0, "polygon": 1, "grid": 5, "ladder": 4, "wheel": 7}
    assert kept == wanted[name.partition("-")[0]]


def test_the_kept_system_of_a_ladder_is_sparse():
    entries = []
    for rungs in (50, 100, 200):
        factors = block_factors(Chain(ladder(at.Weld, rungs), Discretisation(mesh=1)))
        entries.append(len(factors.loops.matrix.L) / rungs)
    assert entries[2] < 1.1 * entries[0]
