"""Order of elimination, and which blocks it fills."""

import heapq
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.by_address import by_address

Ints = NDArray[np.int64]


@by_address
class Plan(NamedTuple):
    """Structure of a factorization, for kernels; blocks are numbered by their position in the order.

    Parameters
    ----------
    start : ndarray of int, shape (blocks + 1,)
        Where the blocks below the diagonal of each column begin.
    row : ndarray of int, shape (entries,)
        Row of each of them, ascending in a column.
    first : ndarray of int, shape (entries + 1,)
        Where the updates of each of them begin in `target`.
    target : ndarray of int
        Numbers of the blocks that a pivot updates: for entries a of its column and b ≤ a that in row a, column b.
        The diagonal block of a column has its number, an entry e the number blocks + e.
    """

    start: Ints
    row: Ints
    first: Ints
    target: Ints


def minimum_degree(
    neighbours: Sequence[set[int]], waiting: Iterable[int] = ()
) -> tuple[list[int], list[set[int]]]:
    """Order of elimination by minimum degree, ties by number.

    Parameters
    ----------
    neighbours : sequence of set of int
        Blocks that each block is coupled with; the sets are used up.
    waiting : iterable of int
        Blocks of multipliers: each is eliminated after all its neighbours that do not wait.

    Returns
    -------
    order : list of int
    columns : list of set of int
        For each block of the order the blocks that are left and coupled with it at its elimination.
    """
    late = set(waiting)
    ahead = {block: len(neighbours[block] - late) for block in late}
    partners = {block: neighbours[block] - late for block in late}
    heap = [(len(near), block) for block, near in enumerate(neighbours) if not ahead.get(block)]
    heapq.heapify(heap)
    done = bytearray(len(neighbours))
    order, columns = list[int](), list[set[int]]()
    waits_for: dict[int, list[int]] = {}
    for block, near in partners.items():
        for other in near:
            waits_for.setdefault(other, []).append(block)
    while heap:
        degree, block = heapq.heappop(heap)
        near = neighbours[block]
        if done[block] or degree != len(near):
            continue
        done[block] = 1
        order.append(block)
        columns.append(near)
        for other in near:
            links = neighbours[other]
            links |= near
            links -= {block, other}
            if not ahead.get(other):
                heapq.heappush(heap, (len(links), other))
        for other in waits_for.get(block, ()):
            ahead[other] -= 1
            if not ahead[other]:
                heapq.heappush(heap, (len(neighbours[other]), other))
    return order, columns


def plan_of(order: Sequence[int], columns: Sequence[set[int]]) -> tuple[Plan, Ints]:
    """Structure of the factorization in an order.

    Returns
    -------
    plan : Plan
    position : ndarray of int, shape (blocks,)
        Of each block in the order.
    """
    blocks = len(order)
    position = np.empty(blocks, dtype=np.int64)
    position[order] = np.arange(blocks)
    places = position.tolist()
    rows = [sorted(places[other] for other in near) for near in columns]
    start = np.cumsum([0, *map(len, rows)])
    row = np.array([i for column in rows for i in column], dtype=np.int64)
    first, i, j = [0], list[int](), list[int]()
    for column in rows:
        for a, one in enumerate(column):
            i += [one] * (a + 1)
            j += column[: a + 1]
            first.append(len(i))
    start, begins = (np.asarray(t, dtype=np.int64) for t in (start, first))
    plan = Plan(start, row, begins, np.empty(0, np.int64))
    return plan._replace(target=numbers_of(plan, np.array(i), np.array(j))), position


def numbers_of(plan: Plan, i: Ints, j: Ints) -> Ints:
    """Numbers of the blocks in rows i ≥ columns j, by positions; each is one of the structure."""
    blocks = len(plan.start) - 1
    columns = np.repeat(np.arange(blocks), np.diff(plan.start))
    keys = columns * blocks + plan.row
    return np.where(i == j, i, blocks + np.searchsorted(keys, j * blocks + i)).astype(np.int64)
