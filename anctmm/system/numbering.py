"""Which vectors of a scene are equal or known, and how the unknown ones are numbered in blocks.

What a joint says of two vectors alone, that they are equal, or of one, that it is known, needs no constraint row: the
first are one unknown, the others none. All other equations are rows with multipliers.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anctmm.elimination.order import Plan, minimum_degree, numbers_of, plan_of
from anctmm.model.expressions import Scalar, Signal, Vector
from anctmm.model.joints import Equation
from anctmm.system.mesh import Mesh

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Known = Mapping[Signal | None, Array]

#: Part of a coefficient below which it is rounding.
ROUNDING = 1e-13
#: What stands for a pair of vectors of which one is known.
NOWHERE = -1
#: How the matrix of a pair stands in its block: as it is, transposed, or both.
PLAIN, TRANSPOSED, BOTH = 0, 1, 2


@dataclass(frozen=True)
class Row:
    """A constraint row: an equation with a multiplier.

    Parameters
    ----------
    equation : Scalar
    owner : str
        What it holds, for messages.
    group : int
        Rows of one equation of vectors, or of one joint, have the same.
    """

    equation: Scalar
    owner: str
    group: int

    @property
    def vectors(self) -> set[int]:
        """Numbers of the vectors that it depends on."""
        used = {x for x, _ in self.equation.terms}
        return used | {x for i, j, _ in self.equation.pairs for x in (i, j)}


@dataclass
class Shares:
    """Which vectors are one, and which are known (union-find)."""

    parent: dict[int, int] = field(default_factory=dict)
    known: dict[int, Known] = field(default_factory=dict)

    def root(self, x: int) -> int:
        """The vector that stands for all that are equal to one."""
        while (above := self.parent.get(x, x)) != x:
            self.parent[x] = x = self.parent.get(above, above)
        return x

    def value(self, x: int) -> Known | None:
        """Constants of a known vector by signal."""
        return self.known.get(self.root(x))

    def take(self, equation: Vector) -> bool:
        """Whether an equation makes two vectors one, or one known, or says again what is so."""
        terms, constants = self._reduced(equation)
        if not terms:
            return all(np.abs(b).max() <= self._noise(equation) for b in constants.values())
        if any(w is not None for _, w in terms):
            return False
        (one, A), *others = ((x, A) for (x, _), A in terms.items())
        if not others:
            if np.abs(A @ A.T - np.eye(len(A))).max() > ROUNDING:
                return False
            self.known[one] = {w: -A.T @ b for w, b in constants.items()}
            return True
        if len(others) > 1 or any(np.abs(b).max() > self._noise(equation) for b in constants.values()):
            return False
        two, B = others[0]
        size, eye = A[0, 0], np.eye(len(A))
        if abs(abs(size) - 1.0) > ROUNDING or np.abs(A - size * eye).max() > ROUNDING:
            return False
        if np.abs(B + A).max() > ROUNDING:
            return False
        self.parent[max(one, two)] = min(one, two)
        return True

    def _reduced(
        self, equation: Vector
    ) -> tuple[dict[tuple[int, Signal | None], Array], dict[Signal | None, Array]]:
        """Terms over unknown vectors that are not equal, with known ones among the constants."""
        terms: dict[tuple[int, Signal | None], Array] = {}
        constants = {w: np.array(b, dtype=float) for w, b in equation.constants.items()}
        for (x, w), A in equation.terms.items():
            root = self.root(x)
            known = self.known.get(root)
            if known is None or (w is not None and set(known) != {None}):
                terms[root, w] = terms.get((root, w), 0.0) + A
                continue
            for u, b in known.items():
                signal = w if u is None else u
                constants[signal] = constants.get(signal, 0.0) + A @ b
        return {key: A for key, A in terms.items() if np.abs(A).max() > ROUNDING}, constants

    @staticmethod
    def _noise(equation: Vector) -> float:
        return 1e-9 * (1.0 + float(np.abs(equation.at).max()))


class Numbering:
    """Unknowns of a scene.

    Parameters
    ----------
    mesh : Mesh
    equations : sequence of (str, sequence of Scalar or Vector)
        Of each joint and rigid body: what it holds, for messages, and what is zero.
    coupled : iterable of sequence of int
        Numbers of vectors that connectors couple beside elements and rows, pair by pair.

    Attributes
    ----------
    rows : list of Row
    at : ndarray of int, shape (slots, nodes)
        Place of each vector in the unknowns, −1 of a known one.
    multiplier : ndarray of int, shape (rows,)
        Place of each multiplier in the unknowns.
    plan : Plan
    blocks : int
    """

    def __init__(
        self,
        mesh: Mesh,
        equations: Sequence[tuple[str, Sequence[Equation]]],
        coupled: Iterable[Sequence[int]] = (),
    ) -> None:
        self.mesh, self.shares = mesh, Shares()
        self.rows = self._rows(equations)
        self._blocks = self._vector_blocks()
        self._place_multipliers()
        self._order(list(coupled))

    def _rows(self, equations: Sequence[tuple[str, Sequence[Equation]]]) -> list[Row]:
        """Rows for all that does not make vectors equal or known."""
        left = [(owner, e, n) for n, (owner, parts) in enumerate(equations) for e in parts]
        while True:
            found = [item for item in left if not (isinstance(item[1], Vector) and self.shares.take(item[1]))]
            if len(found) == len(left):
                break
            left = found
        rows, seen = list[Row](), set[tuple[object, ...]]()
        for group, (owner, equation, _) in enumerate(left):
            for part in _parts(equation):
                row = Row(_without_zeros(part), owner, group)
                key = self._key(row)
                if key not in seen and any(map(self._moves, row.vectors)):
                    seen.add(key)
                    rows.append(row)
        return rows

    def _moves(self, x: int) -> bool:
        """Whether a vector is unknown or driven. Rows of driven ones alone tell where a linkage locks."""
        known = self.shares.value(x)
        return known is None or bool(known.keys() - {None})

    def _key(self, row: Row) -> tuple[object, ...]:
        """The same for rows of the same terms over vectors that are one."""
        e, root = row.equation, self.shares.root
        return (
            frozenset((root(i), root(j), w, C.tobytes()) for (i, j, w), C in e.pairs.items()),
            frozenset((root(x), w, c.tobytes()) for (x, w), c in e.terms.items()),
            frozenset(e.constants.items()),
        )

    def _vector_blocks(self) -> list[list[int]]:
        """Unknown vectors of each block: those of a node that stand for themselves."""
        mesh, blocks = self.mesh, list[list[int]]()
        shared = self.shares.parent.keys() | self.shares.known.keys()
        for name, body in mesh.bodies.items():
            for node in range(mesh.first[name], mesh.first[name] + body.nodes):
                own = range(node * mesh.slots, node * mesh.slots + body.vectors)
                found = [x for x in own if x not in shared]
                if found:
                    blocks.append(found)
        return blocks

    def _place_multipliers(self) -> None:
        """Multipliers of an equation of vectors stand beside a vector of coefficient ±1, where there is room.

        The pivot of such a block is safe whatever the matrix of the vector is. All others have blocks of their own,
        which are eliminated after all vectors of their rows, and those that these vectors are equal to by such rows.
        """
        dim, size = self.mesh.dim, self.mesh.rows
        self._block_of = {x: b for b, found in enumerate(self._blocks) for x in found}
        room = [size - dim * len(found) for found in self._blocks]
        self._beside: dict[int, tuple[int, int]] = {}
        self._hosted: dict[int, list[int]] = {}
        self._late: list[list[int]] = []
        groups: dict[int, list[int]] = {}
        for k, row in enumerate(self.rows):
            groups.setdefault(row.group, []).append(k)
        taken = set[int]()
        for members in groups.values():
            host = self._host(members, room, taken)
            if host is None:
                self._late += [members[k : k + size] for k in range(0, len(members), size)]
                continue
            block = self._block_of[host]
            taken.add(host)
            self._hosted[host] = members
            for k in members:
                self._beside[k] = block, size - room[block]
                room[block] -= 1

    def _host(self, members: Sequence[int], room: Sequence[int], taken: set[int]) -> int | None:
        """The vector that the multipliers of some rows can stand beside."""
        if len(members) != self.mesh.dim or any(self.rows[k].equation.pairs for k in members):
            return None
        candidates = dict[int, list[Array]]()
        for k in members:
            for (x, w), c in self.rows[k].equation.terms.items():
                candidates.setdefault(self.shares.root(x) if w is None else -1, []).append(c)
        for x, coefficients in reversed(candidates.items()):
            if x in taken or self._block_of.get(x) is None or len(coefficients) != len(members):
                continue
            J = np.array(coefficients)
            if room[self._block_of[x]] >= len(members) and np.abs(J @ J.T - np.eye(len(J))).max() < ROUNDING:
                return x
        return None

    def _order(self, coupled: list[Sequence[int]]) -> None:
        """Order of elimination, and the places of all unknowns."""
        count = len(self._blocks)
        near: list[set[int]] = [set() for _ in range(count + len(self._late))]
        for one, two in self._couplings(coupled):
            if one != two:
                near[one].add(two)
                near[two].add(one)
        order, columns = minimum_degree(near, range(count, len(near)))
        plan, position = plan_of(order, columns)
        self.plan: Plan = plan
        self.blocks = len(near)
        size, dim = self.mesh.rows, self.mesh.dim
        place = np.full(self.mesh.nodes * self.mesh.slots, -1, dtype=np.int64)
        for b, found in enumerate(self._blocks):
            place[found] = position[b] * size + dim * np.arange(len(found))
        every = np.arange(len(place))
        for x, above in self.shares.parent.items():
            every[x] = self.shares.root(above)
        self.root = every
        place = place[every]
        self.at = np.ascontiguousarray(place.reshape(self.mesh.nodes, self.mesh.slots).T)
        self._place = place
        self.multiplier = np.empty(len(self.rows), dtype=np.int64)
        for k, (block, offset) in self._beside.items():
            self.multiplier[k] = position[block] * size + offset
        for b, members in enumerate(self._late):
            self.multiplier[members] = position[count + b] * size + np.arange(len(members))

    def _couplings(self, coupled: list[Sequence[int]]) -> Iterable[tuple[int, int]]:
        """Pairs of blocks that the matrix couples."""
        mesh, root, block_of = self.mesh, self.shares.root, self._block_of
        merged = [root(x) if x in self.shares.parent else x for x in range(mesh.nodes * mesh.slots)]
        block = [block_of.get(x, -1) for x in merged]
        for name, body in mesh.bodies.items():
            first, width = mesh.first[name], 2 if body.elements else body.nodes
            for node in range(first, first + body.nodes - width + 1):
                own = range(node * mesh.slots, (node + width) * mesh.slots)
                used = {block[x] for x in own} - {-1}
                if len(used) > 1:
                    yield from ((a, b) for a in used for b in used if a < b)
        late = {k: len(self._blocks) + b for b, members in enumerate(self._late) for k in members}
        for k, row in enumerate(self.rows):
            used = {block[x] for x in row.vectors} - {-1}
            if k in late:
                yield from ((late[k], b) for b in {block[x] for x in self._tied(row)} - {-1})
            else:
                yield from ((self._beside[k][0], b) for b in used)
            yield from ((a, b) for a in used for b in used if a < b and self.curved(row))
        for group in coupled:
            used = {block[x] for x in group} - {-1}
            yield from ((a, b) for a in used for b in used if a < b)

    def _tied(self, row: Row) -> set[int]:
        """Vectors of a row, and those that rows whose multipliers stand beside them tie them to."""
        found, new = set[int](), {self.shares.root(x) for x in row.vectors}
        while new:
            found |= new
            rows = [self.rows[k] for x in new for k in self._hosted.get(x, ())]
            new = {self.shares.root(x) for other in rows for x in other.vectors} - found
        return found

    @staticmethod
    def curved(row: Row) -> bool:
        """Whether a row has products of vectors."""
        return bool(row.equation.pairs)

    def codes(self, x: Ints, y: Ints) -> Ints:
        """How kernels find the blocks of pairs of vectors in the matrix, (n,); −1 where one is known.

        A code is 4 (number of the block · B² + first row · B + first column) + how it stands there.
        """
        return self._codes(self._place[x], self._place[y])

    def row_codes(self, row: Ints, x: Ints) -> Ints:
        """The same of multipliers of rows and vectors."""
        return self._codes(self.multiplier[row], self._place[x])

    def _codes(self, i: Ints, j: Ints) -> Ints:
        size = self.mesh.rows
        swap = i < j
        low, high = np.where(swap, j, i), np.where(swap, i, j)
        good = np.minimum(i, j) >= 0
        a, b = np.where(good, low, 0), np.where(good, high, 0)
        number = numbers_of(self.plan, a // size, b // size)
        stand = np.where(i == j, BOTH, np.where(swap, TRANSPOSED, PLAIN))
        found = 4 * (number * size * size + a % size * size + b % size) + stand
        return np.where(good, found, NOWHERE).astype(np.int64)

    @cached_property
    def padding(self) -> Ints:
        """Unknowns of no meaning, which fill blocks: their diagonal is 1."""
        size, dim = self.mesh.rows, self.mesh.dim
        used = np.zeros(self.blocks * size, dtype=bool)
        for k in range(dim):
            used[self._place[self._place >= 0] + k] = True
        used[self.multiplier] = True
        return np.flatnonzero(~used)

    @cached_property
    def unknowns(self) -> int:
        """Number of unknown coordinates, without multipliers."""
        return self.mesh.dim * sum(map(len, self._blocks))


def _parts(equation: Equation) -> Sequence[Scalar]:
    """Rows of an equation."""
    if isinstance(equation, Vector):
        return equation.components()
    return [equation] if isinstance(equation, Scalar) else equation


def _without_zeros(row: Scalar) -> Scalar:
    """A row without terms that are zero."""
    return Scalar(
        row.at,
        {key: C for key, C in row.pairs.items() if np.any(C)},
        {key: c for key, c in row.terms.items() if np.any(c)},
        row.constants,
    )
