"""Loops: stretches between kept junctions, condensed to both their ends, and the sparse system of the kept unknowns.

The recursion eliminates a stretch like a chain, but the unknowns x of the junction where it starts remain as
parameters: node i has, beside its loads, a coupling C_i with them. When node i is eliminated, with G_i and L_i of the
chain,

    K_i = C_iᵀ G_i,    C_{i+1} = −L_i C_i,    S ← S − K_i C_i,

in the forward sweep −K_i b_i are loads on x, and in the backward sweep K_iᵀ x is subtracted from a_i. The result of a
stretch are the condensed matrices of both ends and their coupling (a two-port). Their sum over all stretches is the
matrix of the kept unknowns (`sparse`).

An end depends on the kept unknowns x by a linear map, a = W x: the position and the gradients of a junction, or of a
point p fixed in a rigid body, r + p_x t + p_y t⊥, and t rotated. It therefore contributes Wᵀ S W and Wᵀ e there.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.kept import Port
from anctmm.discretise.kept_chains import of_masses
from anctmm.discretise.plan import Kept
from anctmm.discretise.singular_positions.repeated import passed_over
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined
from anctmm.model.kept import of_arrays
from anctmm.recursion.branches import Branches
from anctmm.recursion.kept.coupled import Coupled, coupled_of, entries_of
from anctmm.recursion.kept.rows import Rows, rows_of
from anctmm.recursion.kept.sparse import Sparse, matrix_places, order_of, sparse, with_room
from anctmm.recursion.node_blocks import leave_out, put_column, take_column, update_row
from anctmm.recursion.scratch import matrices, vectors

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@by_address
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
        Numbers of the kept unknowns that an end takes something of, or −1.
    shared : ndarray of bool, shape (ports, d)
        Components of the end that they give.
    maps : ndarray, shape (ports, d, d)
        W: components of the end from its kept unknowns, a = W x; rows of what is not shared are 0.
    own : ndarray of int, shape (ports, d, d)
        Where the entries of a port's condensed matrix stand in `Sparse.values`, or −1: above the diagonal only.
    cross : ndarray of int, shape (ports, d, d)
        For a port at the end of a stretch: where its coupling with the start stands.
    matrix : Sparse
    rows : Rows
        Constraints between kept unknowns.
    load : ndarray, shape (n,)
        Loads of the constraints on the kept unknowns, and their right sides: 0 unless a solution needs them.
    x : ndarray, shape (n,)
        Loads on the kept unknowns, then these.
    moved : ndarray, shape (n,)
        Scratch: what a projection adds to the kept unknowns.
    through : ndarray, shape (d,)
        Of the stretch: −Σ K b, or the kept unknowns at its start.
    coupling, condensed, passed : ndarray, shape (d, d)
        C of the node, S and C of the next node, in a factorization.
    coupled : Coupled or None
        What connectors couple.
    """

    K: Array
    begin: Ints
    end: Ints
    start: Ints
    unknowns: Ints
    shared: NDArray[np.bool_]
    maps: Array
    own: Ints
    cross: Ints
    matrix: Sparse
    rows: Rows
    load: Array
    x: Array
    moved: Array
    through: Array
    coupling: Array
    condensed: Array
    passed: Array
    coupled: Coupled | None


def loops(chain: Chain, branches: Branches) -> Loops | None:
    """Loops of a scene; None where nothing is kept: then nothing of this module is compiled."""
    if not chain.plan.kept:
        return None
    return of_masses(chain, lambda: _loops(chain, branches), what=loops)


def _loops(chain: Chain, branches: Branches) -> Loops:
    """The same, found anew."""
    d, nodes, kept = chain.bodies.rows, chain.bodies.nodes, chain.kept
    begin, end, start, ports = _ports(chain, branches)
    table = np.array([port.unknowns for port in ports]).reshape(-1, d)
    ends = np.stack([end, start])[:, (end >= 0) & (start >= 0)]
    entries = entries_of(chain)
    pairs = np.concatenate([kept.constraints.pairs, entries.pairs], axis=1)
    number, table, own, cross, matrix = _pattern(table, ends, pairs, kept.dual, kept.blocks)
    matrix, dual, void = with_room(matrix), matrix.dual, np.zeros(len(number))
    void[number[kept.size :]] = passed_over(kept, np.argsort(number[kept.size :]))
    matrix = matrix._replace(void=void)
    return Loops(
        np.zeros((nodes, d * d)), begin, end, start, table,
        np.array([port.shared for port in ports]), np.array([port.map for port in ports]),
        own, cross, matrix, rows_of(kept, number, matrix),
        np.zeros(len(dual)), np.zeros(len(dual)), np.zeros(len(dual)),
        np.zeros(d), np.zeros((d, d)), np.zeros((d, d)), np.zeros((d, d)),
        coupled_of(entries, number, matrix),
    )  # fmt: skip


