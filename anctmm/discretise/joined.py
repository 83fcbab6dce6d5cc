"""Independent unknowns of a scene: those of all nodes, reduced by the joints."""

from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain

Array = NDArray[np.float64]


class Joined:
    """Independent unknowns of a scene: those of all nodes, less known ones, less the doubles at joints.

    Parameters
    ----------
    chain : Chain
    free : bool
        Whether guides that hold places on lines in the ground are left out.
    """

    def __init__(self, chain: Chain, *, free: bool = False) -> None:
        bodies = chain.bodies
        guided = {end for one in chain.guided for end in one.ends}
        self.shape = (bodies.rows, bodies.nodes)
        index = np.arange(bodies.rows * bodies.nodes).reshape(self.shape)
        master = ~chain.prescribed
        entries: list[tuple[int, int, float]] = []
        for row, ends in chain.shared_vectors():
            if row == 0 and not free and ends[0] in guided:
                continue
            first, *others = sorted(ends, key=chain.node)
            i = chain.node(first)
            for end in () if chain.prescribed[row, i] else others:
                j = chain.node(end)
                c, s = chain.turn_between(first, end) if row else (1.0, 0.0)
                master[row : row + 2, j] = False
                for k, n, value in ((0, 0, c), (0, 1, -s), (1, 0, s), (1, 1, c)):
                    entries.append((index[row + k, j], index[row + n, i], value))
        for end, port in chain.on_bodies():
            j = chain.node(end)
            for own in map(int, np.flatnonzero(port.shared & ~chain.prescribed[:, j])):
                master[own, j] = False
                for p in np.flatnonzero(port.map[own]):
                    home = chain.kept.homes[:, port.unknowns[p]]
                    entries.append((index[own, j], index[home[0], home[1]], port.map[own, p]))
        kept = np.ones(self.shape)
        lines = [] if free else chain.guided
        for one in lines:  # the unknown along a line stands where x of its first node does
            i, *nodes = sorted(map(chain.node, one.ends))
            x, y = one.direction
            master[1, i], kept[0, i] = False, x
            entries.append((index[1, i], index[0, i], y))
            for j in nodes:
                master[:2, j] = False
                entries += [(index[0, j], index[0, i], x), (index[1, j], index[0, i], y)]
        self.masters = index[master]
        number = np.full(index.size, -1)
        number[self.masters] = np.arange(self.masters.size)
        rows = np.concatenate([self.masters, [e[0] for e in entries]]).astype(int)
        columns = number[np.concatenate([self.masters, [e[1] for e in entries]]).astype(int)]
        values = np.concatenate([kept.ravel()[self.masters], [e[2] for e in entries]])
        self._entries = values, (rows, columns)
        #: Where x and y of the unknowns along lines stand, and the directions.
        self.lines = index[:2, [min(map(chain.node, one.ends)) for one in lines]]
        self.along = np.array([one.direction for one in lines]).reshape(-1, 2).T

    @cached_property
    def matrix(self) -> "scipy.sparse.csr_array":
        """Unknowns of all nodes, (rows · nodes, size), from the independent ones."""
        return scipy.sparse.csr_array(self._entries, shape=(self.shape[0] * self.shape[1], self.size))

    def full_matrix(self) -> Array:
        """The same with its zeros: where it is small, it is there much sooner."""
        values, places = self._entries
        found = np.zeros((self.shape[0] * self.shape[1], self.size))
        np.add.at(found, places, values)
        return found

    @property
    def size(self) -> int:
        """Number of independent unknowns."""
        return int(self.masters.size)

    def spread(self, x: Array) -> Array:
        """Unknowns of all nodes, (rows, nodes), from the independent ones."""
        return (self.matrix @ x).reshape(self.shape)

    def gather(self, f: Array) -> Array:
        """Generalized forces on the independent unknowns from those on all nodes, (rows, nodes)."""
        return self.matrix.T @ f.ravel()

    def load(self, f: Array) -> Array:
        """Forces on nodes, (rows, nodes), whose `gather` is f."""
        out = np.zeros(self.shape)
        out.ravel()[self.masters] = f
        out.ravel()[self.lines] = self.along * out.ravel()[self.lines[0]]
        return out

    def unknowns(self, a: Array) -> Array:
        """Independent unknowns among those of all nodes, (rows, nodes)."""
        if not self.lines.size:
            return a.ravel()[self.masters]
        found = a.copy()
        found.ravel()[self.lines[0]] = (self.along * a.ravel()[self.lines]).sum(axis=0)
        return found.ravel()[self.masters]
