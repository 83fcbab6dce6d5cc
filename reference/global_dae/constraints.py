"""Constraints Φ(q, p(t)) = 0, p the angle or the position of a drive: values, Jacobian, second derivatives.

Every row is a sum of products x·Q y of two vectors that are linear in the coordinates (one of which may be constant),
some with Q turned by the angle of a drive: Φ = Σ x·R(p) Q y − (target, or p itself).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.model.drives import value_at
from reference.global_dae.vectors import QUARTER, Stack, Vector

Array = NDArray[np.float64]


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
        moving = [len(vector.at) > 0 for vector in (self.one, self.two)]
        return not all(moving) and not (self.turned and any(moving))


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
        terms = [(j, term) for j, row in enumerate(rows) for term in row.terms]
        self.constant = all(term.constant for _, term in terms)
        self.held = np.array([row.held for row in rows], dtype=bool)
        self.along = np.array([float(row.along) for row in rows])
        self.targets = np.array([row.target for row in rows])
        self.driven = [j for j, row in enumerate(rows) if row.drive is not None]
        self.row = np.array([j for j, _ in terms], dtype=np.int64)
        self.Q = np.array([term.Q for _, term in terms]).reshape(-1, 2, 2)
        self.turned = np.array([term.turned for _, term in terms], dtype=bool)
        self.vectors = Stack([vector for _, term in terms for vector in (term.one, term.two)], size)
        self.components = np.arange(4 * len(terms)).reshape(-1, 2, 2)  # of both vectors of each term

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
        return self._sum(_product(*self._state(q, p))) - self.targets - self.along * p[:, 0]

    def jacobian(self, q: Array, p: Array) -> sparse.csr_array:
        """J, (count, size)."""
        return self._constant_jacobian if self.constant else self._jacobian(q, p)

    @cached_property
    def _constant_jacobian(self) -> sparse.csr_array:
        return self._jacobian(np.zeros(self.size), np.zeros((self.count, 3)))

    def _jacobian(self, q: Array, p: Array) -> sparse.csr_array:
        one, Q, two = self._state(q, p)
        by_one, by_two = np.einsum("tab,tb->ta", Q, two), np.einsum("ta,tab->tb", one, Q)
        slope = np.stack([by_one, by_two], axis=1)
        where = np.repeat(self.row, 4), self.components.ravel()
        J = sparse.csr_array((slope.ravel(), where), shape=(self.count, len(self.vectors.c))) @ self.vectors.V
        J.sort_indices()
        return J

    def hessian(self, q: Array, p: Array, mu: Array) -> sparse.csr_array:
        """Σ μ ∂²Φ/∂q², (size, size)."""
        if self.constant:
            return sparse.csr_array((self.size, self.size))
        blocks = mu[self.row, None, None] * self._state(q, p)[1]
        rows, columns = np.broadcast_arrays(self.components[:, 0, :, None], self.components[:, 1, None, :])
        V, n = self.vectors.V, len(self.vectors.c)
        half = V.T @ sparse.csr_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)) @ V
        return sparse.csr_array(half + half.T)

    def rate(self, q: Array, p: Array) -> Array:
        """∂Φ/∂t, (count,)."""
        return self.by_parameter(q, p) * p[:, 1]

    def right(self, q: Array, v: Array, p: Array) -> Array:
        """γ of J q̈ = γ, (count,)."""
        one, Q, two = self._state(q, p)
        x, y = self.vectors.rate(v).reshape(-1, 2, 2).transpose(1, 0, 2)
        turned, quarter = self.turned * p[self.row, 1], QUARTER @ Q
        mixed = turned * (_product(x, quarter, two) + _product(one, quarter, y))
        second = 2.0 * (_product(x, Q, y) + mixed) - turned * p[self.row, 1] * _product(one, Q, two)
        return -self._sum(second) - self.by_parameter(q, p) * p[:, 2]

    def by_parameter(self, q: Array, p: Array) -> Array:
        """∂Φ/∂p, (count,)."""
        one, Q, two = self._state(q, p)
        return self._sum(self.turned * _product(one, QUARTER @ Q, two)) - self.along

    def _state(self, q: Array, p: Array) -> tuple[Array, Array, Array]:
        """Vectors of the terms, and between them their matrices, turned."""
        one, two = self.vectors(q).reshape(-1, 2, 2).transpose(1, 0, 2)
        angle = np.where(self.turned, p[self.row, 0], 0.0)[:, None, None]
        return one, np.cos(angle) * self.Q + np.sin(angle) * (QUARTER @ self.Q), two

    def _sum(self, terms: Array) -> Array:
        return np.bincount(self.row, terms, self.count).astype(np.float64, copy=False)


def _product(one: Array, Q: Array, two: Array) -> Array:
    return np.asarray(np.einsum("ta,tab,tb->t", one, Q, two))