@of_arrays
def _pattern(
    table: Ints, ends: Ints, pairs: Ints, dual: NDArray[np.bool_], blocks: Ints
) -> tuple[Ints, Ints, Ints, Ints, Sparse]:
    """New numbers of the kept unknowns; `unknowns`, `own` and `cross` of `Loops`, and the matrix by these.

    Parameters
    ----------
    table : ndarray of int, shape (ports, d)
        `unknowns` by the old numbers.
    ends : ndarray of int, shape (2, k)
        Ports at both ends of each stretch.
    pairs : ndarray of int, shape (2, pairs)
        What constraints and connectors couple.
    dual, blocks
        Of `KeptUnknowns`.
    """
    pairs = np.concatenate([_pairs(table, ends), pairs], axis=1)
    number = order_of(pairs, dual, blocks)
    renumbered = np.empty_like(dual)
    renumbered[number] = dual
    matrix = sparse(number[pairs], renumbered)
    table = np.where(table >= 0, number[table], -1)
    own = matrix_places(matrix, table, table)
    own[table[:, :, None] > table[:, None, :]] = -1  # each entry once
    cross = np.full_like(own, -1)
    cross[ends[0]] = matrix_places(matrix, *table[ends])
    return number, table, own, cross, matrix


def _ports(chain: Chain, branches: Branches) -> tuple[Ints, Ints, Ints, list[Port]]:
    """Numbers of the ports at each place, `begin`, `end` and `start` of `Loops`; and the ports."""
    first, kept = chain.bodies.first, chain.kept
    place = {int(node): e for e, node in enumerate(branches.at)}
    begin, end, start = np.full((3, len(branches.at)), -1)
    ports: list[Port] = []
    current = -1
    for b, step in enumerate(chain.plan.steps):
        if step.start is not None:
            begin[place[int(first[b])]] = current = len(ports)
            ports.append(kept.port(step.start, step.inboard, turned=True))
        if isinstance(step.to, Kept):
            e = place[int(first[b + 1])]
            end[e], start[e] = len(ports), current
            ports.append(kept.port(step.to, step.outboard, turned=False))  # the weld there has turned all
            current = -1
    return begin, end, start, ports


def _pairs(table: Ints, ends: Ints) -> Ints:
    """Pairs of kept unknowns that a stretch or an end couples, (2, pairs)."""
    one, two = np.concatenate([table, table[ends[0]]]), np.concatenate([table, table[ends[1]]])
    pairs = np.stack(np.broadcast_arrays(one[:, :, None], two[:, None, :])).reshape(2, -1)
    return pairs[:, (pairs >= 0).all(axis=0)]


@inlined
def start_stretch(size, loops, port, work):  # type: ignore[no-untyped-def]
    """Begin a stretch at a node whose own matrix and coupling with the next node are in the scratch."""
    d, W = len(size), loops.maps[port]
    _, A, K, _ = matrices(size)
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
        if loops.shared[port, k]:
            for p in range(d):
                loops.coupling[k, p] = 0.0


@embedded
def eliminate_coupled(size, loops, port, known, i, work):  # type: ignore[no-untyped-def]
    """Pass an element as `node_blocks` does, and the coupling with the start of the stretch, which begins here at a
    port unless that is −1. Returns the number of negative pivots.
    """
    if port >= 0:
        start_stretch(size, loops, port, work)
    negative = _eliminate(size, loops, known, 0, i, work)
    keep_coupling(loops, port, i)
    return negative


@embedded
def release_coupled(size, loops, passed, turn, known, i, work):  # type: ignore[no-untyped-def]
    """Pass a joint as `node_blocks` does, of which so many components pass, and the coupling.

    Returns the number of negative pivots.
    """
    d = len(size)
    D, _, K, L = matrices(size)
    for m in range(d):
        for k in range(d):
            work[K + d * m + k] = work[D + d * max(m, k) + min(m, k)] if m < passed <= k else 0.0
            loops.passed[m, k] = loops.coupling[m, k] if m < passed else 0.0
    negative = _eliminate(size, loops, known, passed, i, work)
    for m in range(passed):
        work[L + d * m + m] = -1.0
    for k in range(d if passed == 4 else 0):
        x, y = loops.passed[2, k], loops.passed[3, k]
        loops.passed[2, k], loops.passed[3, k] = turn[0] * x - turn[1] * y, turn[1] * x + turn[0] * y
    keep_coupling(loops, -1, i)
    return negative


@embedded
def turn_coupled(size, loops, i, work):  # type: ignore[no-untyped-def]
    """Pass a weld whose L is in the scratch: the coupling turns."""
    d = len(size)
    _, _, _, L = matrices(size)
    for m in range(d):
        for p in range(d):
            total = 0.0
            for k in range(d):
                total -= work[L + d * m + k] * loops.coupling[k, p]
            loops.passed[m, p] = total
    for m in range(d):
        for p in range(d):
            loops.coupling[m, p] = 0.0
    keep_coupling(loops, -1, i)


