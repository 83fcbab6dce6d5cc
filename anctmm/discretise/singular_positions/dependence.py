"""Whether linear equations depend on each other, without a dense matrix.

How they depend on each other takes a singular value decomposition, whose work grows with the cube of their number: a
row of 1,000 four-bars has 4,002 equations. Most scenes have none that do, which a sparse factorization tells.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Singular value, of the largest, that counts as none.
NONE = 1e-9
#: Smallest eigenvalue of J Jᵀ, of the largest, above which no equation depends on others. Rounding makes 1e-16 of none.
CLEAR = 1e-12


def self_stresses(J: "scipy.sparse.csr_array") -> tuple[Array, Array]:
    """States of self-stress λ, λᵀJ = 0, and motions u, J u = 0.

    Parameters
    ----------
    J : csr_array, shape (equations, unknowns)
        With entries of like sizes.

    Returns
    -------
    stresses : ndarray, shape (k, equations)
        Orthonormal; none where no equation depends on others.
    motions : ndarray, shape (r, unknowns)
        Orthonormal; not computed, and none, where there is no stress.
    """
    if independent(J):
        return np.empty((0, J.shape[0])), np.empty((0, J.shape[1]))
    left, sizes, right = np.linalg.svd(J.toarray())
    rank = int((sizes > NONE * sizes[0]).sum())
    return left[:, rank:].T, right[rank:]


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
