"""Whether linear equations depend on each other, without a dense matrix.

How they depend on each other takes a singular value decomposition, whose work grows with the cube of their number: a
row of 1,000 four-bars has 4,002 equations. Most scenes have none that do, which a sparse factorization tells.
"""

import scipy

#: Smallest eigenvalue of J Jᵀ, of the largest, above which no equation depends on others. Rounding makes 1e-16 of none.
CLEAR = 1e-12


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