@inlined
def _eliminate(size, loops, known, least, i, work):  # type: ignore[no-untyped-def]
    """Eliminate a node component by component from `least` on.

    Its own matrix becomes −G, its coupling with the next node L; D of that node, its coupling with the start and S lose
    their parts. Returns the number of negative pivots.
    """
    d = len(size)
    _, A, K, L = matrices(size)
    column, beyond, start, _ = vectors(size)
    C, S, P = loops.coupling, loops.condensed, loops.passed
    negative = 0
    for k in range(d):
        if k < least or known[k, i]:
            leave_out(size, k, work)
            for m in range(d):
                C[k, m] = 0.0
    for k in range(d):
        if k < least or known[k, i]:
            continue
        pivot = work[A + d * k + k]
        negative += 0 if pivot > 0.0 else 1
        inverse = 1.0 / pivot
        take_column(size, k, work)
        for m in range(d):
            work[start + m] = C[k, m]
        for n in range(d):
            f, g, h = work[beyond + n] * inverse, work[column + n] * inverse, work[start + n] * inverse
            update_row(size, n, f, g, work)
            for m in range(d):
                P[n, m] -= f * work[start + m]
                C[n, m] -= g * work[start + m]
                S[n, m] -= h * work[start + m]
        put_column(size, k, inverse, work)
        for m in range(d):
            C[k, m] = work[start + m] * inverse
    for k in range(d * d):
        work[L + k] = work[K + k]
    return negative


@inlined
def keep_coupling(loops, port, i):  # type: ignore[no-untyped-def]
    """Keep K of node i, at which a stretch begins if its port is given, and go on to the next node."""
    d = len(loops.through)
    for p in range(d):
        for k in range(d):
            loops.K[i, d * p + k] = loops.coupling[k, p] - (loops.maps[port, k, p] if port >= 0 else 0.0)
            loops.coupling[k, p], loops.passed[k, p] = loops.passed[k, p], 0.0


@embedded
def end_stretch(size, loops, place, work):  # type: ignore[no-untyped-def]
    """Add what arrives at a kept junction to its matrix; nothing goes on."""
    d = len(size)
    end, start, values = loops.end[place], loops.start[place], loops.matrix.values
    W = loops.maps[end]
    D, _, product, _ = matrices(size)
    for p in range(d):
        for m in range(d):
            total = 0.0
            for k in range(d):
                total += W[k, p] * work[D + d * max(k, m) + min(k, m)]
            work[product + d * p + m] = total
    for p in range(d):
        for r in range(d):
            if loops.own[end, p, r] >= 0:
                total = 0.0
                for k in range(d):
                    total += work[product + d * p + k] * W[k, r]
                values[loops.own[end, p, r]] += total
            if start >= 0:
                if loops.own[start, p, r] >= 0:
                    values[loops.own[start, p, r]] += loops.condensed[p, r]
                if loops.cross[end, p, r] >= 0:  # an entry and its mirror image may be one
                    total = 0.0
                    for k in range(d):
                        total += W[k, p] * loops.coupling[k, r]
                    same = loops.unknowns[end, p] == loops.unknowns[start, r]
                    values[loops.cross[end, p, r]] += (2.0 if same else 1.0) * total
    for k in range(d):
        for m in range(d):
            work[D + d * k + m] = loops.coupling[k, m] = loops.condensed[k, m] = 0.0


@inlined
def clear(loops):  # type: ignore[no-untyped-def]
    """Nothing has come yet to the kept unknowns, but what their constraints put there."""
    for j in range(len(loops.x)):
        loops.x[j] = loops.load[j]
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
    d = len(loops.through) if end >= 0 else 0
    for p in range(d):
        if loops.unknowns[end, p] >= 0:
            for k in range(d):
                loops.x[loops.unknowns[end, p]] += loops.maps[end, k, p] * work[come + k]
        if start >= 0 and loops.unknowns[start, p] >= 0:
            loops.x[loops.unknowns[start, p]] += loops.through[p]
    for k in range(d):
        work[come + k] = loops.through[k] = 0.0


@inlined
def enter_stretch(loops, place, work, x):  # type: ignore[no-untyped-def]
    """Backward at a place: the kept unknowns at the end and at the start of what lies before it."""
    end, start = loops.end[place], loops.start[place]
    d = len(loops.through)
    for p in range(d if end >= 0 or loops.begin[place] >= 0 else 0):
        loops.through[p] = 0.0
        if start >= 0 and loops.unknowns[start, p] >= 0:
            loops.through[p] = loops.x[loops.unknowns[start, p]]
    for k in range(d if end >= 0 else 0):
        work[x + k] = 0.0
        for p in range(d):
            if loops.unknowns[end, p] >= 0:
                work[x + k] += loops.maps[end, k, p] * loops.x[loops.unknowns[end, p]]


@inlined
def add_start(loops, i, work, x):  # type: ignore[no-untyped-def]
    """Backward at node i: its unknowns, in the scratch, lose Kᵀ x of the start."""
    d = len(loops.through)
    for k in range(d):
        for p in range(d):
            work[x + k] -= loops.K[i, d * p + k] * loops.through[p]
