"""Work space of the recursion in full blocks: matrices and vectors of one node, and their offsets.

They are parts of one array, one after another: of several arrays the compiler does not know that they do not overlap.
The size d of the blocks is the length of a tuple, `size`, and thus a part of its type: the offsets are constants in
machine code.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.jit.compiling import inlined

Array = NDArray[np.float64]


def new_scratch(rows: int) -> Array:
    """Room for the matrices and vectors of a node with so many components."""
    return np.zeros(4 * rows * rows + 4 * rows)


@inlined
def matrices(size):  # type: ignore[no-untyped-def]
    """Where the matrices begin, (d, d) each, row by row.

    What has arrived at the node, D; its own, which becomes −G; what couples it with the next node, K_OI; L. Of the
    first two, which are symmetric, the lower triangle counts.
    """
    square = len(size) * len(size)
    return 0, square, 2 * square, 3 * square


@inlined
def vectors(size):  # type: ignore[no-untyped-def]
    """Where the vectors begin, (d,) each.

    Loads of the node; what comes from the node inboard; the unknowns; those of the node outboard. In a factorization,
    which has no vectors, the first three hold columns of matrices.
    """
    d = len(size)
    first = 4 * d * d
    return first, first + d, first + 2 * d, first + 3 * d
