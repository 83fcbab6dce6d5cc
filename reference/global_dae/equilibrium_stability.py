"""Stability of an equilibrium: the inertia of K_T on the null space of the constraints, from a global matrix.

Nothing is shared with the recursion of ANC-TMM: the tangent is assembled, projected by Z with Φ Z = 0, and its
eigenvalues are counted by LAPACK or, for a large one, by the signs of the pivots of a symmetric sparse factorisation.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse.linalg import splu

from reference.global_dae.lu import solved
from reference.global_dae.model import Matrix, Model
from reference.global_dae.stability import DENSE, null_space, tangent

Array = NDArray[np.float64]

#: Relative change of coordinates, a few roundings, and that of a solve's answer which shows a singular matrix.
ROUNDING, SINGULAR, TRIALS = 4.0 * float(np.finfo(float).eps), 0.5, 4
#: Free coordinates above which rounding hides what is singular.
MANY = 4_000


@dataclass(frozen=True)
class Verdict:
    """Stability of an equilibrium: kind, number of negative eigenvalues, node that moves most (−1: not known)."""

    kind: Literal["stable", "unstable", "singular", "unknown"]
    negative: int = 0
    node: int = -1


def verdict(model: Model, q: Array, factor: float) -> Verdict:
    """Stability of an equilibrium q, (rows, nodes), under a part of the load."""
    Z = null_space(model)
    if Z.shape[1] == 0:
        return Verdict("stable")
    A = _projected(model, Z, q, factor)
    if A.shape[0] <= MANY and _singular(model, Z, A, q, factor):
        return Verdict("singular", node=_most_moved(model, Z, A))
    negative = _negative(A)
    if negative is None:
        return Verdict("unknown")
    if negative == 0:
        return Verdict("stable")
    return Verdict("unstable", negative, _most_moved(model, Z, A))


def _projected(model: Model, Z: Matrix, q: Array, factor: float) -> Matrix:
    A = Matrix(Z.T @ tangent(model, q, factor) @ Z)
    return Matrix(0.5 * (A + A.T))


def _singular(model: Model, Z: Matrix, A: Matrix, q: Array, factor: float) -> bool:
    """Whether a solve changes as a whole when coordinates change by a few roundings."""
    rng = np.random.default_rng(1)
    right = rng.standard_normal(A.shape[0])
    first = solved(A, right)
    for _ in range(TRIALS):
        moved = q * (1.0 + ROUNDING * rng.uniform(-1.0, 1.0, q.shape))
        other = solved(_projected(model, Z, moved, factor), right)
        if first is None or other is None:
            return True
        if np.linalg.norm(other - first) >= SINGULAR * max(np.linalg.norm(first), np.linalg.norm(other)):
            return True
    return False


def _negative(A: Matrix) -> int | None:
    """Number of negative eigenvalues; None where the factorisation cannot keep the matrix symmetric."""
    if A.shape[0] <= DENSE:
        # without this scale, stretch would hide the bending of slender beams
        diagonal = np.abs(A.diagonal())
        scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        return int((eigh(scale[:, None] * A.toarray() * scale, eigvals_only=True) < 0.0).sum())
    for order in ("MMD_AT_PLUS_A", "NATURAL"):
        try:
            lu = splu(A, permc_spec=order, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError:  # a pivot of zero in this order
            continue
        if np.array_equal(lu.perm_r, lu.perm_c):
            return int((lu.U.diagonal() < 0.0).sum())
    return None


def _most_moved(model: Model, Z: Matrix, A: Matrix) -> int:
    """Node with the largest part in the lowest mode; −1 of a large matrix."""
    if A.shape[0] > DENSE:
        return -1
    M = Matrix(Z.T @ model.mass @ Z)
    mode = Z @ eigh(A.toarray(), M.toarray(), subset_by_index=[0, 0])[1][:, 0]
    x = np.zeros(model.size)
    x[model.places(1).reshape(-1)[: model.dofs]] = mode
    moved = np.abs(x.reshape(model.bodies.rows, -1))
    return int(np.maximum(moved[:2].max(axis=0) / model.length, moved[2:].max(axis=0)).argmax())
