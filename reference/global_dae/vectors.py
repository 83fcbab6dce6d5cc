"""Vectors of the plane that are linear in the coordinates: places, gradients, unit vectors of rigid bodies."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Turn by +90°.
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Vector:
    """A q[at] + constant, with `at` (k,) ascending, A (2, k) and `constant` (2,)."""

    at: Ints
    A: Array
    constant: Array

    @classmethod
    def fixed(cls, point: Iterable[float]) -> "Vector":
        """One that does not move."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros((2, 0)), np.array([*point], dtype=float))

    @classmethod
    def of(cls, parts: Iterable[tuple[int, float]]) -> "Vector":
        """A sum of vectors of coordinates, each by the number of its x component (y follows), with a factor."""
        parts = sorted(parts)
        at = np.array([[x, x + 1] for x, _ in parts], dtype=np.int64).ravel()
        return cls(at, np.concatenate([factor * np.eye(2) for _, factor in parts], axis=1), np.zeros(2))

    def __call__(self, q: Array) -> Array:
        """Its value, (2,)."""
        return np.asarray(self.A @ q[self.at] + self.constant)

    def minus(self, other: "Vector") -> "Vector":
        """The difference."""
        at = np.union1d(self.at, other.at)
        A = np.zeros((2, len(at)))
        A[:, np.searchsorted(at, self.at)] += self.A
        A[:, np.searchsorted(at, other.at)] -= other.A
        return Vector(at, A, self.constant - other.constant)


class Stack:
    """Several vectors x = V q + c of `size` coordinates, evaluated together."""

    def __init__(self, vectors: Sequence[Vector], size: int) -> None:
        V = sparse.lil_array((2 * len(vectors), size))
        for k, vector in enumerate(vectors):
            V[2 * k : 2 * k + 2, vector.at] = vector.A
        self.V = sparse.csr_array(V)
        self.c = np.array([vector.constant for vector in vectors]).ravel()

    def __call__(self, q: Array) -> Array:
        """Their values, (vectors, 2)."""
        return np.asarray(self.V @ q + self.c).reshape(-1, 2)

    def rate(self, v: Array) -> Array:
        """Their rates at velocities v, (vectors, 2)."""
        return np.asarray(self.V @ v).reshape(-1, 2)
