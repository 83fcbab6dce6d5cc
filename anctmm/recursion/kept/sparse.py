"""The sparse symmetric system of what is kept: coordinates of junctions and rigid bodies, and multipliers.

    [ K  Jᵀ ] [ x ]   [ f ]
    [ J  0  ] [ λ ] = [ −g ]

is factored as L D Lᵀ row by row (Davis 2005, 10.1145/1114268.1114277), without exchange of rows. The order is one of
little fill (minimum degree) in which a multiplier stands behind all coordinates of its constraint: then, with K
positive definite, its pivot is minus a positive number, −J K⁻¹ Jᵀ less what constraints before it hold already. Where
nothing is left of that the constraint says what others say: it is passed over, and its multiplier does not change. What
counts as nothing depends on whether it may be so in all positions (`anctmm.discretise.singular_positions.repeated`).
"""

from heapq import heapify, heappop, heappush
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, shared

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

#: Unknowns up to which all multipliers stand behind all coordinates: what that fills costs less than it saves.
SMALL = 24


@by_address
class Sparse(NamedTuple):
    """A symmetric matrix M and its factors, M = L D Lᵀ.

    Parameters
    ----------
    above : ndarray of int, shape (n + 1,)
        Where the entries of each column above and on the diagonal begin.
    above_row : ndarray of int
    values : ndarray
        Those entries of M.
    left : ndarray of int, shape (n + 1,)
        Where the columns of each row of L begin.
    left_column : ndarray of int
        In ascending order.
    below : ndarray of int, shape (n + 1,)
        Where the rows of each column of L begin.
    below_row : ndarray of int
    L : ndarray
        Entries of L, column by column.
    inverse : ndarray, shape (n,)
        1/D; 0 of constraints that are passed over.
    filled : ndarray of int, shape (n,)
    row : ndarray, shape (n,)
        Scratch.
    dual : ndarray of bool, shape (n,)
        Which unknowns are multipliers.
    void : ndarray, shape (n,)
        Of multipliers: part of −J K⁻¹ Jᵀ up to which its constraint is passed over.
    within : ndarray of int, shape (leading,)
        Entries of each column of L among the leading unknowns, those before the first multiplier.
    """

    above: Ints
    above_row: Ints
    values: Array
    left: Ints
    left_column: Ints
    below: Ints
    below_row: Ints
    L: Array
    inverse: Array
    filled: Ints
    row: Array
    dual: Mask
    void: Array
    within: Ints


def order_of(pairs: Ints, dual: Mask, blocks: Ints) -> Ints:
    """New numbers of unknowns such that little is filled, those of a block together.

    Parameters
    ----------
    pairs : ndarray of int, shape (2, pairs)
        Unknowns that are coupled.
    dual : ndarray of bool, shape (n,)
        Which are multipliers: behind all coordinates that they are coupled with.
    blocks : ndarray of int, shape (n,)
        Block of each unknown; those of a block are of one kind.
    """
    if not dual.any():
        return _least_fill(len(dual), pairs)
    rank = np.empty(blocks.max() + 1, dtype=np.int64)
    of_block = np.zeros(len(rank), dtype=bool)
    of_block[blocks] = dual
    rank[_least_degree(blocks[pairs], of_block)] = np.arange(len(rank))
    number = np.empty(len(dual), dtype=np.int64)
    order = np.argsort(rank[blocks], kind="stable")
    if len(dual) <= SMALL:  # all coordinates first: explicit steps keep their factors
        order = np.concatenate([order[~dual[order]], order[dual[order]]])
    number[order] = np.arange(len(dual))
    return number


def _least_degree(pairs: Ints, dual: Mask) -> list[int]:
    """Blocks in the order in which they are eliminated: next one of those with the fewest neighbours that may be."""
    near: list[set[int]] = [set() for _ in dual]
    for one, two in pairs.T.tolist():
        if one != two:
            near[one].add(two)
            near[two].add(one)
    awaited = [sum(not dual[b] for b in near[block]) if dual[block] else 0 for block in range(len(dual))]
    behind = [[b for b in near[block] if dual[b]] if not dual[block] else [] for block in range(len(dual))]
    queue = [(len(near[block]), block) for block in range(len(dual)) if awaited[block] == 0]
    heapify(queue)
    order: list[int] = []
    done = set()
    while queue:
        degree, block = heappop(queue)
        if block in done or degree != len(near[block]):
            continue
        order.append(block)
        done.add(block)
        neighbours = near[block]
        for other in neighbours:
            near[other] |= neighbours
            near[other] -= {other, block}
        for other in behind[block]:
            awaited[other] -= 1
        for other in neighbours | set(behind[block]):
            if awaited[other] == 0 and other not in done:
                heappush(queue, (len(near[other]), other))
    return order


