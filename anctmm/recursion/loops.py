"""Loops: stretches between kept junctions, condensed to both their ends, and the sparse system of what is kept.

The recursion passes a stretch as it passes a chain, but the unknowns x of the junction it starts at stay parameters:
node i has, beside its loads, a coupling C_i with them. Where node i is eliminated, with G_i and L_i of the chain,

    K_i = C_iᵀ G_i,    C_{i+1} = −L_i C_i,    S ← S − K_i C_i,

forwards −K_i b_i are loads on x, and backwards a_i loses K_iᵀ x. At its end a stretch leaves the condensed matrices of
both ends and their coupling (a two-port). Their sum over all stretches is the matrix of the kept unknowns: sparse, in
an order of little fill (minimum degree), factored as L D Lᵀ row by row (Davis 2005, 10.1145/1114268.1114277).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import splu

from anctmm.discretise.chain import Chain
from anctmm.discretise.plan import Kept
from anctmm.jit.compiling import embedded, inlined
from anctmm.recursion.branches import Branches

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


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
    D : ndarray, shape (n,)
    filled : ndarray of int, shape (n,)
    row : ndarray, shape (n,)
        Scratch.
    """

    above: Ints
    above_row: Ints
    values: Array
    left: Ints
    left_column: Ints
    below: Ints
    below_row: Ints
    L: Array
    D: Array
    filled: Ints
    row: Array


class Loops(NamedTuple):
    """What the recursion needs where there are loops.

    Parameters
    ----------
    K : ndarray, shape (nodes, d²)
        K_i, row by row; 0 outside of stretches.
    begin, end : ndarray of int, shape (places,)
        By the places of `Branches`: port of the stretch that begins behind it, port of the body that ends before it
        at a kept junction; −1 for none.
    start : ndarray of int, shape (places,)
        Port at which the stretch began that is left before the place, or −1.
    unknowns : ndarray of int, shape (ports, d)
        Numbers of the kept unknowns that an end shares, or −1.
    turn : ndarray, shape (ports, d, d)
        W: components of the end from the kept unknowns, a = W x; rows and columns of what is not shared are 0.
    own : ndarray of int, shape (ports, d, d)
        Where the entries of a port's condensed matrix stand in `Sparse.values`, or −1: above the diagonal only.
    cross : ndarray of int, shape (ports, d, d)
        For a port at the end of a stretch: where its coupling with the start stands.
    matrix : Sparse
    x : ndarray, shape (n,)
        Loads on the kept unknowns, then these.
    through : ndarray, shape (d,)
        Of the stretch: −Σ K b, or the kept unknowns at its start.
    coupling, condensed, passed : ndarray, shape (d, d)
        C of the node, S and C of the next node, in a factorization.
    """

    K: Array
    begin: Ints
    end: Ints
    start: Ints
    unknowns: Ints
    turn: Array
    own: Ints
    cross: Ints
    matrix: Sparse
    x: Array
    through: Array
    coupling: Array
    condensed: Array
    passed: Array


def loops(chain: Chain, branches: Branches) -> Loops | None:
    """Loops of a scene; None where it has none: then nothing of this module is compiled."""
    if not chain.plan.kept:
        return None
    d, nodes, first = chain.bodies.rows, chain.bodies.nodes, chain.bodies.first
    place = {int(node): e for e, node in enumerate(branches.at)}
    begin, end, start = np.full((3, len(branches.at)), -1)
    ports: list[tuple[Kept, tuple[float, float]]] = []
    current = -1
    for b, step in enumerate(chain.plan.steps):
        if step.start is not None:
            begin[place[int(first[b])]] = current = len(ports)
            turn = (1.0, 0.0)
            if step.start.group is not None:
                turn = chain.turn_between(chain.frame_of(step.start), step.inboard)
            ports.append((step.start, turn))
        if isinstance(step.to, Kept):
            e = place[int(first[b + 1])]
            end[e], start[e] = len(ports), current
            ports.append((step.to, (1.0, 0.0)))  # the weld there has turned all to its frame
            current = -1
    table, size = _unknowns(chain, [kept for kept, _ in ports])
    ends = np.stack([end, start])[:, (end >= 0) & (start >= 0)]
    used = _pairs(table, ends)
    table = np.where(table >= 0, _order(size, used)[table], -1)
    matrix = _sparse(size, _pairs(table, ends))
    own = matrix_places(matrix, table, table)
    own[table[:, :, None] > table[:, None, :]] = -1  # each entry once
    cross = np.full_like(own, -1)
    cross[ends[0]] = matrix_places(matrix, *table[ends])
    W = _turns(table, np.array([turn for _, turn in ports]).reshape(-1, 2))
    return Loops(
        np.zeros((nodes, d * d)), begin, end, start, table, W, own, cross, matrix,
        np.zeros(size), np.zeros(d), *np.zeros((3, d, d)),
    )  # fmt: skip


