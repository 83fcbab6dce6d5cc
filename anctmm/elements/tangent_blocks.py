"""Second derivatives in 2 × 2 blocks: summed up by few vectors, then placed in the triangle of an element's tangent.

A buffer has rows of TANGENT_BLOCK elements. First comes the result, the lower triangle by the components of the nodal
vectors: entry (k, m ≤ k) in row k (k + 1)/2 + m. From row SUMS on lie the sums over the quadrature points: three rows,
xx, yx, yy, where a block is symmetric, else four, row by row. All rows lie in one array at constant distances, so that
the compiler sees that they do not overlap.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.options import inlined

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Elements whose tangents are found at once.
TANGENT_BLOCK = 16
#: Rows of the result for an element of 12 components, the largest, and of what a kind keeps behind it at most.
SUMS, KEPT = 78, 70
TANGENT_BUFFER = (SUMS + KEPT) * TANGENT_BLOCK


@inlined
def clear_sums(out, rows):  # type: ignore[no-untyped-def]
    """Make so many rows of sums zero."""
    for k in range(SUMS * TANGENT_BLOCK, (SUMS + rows) * TANGENT_BLOCK):
        out[k] = 0.0


@inlined
def add_symmetric(out, row, j, n, S):  # type: ignore[no-untyped-def]
    """Add n S, S = (xx, xy, yy), to the sums from `row` on."""
    at = (SUMS + row) * TANGENT_BLOCK + j
    out[at] += n * S[0]
    out[at + TANGENT_BLOCK] += n * S[1]
    out[at + 2 * TANGENT_BLOCK] += n * S[2]


@inlined
def add_full(out, row, j, n, B):  # type: ignore[no-untyped-def]
    """Add n B, B = (xx, xy, yx, yy), to the sums from `row` on."""
    at = (SUMS + row) * TANGENT_BLOCK + j
    out[at] += n * B[0]
    out[at + TANGENT_BLOCK] += n * B[1]
    out[at + 2 * TANGENT_BLOCK] += n * B[2]
    out[at + 3 * TANGENT_BLOCK] += n * B[3]


def placement(blocks: Sequence[tuple[int, int, str, int, int]]) -> Ints:
    """Where sums go, (entries, 3): row of the result, row of the sums, power.

    Parameters
    ----------
    blocks : sequence of (int, int, str, int, int)
        Nodal vectors k ≥ m; whether the sum is "symmetric", "full" or to be "transposed"; its first row; the power p of
        its factor: ±1 for ±v, ±2 for ±v², v = 1/l.
    """
    index = lower.py_func  # as a module is imported nothing is to be compiled
    entries = []
    for k, m, form, source, power in blocks:
        for r in range(2):
            for s in range(2 if k > m else r + 1):
                row = {"symmetric": r + s, "full": 2 * r + s, "transposed": 2 * s + r}[form]
                entries.append((index(2 * k + r, 2 * m + s) // TANGENT_BLOCK, source + row, power))
    return np.array(entries, dtype=np.int64)


@inlined
def place(table: Ints, v: float, count: int, out: Array) -> None:
    """Make the result of the sums, for so many elements."""
    for t in range(len(table)):
        to, source = out[table[t, 0] * TANGENT_BLOCK :], out[(SUMS + table[t, 1]) * TANGENT_BLOCK :]
        power = table[t, 2]
        f = (v if abs(power) == 1 else v * v if abs(power) == 2 else 1.0) * (1.0 if power >= 0 else -1.0)
        for j in range(count):
            to[j] = f * source[j]


@inlined
def lower(k, m):  # type: ignore[no-untyped-def]
    """Where row k, column m ≤ k of the result begins."""
    return (k * (k + 1) // 2 + m) * TANGENT_BLOCK