def _least_fill(size: int, pairs: Ints) -> Ints:
    """New numbers of the unknowns, such that little is filled: SuperLU's minimum degree."""
    pattern = scipy.sparse.csc_array((np.ones(pairs.shape[1]), pairs), shape=(size, size))
    dominant = scipy.sparse.csc_array(
        pattern + pattern.T + float(4 * pattern.nnz) * scipy.sparse.eye_array(size)
    )
    factors = scipy.sparse.linalg.splu(
        dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return np.asarray(factors.perm_c, dtype=np.int64)


def sparse(pairs: Ints, dual: Mask) -> Sparse:
    """Room for the matrix of unknowns, coupled in pairs, (2, pairs), and its factors; which of them are multipliers."""
    size = len(dual)
    entries = np.unique(np.append(pairs.max(axis=0) * size + pairs.min(axis=0), np.arange(size) * (size + 1)))
    column, row = np.divmod(entries, size)
    above = np.searchsorted(column, np.arange(size + 1))
    parent, met = np.full((2, size), -1)
    rows: list[list[int]] = []
    for k in range(size):  # the pattern of row k of L: what the elimination tree reaches from that of M
        met[k] = k
        reached = []
        for i in row[above[k] : above[k + 1]].tolist():
            while met[i] != k:
                if parent[i] < 0:
                    parent[i] = k
                met[i] = k
                reached.append(i)
                i = parent[i]
        rows.append(sorted(reached))
    left = np.cumsum([0, *map(len, rows)])
    left_column = np.array([i for reached in rows for i in reached], dtype=np.int64)
    leading = int(np.argmax(dual)) if dual.any() else size
    by_column = np.argsort(left_column, kind="stable")
    below_row = np.repeat(np.arange(size), np.diff(left))[by_column]
    below = np.searchsorted(left_column[by_column], np.arange(size + 1))
    return Sparse(
        above, row, np.zeros(len(row)), left, left_column, below, below_row, np.zeros(len(below_row)),
        np.zeros(size), np.zeros(size, dtype=np.int64), np.zeros(size), dual, np.zeros(size),
        np.array([np.sum(below_row[below[i] : below[i + 1]] < leading) for i in range(leading)], dtype=np.int64),
    )  # fmt: skip


def matrix_places(matrix: Sparse, rows: Ints, columns: Ints) -> Ints:
    """Where the entries of M between each `rows` and `columns`, (n, d), stand in its values, (n, d, d); −1 for none."""
    size = len(matrix.inverse)
    entries = np.repeat(np.arange(size), np.diff(matrix.above)) * size + matrix.above_row
    one, two = rows[:, :, None], columns[:, None, :]
    places = np.searchsorted(entries, np.maximum(one, two) * size + np.minimum(one, two))
    return np.where((one >= 0) & (two >= 0), places, -1)


def with_room(matrix: Sparse) -> Sparse:
    """The same pattern with values and factors of its own."""
    size = len(matrix.inverse)
    return matrix._replace(
        values=np.zeros_like(matrix.values), L=np.zeros_like(matrix.L), inverse=np.zeros(size),
        filled=np.zeros(size, dtype=np.int64), row=np.zeros(size),
    )  # fmt: skip


@embedded
def factorize_kept(matrix):  # type: ignore[no-untyped-def]
    """L and 1/D of the kept unknowns' matrix, row by row.

    Returns the number of negative pivots less that of the constraints: of K where these hold.
    """
    return _factorize_from(matrix, 0)


@embedded
def factorize_rows(matrix):  # type: ignore[no-untyped-def]
    """The same where J alone is another than it was: the unknowns before the first multiplier keep their factors."""
    for i in range(len(matrix.within)):
        matrix.filled[i] = matrix.within[i]
    _factorize_from(matrix, len(matrix.within))


@shared
def _factorize_from(matrix, first):  # type: ignore[no-untyped-def]
    above, above_row, values, left, left_column, below, below_row, L, inverse, filled, row, dual, void, _ = (
        matrix
    )
    negative = 0
    for k in range(first, len(inverse)):
        filled[k] = 0
        for p in range(above[k], above[k + 1]):
            row[above_row[p]] = values[p]
        pivot, alone = row[k], 0.0
        row[k] = 0.0
        for p in range(left[k], left[k + 1]):
            i = left_column[p]
            y = row[i]
            row[i] = 0.0
            after = below[i] + filled[i]
            for n in range(below[i], after):
                row[below_row[n]] -= L[n] * y
            part = y * inverse[i]
            L[after] = part
            pivot -= part * y
            alone += 0.0 if dual[i] else abs(part * y)
            filled[i] += 1
        if not dual[k]:
            negative += 0 if pivot > 0.0 else 1
        elif abs(pivot) <= void[k] * alone:
            inverse[k] = 0.0
            continue
        else:
            negative += 0 if pivot < 0.0 else -1
        inverse[k] = 1.0 / pivot
    return negative


@shared
def solve_kept(matrix, x):  # type: ignore[no-untyped-def]
    """The kept unknowns from their loads, in place."""
    _, _, _, _, _, below, below_row, L, inverse, _, _, _, _, _ = matrix
    for j in range(len(inverse)):
        y = x[j]
        for p in range(below[j], below[j + 1]):
            x[below_row[p]] -= L[p] * y
    for j in range(len(inverse) - 1, -1, -1):
        y = x[j] * inverse[j]
        for p in range(below[j], below[j + 1]):
            y -= L[p] * x[below_row[p]]
        x[j] = y


@shared
def solve_pairs(matrix, x):  # type: ignore[no-untyped-def]
    """The same of a matrix that x and y share, from loads in both directions, (n, 2), in place."""
    _, _, _, _, _, below, below_row, L, inverse, _, _, _, _, _ = matrix
    for j in range(len(inverse)):
        y, z = x[j, 0], x[j, 1]
        for p in range(below[j], below[j + 1]):
            x[below_row[p], 0] -= L[p] * y
            x[below_row[p], 1] -= L[p] * z
    for j in range(len(inverse) - 1, -1, -1):
        y, z = x[j, 0] * inverse[j], x[j, 1] * inverse[j]
        for p in range(below[j], below[j + 1]):
            y -= L[p] * x[below_row[p], 0]
            z -= L[p] * x[below_row[p], 1]
        x[j, 0], x[j, 1] = y, z
