"""Sparse LU factors as plain arrays, with compiled triangular solves and refactorisation.

SuperLU (through SciPy) chooses ordering and pivots once. A matrix that stays constant is then only solved with; one
whose numbers change is refactored in the same pattern with the same pivots, as KLU does, until a pivot turns bad.
"""

from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import SuperLU, splu

from reference.global_dae.kernels import kernel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
#: Indices of the hot loops: as they cannot be negative, the compiler need not look for indices counted from the end.
Index = NDArray[np.uint32]
Matrix = sparse.csc_array
#: Pivots are taken from the diagonal where these fractions of their column's largest entry let them be.
THRESHOLDS = (1e-3, 1.0)
#: Entry of L above which the pivots of a refactorisation count as bad.
GROWTH = 1e8


class Factors(NamedTuple):
    """P_r A P_c = L U, by columns, the diagonal of U inverted, that of L one.

    Unknown p of the permuted system takes its right-hand sides from `source` and puts its results into `sink`: flat
    places, one for each of the `width` (1 or 2) right-hand sides that are solved at once; 0 without factors.
    """

    width: int
    source: Index
    sink: Index
    lower_first: Index
    lower_row: Index
    lower: Array
    upper_first: Index
    upper_row: Index
    upper: Array
    inverse: Array


class Pattern(NamedTuple):
    """Where the numbers of A go: column p of the permuted matrix has the rows `row` and the numbers data[take]."""

    first: Index
    row: Index
    take: Index


def order(A: Matrix) -> tuple[SuperLU, Ints, Ints]:
    """Factors of A with the least fill, and for each place in L and U the row and the column of A that stand there.

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
    return lu, before[np.argsort(lu.perm_r)], before[np.argsort(lu.perm_c)]


def factorise(A: Matrix, places: Ints) -> Factors:
    """Factors of a constant matrix; places (n, width) of its unknowns in the flat vectors."""
    if A.shape[0] == 0:
        return no_factors(places)._replace(width=places.shape[1], upper=A.data, lower=A.data, inverse=A.data)
    lu, rows, columns = order(A)
    lower = sparse.csc_array(sparse.tril(lu.L, -1))
    upper = sparse.csc_array(sparse.triu(lu.U, 1))
    lower.eliminate_zeros()
    upper.eliminate_zeros()
    return Factors(
        places.shape[1],
        places[rows].reshape(-1).astype(np.uint32),
        places[columns].reshape(-1).astype(np.uint32),
        *_arrays(lower),
        *_arrays(upper),
        1.0 / lu.U.diagonal(),
    )


def choose(A: Matrix, places: Ints) -> tuple[Pattern, Factors]:
    """Pattern and room of the factors of a matrix whose numbers will change; A has sample numbers."""
    _, rows, columns = order(A)
    counted = sparse.csc_array((np.arange(1.0, A.nnz + 1.0), A.indices, A.indptr), shape=A.shape)
    permuted = sparse.csc_array(counted[rows][:, columns])
    permuted.sort_indices()
    pattern = Pattern(
        *(part.astype(np.uint32) for part in (permuted.indptr, permuted.indices, permuted.data - 1))
    )
    lower_first, lower_row, upper_first, upper_row = (
        part.astype(np.uint32)
        for part in fill_in(permuted.indptr.astype(np.int64), permuted.indices.astype(np.int64))
    )
    factors = Factors(
        places.shape[1],
        places[rows].reshape(-1).astype(np.uint32),
        places[columns].reshape(-1).astype(np.uint32),
        lower_first,
        lower_row,
        np.zeros(len(lower_row)),
        upper_first,
        upper_row,
        np.zeros(len(upper_row)),
        np.zeros(A.shape[0]),
    )
    return pattern, factors


def no_factors(places: Ints) -> Factors:
    """Only the places of the unknowns, for a dense solve."""
    at, ints, numbers = places.reshape(-1).astype(np.uint32), np.zeros(0, dtype=np.uint32), np.zeros(0)
    return Factors(0, at, at, ints, ints, numbers, ints, ints, numbers, numbers)


def _arrays(A: sparse.csc_array) -> tuple[Index, Index, Array]:
    A.sort_indices()
    return A.indptr.astype(np.uint32), A.indices.astype(np.uint32), np.ascontiguousarray(A.data)


@kernel
def fill_in(first: Ints, row: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """Patterns of L (strictly lower) and U (strictly upper) of a permuted matrix, by columns, sorted."""
    n = len(first) - 1
    mark = np.zeros(n, dtype=np.bool_)
    lower_first, upper_first = np.zeros(n + 1, dtype=np.int64), np.zeros(n + 1, dtype=np.int64)
    lower, upper = np.empty(4 * len(row) + n, dtype=np.int64), np.empty(4 * len(row) + n, dtype=np.int64)
    for j in range(n):
        low, high = j, j
        for t in range(first[j], first[j + 1]):
            mark[row[t]] = True
            low, high = min(low, row[t]), max(high, row[t])
        for k in range(low, j):
            if mark[k]:
                for t in range(lower_first[k], lower_first[k + 1]):
                    mark[lower[t]] = True
                    high = max(high, lower[t])
        a, b = upper_first[j], lower_first[j]
        if a + n > len(upper):
            upper = np.concatenate((upper, np.empty(len(upper) + n, dtype=np.int64)))
        if b + n > len(lower):
            lower = np.concatenate((lower, np.empty(len(lower) + n, dtype=np.int64)))
        for k in range(low, high + 1):
            if mark[k]:
                if k < j:
                    upper[a] = k
                    a += 1
                elif k > j:
                    lower[b] = k
                    b += 1
                mark[k] = False
        upper_first[j + 1], lower_first[j + 1] = a, b
    return lower_first, lower[: lower_first[n]].copy(), upper_first, upper[: upper_first[n]].copy()


@kernel
def refactor(pattern: Pattern, data: Array, f: Factors, w: Array) -> bool:
    """Factor the matrix of numbers `data` into f, column by column (left-looking), without new pivots.

    Parameters
    ----------
    w : ndarray, shape (n,)
        Scratch, zero on entry and on exit.

    Returns
    -------
    bool
        False if a pivot is zero or much smaller than its column: new pivots are needed.
    """
    good = True
    for j in range(len(f.inverse)):
        for t in range(pattern.first[j], pattern.first[j + 1]):
            w[pattern.row[t]] = data[pattern.take[t]]
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
def solve_factored(f: Factors, right: Array, left: Array, z: Array) -> None:
    """Solve with the factors: from the flat vector `right` into the flat vector `left`; z (n width,) is scratch."""
    for p in range(len(f.source)):
        z[p] = right[f.source[p]]
    if f.width == 2:
        solve_two(f, z)
    else:
        solve_one(f, z)
    for p in range(len(f.sink)):
        left[f.sink[p]] = z[p]


@kernel
def solve_one(f: Factors, z: Array) -> None:
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
def solve_two(f: Factors, z: Array) -> None:
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
