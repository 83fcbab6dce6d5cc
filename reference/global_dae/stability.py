"""Stability limit of the explicit integrator, from sparse K and M on the null space of the constraints."""

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from anctmm.discretise.assembly import Bodies
from anctmm.elements.tangent_blocks import TANGENT_BUFFER
from anctmm.errors import StabilityError
from reference.global_dae.assemble import assemble, matrix_of, system_of
from reference.global_dae.loads import load_table
from reference.global_dae.model import Matrix, Model

Array = NDArray[np.float64]

#: Coordinates up to which the dense eigenvalue solver is used.
DENSE = 400


def stiffness(model: Model, bodies: Bodies | None = None) -> Matrix:
    """K_T of the undeformed scene without torques, (dofs, dofs); with other bodies of the same nodes, theirs."""
    return tangent(model, model.bodies.reference(), 0.0, bodies)


def tangent(model: Model, q: Array, factor: float, bodies: Bodies | None = None) -> Matrix:
    """K_T at coordinates q, (rows, nodes), with that of a part of the torques of t = 0, (dofs, dofs)."""
    constants = (bodies or model.bodies).constants
    system = system_of(model, 1.0)
    rows, data = 2 * model.bodies.rows, np.zeros(len(system.row) + 1)
    loads = factor * load_table(model.scene, np.zeros(1))[0]
    scratch = np.zeros(TANGENT_BUFFER), np.zeros((rows, rows))
    assemble(system, 0.0, model.parts._replace(constants=constants), model.loads, loads, q, *scratch, data)
    return Matrix(matrix_of(system, data)[: model.dofs, : model.dofs])


def null_space(model: Model) -> Matrix:
    """Z with Φ Z = 0, (dofs, free coordinates): of vectors that rows connect, all follow from the first, or none moves.

    A row holds a vector g_B = e^{iΔ} g_A, or a single one that is fixed; rows close no circles.
    """
    linked: dict[int, list[tuple[int, complex]]] = {}
    fixed = set()
    for row in model.joints:
        at = [int(model.numbers[term.vector, term.node]) for term in row.terms]
        if len(at) == 1:
            fixed.add(at[0])
            continue
        ratio = -row.terms[0].factor / row.terms[1].factor
        linked.setdefault(at[0], []).append((at[1], ratio))
        linked.setdefault(at[1], []).append((at[0], 1.0 / ratio))
    seen = np.zeros(model.vectors, dtype=bool)
    entries: list[tuple[int, int, complex]] = []
    free = 0
    for first in range(model.vectors):
        if seen[first]:
            continue
        group = {first: 1.0 + 0.0j}
        queue = [first]
        for here in queue:  # it grows meanwhile
            for there, ratio in linked.get(here, ()):
                if there not in group:
                    group[there] = ratio * group[here]
                    queue.append(there)
        seen[queue] = True
        if fixed.isdisjoint(queue):
            entries.extend((vector, free, factor) for vector, factor in group.items())
            free += 1
    rows, columns, factors = zip(*entries, strict=True) if entries else ((), (), ())
    where = np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)
    Z = sparse.csc_array((np.array(factors, dtype=complex), where), shape=(model.vectors, free))
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    return Matrix(sparse.kron(Z.real, np.eye(2)) + sparse.kron(Z.imag, turn))


def highest_frequency(model: Model, bodies: Bodies | None = None) -> float:
    """Largest angular frequency of the undeformed scene with its joints, rad/s; 0 if nothing is free.

    With other bodies of the same nodes, their stiffness is taken.
    """
    Z = null_space(model)
    K, M = Matrix(Z.T @ stiffness(model, bodies) @ Z), Matrix(Z.T @ model.mass @ Z)
    n = K.shape[0]
    if n == 0:
        return 0.0
    if n <= DENSE:
        largest = eigh(K.toarray(), M.toarray(), eigvals_only=True, subset_by_index=[n - 1, n - 1])[0]
    else:
        inverse = LinearOperator((n, n), matvec=splu(M).solve, dtype=float)
        start = np.random.default_rng(0).standard_normal(n)
        largest = eigsh(K, 1, M, Minv=inverse, v0=start, tol=1e-8, return_eigenvectors=False)[0]
    return sqrt(max(float(largest), 0.0))


def limit(psi: float, phi: float) -> float:
    """Largest stable h ω of Zhai's integrator without damping: √(2/ψ) for ψ = φ ≥ ½; 0 for others: refused."""
    return sqrt(2.0 / psi) if psi == phi and psi >= 0.5 else 0.0


def check_step(model: Model) -> None:
    """Refuse a step above the stability limit.

    Raises
    ------
    StabilityError
        Naming the step and the largest one allowed.
    """
    run = model.run
    allowed = limit(run.psi, run.phi)
    if allowed == 0.0:
        raise StabilityError(
            f"psi is {run.psi!r} and phi is {run.phi!r}; psi = phi >= 0.5 is needed; other pairs are unstable "
            f"at any step or have no larger stable step (check_stability=False runs it all the same)"
        )
    frequency = highest_frequency(model)
    largest = allowed / frequency if frequency > 0.0 else inf
    if model.bodies.damping is not None:
        # an oscillation about rest changes sign in a step at ½ψ(hω)² + (½ + φ)hc = 1, c the highest rate of damping
        viscous = model.bodies.stiffened(model.bodies.damping)
        rate = (0.5 + run.phi) * highest_frequency(model, viscous) ** 2
        sum_of_both = rate + sqrt(rate * rate + 2.0 * run.psi * frequency**2)
        largest = 2.0 / sum_of_both if sum_of_both > 0.0 else inf
    if run.dt > largest * (1.0 + 1e-9):
        raise StabilityError(
            f"dt is {run.dt!r} s; at most {largest:.6g} s is stable, for the highest frequency of scene "
            f"{model.scene.name!r} as discretised is {frequency:.6g} rad/s (check_stability=False runs it all the same)"
        )
