"""Constraints Φ(q, p(t)) = 0, p the angle or the place of a drive: values, Jacobians and second derivatives.

All are linear or bilinear in vectors that are linear in q. `Drive` gives p, p', p'' at a time.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from anctmm.model.drives import value_at
from reference.global_dae.mechanisms.vectors import QUARTER, Vector, rotation, together

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Drive:
    """History of an angle (rad) or a place on a line (m): name, for errors, and callable t -> (p, p', p'')."""

    name: str
    history: Callable[[float], tuple[float, float, float]]

    def __call__(self, t: float) -> Array:
        """(p, p', p'') at a time."""
        return value_at(self.name, self.history, t, 3)


class Constraint:
    """Rows of Φ on the coordinates `at`.

    Attributes
    ----------
    at : ndarray of int, shape (k,)
    rows : int
    drive : Drive or None
    held : bool
        Whether the ground prescribes components of beams' nodes: these are set directly in explicit steps.
    """

    at: Ints
    rows: int
    drive: Drive | None = None
    held: bool = False

    def value(self, q: Array, p: float) -> Array:
        """Φ, (rows,)."""
        raise NotImplementedError

    def jacobian(self, q: Array, p: float) -> Array:
        """∂Φ/∂q, (rows, k)."""
        raise NotImplementedError

    def hessian(self, q: Array, p: float, mu: Array) -> Array | None:
        """Σ μ ∂²Φ/∂q², (k, k); None where it vanishes."""
        return None

    def curvature(self, q: Array, v: Array, p: float) -> Array:
        """∂²Φ/∂q² : v v, (rows,)."""
        return np.zeros(self.rows)

    def driven(self, q: Array, v: Array, p: float) -> tuple[Array, Array, Array]:
        """∂Φ/∂p, ∂²Φ/∂p² and the rate of ∂Φ/∂p at v, (rows,) each."""
        return (np.zeros(self.rows),) * 3


@dataclass(frozen=True)
class Fixed(Constraint):
    """C vector(q) = C R(θ) target, or = C target + (p, …) along the first row where `along`."""

    vector: Vector
    C: Array
    target: Array
    drive: Drive | None = None
    along: bool = False
    held: bool = False
    at: Ints = field(init=False)
    rows: int = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", self.vector.at)
        object.__setattr__(self, "rows", len(self.C))

    def value(self, q: Array, p: float) -> Array:
        """Φ, (rows,)."""
        if self.along:
            return np.asarray(self.C @ (self.vector(q) - self.target) - p)
        return np.asarray(self.C @ (self.vector(q) - rotation(p) @ self.target))

    def jacobian(self, q: Array, p: float) -> Array:
        """∂Φ/∂q, (rows, k)."""
        return np.asarray(self.C @ self.vector.A)

    def driven(self, q: Array, v: Array, p: float) -> tuple[Array, Array, Array]:
        """∂Φ/∂p, ∂²Φ/∂p² and the rate of ∂Φ/∂p at v, (rows,) each."""
        nothing = np.zeros(self.rows)
        if self.along:
            return -np.ones(self.rows), nothing, nothing
        b = rotation(p) @ self.target
        return -self.C @ QUARTER @ b, self.C @ b, nothing


@dataclass(frozen=True)
class Turned(Constraint):
    """second(q) = R(turn + p) first(q)."""

    first: Vector
    second: Vector
    turn: Array
    drive: Drive | None = None
    at: Ints = field(init=False)
    rows: int = field(init=False, default=2)

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", together(self.first, self.second))

    def value(self, q: Array, p: float) -> Array:
        """Φ, (rows,)."""
        return np.asarray(self.second(q) - rotation(p) @ self.turn @ self.first(q))

    def jacobian(self, q: Array, p: float) -> Array:
        """∂Φ/∂q, (rows, k)."""
        return np.asarray(self.second.on(self.at) - rotation(p) @ self.turn @ self.first.on(self.at))

    def driven(self, q: Array, v: Array, p: float) -> tuple[Array, Array, Array]:
        """∂Φ/∂p, ∂²Φ/∂p² and the rate of ∂Φ/∂p at v, (rows,) each."""
        R = rotation(p) @ self.turn
        return -QUARTER @ R @ self.first(q), R @ self.first(q), -QUARTER @ R @ self.first.rate(v)


@dataclass(frozen=True)
class Product(Constraint):
    """one(q) · R(p) Q two(q) = value, or, where `along`, = value + p."""

    one: Vector
    two: Vector
    Q: Array
    target: float = 0.0
    drive: Drive | None = None
    along: bool = False
    at: Ints = field(init=False)
    rows: int = field(init=False, default=1)

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", together(self.one, self.two))

    def _matrix(self, p: float) -> Array:
        return self.Q if self.along else np.asarray(rotation(p) @ self.Q)

    def value(self, q: Array, p: float) -> Array:
        """Φ, (rows,)."""
        found = self.one(q) @ self._matrix(p) @ self.two(q) - self.target
        return np.array([found - p if self.along else found])

    def jacobian(self, q: Array, p: float) -> Array:
        """∂Φ/∂q, (rows, k)."""
        Q = self._matrix(p)
        return np.asarray(
            [(Q @ self.two(q)) @ self.one.on(self.at) + (self.one(q) @ Q) @ self.two.on(self.at)]
        )

    def hessian(self, q: Array, p: float, mu: Array) -> Array:
        """Σ μ ∂²Φ/∂q², (k, k)."""
        half = mu[0] * self.one.on(self.at).T @ self._matrix(p) @ self.two.on(self.at)
        return np.asarray(half + half.T)

    def curvature(self, q: Array, v: Array, p: float) -> Array:
        """∂²Φ/∂q² : v v, (rows,)."""
        return np.array([2.0 * self.one.rate(v) @ self._matrix(p) @ self.two.rate(v)])

    def driven(self, q: Array, v: Array, p: float) -> tuple[Array, Array, Array]:
        """∂Φ/∂p, ∂²Φ/∂p² and the rate of ∂Φ/∂p at v, (rows,) each."""
        if self.along:
            return -np.ones(1), np.zeros(1), np.zeros(1)
        one, two, Q = self.one(q), self.two(q), self._matrix(p)
        rate = self.one.rate(v) @ QUARTER @ Q @ two + one @ QUARTER @ Q @ self.two.rate(v)
        return np.array([one @ QUARTER @ Q @ two]), np.array([-one @ Q @ two]), np.array([rate])


class Constraints:
    """All constraints of a scene.

    Parameters
    ----------
    parts : list of Constraint
    size : int
        Number of coordinates.
    """

    def __init__(self, parts: list[Constraint], size: int) -> None:
        self.parts, self.size = parts, size
        self.first = np.cumsum([0, *(part.rows for part in parts)])
        self.count = int(self.first[-1])
        self.held = np.concatenate([np.zeros(0, bool), *(np.full(part.rows, part.held) for part in parts)])

    def parameters(self, t: float) -> Array:
        """(p, p', p'') of each constraint, (parts, 3); zeros where nothing drives it."""
        found = np.zeros((len(self.parts), 3))
        for k, part in enumerate(self.parts):
            if part.drive is not None:
                found[k] = part.drive(t)
        return found

    def value(self, q: Array, p: Array) -> Array:
        """Φ, (count,)."""
        if not self.parts:
            return np.zeros(0)
        return np.concatenate([part.value(q, p[k, 0]) for k, part in enumerate(self.parts)])

    def jacobian(self, q: Array, p: Array) -> Array:
        """J, (count, size)."""
        J = np.zeros((self.count, self.size))
        for k, part in enumerate(self.parts):
            J[self.first[k] : self.first[k + 1], part.at] = part.jacobian(q, p[k, 0])
        return J

    def rate(self, q: Array, p: Array) -> Array:
        """∂Φ/∂t, (count,)."""
        found = np.zeros(self.count)
        for k, part in self._driven():
            by_p = part.driven(q, np.zeros(self.size), p[k, 0])[0]
            found[self.first[k] : self.first[k + 1]] = by_p * p[k, 1]
        return found

    def right(self, q: Array, v: Array, p: Array) -> Array:
        """γ of J q̈ = γ, (count,)."""
        found = np.zeros(self.count)
        for k, part in enumerate(self.parts):
            rows = slice(self.first[k], self.first[k + 1])
            found[rows] = -part.curvature(q, v, p[k, 0])
            if part.drive is not None:
                first, second, rate = part.driven(q, v, p[k, 0])
                found[rows] -= first * p[k, 2] + second * p[k, 1] ** 2 + 2.0 * rate * p[k, 1]
        return found

    def hessian(self, q: Array, p: Array, mu: Array) -> Array:
        """Σ μ ∂²Φ/∂q², (size, size)."""
        H = np.zeros((self.size, self.size))
        for k, part in enumerate(self.parts):
            found = part.hessian(q, p[k, 0], mu[self.first[k] : self.first[k + 1]])
            if found is not None:
                H[np.ix_(part.at, part.at)] += found
        return H

    def effort(self, q: Array, p: Array, mu: Array) -> tuple[Array, Array]:
        """Moment (N m) or force (N) of each drive, and its angle or place: what its work is summed up from."""
        forces, places = [], []
        for k, part in self._driven():
            by_p = part.driven(q, np.zeros(self.size), p[k, 0])[0]
            forces.append(float(mu[self.first[k] : self.first[k + 1]] @ by_p))
            places.append(p[k, 0])
        return np.array(forces), np.array(places)

    def _driven(self) -> list[tuple[int, Constraint]]:
        return [(k, part) for k, part in enumerate(self.parts) if part.drive is not None]
