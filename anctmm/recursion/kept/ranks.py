"""How many constraints of a scene are independent: others repeat them, as of a third parallel crank."""

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.recursion.kept.rows import Rows

Array = NDArray[np.float64]

#: Part of the largest singular value of constraints, each of length 1, below which one repeats others.
REPEATED = 1e-8


def independent(rows: Rows, q: Array, joined: "scipy.sparse.csr_array") -> int:
    """Rank of the Jacobian of the constraints at coordinates q.

    Parameters
    ----------
    rows : Rows
        With the signals of the time.
    q : ndarray, shape (rows, nodes)
    joined : csr_array, shape (rows · nodes, size)
        Unknowns of all nodes from the independent ones.

    Returns
    -------
    int
        Constraints that share no unknown are looked at apart, as the work grows with the cube of their number.
    """
    J = scipy.sparse.csr_array(jacobian(rows, q) @ joined)
    touching = scipy.sparse.csr_array((np.ones_like(J.data), J.indices, J.indptr), shape=J.shape)
    count, part = scipy.sparse.csgraph.connected_components(touching @ touching.T, directed=False)
    return sum(_rank(J[np.flatnonzero(part == k)]) for k in range(count))


def jacobian(rows: Rows, q: Array) -> "scipy.sparse.csr_array":
    """Derivative of the constraints, metres, by the coordinates in units of the sizes of the unknowns, 1 m or 1 rad."""
    n = len(rows.lengths)
    x = np.append(q[rows.homes[0, :n], rows.homes[1, :n]], 1.0)
    weight = rows.factor * rows.signals[0, rows.signal]
    entries = [
        (rows.row[there], own[there], (weight * x[other])[there])
        for own, other in ((rows.one, rows.two), (rows.two, rows.one))
        for there in [own < n]
    ]
    row, column, value = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    place = rows.homes[0, column] * q.shape[1] + rows.homes[1, column]
    shape = (len(rows.number), q.size)
    return scipy.sparse.csr_array((value / rows.lengths[column], (row, place)), shape=shape)


def _rank(J: "scipy.sparse.csr_array") -> int:
    """Of a few rows, whatever their sizes."""
    used = np.unique(J.indices)
    dense = J[:, used].toarray()
    sizes = np.linalg.norm(dense, axis=1, keepdims=True)
    if not sizes.any():
        return 0
    values = np.linalg.svd(dense / np.where(sizes > 0.0, sizes, 1.0), compute_uv=False)
    return int((values > REPEATED * values[0]).sum())
