"""Vectors of the plane that are linear in the coordinates: places, gradients, unit vectors of rigid bodies."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Turn by +90°.
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


def rotation(angle: float) -> Array:
    """Matrix that turns by an angle, rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


@dataclass(frozen=True, eq=False)
class Vector:
    """A q[at] + constant.

    Parameters
    ----------
    at : ndarray of int, shape (k,)
        Ascending.
    A : ndarray, shape (2, k)
    constant : ndarray, shape (2,)
    """

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
        at = np.concatenate([[x, x + 1] for x, _ in parts]).astype(np.int64)
        return cls(at, np.concatenate([factor * np.eye(2) for _, factor in parts], axis=1), np.zeros(2))

    @property
    def moves(self) -> bool:
        """Whether it depends on coordinates."""
        return len(self.at) > 0

    def __call__(self, q: Array) -> Array:
        """Its value, (2,)."""
        return np.asarray(self.A @ q[self.at] + self.constant)

    def rate(self, v: Array) -> Array:
        """Its rate at velocities v, (2,)."""
        return np.asarray(self.A @ v[self.at])

    def on(self, at: Ints) -> Array:
        """A on other coordinates, which hold its own, (2, len(at))."""
        full = np.zeros((2, len(at)))
        full[:, np.searchsorted(at, self.at)] = self.A
        return full

    def minus(self, other: "Vector") -> "Vector":
        """The difference."""
        at = together(self, other)
        return Vector(at, self.on(at) - other.on(at), self.constant - other.constant)


def together(*vectors: Vector) -> Ints:
    """Coordinates of several vectors, ascending."""
    return np.unique(np.concatenate([vector.at for vector in vectors]))
