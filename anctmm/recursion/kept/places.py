"""Explicit steps of loops of pinned beams: kept places in scalar blocks.

Where beams are only pinned to kept junctions, and no constraint acts on these, the kept unknowns are places, and x and
y do not mix in their mass. The recursion of `loops` is then one of scalars, which x and y share: a node is coupled with
the place x at the start of its stretch by C_i = (C_r, C_g), and

    K_i = C_iᵀ G_i,    C_{i+1} = −L_i C_i,    S ← S − K_i C_i

once for a whole run, with G_i and L_i of `split`. In each step the loads b_i that arrive at a node put −K_i b_i on x,
and x takes K_iᵀ x from its accelerations. The sparse matrix of the kept places is factored once.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.junctions.structure import common
from anctmm.discretise.plan import Kept
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, kernel
from anctmm.jit.copies import writes
from anctmm.recursion.kept.sparse import (
    Sparse,
    factorize_kept,
    matrix_places,
    order_of,
    solve_pairs,
    sparse,
    with_room,
)

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@writes("x")
@by_address
class KeptPlaces(NamedTuple):
    """Kept places of pinned beams, and what couples nodes with them.

    Parameters
    ----------
    K : ndarray, shape (2, nodes)
        K_r and K_g; 0 outside of stretches.
    begin, end : ndarray of int, shape (bodies,)
        Kept place at which a stretch begins with the body, and the one at which the body ends; −1 for none.
    origin : ndarray of int, shape (bodies,)
        Kept place at which the stretch began that ends with the body; −1 for none.
    matrix : Sparse
    x : ndarray, shape (n, 2)
        Loads on the kept places, then their accelerations.
    """

    K: Array
    begin: Ints
    end: Ints
    origin: Ints
    matrix: Sparse
    x: Array


def kept_places(chain: Chain, L: Array, G: Array, D: Array) -> KeptPlaces | None:
    """Kept places of a chain of scalar blocks, factored; None where nothing is kept, or more than places.

    Parameters
    ----------
    chain : Chain
    L, G, D : ndarray
        Of its `SplitFactors`.
    """
    if not chain.plan.kept or not chain.kept.pinned:
        return None
    begin, end, origin, own, cross, pattern = common(chain, _pattern)
    matrix, bodies = with_room(pattern), chain.bodies
    found = KeptPlaces(np.zeros((2, bodies.nodes)), begin, end, origin, matrix, np.zeros((len(own), 2)))
    _factorize_places(bodies.first, bodies.masses, L, G, D, own, cross, found)
    return found


def _pattern(chain: Chain) -> tuple[Ints, Ints, Ints, Ints, Ints, Sparse]:
    """`begin`, `end` and `origin` of `KeptPlaces`; where the entry of each place stands in the matrix, and that of both
    ends of the stretch that ends with each body, or −1; the matrix.
    """
    begin, end, origin = np.full((3, len(chain.plan.steps)), -1)
    current = -1
    for b, step in enumerate(chain.plan.steps):
        if step.start is not None:
            begin[b] = current = step.start.junction
        if isinstance(step.to, Kept):
            end[b], origin[b], current = step.to.junction, current, -1
    free = np.zeros(len(chain.plan.kept), dtype=bool)  # no multipliers
    number = order_of(np.stack([end, origin])[:, origin >= 0], free, np.arange(len(free)))
    begin, end, origin = (np.where(of >= 0, number[of], -1) for of in (begin, end, origin))
    matrix = sparse(np.stack([end, origin])[:, origin >= 0], free)
    every = np.arange(len(free))[:, None]
    own = matrix_places(matrix, every, every).ravel()
    return begin, end, origin, own, matrix_places(matrix, end[:, None], origin[:, None]).ravel(), matrix


@kernel
def _factorize_places(
    first: Ints, masses: Array, L: Array, G: Array, D: Array, own: Ints, cross: Ints, kept: KeptPlaces
) -> None:
    """Find K of all nodes and the matrix of the kept places, and factor this; parameters as of `_pattern`."""
    K, begin, end, origin, matrix, _ = kept
    values = matrix.values
    r = g = S = 0.0
    for b in range(len(begin)):
        m, last = masses[b], first[b + 1] - 1
        for i in range(first[b], last + 1):
            starts = i == first[b] and begin[b] >= 0
            if starts:
                r, g, S = 0.0, m[0, 1], m[0, 0]
            K[0, i], K[1, i] = G[0, i] * r + G[1, i] * g, G[1, i] * r + G[2, i] * g
            S -= K[0, i] * r + K[1, i] * g
            r, g = -(L[0, i] * r + L[1, i] * g), -(L[2, i] * r + L[3, i] * g)
            if starts:  # the place is no unknown of the node, but x itself
                K[0, i] = -1.0
                r, g = r + m[3, 0], g + m[4, 0]
        if end[b] >= 0:
            here = D[0, last] - L[1, last] * D[1, last]
            values[own[end[b]]] += here + (m[0, 0] if first[b] == last else 0.0)
            if origin[b] >= 0:
                values[own[origin[b]]] += S
                same = origin[b] == end[b]  # an entry and its mirror image are one
                values[cross[b]] += (2.0 if same else 1.0) * r
            r = g = S = 0.0
    factorize_kept(matrix)


@embedded
def clear_places(kept):  # type: ignore[no-untyped-def]
    """Nothing has come yet to the kept places."""
    if kept is not None:
        for n in range(len(kept.x)):
            kept.x[n, 0] = kept.x[n, 1] = 0.0


@embedded
def pass_start(kept, i, a, x, y):  # type: ignore[no-untyped-def]
    """Forward at node i: the loads that have arrived there, in a, bring −K b to those of the start, (x, y)."""
    if kept is None:
        return x, y
    r, g = kept.K[0, i], kept.K[1, i]
    return x - (r * a[0, i] + g * a[2, i]), y - (r * a[1, i] + g * a[3, i])


@embedded
def leave_body(kept, b, rx, ry, x, y):  # type: ignore[no-untyped-def]
    """Forward behind a body: what comes to a kept place, (rx, ry), and to the start, (x, y), is added to their loads.

    Returns what goes on of both.
    """
    if kept is None or kept.end[b] < 0:
        return rx, ry, x, y
    end, origin = kept.end[b], kept.origin[b]
    kept.x[end, 0] += rx
    kept.x[end, 1] += ry
    if origin >= 0:
        kept.x[origin, 0] += x
        kept.x[origin, 1] += y
    return 0.0, 0.0, 0.0, 0.0


@embedded
def find_places(kept):  # type: ignore[no-untyped-def]
    """Accelerations of the kept places from their loads."""
    if kept is not None:
        solve_pairs(kept.matrix, kept.x)


@embedded
def enter_body(kept, b, rx, ry, x, y):  # type: ignore[no-untyped-def]
    """Backward at a body: accelerations of the kept place where it ends and of the start of its stretch."""
    if kept is None or kept.end[b] < 0:
        return rx, ry, x, y
    end, origin = kept.end[b], kept.origin[b]
    if origin < 0:
        return kept.x[end, 0], kept.x[end, 1], 0.0, 0.0
    return kept.x[end, 0], kept.x[end, 1], kept.x[origin, 0], kept.x[origin, 1]


@embedded
def take_start(kept, i, x, y, rx, ry, gx, gy):  # type: ignore[no-untyped-def]
    """Backward at node i: the acceleration of the start, (x, y), takes Kᵀ x from what its loads alone would bring."""
    if kept is None:
        return rx, ry, gx, gy
    r, g = kept.K[0, i], kept.K[1, i]
    return rx - r * x, ry - r * y, gx - g * x, gy - g * y
