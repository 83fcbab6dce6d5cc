"""Kept unknowns: their numbering, their position among the coordinates, and the map from them to the ends of bodies.

The kept unknowns of a rigid body are r and t; those of another kept vertex are its position, unless it is fixed, and
the gradients of its welded groups, in the frame of the first end of each.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.junctions.constraints import Constraints, Situated, constraints_of
from anctmm.discretise.junctions.vertices import Vertex
from anctmm.discretise.plan import Kept, Plan
from anctmm.model.places import End

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

#: Independent motions of kept unknowns, and constraints between them, up to which an explicit step takes them one by
#: one, each over all nodes; and nodes up to which their fields are found by a general sparse solver.
FEW, NODES = 8, 20_000


class Passed(Situated, Protocol):
    """The part of `anctmm.discretise.chain.Chain` that this module needs."""

    @property
    def plan(self) -> Plan:
        """Order and links of the bodies."""
        ...

    @property
    def bodies(self) -> Bodies:
        """Bodies as they are passed."""
        ...

    @property
    def prescribed(self) -> Mask:
        """Components whose motion is known, (rows, nodes)."""
        ...

    def node(self, end: End) -> int:
        """Node at an end of a body."""
        ...

    def frame_of(self, to: End | Kept) -> End:
        """The end whose frame is that of an end, or of a kept group."""
        ...

    def turn_between(self, one: End, two: End) -> tuple[float, float]:
        """Cosine and sine of the turn from the frame of an end to that of another."""
        ...


class Port(NamedTuple):
    """What an end takes from kept unknowns x, a = W x.

    Parameters
    ----------
    unknowns : ndarray of int, shape (d,)
        Numbers of these unknowns, or −1.
    shared : ndarray of bool, shape (d,)
        Components of the end that they give.
    map : ndarray, shape (d, d)
        W; rows of other components are 0.
    """

    unknowns: Ints
    shared: Mask
    map: Array


@dataclass(frozen=True)
class KeptUnknowns:
    """The kept unknowns of a scene.

    Parameters
    ----------
    chain : Passed
    """

    chain: Passed

    @cached_property
    def first(self) -> dict[tuple[int, int | None], int]:
        """Number of the first unknown of each kept place or body, (vertex, None), and of each group's gradients."""
        numbers: dict[tuple[int, int | None], int] = {}
        size = 0
        for j, vertex in enumerate(self.chain.plan.kept):
            if vertex.body is not None:
                numbers[j, None] = size
                size += 4
                continue
            if not vertex.held:
                numbers[j, None] = size
                size += 2
            for g, group in enumerate(vertex.welded):
                if not self.chain.prescribed[2, self.chain.node(group[0])]:
                    numbers[j, g] = size
                    size += self._gradients(group)
        numbers[-1, None] = size
        return numbers

    def _gradients(self, group: Sequence[End]) -> int:
        return int(self.chain.bodies.mesh(group[0][0]).held) - 2

    @cached_property
    def few(self) -> bool:
        """Whether these are so few that an explicit step finds their independent motions one by one."""
        still, lines = int(self.constraints.still.sum()), len(self.chain.guided)
        left = len(self.constraints.names) - still
        return max(self.size + lines - still, left) <= FEW and self.chain.bodies.nodes <= NODES

    @cached_property
    def pinned(self) -> bool:
        """Whether these are places alone, free of constraints and lines: those of pinned beams."""
        vertices = self.chain.plan.kept
        places = all(v.body is None and not v.held and not v.welded for v in vertices)
        return places and not self.constraints.names and not self.chain.guided

    @property
    def size(self) -> int:
        """Number of kept coordinates."""
        return self.first[-1, None]

    @cached_property
    def homes(self) -> Ints:
        """Row and node of a coordinate that is each unknown, (2, size)."""
        found = np.zeros((2, self.size), dtype=np.int64)
        for (j, g), begin in self.first.items():
            if j < 0:
                continue
            vertex = self.chain.plan.kept[j]
            if vertex.body is not None:
                rows = np.arange(4)
            elif g is None:
                rows = np.arange(2)
            else:
                rows = np.arange(2, 2 + self._gradients(vertex.welded[g]))
            end = vertex.groups[0][0] if g is None else vertex.welded[g][0]
            found[0, begin : begin + len(rows)], found[1, begin : begin + len(rows)] = (
                rows,
                self.chain.node(end),
            )
        return found

    @cached_property
    def constraints(self) -> Constraints:
        """What holds between the kept unknowns."""
        return constraints_of(self.chain, self.of_end, self.size)

    @cached_property
    def dual(self) -> Mask:
        """Which unknowns of the kept system are multipliers: they stand behind the coordinates."""
        return np.arange(self.size + len(self.constraints.names)) >= self.size

    @cached_property
    def blocks(self) -> Ints:
        """Unknowns that are eliminated together have one number."""
        starts = np.zeros(len(self.dual), dtype=np.int64)
        starts[[begin for begin in self.first.values() if begin < len(starts)]] = 1
        starts[self.size + np.array(self.constraints.begins, dtype=np.int64)] = 1
        return np.asarray(np.cumsum(starts) - 1)

    def of_end(self, end: End) -> tuple[int | None, int | None, Vertex] | None:
        """First numbers of the place and the gradients of an end at a kept vertex, and the vertex; None elsewhere."""
        found = self._at.get(end)
        if found is None:
            return None
        j, g = found
        return (
            self.first.get((j, None)),
            self.first.get((j, g)) if g is not None else None,
            self.chain.plan.kept[j],
        )

    @cached_property
    def _at(self) -> dict[End, tuple[int, int | None]]:
        found: dict[End, tuple[int, int | None]] = {}
        for j, vertex in enumerate(self.chain.plan.kept):
            found |= {end: (j, None) for group in vertex.groups for end in group}
            found |= {end: (j, g) for g, group in enumerate(vertex.welded) for end in group}
        return found

    def port(self, kept: Kept, end: End, turned: bool) -> Port:
        """What an end takes there; in its own frame if `turned`, else in that of the kept gradients."""
        vertex = self.chain.plan.kept[kept.junction]
        d, node = self.chain.bodies.rows, self.chain.node(end)
        unknowns, map_ = np.full(d, -1), np.zeros((d, d))
        own = self.chain.bodies.mesh(end[0]).held if kept.group is not None else 2
        c, s = self.chain.turn_between(self.chain.frame_of(kept), end) if turned and own > 2 else (1.0, 0.0)
        turn = np.array([[c, -s], [s, c]])
        place, gradients = self.first.get((kept.junction, None)), self.first.get((kept.junction, kept.group))
        if vertex.body is not None:
            assert place is not None  # a body has unknowns
            unknowns[:4] = place + np.arange(4)
            center = self.chain.node((vertex.body, 1))
            reference = self.chain.bodies.reference()
            x, y = reference[:2, node] - reference[:2, center]
            map_[0, 0] = map_[1, 1] = 1.0
            map_[:2, 2:4] = [[x, -y], [y, x]]
            for k in range(2, own, 2):
                map_[k : k + 2, 2:4] = turn
                turn = turn @ [[0.0, -1.0], [1.0, 0.0]]  # r_y stands across r_x
        else:
            if place is not None:
                unknowns[:2] = place + np.arange(2)
                map_[0, 0] = map_[1, 1] = 1.0
            if kept.group is not None and gradients is not None:
                unknowns[2:own] = gradients + np.arange(own - 2)
                for k in range(2, own, 2):
                    map_[k : k + 2, k : k + 2] = turn
        shared = np.arange(d) < own
        map_[self.chain.prescribed[:, node]] = 0.0
        return Port(unknowns, shared, map_)
