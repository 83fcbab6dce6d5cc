"""Sparse L D Lᵀ in an order that is chosen once: compiled factorisation (Davis 2005, "LDL") and triangular solves."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from reference.global_dae.kernels import kernel

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
#: Indices of the hot loops: as they cannot be negative, the compiler need not look for indices counted from the end.
Index = NDArray[np.uint32]
Matrix = sparse.csc_array
#: A pivot is lost where it is no more than this part of the terms that it is the sum of.
LOST = 1e-13


class Factors(NamedTuple):
    """P A Pᵀ = L D Lᵀ with a unit diagonal of L.

    Column k of the upper triangle of P A Pᵀ has the rows `row` and the numbers data[take] of A; unknown k stands at
    one or two flat `places` of a vector, which are solved at once. L is stored by columns, `before` are the columns of
    its entries by rows; inverse: of D; filled, scratch: room.
    """

    first: Index
    row: Index
    take: Index
    places: Index
    lower_first: Index
    lower_row: Index
    lower: Array
    before_first: Index
    before: Index
    inverse: Array
    filled: Index
    scratch: Array


def factorise(A: Matrix, size: int, places: Ints) -> tuple[Factors, bool]:
    """Factors of a symmetric matrix, and whether no pivot is lost.

    A is of `size` coordinates, and then of the multipliers of rows; its unknowns stand at `places` (n, 1 or 2) of the
    flat vectors.
    """
    n, order = A.shape[0], order_of(A, size)
    counted = sparse.csc_array((np.arange(1.0, A.nnz + 1.0), A.indices, A.indptr), shape=A.shape)
    upper = Matrix(sparse.triu(counted[order][:, order], format="csc"))
    upper.sort_indices()
    below = fill_of(upper)
    first, rows = (
        np.cumsum([0, *map(len, below)]),
        np.array([row for part in below for row in part], dtype=np.int64),
    )
    by_rows = sparse.csr_array(Matrix((np.ones(len(rows)), rows, first), shape=(n, n)))
    by_rows.sort_indices()
    found = Factors(
        index(upper.indptr), index(upper.indices), index(upper.data - 1.0), index(places[order]), index(first),
        index(rows), np.zeros(len(rows)), index(by_rows.indptr), index(by_rows.indices), np.zeros(n),
        index(np.zeros(n)), np.zeros(places.size),
    )  # fmt: skip
    return found, bool(factor(found, A.data))


def order_of(A: Matrix, size: int) -> Ints:
    """Coordinates by minimum degree, coupled as rows couple them; each multiplier behind its last coordinate."""
    rows = sparse.csr_array(abs(A[size:, :size]))
    coupled = abs(A[:size, :size]) + rows.T @ rows
    dominant = Matrix(coupled + sparse.diags_array(1.0 + coupled.sum(axis=0)))
    order = (
        splu(dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0).perm_c if size else np.zeros(0, int)
    )
    place = np.argsort(order)
    last = np.maximum.reduceat(place[rows.indices], rows.indptr[:-1]) if rows.shape[0] else np.zeros(0)
    return np.argsort(np.concatenate([place, last + 0.5]), kind="stable").astype(np.int64)


def fill_of(upper: Matrix) -> list[list[int]]:
    """Rows of the entries of each column of L, ascending."""
    lower = upper.tocsr()
    below: list[set[int]] = []
    children: list[list[int]] = [[] for _ in range(lower.shape[0])]
    for j, own in enumerate(children):
        rows = set(lower.indices[lower.indptr[j] : lower.indptr[j + 1]].tolist())
        below.append(rows.union(*(below[child] for child in own)) - {j})
        if below[j]:
            children[min(below[j])].append(j)
    return [sorted(rows) for rows in below]


def index(numbers: Any) -> Index:
    """Numbers as indices, flat."""
    return np.asarray(numbers).reshape(-1).astype(np.uint32)


@kernel
def factor(f: Factors, data: Array) -> bool:
    """Factor the matrix of numbers `data` row by row; False if a pivot is lost."""
    good, y = True, f.scratch
    y[:] = 0.0
    f.filled[:] = 0
    for k in range(len(f.inverse)):
        for t in range(f.first[k], f.first[k + 1]):
            y[f.row[t]] = data[f.take[t]]
        pivot = y[k]
        terms = abs(pivot)
        y[k] = 0.0
        for s in range(f.before_first[k], f.before_first[k + 1]):
            i = f.before[s]
            value = y[i]
            y[i] = 0.0
            at = f.lower_first[i]
            end = at + f.filled[i]
            for t in range(at, end):
                y[f.lower_row[t]] -= f.lower[t] * value
            f.lower[end] = value * f.inverse[i]
            f.filled[i] += np.uint32(1)
            part = f.lower[end] * value
            pivot -= part
            terms += abs(part)
        f.inverse[k] = 1.0 / pivot
        good &= abs(pivot) > LOST * terms
    return good


@kernel
def solve_factored(f: Factors, right: Array, left: Array) -> None:
    """Solve with the factors: from the flat vector `right` into the flat vector `left`."""
    z = f.scratch
    for p in range(len(f.places)):
        z[p] = right[f.places[p]]
    if len(f.places) == len(f.inverse):
        solve_one(f, z)
    else:
        solve_two(f, z)
    for p in range(len(f.places)):
        left[f.places[p]] = z[p]


@kernel
def solve_one(f: Factors, z: Array) -> None:
    """Forward and backward substitution in place, of one right-hand side."""
    for j in range(len(f.inverse)):
        x = z[j]
        for t in range(f.lower_first[j], f.lower_first[j + 1]):
            z[f.lower_row[t]] -= f.lower[t] * x
    for j in range(len(f.inverse) - 1, -1, -1):
        x = z[j] * f.inverse[j]
        for t in range(f.lower_first[j], f.lower_first[j + 1]):
            x -= f.lower[t] * z[f.lower_row[t]]
        z[j] = x


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
        for t in range(f.lower_first[j], f.lower_first[j + 1]):
            i, value = f.lower_row[t], f.lower[t]
            x -= value * z[2 * i]
            y -= value * z[2 * i + 1]
        z[2 * j], z[2 * j + 1] = x, y
