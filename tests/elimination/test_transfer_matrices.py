"""Transfer matrices and the Riccati recursion against the equation of motion and the compiled elimination."""

import itertools
from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from samples import KINDS, SOFT, SQUARE, SUPPORTS, outer, row_scene
from scipy.linalg import eigvals

import anctmm as at
from anctmm.elements.cable import CableElement
from anctmm.elements.shear import ShearElement
from anctmm.elimination.transfer import (
    accelerations_plain,
    accelerations_riccati,
    element_transfer,
    riccati_step,
    weld_transfer,
)
from anctmm.integrators.starting import balance
from anctmm.integrators.state import new_state
from anctmm.system.system import System
from studies.regression.readable import Chain, vectors_of

HEIGHT = sqrt(12.0 * SQUARE.second_moment / SQUARE.area)
#: Joints between bodies, and the angles by which their directions turn there.
LAYOUTS = {
    "one body": [],
    "pin": [("pin", 1.0)],
    "straight weld": [("weld", 0.0)],
    "angled weld": [("weld", 1.0)],
    "pins and welds": [("pin", 0.5), ("weld", 0.0), ("pin", -1.0), ("weld", -0.7)],
    "folded back": [("weld", pi), ("pin", 0.0)],
}
every_kind = pytest.mark.parametrize("kind", KINDS)


def loaded(start, links, end, lengths=None, turned=()):
    """A row of bodies under its weight, a torque on its last end and a force on the end of its first body."""
    loads = [at.Torque(outer(len(links), turned), 0.5), at.Force(outer(0, turned), (30.0, -20.0))]
    return row_scene(start, links, end, lengths, turned, loads, (2.0, -9.81))


class Both:
    """A scene at random places of all nodes, joints not respected: as a chain, and as the compiled system."""

    def __init__(self, scene, kind="cable", mesh=2, amount=0.05):
        run = at.Discretisation(mesh, kind, integrator="zhai", dt=1e-4)
        self.chain, self.system = Chain(scene, run), System(scene, run)
        count, k = self.chain.reference.shape
        length = self.system.mesh.beams[0].element.l
        self.lever = np.array([1.0, length, HEIGHT / 2][:k])  # of each vector: what moves a point by one unit
        x, y = np.random.default_rng(0).standard_normal((2, count, k))
        self.q = self.chain.reference + amount * np.array([length, 1.0, 1.0][:k]) * (x + 1j * y)

    def compiled(self):
        """Accelerations by the block elimination of all unknowns and rows."""
        system, q = self.system, np.empty((2 * self.q.shape[1], len(self.q)))
        q[::2], q[1::2] = self.q.T.real, self.q.T.imag
        state, inputs = new_state(system, q, np.zeros_like(q)), system.inputs(np.zeros(1))
        for _ in range(2):  # as `started`
            balance(system.size, system.space, system.tables, state, inputs, 0)
        return vectors_of(state.w)

    def error(self, accelerations):
        """Largest difference of accelerations by transfer matrices from those, of the largest one of a point."""
        q, v, a = self.q.copy(), np.zeros_like(self.q), np.empty_like(self.q)
        known = self.chain.drive(0.0, q, v)
        a[self.chain.order] = accelerations(self.chain.row(q, v, self.chain.forces(0.0, q), known)).T
        exact = self.compiled()
        return np.abs((a - exact) * self.lever).max() / np.abs(exact * self.lever).max()


def one_element(kind, slenderness):
    body = at.Beam("b", (0.0, 0.0), (slenderness * HEIGHT, 0.0), SQUARE, SOFT)
    return ShearElement.of(body, 1) if kind == "shear" else CableElement.of(body, 1)


@every_kind
@pytest.mark.parametrize("slenderness", [1, 3, 10, 30, 100])
def test_transfer_satisfies_the_equation_of_motion(kind, slenderness):
    """M δ̈ = F − Kδ + [−P_I; P_O] for any state of node I (Rong 2014, eq. 15)."""
    e, rng = one_element(kind, slenderness), np.random.default_rng(slenderness)
    k = e.vectors_per_node
    size = np.tile([1.0, e.l, HEIGHT][:k], 2)  # of forces; accelerations have its inverse
    loads, state = (size * (rng.standard_normal(2 * k) + 1j * rng.standard_normal(2 * k)) for _ in range(2))
    state[:k] /= size[:k] ** 2
    U, T = element_transfer(e.mass, loads[:k], loads[k:])
    after = U @ state + T
    a, P = np.concatenate([state[:k], after[:k]]), np.concatenate([-state[k:], after[k:]])
    inertia = e.mass @ a
    size = np.abs(e.mass) @ np.abs(a) + np.abs(loads) + np.abs(P)
    assert (np.abs(inertia - loads - P) / size).max() < 1e-12


