"""The matrix of Newton's method and of accelerations, and how kernels add to it; codes are those of `Numbering.codes`.

Blocks lie one after another, so that entry (k, m) of the matrix of a pair is size k + m behind its first one.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.options import inlined, kernel, part
from anctmm.system.rows import Rows

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@inlined
def add(flat, size, code, k, m, x):  # type: ignore[no-untyped-def]
    """Add x to row k, column m of the matrix of a pair of vectors; flat: all blocks, of `size` rows."""
    if code >= 0:
        at, stand = code >> 2, code & 3
        if stand != 1:
            flat[at + size * k + m] += x
        if stand != 0:
            flat[at + size * m + k] += x


@part
def add_rows(rows: Rows, flat: Array, size: int, mass: float, stiffness: float, signals: Array) -> None:
    """Add J, the curvature Σ λ ∇²g and the regularisation −δ to the matrix mass · M + stiffness · K."""
    dim = rows.J.shape[1]
    for e in range(len(rows.entries)):
        code = rows.codes[e]
        if code >= 0:
            step = 1 if code & 3 == 0 else size
            for k in range(dim):
                flat[(code >> 2) + step * k] += rows.J[e, k]
    for t in range(len(rows.pairs)):
        factor = stiffness * rows.multiplier[rows.pairs[t, 0]] * signals[rows.pairs[t, 5], 0]
        for k in range(dim):
            for m in range(dim):
                add(flat, size, rows.curvature[t], k, m, factor * rows.C[t, k, m])
    for r in range(len(rows.at)):
        at = rows.at[r]
        flat[at * size + at % size] -= rows.compliance[r] / mass
        rows.weight[r] = rows.stiff[r] * mass
    for t in range(len(rows.squares)):
        e, d, code = rows.squares[t]
        weight = rows.weight[rows.entries[e, 0]]
        for k in range(dim):
            for m in range(dim):
                add(flat, size, code, k, m, weight * rows.J[e, k] * rows.J[d, m])


@part
def augment(rows: Rows, at: Ints, x: Array) -> None:
    """Add s Jᵀ r to the right-hand side x, where r are the right-hand sides of the rows: J y = r has s JᵀJ y = s Jᵀ r.

    The matrix M + s JᵀJ can be eliminated, too, where M is zero, and the multipliers are the same.
    """
    dim = rows.J.shape[1]
    for e in range(len(rows.entries)):
        row, i, a = rows.entries[e]
        to = at[a // dim, i]
        if rows.weight[row] != 0.0 and to >= 0:
            for k in range(dim):
                x[to + k] += rows.weight[row] * rows.J[e, k] * x[rows.at[row]]


@part
def clear(flat: Array, size: int, padding: Ints) -> None:
    """Make a matrix zero, with ones in the place of unknowns of no meaning."""
    for i in range(len(flat)):
        flat[i] = 0.0
    for n in range(len(padding)):
        flat[padding[n] * size + padding[n] % size] = 1.0


@kernel
def gather(space: tuple[int, ...], at: Ints, f: Array, x: Array) -> None:
    """Sum f, (rows of nodes, nodes), into the unknowns x, (unknowns,); known vectors are left out."""
    for k in range(len(x)):
        x[k] = 0.0
    for s in range(at.shape[0]):
        for i in range(at.shape[1]):
            to = at[s, i]
            if to >= 0:
                for k in range(len(space)):
                    x[to + k] += f[s * len(space) + k, i]


@kernel
def scatter(space: tuple[int, ...], at: Ints, x: Array, out: Array) -> None:
    """Give every vector of the nodes, out, its unknowns; known ones are zero."""
    for s in range(at.shape[0]):
        for i in range(at.shape[1]):
            of = at[s, i]
            for k in range(len(space)):
                out[s * len(space) + k, i] = x[of + k] if of >= 0 else 0.0
