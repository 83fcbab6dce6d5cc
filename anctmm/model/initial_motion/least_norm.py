"""Least-norm solution of many sparse linear equations, of which some may follow from others."""

from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Equations from which on this is quicker than dense matrices, as measured.
MANY = 60
#: Regularisation of the equations, whose rows have the length 1. Rounding makes 1e-16 of it, over this, a step's error.
REGULARISED = 1e-10
#: Steps, at most; one leaves REGULARISED / (σ² + REGULARISED) of what a singular value σ takes part in.
STEPS = 40
#: Part of the largest terms of an equation that rounding leaves.
ROUNDING = 1e-15
#: Change of what is left of the equations, of itself, from which on it is known.
SETTLED = 1e-5


class LeastNorm(NamedTuple):
    """A solution x, and what it leaves of the equations: right − A x."""

    x: Array
    left: Array


def least_norm(
    mass: "scipy.sparse.csc_array", A: "scipy.sparse.csr_array", right: Array, *, scaled: bool = True
) -> LeastNorm | None:
    """The least xᵀ mass x of those x for which |right − A x| is the least.

    Each step solves the equations of the last one's remainders, regularised: ::

        [mass   Aᵀ ] [ d]   [Aᵀ λ − mass x]
        [A    −δ W ] [-l] = [ right − A x ],   x ← x + d,  λ ← λ + l

    This is the method of multipliers, or iterated Tikhonov regularisation (Björck, Numerical Methods for Least Squares
    Problems, 1996, 4.5): equations may depend on each other, and x stays in the range of mass⁻¹ Aᵀ. The matrix is
    quasi-definite and so has factors in any order (Vanderbei, SIAM J. Optim. 5, 1995, 100-113).

    Parameters
    ----------
    mass : csc_array, shape (n, n)
        Symmetric and positive definite.
    A : csr_array, shape (m, n)
    right : ndarray, shape (m,)
    scaled : bool
        Whether rows of A are scaled to like lengths. It matters where no x satisfies all equations: then those count
        by these lengths.

    Returns
    -------
    LeastNorm or None
        None where steps do not settle: equations that nearly depend on others, which a dense decomposition may tell.
    """
    unit = 1.0 / np.sqrt(mass.diagonal())
    A = scipy.sparse.csr_array(A @ scipy.sparse.diags_array(unit))
    lengths = np.sqrt(np.asarray(A.multiply(A).sum(axis=1)).ravel())
    rows = 1.0 / np.where(lengths > 0.0, lengths, 1.0) if scaled else np.ones(len(right)) / lengths.max()
    A, wanted = scipy.sparse.csr_array(scipy.sparse.diags_array(rows) @ A), rows * right
    M = scipy.sparse.csr_array(scipy.sparse.diags_array(unit) @ mass @ scipy.sparse.diags_array(unit))
    factors, T, size = _factors(M, A), scipy.sparse.csr_array(A.T), abs(A)
    n = A.shape[1]
    x, multipliers, unbalanced, left = np.zeros(n), np.zeros(len(right)), np.zeros(n), wanted
    for _ in range(STEPS):
        step = factors.solve(np.concatenate([unbalanced, left]))
        x, multipliers, before = x + step[:n], multipliers - step[n:], left
        unbalanced, left = T @ multipliers - M @ x, wanted - A @ x
        kept = _rounded(left, size @ abs(x) + abs(wanted))
        if kept and _rounded(unbalanced, size.T @ abs(multipliers) + abs(x)):
            return LeastNorm(unit * x, left / rows)
        if not kept and _settled(left, before):
            return LeastNorm(unit * x, left / rows)
    return None


def _rounded(remainder: Array, terms: Array) -> bool:
    """Whether a remainder is what rounding leaves of terms."""
    return bool(np.abs(remainder).max() <= ROUNDING * terms.max())


def _settled(left: Array, before: Array) -> bool:
    return bool(np.abs(left - before).max() <= SETTLED * np.abs(left).max())


def _factors(M: "scipy.sparse.csr_array", A: "scipy.sparse.csr_array") -> "scipy.sparse.linalg.SuperLU":
    regularised = scipy.sparse.diags_array(np.full(A.shape[0], -REGULARISED))
    blocks: list[list[Any]] = [[M, A.T], [A, regularised]]
    whole = scipy.sparse.csc_array(scipy.sparse.block_array(blocks))
    return scipy.sparse.linalg.splu(
        whole, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