@every_kind
def test_chain_product_grows_by_68_per_element(kind):
    """Eigenvalues of U are those of a free wave, (M12 λ² + (M11 + M22) λ + M21) a = 0; the largest is 68."""
    e = one_element(kind, 10)
    k = e.vectors_per_node
    size = np.array([1.0, 1.0 / e.l, 1.0 / HEIGHT])[:k]
    m = e.mass * np.outer(np.tile(size, 2), np.tile(size, 2))  # similar, and well conditioned
    zero = np.zeros(k)
    values = np.sort(np.abs(np.linalg.eigvals(element_transfer(m, zero, zero)[0])))
    M11, M12, M21, M22 = m[:k, :k], m[:k, k:], m[k:, :k], m[k:, k:]
    O, I = np.zeros((k, k)), np.eye(k)  # noqa: E741
    wave = np.sort(np.abs(eigvals(np.block([[O, I], [-M21, -M11 - M22]]), np.block([[I, O], [O, M12]]))))
    assert values == pytest.approx(wave, rel=1e-9)
    assert values[-1] == pytest.approx(68.17228516, abs=1e-8)
    assert values * values[::-1] == pytest.approx(np.ones(2 * k), rel=1e-9)


def test_weld_turns_all_but_the_position():
    U, T = weld_transfer(3, 0.6 + 0.8j)
    z = np.arange(1.0, 7.0) * (1.0 + 2.0j)
    turn = np.array([1.0, 0.6 + 0.8j, 0.6 + 0.8j])
    assert np.abs(U @ z + T - z * np.concatenate([turn, turn])).max() < 1e-15


@every_kind
def test_riccati_step_keeps_every_state_on_its_relation(kind):
    """za = S zb + e at node I, transferred, is za = S' zb + e' at node O, for any zb (Rong 2014, eqs. 30-31)."""
    e, rng = one_element(kind, 1), np.random.default_rng(2)
    k = e.vectors_per_node
    U, T = element_transfer(e.mass / e.mass[0, 0], *rng.standard_normal((2, k)))
    for by_force in itertools.product([False, True], repeat=k):
        a = np.where(by_force, k + np.arange(k), np.arange(k))
        b = np.where(by_force, np.arange(k), k + np.arange(k))
        S, rest, zb = rng.standard_normal((k, k)), rng.standard_normal(k), rng.standard_normal(k)
        z = np.empty(2 * k)
        z[a], z[b] = S @ zb + rest, zb
        after = U @ z + T
        S, rest = riccati_step(S, rest, U, T, np.array(by_force))
        assert np.abs(after[a] - S @ after[b] - rest).max() < 1e-9 * np.abs(after).max()


@pytest.mark.parametrize("layout", LAYOUTS)
@every_kind
def test_both_methods_give_the_accelerations_of_the_block_elimination(kind, layout):
    links = LAYOUTS[layout]
    for (start, end), mesh in itertools.product(itertools.product(SUPPORTS, SUPPORTS), (1, 2)):
        if (layout, start, end, mesh) == ("one body", "clamp", "clamp", 1):  # nothing can move
            continue
        both = Both(loaded(start, links, end, turned=(1, 2)), kind, mesh)
        assert both.error(accelerations_riccati) < 1e-11
        if mesh * (len(links) + 1) <= 3:
            assert both.error(accelerations_plain) < 1e-9


@every_kind
@pytest.mark.parametrize(("start", "end"), [("clamp", "free"), ("pin", "clamp"), ("clamp", "clamp")])
def test_driven_clamps(kind, start, end):
    scene = loaded(start, [("pin", 0.5)], end, turned=(1,))
    pull = at.History(lambda t: (15.0 * t * t, 30.0 * t, 30.0 + 0.0 * t), breaks=())
    joints = [replace(j, angle=pull) if isinstance(j, at.Clamp) else j for j in scene.joints]
    both = Both(at.Scene("driven", scene.bodies, joints, scene.loads, scene.gravity), kind)
    assert both.error(accelerations_riccati) < 1e-11
    assert both.error(accelerations_plain) < 1e-8


@every_kind
def test_plain_product_loses_its_digits_within_nine_elements_and_riccati_keeps_them(kind):
    rows = [Both(loaded("clamp", [], "free", [0.1 * n]), kind, n) for n in range(1, 11)]
    plain = np.array([both.error(accelerations_plain) for both in rows])
    assert plain[:4].max() < 1e-8
    assert plain[8:].min() > 0.01  # nothing left
    assert 30.0 < (plain[7] / plain[2]) ** (1 / 5) < 150.0
    assert max(both.error(accelerations_riccati) for both in rows) < 1e-9
    long = Both(loaded("free", [("pin", 0.5)], "pin", [5.0] * 2), kind, 50)
    assert long.error(accelerations_riccati) < 1e-9