def _unknowns(chain: Chain, ports: list[Kept]) -> tuple[Ints, int]:
    """Numbers of the kept unknowns that the components of each port are, (ports, d), or −1, and how many there are."""
    numbers: dict[tuple[int, int | None], int] = {}
    size = 0
    for j, vertex in enumerate(chain.plan.kept):
        if not vertex.held:
            numbers[j, None] = size
            size += 2
        for g, group in enumerate(vertex.groups):
            numbers[j, g] = size
            size += 2 * chain.bodies.mesh(group[0][0]).vectors - 2
    table = np.full((len(ports), chain.bodies.rows), -1)
    for row, kept in zip(table, ports, strict=True):
        if (kept.junction, None) in numbers:
            row[:2] = numbers[kept.junction, None] + np.arange(2)
        if kept.group is not None:
            own = 2 * chain.bodies.mesh(chain.frame_of(kept)[0]).vectors
            row[2:own] = numbers[kept.junction, kept.group] + np.arange(own - 2)
    return table, size


def _turns(table: Ints, turns: Array) -> Array:
    """W of each port, (ports, d, d), from cosine and sine of the turns, (ports, 2)."""
    W = np.zeros((*table.shape, table.shape[1]))
    W[:, 0, 0] = W[:, 1, 1] = 1.0
    for k in range(2, table.shape[1], 2):
        W[:, k, k] = W[:, k + 1, k + 1] = turns[:, 0]
        W[:, k, k + 1], W[:, k + 1, k] = -turns[:, 1], turns[:, 1]
    return np.where((table[:, :, None] >= 0) & (table[:, None, :] >= 0), W, 0.0)


def _pairs(table: Ints, ends: Ints) -> Ints:
    """Pairs of kept unknowns that a stretch or an end couples, (2, pairs)."""
    one, two = np.concatenate([table, table[ends[0]]]), np.concatenate([table, table[ends[1]]])
    pairs = np.stack(np.broadcast_arrays(one[:, :, None], two[:, None, :])).reshape(2, -1)
    return pairs[:, (pairs >= 0).all(axis=0)]


