"""Constraints Φ(q, p(t)) = 0, p the angle or the position of a drive: values, Jacobian, second derivatives.

Every row is a sum of products x·Q y of two vectors that are linear in the coordinates (one of which may be constant),
some with Q turned by the angle of a drive: Φ = Σ x·R(p) Q y − (target, or p itself).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.model.drives import tabulate, value_at
from reference.global_dae.vectors import QUARTER, Stack, Vector

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Drive:
    """History of an angle (rad) or a position on a line (m): name, for errors, and callable t -> (p, p', p'')."""

    name: str
    history: Callable[[Any], tuple[Any, Any, Any]]

    def __call__(self, t: Any) -> Array:
        """(p, p', p'') at a time, (3,), or at times (n,), (n, 3)."""
        if np.ndim(t):
            return tabulate(self.name, self.history, t, 3)
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
    """All constraints on `size` coordinates, evaluated together; p may be that of several times, (…, count, 3)."""

    def __init__(self, rows: Sequence[Row], size: int) -> None:
        self.rows, self.size, self.count = rows, size, len(rows)
        terms = [term for row in rows for term in row.terms]
        self.row = np.repeat(np.arange(self.count), [len(row.terms) for row in rows])
        self.constant = all(term.constant for term in terms)
        self.held = np.array([row.held for row in rows], dtype=bool)
        self.along = np.array([float(row.along) for row in rows])
        self.targets = np.array([row.target for row in rows])
        self.drives: dict[Drive, list[int]] = {}
        for j, row in enumerate(rows):
            if row.drive is not None:
                self.drives.setdefault(row.drive, []).append(j)
        self.Q = np.array([term.Q for term in terms]).reshape(-1, 2, 2)
        self.turned = np.array([term.turned for term in terms], dtype=bool)
        self.vectors = Stack([vector for term in terms for vector in (term.one, term.two)], size)
        self.components = np.arange(4 * len(terms)).reshape(-1, 2, 2)  # of both vectors of each term

    def parameters(self, t: Any) -> Array:
        """(p, p', p'') of each row at a time, (count, 3), or at times; zeros where nothing drives it."""
        found = np.zeros((*np.shape(t), self.count, 3))
        for drive, rows in self.drives.items():
            found[..., rows, :] = drive(t)[..., None, :]
        return found

    def value(self, q: Array, p: Array) -> Array:
        """Φ, (…, count)."""
        one, two = self._ends(q)
        return self._sum(self._products(one, two, p)[0]) - self.targets - self.along * p[..., 0]

    def jacobian(self, q: Array, p: Array) -> sparse.csr_array:
        """J, (count, size)."""
        return self._constant_jacobian if self.constant else self._jacobian(q, p)

    @cached_property
    def _constant_jacobian(self) -> sparse.csr_array:
        return self._jacobian(np.zeros(self.size), np.zeros((self.count, 3)))

    def _jacobian(self, q: Array, p: Array) -> sparse.csr_array:
        (one, two), Q = self._ends(q), self._matrices(p)
        slope = np.stack([np.einsum("tab,tb->ta", Q, two), np.einsum("ta,tab->tb", one, Q)], axis=1)
        where = np.repeat(self.row, 4), self.components.ravel()
        J = sparse.csr_array((slope.ravel(), where), shape=(self.count, len(self.vectors.c))) @ self.vectors.V
        J.sort_indices()
        return J

    def hessian(self, q: Array, p: Array, mu: Array) -> sparse.csr_array:
        """Σ μ ∂²Φ/∂q², (size, size)."""
        if self.constant:
            return sparse.csr_array((self.size, self.size))
        blocks = mu[self.row, None, None] * self._matrices(p)
        rows, columns = np.broadcast_arrays(self.components[:, 0, :, None], self.components[:, 1, None, :])
        V, n = self.vectors.V, len(self.vectors.c)
        half = V.T @ sparse.csr_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n)) @ V
        return sparse.csr_array(half + half.T)

    def rate(self, q: Array, p: Array) -> Array:
        """∂Φ/∂t, (…, count)."""
        return self.by_parameter(q, p) * p[..., 1]

    def by_parameter(self, q: Array, p: Array) -> Array:
        """∂Φ/∂p, (…, count)."""
        one, two = self._ends(q)
        return self._sum(self._products(one, two, p)[1]) - self.along

    def right(self, q: Array, v: Array, p: Array) -> Array:
        """γ of J q̈ = γ, (…, count)."""
        (one, two), (x, y) = self._ends(q), self.vectors.rate(v).reshape(-1, 2, 2).transpose(1, 0, 2)
        value = self._products(one, two, p)[0]
        turning = self.turned * p[..., self.row, 1]
        mixed = turning * (self._products(x, two, p)[1] + self._products(one, y, p)[1])
        second = 2.0 * (self._products(x, y, p)[0] + mixed) - turning**2 * value
        return -self._sum(second) - self.by_parameter(q, p) * p[..., 2]

    def _ends(self, q: Array) -> Array:
        """Both vectors of all terms, (2, terms, 2)."""
        return self.vectors(q).reshape(-1, 2, 2).transpose(1, 0, 2)

    def _matrices(self, p: Array) -> Array:
        """R(p) Q of all terms."""
        angle = (self.turned * p[self.row, 0])[:, None, None]
        return np.asarray(np.cos(angle) * self.Q + np.sin(angle) * (QUARTER @ self.Q))

    def _products(self, one: Array, two: Array, p: Array) -> tuple[Array, Array]:
        """one · R(p) Q two of all terms, and its derivative by p, (…, terms)."""
        along, across = (np.einsum("ta,tab,tb->t", one, Q, two) for Q in (self.Q, QUARTER @ self.Q))
        angle = self.turned * p[..., self.row, 0]
        c, s = np.cos(angle), np.sin(angle)
        return c * along + s * across, self.turned * (c * across - s * along)

    def _sum(self, terms: Array) -> Array:
        """Sums over the terms of each row."""
        first = np.searchsorted(self.row, np.arange(self.count))
        return np.add.reduceat(terms, first, axis=-1) if self.count else terms
