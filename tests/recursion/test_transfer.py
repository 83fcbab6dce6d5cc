"""Transfer matrices and the Riccati recursion against the equation of motion and a direct sparse solve."""

import itertools
from math import pi

import numpy as np
import pytest
from direct import (
    HEIGHT,
    by_split,
    direct,
    elastic,
    elements_of,
    error,
    mass_of,
    scales,
    stiffness_of,
    torque_stiffness,
)
from marks import interpreted_where
from numpy.testing import assert_array_equal
from samples import INTEGRATORS, KINDS, SOFT, SQUARE, SUPPORTS, chain_of, deformed, row_scene
from scipy.linalg import eigvals

from anctmm.discretise.joined import Joined
from anctmm.elements.cable import CableElement
from anctmm.elements.shear import ShearElement
from anctmm.errors import DiscretisationError, SolverError
from anctmm.forces.actuation import Actuation
from anctmm.forces.loads import no_loads
from anctmm.jit.compiling import kernel
from anctmm.jit.mixed_precision import in_double
from anctmm.model.scene import Beam, Scene, Torque, Weld
from anctmm.recursion.riccati import block_factors, factorize, links, mass_factors, solve
from anctmm.recursion.transfer import (
    accelerations_plain,
    accelerations_riccati,
    element_transfer,
    riccati_step,
    row_of,
    weld_transfer,
)

LAYOUTS = {
    "one body": [],
    "pin": [("pin", 1.0)],
    "straight weld": [("weld", 0.0)],
    "angled weld": [("weld", 1.0)],
    "pins and welds": [("pin", 0.5), ("weld", 0.0), ("pin", -1.0), ("weld", -0.7)],
    "folded back": [("weld", pi), ("pin", 0.0)],
}
every_layout = pytest.mark.parametrize("layout", LAYOUTS)
every_support = pytest.mark.parametrize(("start", "end"), list(itertools.product(SUPPORTS, SUPPORTS)))
every_kind = pytest.mark.parametrize("kind", KINDS)


def real(a):
    """Components from a readable method's complex vectors."""
    out = np.empty((2 * len(a), a.shape[1]))
    out[::2], out[1::2] = a.real, a.imag
    return out


def problem(chain, amount=0.05):
    """Coordinates, external forces and the accelerations of the direct solve."""
    q = deformed(chain, amount)
    f = np.random.default_rng(1).standard_normal(q.shape) * scales(chain)
    return q, f, direct(chain, mass_of(chain), f - elastic(chain, q))


# --- one element -------------------------------------------------------------------------------------------


def one_element(kind, slenderness):
    body = Beam("b", (0.0, 0.0), (slenderness * HEIGHT, 0.0), SQUARE, SOFT)
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
    U, T = weld_transfer(3, 0.6, 0.8)
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


# --- chains ------------------------------------------------------------------------------------------------


def readable_and_compiled(chain, q, f):
    yield solve(mass_factors(chain), f - elastic(chain, q))
    yield real(accelerations_riccati(row_of(chain, q, f)))
    if chain.split:
        yield by_split(chain, q, f)


@every_layout
@every_support
@every_kind
def test_every_road_to_the_accelerations_is_the_direct_solve(kind, start, end, layout):
    for mesh in (1, 2, 5):
        chain = chain_of(row_scene(start, LAYOUTS[layout], end), mesh=mesh, element=kind)
        if Joined(chain).size == 0:  # one element, clamped at both ends
            assert not solve(mass_factors(chain), np.ones((chain.bodies.rows, 2))).any()
            continue
        q, f, exact = problem(chain)
        for a in readable_and_compiled(chain, q, f):
            assert error(chain, a, exact) < 1e-12


@every_kind
@pytest.mark.parametrize(("start", "end"), [("clamp", "free"), ("free", "clamp"), ("clamp", "clamp")])
def test_ends_with_known_accelerations(kind, start, end):
    """A driven clamp at either end or both: what it brings to the others is −M times its acceleration."""
    chain = chain_of(row_scene(start, [("pin", 0.5)], end), mesh=2, element=kind)
    q, f, _ = problem(chain)
    known = np.random.default_rng(3).standard_normal(q.shape) / scales(chain) * 100.0
    known[:, 1:-1] = 0.0
    known[~chain.prescribed] = 0.0
    mass = mass_of(chain)
    inertia = (mass @ known.ravel()).reshape(q.shape)
    exact = known + direct(chain, mass, f - elastic(chain, q) - inertia)
    for accelerations in (accelerations_riccati, accelerations_plain):
        assert error(chain, real(accelerations(row_of(chain, q, f, known))), exact) < 1e-9


