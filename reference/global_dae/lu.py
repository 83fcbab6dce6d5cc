"""Sparse LU factors as plain arrays, with compiled refactorisation and triangular solves.

SuperLU (through SciPy) chooses the order and the pivots once. The numbers are then factored in the same pattern with
the same pivots, as KLU does, until a pivot turns bad.
"""

from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import SuperLU, splu

from reference.global_dae.kernels import allocating, kernel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
#: Indices of the hot loops: as they cannot be negative, the compiler need not look for indices counted from the end.
Index = NDArray[np.uint32]
Matrix = sparse.csc_array
#: Pivots are taken from the diagonal where these fractions of their column's largest entry let them be.
THRESHOLDS = (1e-3, 1.0)
#: Entry of L above which the pivots of a refactorisation count as bad.
GROWTH = 1e8


class LU(NamedTuple):
    """P_r A P_c = L U, by columns, the diagonal of U inverted, that of L one.

    Column p of the permuted matrix has the rows `row` and the numbers data[take] of A. Its unknown p takes its
    right-hand sides from `source` and puts its results into `sink`: flat places, one or two for each unknown, which are
    solved at once. scratch: of as many numbers.
    """

    first: Index
    row: Index
    take: Index
    source: Index
    sink: Index
    lower_first: Index
    lower_row: Index
    lower: Array
    upper_first: Index
    upper_row: Index
    upper: Array
    inverse: Array
    scratch: Array


def order(A: Matrix) -> tuple[Ints, Ints]:
    """Rows and columns of A in the order of elimination, so that there is little fill.

    Tried: COLAMD and reverse Cuthill-McKee, each with pivots from the diagonal where they are not small, and with
    partial pivoting.
    """
    natural = np.arange(A.shape[0])
    band = np.asarray(reverse_cuthill_mckee(sparse.csr_matrix(abs(A)), symmetric_mode=True), dtype=np.int64)
    found: list[tuple[int, SuperLU, Ints]] = []
    for before, spec in ((natural, "COLAMD"), (band, "NATURAL")):
        for threshold in THRESHOLDS:
            with suppress(RuntimeError):  # exactly singular in this order
                lu = splu(Matrix(A[before][:, before]), permc_spec=spec, diag_pivot_thresh=threshold)  # type: ignore[call-overload]
                found.append((lu.L.nnz + lu.U.nnz, lu, before))
    if not found:
        raise np.linalg.LinAlgError("the matrix is singular in every order")
    _, lu, before = min(found, key=lambda one: one[0])
    return before[np.argsort(lu.perm_r)], before[np.argsort(lu.perm_c)]


def factorise(A: Matrix, places: Ints) -> LU:
    """Factors of a matrix; places (n, 1 or 2) of its unknowns in the flat vectors."""
    rows, columns = order(A) if A.shape[0] else (np.zeros(0, dtype=np.int64),) * 2
    counted = sparse.csc_array((np.arange(1.0, A.nnz + 1.0), A.indices, A.indptr), shape=A.shape)
    permuted = sparse.csc_array(counted[rows][:, columns])
    permuted.sort_indices()
    first, row = (part.astype(np.int64) for part in (permuted.indptr, permuted.indices))
    lower_first, lower, upper_first, upper = fill_in(first, row)
    found = LU(
        _index(first), _index(row), _index(permuted.data - 1.0), _index(places[rows]), _index(places[columns]),
        _index(lower_first), _index(lower), np.zeros(len(lower)),
        _index(upper_first), _index(upper), np.zeros(len(upper)), np.zeros(len(rows)), np.zeros(places.size),
    )  # fmt: skip
    refactor(found, A.data)
    return found


def _index(numbers: NDArray[np.generic]) -> Index:
    return numbers.reshape(-1).astype(np.uint32)


