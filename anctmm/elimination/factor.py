"""Factorization and solution: A = L D Lᵀ in blocks of equal size.

In the order from the leaves to a root this is the Riccati recursion (Rong 2014, eqs. 28–35): the pivot of a node is the
condensed matrix S of all that lies inboard, and what has been swept to it is e. See `anctmm.elimination.transfer`.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.elimination.order import Plan
from anctmm.kernels.intrinsics import matrix, vector
from anctmm.kernels.options import kernel, part

Array = NDArray[np.float64]


@kernel
def factorize(size: tuple[int, ...], plan: Plan, values: Array) -> int:
    """Factor a matrix in place.

    Parameters
    ----------
    size : tuple of int
        As many zeros as a block has rows: its length is constant for the compiler.
    plan : Plan
    values : ndarray, shape (blocks + entries, rows, rows)
        Blocks of the lower triangle, the diagonal ones first. Overwritten by D⁻¹ and L.

    Returns
    -------
    int
        Number of negative pivots: by Sylvester's law of inertia that of negative eigenvalues.
    """
    start, first, target = plan.start, plan.first, plan.target
    blocks, negative = len(start) - 1, 0
    G = matrix(size, size)
    for j in range(blocks):
        negative += invert(size, values, j)
        for e in range(start[j + 1] - 1, start[j] - 1, -1):
            for i in range(len(size)):
                for k in range(len(size)):
                    s = 0.0
                    for m in range(len(size)):
                        s += values[blocks + e, i, m] * values[j, m, k]
                    G[i, k] = s
            b = blocks + start[j]
            for t in range(first[e], first[e + 1]):
                to = target[t]
                for i in range(len(size)):
                    for k in range(len(size)):
                        s = 0.0
                        for m in range(len(size)):
                            s += G[i, m] * values[b, k, m]
                        values[to, i, k] -= s
                b += 1
            for i in range(len(size)):
                for k in range(len(size)):
                    values[blocks + e, i, k] = G[i, k]
    return negative


@part
def invert(size: tuple[int, ...], values: Array, j: int) -> int:
    """Invert a symmetric block in place by its lower triangle, without exchanges; its number of negative pivots."""
    A, negative = matrix(size, size), 0
    for i in range(len(size)):
        for k in range(i + 1):
            A[i, k] = values[j, i, k]
            A[k, i] = values[j, i, k]
    for p in range(len(size)):
        pivot = A[p, p]
        if pivot < 0.0:
            negative += 1
        pivot = 1.0 / pivot
        A[p, p] = 1.0
        for k in range(len(size)):
            A[p, k] *= pivot
        for i in range(len(size)):
            if i != p:
                f = A[i, p]
                A[i, p] = 0.0
                for k in range(len(size)):
                    A[i, k] -= f * A[p, k]
    for i in range(len(size)):
        for k in range(len(size)):
            values[j, i, k] = A[i, k]
    return negative


@kernel
def solve(size: tuple[int, ...], plan: Plan, values: Array, x: Array) -> None:
    """Solve with a factored matrix; x, (blocks, rows), the right-hand side, is overwritten by the solution."""
    start, row = plan.start, plan.row
    blocks = len(start) - 1
    y: Array = vector(size)
    z: Array = vector(size)
    for j in range(blocks):
        for i in range(len(size)):
            y[i] = x[j, i]
        for e in range(start[j], start[j + 1]):
            to = row[e]
            for i in range(len(size)):
                s = 0.0
                for m in range(len(size)):
                    s += values[blocks + e, i, m] * y[m]
                x[to, i] -= s
        for i in range(len(size)):
            s = 0.0
            for m in range(len(size)):
                s += values[j, i, m] * y[m]
            x[j, i] = s
    for j in range(blocks - 1, -1, -1):
        for i in range(len(size)):
            z[i] = x[j, i]
        for e in range(start[j], start[j + 1]):
            of = row[e]
            for i in range(len(size)):
                y[i] = x[of, i]
            for m in range(len(size)):
                s = 0.0
                for i in range(len(size)):
                    s += values[blocks + e, i, m] * y[i]
                z[m] -= s
        for i in range(len(size)):
            x[j, i] = z[i]