@every_kind
@pytest.mark.parametrize(("start", "end"), [("free", "pin"), ("pin", "clamp"), ("clamp", "free")])
def test_recursion_is_the_direct_solve_up_to_ten_thousand_elements(kind, start, end):
    for mesh in (50, 500, 5000):
        scene = row_scene(start, [("pin", 0.5)], end, lengths=[0.05 * mesh] * 2)
        chain = chain_of(scene, mesh=mesh, element=kind)
        q, f, exact = problem(chain)
        roads = readable_and_compiled(chain, q, f) if mesh < 5000 else (by_split(chain, q, f),)
        for a in roads:
            assert error(chain, a, exact) < 1e-12


@every_kind
def test_recursion_is_the_direct_solve_for_ten_thousand_tiny_elements(kind):
    """A body of 0.3 m in elements of 60 µm: the same numbers, measured by the lever arms of the gradients."""
    chain = chain_of(row_scene("pin", [("weld", 1.0)], "free"), mesh=5000, element=kind)
    f = np.random.default_rng(1).standard_normal((chain.bodies.rows, chain.bodies.nodes)) * scales(chain)
    assert error(chain, solve(mass_factors(chain), f), direct(chain, mass_of(chain), f)) < 1e-12


def test_readable_recursion_takes_ten_thousand_elements():
    """Its elastic forces are summed element by element: 500 m away from the origin their last digits count."""
    scene = row_scene("pin", [("pin", 0.5)], "free", lengths=[250.0] * 2)
    chain = chain_of(scene, mesh=5000, element="shear")
    q, f, _ = problem(chain)
    load = f.copy()
    for mesh, i in elements_of(chain):
        load[:, i : i + 2] -= mesh.element.force(q[:, i : i + 2].T.reshape(6, 2)).reshape(2, 6).T
    exact = direct(chain, mass_of(chain), load)
    assert error(chain, real(accelerations_riccati(row_of(chain, q, f))), exact) < 1e-12


@pytest.mark.slow  # kernels of both elements
@every_layout
def test_mixed_elements_and_several_chains(layout):
    """Cables in a chain of shear elements, and a second chain that nothing joins to the first."""
    scene = row_scene("pin", LAYOUTS[layout], "free")
    kinds, kind = {}, "shear"
    for body, link in zip(scene.bodies, [*LAYOUTS[layout], ("weld", 0)], strict=True):
        kinds[body.name] = kind
        kind = kind if link[0] == "weld" else {"cable": "shear", "shear": "cable"}[kind]
    free = Beam("free", (0.0, 5.0), (0.0, 6.0), SQUARE, SOFT)
    scene = Scene("two", [*scene.bodies, free], scene.joints)
    chain = chain_of(scene, mesh=3, element={**kinds, "free": "cable"})
    q, f, exact = problem(chain)
    load = f - elastic(chain, q)
    known = chain.prescribed
    for a in (solve(mass_factors(chain), load), *([by_split(chain, q, f)] if chain.split else [])):
        assert error(chain, np.where(known, 0.0, a), exact) < 1e-12
    with pytest.raises(SolverError, match="several chains"):
        row_of(chain, q, f)


@every_kind
@every_support
def test_recursion_solves_newtons_matrix(kind, start, end):
    """mass · M + K_T at a bent shape, positive definite by its mass, through a pin and an angled weld."""
    chain = chain_of(row_scene(start, [("pin", 0.5), ("weld", 1.0)], end), mesh=20, element=kind)
    bodies, q = chain.bodies, deformed(chain, 0.02)
    factors, none = block_factors(chain), np.empty((0, 2))
    loads = no_loads(chain.bodies)
    weight = 1e7
    pivots = factorize(q, bodies.tables(), links(chain), weight, 1.0, loads, none, factors)
    f = np.random.default_rng(1).standard_normal(q.shape) * scales(chain)
    exact = direct(chain, weight * mass_of(chain) + stiffness_of(chain, q), f)
    assert pivots == 0
    assert error(chain, solve(factors, f), exact) < 1e-11


@pytest.mark.slow  # kernels whose factors are rounded
@pytest.mark.parametrize("kind", interpreted_where(lambda kind: kind == "shear", KINDS))
def test_factors_in_single_precision_are_those_in_double_rounded(kind):
    """And both sweeps read them as they are: the same solution as with the rounded numbers in double precision."""
    chain = chain_of(row_scene("clamp", [("pin", 0.5), ("weld", 1.0)], "free"), mesh=20, element=kind)
    bodies, q = chain.bodies, deformed(chain, 0.02)
    loads = no_loads(chain.bodies)
    exact, single, rounded = (block_factors(chain, s) for s in (False, True, False))
    for factors in (exact, single):
        factorize(q, bodies.tables(), links(chain), 1e7, 1.0, loads, np.empty((0, 2)), factors)
    size = exact.G.shape[1]
    assert single.L.dtype == single.G.dtype == np.float32
    assert_array_equal(single.L, exact.L.astype(np.float32))
    assert_array_equal(single.G[:, :size], exact.G.astype(np.float32))
    rounded.L[:], rounded.G[:] = single.L, single.G[:, :size]
    f = np.random.default_rng(1).standard_normal(q.shape) * scales(chain)
    assert_array_equal(solve(single, f), solve(rounded, f))
    assert 1e-9 < error(chain, solve(single, f), solve(exact, f)) < 1e-4