def _order(size: int, pairs: Ints) -> Ints:
    """New numbers of the unknowns, such that little is filled: SuperLU's minimum degree."""
    pattern = csc_array((np.ones(pairs.shape[1]), pairs), shape=(size, size))
    dominant = csc_array(pattern + pattern.T + float(4 * pattern.nnz) * eye_array(size))
    factors = splu(
        dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return np.asarray(factors.perm_c, dtype=np.int64)


def _sparse(size: int, pairs: Ints) -> Sparse:
    """Room for a matrix of coupled unknowns and its factors."""
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
    by_column = np.argsort(left_column, kind="stable")
    below_row = np.repeat(np.arange(size), np.diff(left))[by_column]
    below = np.searchsorted(left_column[by_column], np.arange(size + 1))
    return Sparse(
        above, row, np.zeros(len(row)), left, left_column, below, below_row, np.zeros(len(below_row)),
        np.zeros(size), np.zeros(size, dtype=np.int64), np.zeros(size),
    )  # fmt: skip


def matrix_places(matrix: Sparse, rows: Ints, columns: Ints) -> Ints:
    """Where the entries of M between each `rows` and `columns`, (n, d), stand in its values, (n, d, d); −1 for none."""
    size = len(matrix.D)
    entries = np.repeat(np.arange(size), np.diff(matrix.above)) * size + matrix.above_row
    one, two = rows[:, :, None], columns[:, None, :]
    places = np.searchsorted(entries, np.maximum(one, two) * size + np.minimum(one, two))
    return np.where((one >= 0) & (two >= 0), places, -1)


@inlined
def start_stretch(loops, port, d, work):  # type: ignore[no-untyped-def]
    """Begin a stretch at a node whose matrix 1 and coupling with the next node, 2, are in the scratch."""
    A, K, W = d * d, 2 * d * d, loops.turn[port]
    for m in range(d):
        for p in range(d):
            near = far = 0.0
            for k in range(d):
                near += work[A + d * max(m, k) + min(m, k)] * W[k, p]
                far += work[K + d * m + k] * W[k, p]
            loops.coupling[m, p], loops.passed[m, p] = near, far
    for p in range(d):
        for r in range(d):
            total = 0.0
            for k in range(d):
                total += W[k, p] * loops.coupling[k, r]
            loops.condensed[p, r] = total
    for k in range(d):
        if loops.unknowns[port, k] >= 0:
            for p in range(d):
                loops.coupling[k, p] = 0.0


@embedded
def eliminate_coupled(unit, loops, port, known, i, work):  # type: ignore[no-untyped-def]
    """Pass an element as `riccati` does, and the coupling with the start of the stretch, which begins here at a port
    unless that is −1. Returns the number of negative pivots.
    """
    if port >= 0:
        start_stretch(loops, port, len(unit), work)
    negative = _eliminate(unit, loops, known, 0, i, work)
    keep_coupling(loops, port, i)
    return negative


@embedded
def release_coupled(unit, loops, known, i, work):  # type: ignore[no-untyped-def]
    """Pass a pin as `riccati` does, and the coupling. Returns the number of negative pivots."""
    d = len(unit)
    K, L = 2 * d * d, 3 * d * d
    for m in range(d):
        for k in range(d):
            work[K + d * m + k] = work[d * max(m, k) + min(m, k)] if m < 2 <= k else 0.0
            loops.passed[m, k] = loops.coupling[m, k] if m < 2 else 0.0
    negative = _eliminate(unit, loops, known, 2, i, work)
    for m in range(2):
        work[L + d * m + m] = -1.0
    keep_coupling(loops, -1, i)
    return negative


@embedded
def turn_coupled(unit, loops, i, work):  # type: ignore[no-untyped-def]
    """Pass a weld whose L is in the scratch: the coupling turns."""
    d = len(unit)
    for m in range(d):
        for p in range(d):
            total = 0.0
            for k in range(d):
                total -= work[3 * d * d + d * m + k] * loops.coupling[k, p]
            loops.passed[m, p] = total
    for m in range(d):
        for p in range(d):
            loops.coupling[m, p] = 0.0
    keep_coupling(loops, -1, i)


@inlined
def _eliminate(unit, loops, known, least, i, work):  # type: ignore[no-untyped-def]
    """Eliminate a node component by component from `least` on.

    Matrix 1 of the scratch, symmetric, becomes −G, 2 and 3 become L; D of the next node, its coupling and S lose their
    parts. Returns the number of negative pivots.
    """
    d = len(unit)
    A, K, column = d * d, 2 * d * d, 4 * d * d
    C, S, P = loops.coupling, loops.condensed, loops.passed
    negative = 0
    for k in range(d):
        if k < least or known[k, i]:
            for m in range(d):
                work[A + d * max(k, m) + min(k, m)] = work[K + d * m + k] = C[k, m] = 0.0
    for k in range(d):
        if k < least or known[k, i]:
            continue
        pivot = work[A + d * k + k]
        negative += 0 if pivot > 0.0 else 1
        inverse = 1.0 / pivot
        for m in range(d):
            work[column + m] = work[A + d * max(k, m) + min(k, m)]
            work[column + d + m] = work[K + d * m + k]
            work[column + 2 * d + m] = C[k, m]
        for n in range(d):
            f, g = work[column + d + n] * inverse, work[column + n] * inverse
            h = work[column + 2 * d + n] * inverse
            for m in range(n + 1):
                work[d * n + m] -= f * work[column + d + m]
                work[A + d * n + m] -= g * work[column + m]
            for m in range(d):
                work[K + d * n + m] -= f * work[column + m]
                P[n, m] -= f * work[column + 2 * d + m]
                C[n, m] -= g * work[column + 2 * d + m]
                S[n, m] -= h * work[column + 2 * d + m]
        for m in range(d):
            work[A + d * max(k, m) + min(k, m)] = work[column + m] * inverse
            work[K + d * m + k] = work[column + d + m] * inverse
            C[k, m] = work[column + 2 * d + m] * inverse
        work[A + d * k + k] = -inverse
    for k in range(d * d):
        work[K + d * d + k] = work[K + k]
    return negative


@inlined
def keep_coupling(loops, port, i):  # type: ignore[no-untyped-def]
    """Keep K of node i, at which a stretch begins if its port is given, and go on to the next node."""
    d = len(loops.through)
    for p in range(d):
        for k in range(d):
            loops.K[i, d * p + k] = loops.coupling[k, p] - (loops.turn[port, k, p] if port >= 0 else 0.0)
            loops.coupling[k, p], loops.passed[k, p] = loops.passed[k, p], 0.0


@embedded
def end_stretch(unit, loops, place, work):  # type: ignore[no-untyped-def]
    """Add what arrives at a kept junction to its matrix; nothing goes on."""
    d = len(unit)
    end, start, values = loops.end[place], loops.start[place], loops.matrix.values
    for k in range(d):
        for m in range(d):
            if loops.own[end, k, m] >= 0:
                values[loops.own[end, k, m]] += work[d * max(k, m) + min(k, m)]
            if start >= 0:
                if loops.own[start, k, m] >= 0:
                    values[loops.own[start, k, m]] += loops.condensed[k, m]
                if loops.cross[end, k, m] >= 0:  # an entry and its mirror image may be one
                    same = loops.unknowns[end, k] == loops.unknowns[start, m]
                    values[loops.cross[end, k, m]] += (2.0 if same else 1.0) * loops.coupling[k, m]
    for k in range(d):
        for m in range(d):
            work[d * k + m] = loops.coupling[k, m] = loops.condensed[k, m] = 0.0


@embedded
def factorize_kept(matrix):  # type: ignore[no-untyped-def]
    """L and D of the kept unknowns' matrix, row by row; the number of negative pivots."""
    above, above_row, values, left, left_column, below, below_row, L, D, filled, row = matrix
    negative = 0
    for k in range(len(D)):
        filled[k] = 0
        for p in range(above[k], above[k + 1]):
            row[above_row[p]] = values[p]
        pivot = row[k]
        row[k] = 0.0
        for p in range(left[k], left[k + 1]):
            i = left_column[p]
            y = row[i]
            row[i] = 0.0
            after = below[i] + filled[i]
            for n in range(below[i], after):
                row[below_row[n]] -= L[n] * y
            L[after] = y / D[i]
            pivot -= L[after] * y
            filled[i] += 1
        D[k] = pivot
        negative += 0 if pivot > 0.0 else 1
    return negative


@embedded
def solve_kept(matrix, x):  # type: ignore[no-untyped-def]
    """The kept unknowns from their loads, in place."""
    _, _, _, _, _, below, below_row, L, D, _, _ = matrix
    for j in range(len(D)):
        for p in range(below[j], below[j + 1]):
            x[below_row[p]] -= L[p] * x[j]
    for j in range(len(D) - 1, -1, -1):
        x[j] /= D[j]
        for p in range(below[j], below[j + 1]):
            x[j] -= L[p] * x[below_row[p]]


@inlined
def clear(loops):  # type: ignore[no-untyped-def]
    """Nothing has come yet to the kept unknowns."""
    for j in range(len(loops.x)):
        loops.x[j] = 0.0
    for k in range(len(loops.through)):
        loops.through[k] = 0.0


@inlined
def pass_start(loops, i, work, load):  # type: ignore[no-untyped-def]
    """Forward at node i: its loads b, in the scratch, bring −K b to the start of the stretch."""
    d = len(loops.through)
    for p in range(d):
        for k in range(d):
            loops.through[p] -= loops.K[i, d * p + k] * work[load + k]


@inlined
def leave_stretch(loops, place, work, come):  # type: ignore[no-untyped-def]
    """Forward at a place: what comes to a kept junction, and to the start of the stretch, is added to their loads."""
    end, start = loops.end[place], loops.start[place]
    for k in range(len(loops.through) if end >= 0 else 0):
        if loops.unknowns[end, k] >= 0:
            loops.x[loops.unknowns[end, k]] += work[come + k]
        if start >= 0 and loops.unknowns[start, k] >= 0:
            loops.x[loops.unknowns[start, k]] += loops.through[k]
        work[come + k] = loops.through[k] = 0.0


@inlined
def enter_stretch(loops, place, work, x):  # type: ignore[no-untyped-def]
    """Backward at a place: the kept unknowns at the end and at the start of what lies before it."""
    end, start = loops.end[place], loops.start[place]
    for k in range(len(loops.through) if end >= 0 or loops.begin[place] >= 0 else 0):
        loops.through[k] = 0.0
        if start >= 0 and loops.unknowns[start, k] >= 0:
            loops.through[k] = loops.x[loops.unknowns[start, k]]
        if end >= 0:
            work[x + k] = loops.x[loops.unknowns[end, k]] if loops.unknowns[end, k] >= 0 else 0.0


@inlined
def add_start(loops, i, work, x):  # type: ignore[no-untyped-def]
    """Backward at node i: its unknowns, in the scratch, lose Kᵀ x of the start."""
    d = len(loops.through)
    for k in range(d):
        for p in range(d):
            work[x + k] -= loops.K[i, d * p + k] * loops.through[p]
