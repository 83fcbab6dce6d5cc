"""Stiffness of connectors between kept nodes, added to the matrix of the kept unknowns.

The vectors a and b of such a connector depend on the kept unknowns x by linear maps, a = A x and b = B x. With C the
second derivatives of its energy by a and b, it couples them by AᵀC B + BᵀCᵀA; what acts on one vector alone is part of
the matrix of its element (`anctmm.forces.stiffness`).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.kept import Port
from anctmm.discretise.maps import Map
from anctmm.discretise.plan import Kept
from anctmm.forces.connectors import vectors_of
from anctmm.forces.stiffness import mixed_at
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded
from anctmm.recursion.kept.sparse import Sparse, matrix_places

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Entries(NamedTuple):
    """What connectors couple, by the old numbers of the kept unknowns.

    Parameters
    ----------
    connector : ndarray of int, shape (n,)
        Which couples each pair, in ascending order.
    pairs : ndarray of int, shape (2, n)
        An unknown of a, and one of b.
    left, right : ndarray, shape (n, 2)
        Columns of A and B that belong to these.
    """

    connector: Ints
    pairs: Ints
    left: Array
    right: Array


@by_address
class Coupled(NamedTuple):
    """The same for kernels.

    Parameters
    ----------
    connector : ndarray of int, shape (m,)
    start : ndarray of int, shape (m + 1,)
        Where the entries of each begin.
    place : ndarray of int, shape (entries,)
        Where they stand in `Sparse.values`.
    left, right : ndarray, shape (entries, 2)
        Columns of A and B; of an unknown that both have, that of A is doubled: an entry and its mirror image are one.
    """

    connector: Ints
    start: Ints
    place: Ints
    left: Array
    right: Array


def entries_of(chain: Chain) -> Entries:
    """What the coupled connectors of a scene couple; each of their nodes is kept, or its motion known."""
    ports = _ports(chain)
    found: list[tuple[int, int, int, tuple[float, float], tuple[float, float]]] = []
    for n in sorted(chain.segments.coupled):
        a, b = vectors_of(chain.parts, chain.bodies, chain.parts.connectors[n])
        if a.site != b.site:
            one, two = _columns(chain, ports, a), _columns(chain, ports, b)
            found += [(n, i, j, one[i], two[j]) for i in one for j in two]
    connector, i, j = (np.array([entry[k] for entry in found], dtype=np.int64) for k in range(3))
    left, right = (np.array([e[k] for e in found], dtype=np.float64).reshape(-1, 2) for k in (3, 4))
    return Entries(connector, np.array([i, j]), left, right)


def coupled_of(entries: Entries, number: Ints, matrix: Sparse) -> Coupled | None:
    """The same by the new numbers of the kept unknowns; None where there is nothing: then nothing of it is compiled."""
    if not len(entries.connector):
        return None
    one, two = number[entries.pairs]
    connector, start = np.unique(entries.connector, return_index=True)
    same = np.where(one == two, 2.0, 1.0)[:, None]
    return Coupled(
        connector,
        np.append(start, len(one)),
        matrix_places(matrix, one[:, None], two[:, None]).reshape(-1),
        same * entries.left,
        entries.right,
    )


def _ports(chain: Chain) -> dict[int, Port]:
    """What nodes take from the kept unknowns, in their own frames."""
    found = dict[int, Port]()
    for step in chain.plan.steps:
        for end, to in ((step.inboard, step.start), (step.outboard, step.to)):
            if isinstance(to, Kept):
                found[chain.node(end)] = chain.kept.port(to, end, turned=True)
    return found


def _columns(chain: Chain, ports: dict[int, Port], vector: Map) -> dict[int, tuple[float, float]]:
    """By which kept unknowns a vector changes, and how."""
    found = dict[int, tuple[float, float]]()
    for node, row, a, b in vector.terms:
        if chain.prescribed[row, node]:
            continue
        port = ports[node]
        assert port.shared[row]  # its vertex has kept it (`Segments.coupled_ends`)
        for unknown, x, y in zip(port.unknowns.tolist(), *port.map[row : row + 2].tolist(), strict=True):
            if unknown >= 0 and (x or y):
                before = found.get(unknown, (0.0, 0.0))
                found[unknown] = before[0] + a * x - b * y, before[1] + a * y + b * x
    return found


@embedded
def add_coupled(coupled, matrix, q, stiffness, connectors, values):  # type: ignore[no-untyped-def]
    """Add what connectors couple at coordinates q, times `stiffness`, to the matrix of the kept unknowns."""
    if coupled is not None:
        for m in range(len(coupled.connector)):
            xx, xy, yx, yy = mixed_at(connectors, coupled.connector[m], q, stiffness, values)
            for k in range(coupled.start[m], coupled.start[m + 1]):
                x = coupled.left[k, 0] * xx + coupled.left[k, 1] * yx
                y = coupled.left[k, 0] * xy + coupled.left[k, 1] * yy
                matrix.values[coupled.place[k]] += x * coupled.right[k, 0] + y * coupled.right[k, 1]
