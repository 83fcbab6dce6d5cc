"""Constraints Φ(q, p(t)) = 0, p the angle or the position of a drive: values, Jacobian, second derivatives.

Every row is a sum of products x·Q y of two vectors that are linear in the coordinates (one of which may be constant),
some with Q turned by the angle of a drive: Φ = Σ x·R(p) Q y − (target, or p itself).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.model.drives import value_at
from reference.global_dae.vectors import QUARTER, Vector

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Drive:
    """History of an angle (rad) or a position on a line (m): name, for errors, and callable t -> (p, p', p'')."""

    name: str
    history: Callable[[float], tuple[float, float, float]]

    def __call__(self, t: float) -> Array:
        """(p, p', p'') at a time."""
        return value_at(self.name, self.history, t, 3)


class Term(NamedTuple):
    """one · Q two, or one · R(p) Q two where `turned`."""

    one: Vector
    Q: Array
    two: Vector
    turned: bool = False

    @property
    def constant(self) -> bool:
        """Whether its derivative by the coordinates is constant."""
        still = not self.one.moves or not self.two.moves
        return still and not (self.turned and (self.one.moves or self.two.moves))


class Row(NamedTuple):
    """Σ terms = target; where `along`, = p.

    held: whether nodes of beams alone stand in it, with constant factors: explicit steps and stages set such
    coordinates, the others follow from the equations of motion.
    """

    terms: tuple[Term, ...]
    target: float = 0.0
    drive: Drive | None = None
    along: bool = False
    held: bool = False

    @property
    def constant(self) -> bool:
        """Whether its derivative by the coordinates is constant."""
        return all(term.constant for term in self.terms)


class Constraints:
    """All constraints of a scene, evaluated together.

    Parameters
    ----------
    rows : sequence of Row
    size : int
        Number of coordinates.
    """

    def __init__(self, rows: Sequence[Row], size: int) -> None:
        self.rows, self.size, self.count = rows, size, len(rows)
        self.constant = all(row.constant for row in rows)
        self.held = np.array([row.held for row in rows], dtype=bool)
        self.along = np.array([float(row.along) for row in rows])
        self.targets = np.array([row.target for row in rows])
        self.driven = [j for j, row in enumerate(rows) if row.drive is not None]
        terms = [(j, term) for j, row in enumerate(rows) for term in row.terms]
        self.row = np.array([j for j, _ in terms], dtype=np.int64)
        self.Q = np.array([term.Q for _, term in terms]).reshape(-1, 2, 2)
        self.turned = np.array([term.turned for _, term in terms], dtype=bool)
        vectors = [vector for _, term in terms for vector in (term.one, term.two)]
        self.number = np.arange(len(vectors)).reshape(-1, 2)
        self.V, self.c = _stacked(vectors, size)
        self._constant: sparse.csr_array | None = None

    def parameters(self, t: float) -> Array:
        """(p, p', p'') of each row, (count, 3); zeros where nothing drives it."""
        found, known = np.zeros((self.count, 3)), dict[Drive, Array]()
        for j in self.driven:
            drive = self.rows[j].drive
            assert drive is not None
            found[j] = known[drive] if drive in known else known.setdefault(drive, drive(t))
        return found

    def value(self, q: Array, p: Array) -> Array:
        """Φ, (count,)."""
        one, two, Q = self._state(q, p)
        return self._sum(_product(one, Q, two)) - self.targets - self.along * p[:, 0]

    def jacobian(self, q: Array, p: Array) -> sparse.csr_array:
        """J, (count, size)."""
        if self.constant and self._constant is not None:
            return self._constant
        one, two, Q = self._state(q, p)
        by_one, by_two = np.einsum("tab,tb->ta", Q, two), np.einsum("ta,tab->tb", one, Q)
        slope = np.concatenate([by_one, by_two], axis=1)
        columns = (2 * self.number[:, :, None] + np.arange(2)).reshape(len(slope), 4)
        where = np.repeat(self.row, 4), columns.ravel()
        G = sparse.csr_array((slope.ravel(), where), shape=(self.count, len(self.c)))
        self._constant = sparse.csr_array(G @ self.V)
        self._constant.sort_indices()
        return self._constant

    def hessian(self, q: Array, p: Array, mu: Array) -> sparse.csr_array:
        """Σ μ ∂²Φ/∂q², (size, size)."""
        if self.constant:
            return sparse.csr_array((self.size, self.size))
        blocks = mu[self.row, None, None] * self._state(q, p)[2]
        rows = 2 * self.number[:, 0, None, None] + np.arange(2)[:, None] + np.zeros((2, 2), dtype=np.int64)
        columns = 2 * self.number[:, 1, None, None] + np.arange(2) + np.zeros((2, 2), dtype=np.int64)
        H = sparse.csr_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(len(self.c),) * 2)
        half = self.V.T @ H @ self.V
        return sparse.csr_array(half + half.T)

    def rate(self, q: Array, p: Array) -> Array:
        """∂Φ/∂t, (count,)."""
        return self.by_parameter(q, p) * p[:, 1]

    def right(self, q: Array, v: Array, p: Array) -> Array:
        """γ of J q̈ = γ, (count,)."""
        one, two, Q = self._state(q, p)
        x, y = (self.V @ v).reshape(-1, 2, 2).transpose(1, 0, 2)
        curvature = self._sum(2.0 * _product(x, Q, y))
        turned = self.turned * p[self.row, 1]
        quarter = QUARTER @ Q
        mixed = self._sum(2.0 * turned * (_product(x, quarter, two) + _product(one, quarter, y)))
        second = self._sum(-turned * p[self.row, 1] * _product(one, Q, two))
        return -curvature - mixed - second - self.by_parameter(q, p) * p[:, 2]

    def by_parameter(self, q: Array, p: Array) -> Array:
        """∂Φ/∂p, (count,)."""
        one, two, Q = self._state(q, p)
        return self._sum(self.turned * _product(one, QUARTER @ Q, two)) - self.along

    def _state(self, q: Array, p: Array) -> tuple[Array, Array, Array]:
        """Vectors of the terms and their matrices, turned."""
        one, two = (self.V @ q + self.c).reshape(-1, 2, 2).transpose(1, 0, 2)
        if not self.turned.any():
            return one, two, self.Q
        angle = np.where(self.turned, p[self.row, 0], 0.0)[:, None, None]
        return one, two, np.cos(angle) * self.Q + np.sin(angle) * (QUARTER @ self.Q)

    def _sum(self, terms: Array) -> Array:
        return np.bincount(self.row, terms, self.count).astype(np.float64, copy=False)


def _product(one: Array, Q: Array, two: Array) -> Array:
    return np.asarray(np.einsum("ta,tab,tb->t", one, Q, two))


def _stacked(vectors: Sequence[Vector], size: int) -> tuple[sparse.csr_array, Array]:
    """Matrix and constant of all vectors, one below the other."""
    none = [np.zeros(0)]
    values = [vector.A.ravel() for vector in vectors]
    rows = [np.repeat([2 * k, 2 * k + 1], len(vector.at)) for k, vector in enumerate(vectors)]
    columns = [np.tile(vector.at, 2) for vector in vectors]
    entries = np.concatenate(none + values)
    where = tuple(np.concatenate([np.zeros(0, dtype=np.int64), *part]) for part in (rows, columns))
    matrix = sparse.csr_array((entries, (where[0], where[1])), shape=(2 * len(vectors), size))
    return matrix, np.concatenate(none + [vector.constant for vector in vectors])