@allocating
def fill_in(first: Ints, row: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """Patterns of L (strictly lower) and U (strictly upper) of a permuted matrix, by columns, sorted."""
    n = len(first) - 1
    mark = np.zeros(n, dtype=np.bool_)
    lower_first, upper_first = np.zeros(n + 1, dtype=np.int64), np.zeros(n + 1, dtype=np.int64)
    lower, upper = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    for j in range(n):
        a, b = upper_first[j], lower_first[j]
        if max(a, b) + n > len(lower):
            more = np.empty(len(lower) + n, dtype=np.int64)
            lower, upper = np.concatenate((lower, more)), np.concatenate((upper, more))
        k, last = j, j  # the first and the last row of this column
        for t in range(first[j], first[j + 1]):
            mark[row[t]] = True
            k, last = min(k, row[t]), max(last, row[t])
        while k <= last:
            if mark[k] and k < j:
                for t in range(lower_first[k], lower_first[k + 1]):
                    mark[lower[t]] = True
                    last = max(last, lower[t])
                upper[a] = k
                a += 1
            elif mark[k] and k > j:
                lower[b] = k
                b += 1
            mark[k] = False
            k += 1
        upper_first[j + 1], lower_first[j + 1] = a, b
    return lower_first, lower[: lower_first[n]].copy(), upper_first, upper[: upper_first[n]].copy()


@kernel
def refactor(f: LU, data: Array) -> bool:
    """Factor the matrix of numbers `data` into f, column by column (left-looking), without new pivots.

    Returns
    -------
    bool
        False if a pivot is zero or much smaller than its column: new pivots are needed.
    """
    good, w = True, f.scratch
    w[:] = 0.0
    for j in range(len(f.inverse)):
        for t in range(f.first[j], f.first[j + 1]):
            w[f.row[t]] = data[f.take[t]]
        for t in range(f.upper_first[j], f.upper_first[j + 1]):
            k = f.upper_row[t]
            u = w[k]
            w[k] = 0.0
            f.upper[t] = u
            for s in range(f.lower_first[k], f.lower_first[k + 1]):
                w[f.lower_row[s]] -= f.lower[s] * u
        inverse = 1.0 / w[j]
        w[j] = 0.0
        f.inverse[j] = inverse
        for s in range(f.lower_first[j], f.lower_first[j + 1]):
            value = w[f.lower_row[s]] * inverse
            w[f.lower_row[s]] = 0.0
            f.lower[s] = value
            good &= abs(value) < GROWTH
    return good


@kernel
def solve_factored(f: LU, right: Array, left: Array) -> None:
    """Solve with the factors: from the flat vector `right` into the flat vector `left`."""
    z = f.scratch
    for p in range(len(f.source)):
        z[p] = right[f.source[p]]
    if len(f.source) == len(f.inverse):
        solve_one(f, z)
    else:
        solve_two(f, z)
    for p in range(len(f.sink)):
        left[f.sink[p]] = z[p]


@kernel
def solve_one(f: LU, z: Array) -> None:
    """Forward and backward substitution in place, of one right-hand side."""
    for j in range(len(f.inverse)):
        x = z[j]
        for t in range(f.lower_first[j], f.lower_first[j + 1]):
            z[f.lower_row[t]] -= f.lower[t] * x
    for j in range(len(f.inverse) - 1, -1, -1):
        x = z[j] * f.inverse[j]
        z[j] = x
        for t in range(f.upper_first[j], f.upper_first[j + 1]):
            z[f.upper_row[t]] -= f.upper[t] * x


@kernel
def solve_two(f: LU, z: Array) -> None:
    """The same of two, which stand beside each other."""
    for j in range(len(f.inverse)):
        x, y = z[2 * j], z[2 * j + 1]
        for t in range(f.lower_first[j], f.lower_first[j + 1]):
            i, value = f.lower_row[t], f.lower[t]
            z[2 * i] -= value * x
            z[2 * i + 1] -= value * y
    for j in range(len(f.inverse) - 1, -1, -1):
        x, y = z[2 * j] * f.inverse[j], z[2 * j + 1] * f.inverse[j]
        z[2 * j], z[2 * j + 1] = x, y
        for t in range(f.upper_first[j], f.upper_first[j + 1]):
            i, value = f.upper_row[t], f.upper[t]
            z[2 * i] -= value * x
            z[2 * i + 1] -= value * y
