"""The matrix of the unknowns as one of SciPy, for what is done once."""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.system.system import System

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def coordinates_of(system: System) -> Ints:
    """Places of all unknown coordinates, without multipliers and padding."""
    count = system.numbering.blocks * system.mesh.rows
    left = np.ones(count, dtype=bool)
    left[system.numbering.padding] = False
    left[system.numbering.multiplier] = False
    return np.flatnonzero(left)


def assembled(system: System) -> sparse.csc_array:
    """The symmetric matrix that `set_matrix` has left in the blocks, (unknowns, unknowns), multipliers included."""
    matrix, size = system.tables.matrix, system.mesh.rows
    blocks = len(matrix.plan.start) - 1
    column = np.concatenate([np.arange(blocks), np.repeat(np.arange(blocks), np.diff(matrix.plan.start))])
    row = np.concatenate([np.arange(blocks), matrix.plan.row])
    inner, outer = np.indices((size, size))
    i = row[:, None, None] * size + inner
    j = column[:, None, None] * size + outer
    lower = np.where((i >= j), matrix.values, 0.0).ravel()
    n = blocks * size
    found = sparse.coo_array((lower, (i.ravel(), j.ravel())), shape=(n, n)).tocsc()
    found.eliminate_zeros()
    return sparse.csc_array(found + sparse.tril(found, -1).T)
