"""Whether linear equations depend on each other, and whether that blocks a motion, without a dense matrix.

A singular value decomposition tells it best, but its work grows with the cube of the equations' number: 650 cranks
side by side on one coupler have 2,600. Sparse factors tell as much, except of equations that nearly depend on each
other.
"""

from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Singular value, of the largest, that counts as none.
NONE = 1e-9
#: Smallest eigenvalue of J Jᵀ, of the largest, above which no equation depends on others. Rounding makes 1e-16 of none.
CLEAR = 1e-12
#: Of a self-stress of size 1, and of motions whose parts are of this size on average: what counts as parting.
PARTING = 1e-6
#: Motions that are tried: one that happens to be free, where others are blocked, decides nothing.
MOTIONS = 8
#: Equations up to which a decomposition is quicker, as measured.
FEW = 100
#: Steps that settle where no singular value is near to `NONE`, and the change that counts as none.
STEPS, SETTLED = 8, 1e-8


def stress_of(
    J: "scipy.sparse.csr_array", curved: Callable[[Array], Array], most: float = np.inf
) -> Array | None:
    """Stress λ of size 1 of equations that block motions, or None; parameters as of `blocking_stress`."""
    return None if independent(J) else blocking_stress(J, curved, most)


def blocking_stress(
    J: "scipy.sparse.csr_array", curved: Callable[[Array], Array], most: float = np.inf
) -> Array | None:
    """State of self-stress λ, λᵀJ = 0, that blocks motions u, J u = 0, in second order.

    A motion goes on if J ü = −J'(u, u) has a solution ü. What no ü takes away of J'(u, u) is its projection on the
    states of self-stress; it is computed for motions that are drawn at random, always the same ones. As it is quadratic
    in u, it vanishes for all motions if it does for these (with probability 1).

    Parameters
    ----------
    J : csr_array, shape (equations, unknowns)
        With entries of like sizes.
    curved : callable
        J'(u, u), (equations, k), of motions u, (unknowns, k).
    most : float
        Equations up to which a singular value decomposition decides where sparse factors cannot; of more, nothing is
        known then.

    Returns
    -------
    ndarray, shape (equations,), or None
        Of size 1, where motions are blocked.
    """
    draws = np.random.default_rng(0).standard_normal((J.shape[1], MOTIONS))
    stresses = _by_factors(J, draws, curved) if J.shape[0] > FEW else None
    if stresses is None and J.shape[0] <= most:
        stresses = _by_decomposition(J, draws, curved)
    if stresses is None:
        return None
    sizes = np.linalg.norm(stresses, axis=0)
    worst = int(np.argmax(sizes))
    return stresses[:, worst] / sizes[worst] if sizes.mean() > PARTING else None


def _by_decomposition(J: "scipy.sparse.csr_array", draws: Array, curved: Callable[[Array], Array]) -> Array:
    """What no ü takes away of J'(u, u), of the motions that are nearest to the ones drawn."""
    left, sizes, right = np.linalg.svd(J.toarray())
    rank = int((sizes > NONE * sizes[0]).sum())
    stresses, motions = left[:, rank:], right[rank:]
    return np.asarray(stresses @ (stresses.T @ curved(motions.T @ (motions @ draws))))


def _by_factors(J: "scipy.sparse.csr_array", draws: Array, curved: Callable[[Array], Array]) -> Array | None:
    """The same by sparse factors; None where a singular value is too near to `NONE` for them.

    With B = J / ‖J‖ and ν = `NONE`, the equations of least squares that are regularised, ::

        [ν   Bᵀ] [d]   [0]
        [B  −ν ] [y] = [b],   d = Bᵀ (B Bᵀ + ν²)⁻¹ b

    have a condition of 1/ν (Björck, Numerical Methods for Least Squares Problems, 1996, 2.5.3); B Bᵀ + ν² would have
    that of its square, which rounding hides. u ← u − d(B u) leaves ν² / (σ² + ν²) of what a singular value σ takes part
    in, and so does c ← c − B d(c): repeated, they project on motions and on states of self-stress.
    """
    size = np.sqrt(scipy.sparse.linalg.norm(J, 1) * scipy.sparse.linalg.norm(J, np.inf))
    B, (count, unknowns) = J / size, J.shape
    one, two = (scipy.sparse.diags_array(np.full(k, NONE)) for k in (unknowns, count))
    whole = scipy.sparse.csc_array(scipy.sparse.block_array([[one, B.T], [B, -two]]))
    factors = scipy.sparse.linalg.splu(whole)  # with pivots from all rows: NONE alone is too small for one

    def nearest(b: Array) -> Array:
        return np.asarray(factors.solve(np.concatenate([np.zeros((unknowns, b.shape[1])), b]))[:unknowns])

    motions = settled(lambda u: nearest(B @ u), draws)
    return None if motions is None else settled(lambda c: B @ nearest(c), curved(motions))


def settled(part: Callable[[Array], Array], x: Array) -> Array | None:
    """What is left of x if the same part of it is taken away again and again; None if there is no end of it."""
    size = float(np.abs(x).max())
    for _ in range(STEPS):
        taken = part(x)
        x = x - taken
        if np.abs(taken).max() <= SETTLED * size:
            return x
    return None


def independent(J: "scipy.sparse.csr_array") -> bool:
    """Whether no equation of J u = 0 depends on others, by far.

    Parameters
    ----------
    J : csr_array, shape (equations, unknowns)
        With entries of like sizes.

    Returns
    -------
    bool
        False also where J Jᵀ is too near to singular to tell: a singular value decomposition of J can tell more.
    """
    count, unknowns = J.shape
    if count > unknowns:
        return False
    S = (J @ J.T).tocsc()
    try:
        factors = scipy.sparse.linalg.splu(
            S, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:  # a pivot of zero
        return False
    inverse = scipy.sparse.linalg.LinearOperator(
        S.shape, matvec=factors.solve, rmatvec=factors.solve, dtype=float
    )
    least = 1.0 / float(scipy.sparse.linalg.onenormest(inverse)) if count > 1 else float(abs(S[0, 0]))
    return least > CLEAR * float(scipy.sparse.linalg.norm(S, 1))
