"""The matrix of Newton's method and of accelerations, and how kernels add to it; codes are those of `Numbering.codes`.

Blocks lie one after another, so that entry (k, m) of the matrix of a pair is size k + m behind its first one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.elimination.factor import factorize, solve
from anctmm.elimination.order import Plan
from anctmm.kernels.by_address import by_address
from anctmm.kernels.options import inlined, kernel, part
from anctmm.system.rows import Rows

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@by_address
class Matrix(NamedTuple):
    """The matrix and the unknowns, for kernels.

    Parameters
    ----------
    plan : Plan
    values, flat : ndarray, shape (blocks + entries, rows, rows), and the same as a vector
        The matrix, or its factors.
    x, unknowns : ndarray, shape (blocks, rows), and the same as a vector
        Right-hand side and solution.
    at : ndarray of int, shape (slots, nodes)
        Place of each vector in the unknowns, −1 of a known one.
    padding : ndarray of int
        Unknowns of no meaning.
    """

    plan: Plan
    values: Array
    flat: Array
    x: Array
    unknowns: Array
    at: Ints
    padding: Ints


@inlined
def add(flat, size, code, k, m, x):  # type: ignore[no-untyped-def]
    """Add x to row k, column m of the matrix of a pair of vectors; flat: all blocks, of `size` rows."""
    if code >= 0:
        at, stand = code >> 2, code & 3
        if stand != 1:
            flat[at + size * k + m] += x
        if stand != 0:
            flat[at + size * m + k] += x


def add_rows(
    size: tuple[int, ...], rows: Rows, flat: Array, mass: float, stiffness: float, signals: Array
) -> None:
    """Add J, the curvature Σ λ ∇²g and the regularisation −δ to the matrix mass · M + stiffness · K."""
    dim, width = rows.J.shape[1], len(size)
    for e in range(len(rows.entries)):
        code = rows.codes[e]
        if code >= 0:
            step = 1 if code & 3 == 0 else width
            for k in range(dim):
                flat[(code >> 2) + step * k] += rows.J[e, k]
    for t in range(len(rows.pairs)):
        factor = stiffness * rows.multiplier[rows.pairs[t, 0]] * signals[rows.pairs[t, 5], 0]
        for k in range(dim):
            for m in range(dim):
                add(flat, width, rows.curvature[t], k, m, factor * rows.C[t, k, m])
    for r in range(len(rows.at)):
        at = rows.at[r]
        flat[at * width + at % width] -= rows.compliance[r] / mass
        rows.weight[r] = rows.stiff[r] * mass
    for t in range(len(rows.squares)):
        e, d, code = rows.squares[t]
        weight = rows.weight[rows.entries[e, 0]]
        for k in range(dim):
            for m in range(dim):
                add(flat, width, code, k, m, weight * rows.J[e, k] * rows.J[d, m])


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


def factorize_matrix(size: tuple[int, ...], matrix: Matrix) -> float:
    """Factor the matrix in place; its number of negative pivots."""
    return float(factorize(size, matrix.plan, matrix.values))


def solve_for(size: tuple[int, ...], space: tuple[int, ...], matrix: Matrix, rows: Rows, x: Array) -> None:
    """Solve for the right-hand side in the unknowns, in its place; x, (rows, nodes): the solution by nodes."""
    if len(rows.squares) > 0:
        augment(rows, matrix.at, matrix.unknowns)
    solve(size, matrix.plan, matrix.values, matrix.x)
    scatter(space, matrix.at, matrix.unknowns, x)