def read(array, row, wide, place, out):
    numbers, i = in_double(array, row, wide, place)
    for k in range(len(out)):
        out[k] = numbers[i, k]


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("reader", [read, kernel(read)], ids=["readable", "compiled"])
def test_rows_are_read_in_double_precision(kind, reader):
    """Those that have it already are not copied."""
    matrix = np.random.default_rng(2).standard_normal((5, 12)).astype(kind)
    wide, out = np.zeros((2, 16)), np.zeros(12)
    reader(matrix, 3, wide, 1, out)
    assert_array_equal(out, matrix[3])
    copied = np.zeros((2, 16))
    if kind is np.float32:
        copied[1, :12] = out
    assert_array_equal(wide, copied)


@pytest.mark.parametrize("kinds", list(itertools.product(KINDS, KINDS)), ids="-".join)
def test_recursion_solves_newtons_matrix_with_torques(kinds):
    """Torques on both sides of a pin and at both ends, on any mixture of elements."""
    loads = [Torque(end, 40.0 * 2**i) for i, end in enumerate(("b0.start", "b0.end", "b1.start", "b1.end"))]
    scene = row_scene("pin", [("pin", 0.5)], "free", loads=loads)
    chain = chain_of(scene, mesh=3, element=dict(zip(("b0", "b1"), kinds, strict=True)))
    bodies, q, weight = chain.bodies, deformed(chain, 0.02), 1e7
    actuation, factors = Actuation(scene, bodies), block_factors(chain)
    values = actuation.load_table(np.zeros(1))[0]
    factorize(q, bodies.tables(), links(chain), weight, 1.0, actuation.loads(), values, factors)
    f = np.random.default_rng(1).standard_normal(q.shape) * scales(chain)
    matrix = weight * mass_of(chain) + stiffness_of(chain, q) + torque_stiffness(chain, q)
    exact = direct(chain, matrix, f)
    assert error(chain, np.where(chain.prescribed, 0.0, solve(factors, f)), exact) < 1e-11


def test_factorization_counts_the_negative_pivots():
    """K_T of a free body at rest has three zero modes; with a negative mass nothing is positive."""
    chain = chain_of(row_scene("free", [], "free"), mesh=2)
    bodies, factors = chain.bodies, block_factors(chain)
    loads = no_loads(chain.bodies)
    for mass, negative in ((1.0, 0), (-1.0, 12)):
        arguments = (bodies.reference(), bodies.tables(), links(chain), mass, 0.0, loads, np.empty((0, 2)))
        assert factorize(*arguments, factors) == negative


def plain_error(kind, elements):
    chain = chain_of(row_scene("clamp", [], "free", lengths=[0.1 * elements]), mesh=elements, element=kind)
    q, f, exact = problem(chain)
    return error(chain, real(accelerations_plain(row_of(chain, q, f))), exact)


@every_kind
def test_plain_product_equals_riccati_up_to_four_elements_and_loses_its_digits_beyond(kind):
    errors = np.array([plain_error(kind, n) for n in range(1, 10)])
    assert errors[:4].max() < 1e-8
    assert errors[8] > 0.05  # nothing left
    growth = (errors[7] / errors[2]) ** (1 / 5)
    assert 30.0 < growth < 150.0


@every_layout
@every_kind
def test_plain_product_passes_joints(kind, layout):
    for start, end in itertools.product(SUPPORTS, SUPPORTS):
        chain = chain_of(row_scene(start, LAYOUTS[layout], end), mesh=1, element=kind)
        if len(LAYOUTS[layout]) > 2 or Joined(chain).size == 0:
            continue
        q, f, exact = problem(chain)
        assert error(chain, real(accelerations_plain(row_of(chain, q, f))), exact) < 1e-9


def test_readable_form_refuses_mixed_elements():
    chain = chain_of(row_scene("pin", [("pin", 0.5)], "free"), element={"b0": "cable", "b1": "shear"})
    q = chain.bodies.reference()
    with pytest.raises(SolverError, match="mixes cable and shear"):
        row_of(chain, q, q)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_weld_of_different_elements_is_refused(integrator):
    scene = row_scene("pin", [("weld", 0.0)], "free")
    assert isinstance(scene.joints[1], Weld)
    with pytest.raises(DiscretisationError, match=r"'cable' of 'b0', 'shear' of 'b1'; a weld needs one kind"):
        chain_of(scene, element={"b0": "cable", "b1": "shear"}, integrator=integrator)
