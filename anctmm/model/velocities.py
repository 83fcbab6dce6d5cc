"""Initial velocities as functions of the fraction of a body's length: rigid motions, and derivatives of any."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.model.accepted import Point
from anctmm.validation import LONGEST, number, point, vector

Array = NDArray[np.float64]
#: Points at which a velocity is looked at.
SAMPLES = 9


def turned(spin: Any, arm: Any) -> Array:
    """Velocity of the end of an arm that turns: spin (rad/s) is a number in the plane, a vector in space."""
    if len(arm) == 2:
        return np.array([-spin * arm[1], spin * arm[0]])
    return np.cross(spin, arm)


@dataclass(frozen=True)
class RigidVelocity:
    """Velocity field of a rigid motion, for `Beam(velocity=...)`.

    Parameters
    ----------
    start, end : (float, float), or three numbers in space
        Of the body, m.
    center : (float, float), or three numbers
        Reference point of the rotation, m.
    spin : float, or three numbers
        Angular velocity, rad/s.
    velocity : (float, float), or three numbers, optional
        Velocity of the reference point, m/s; zero by default.

    Raises
    ------
    PropertyError
        If a number is not finite, or the numbers are not as many as those of the start.
    """

    start: Point
    end: Point
    center: Point
    spin: float | Point
    velocity: Point | None = None

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "start", point("RigidVelocity start (m)", self.start))
        dims = (len(self.start),)
        for name in ("end", "center"):
            set_(self, name, vector(f"RigidVelocity {name} (m)", getattr(self, name), LONGEST, dims))
        name = "RigidVelocity spin (rad/s)"
        set_(self, "spin", number(name, self.spin) if dims == (2,) else vector(name, self.spin, dims=dims))
        velocity = dims[0] * (0.0,) if self.velocity is None else self.velocity
        set_(self, "velocity", vector("RigidVelocity velocity (m/s)", velocity, dims=dims))

    def __call__(self, fraction: float) -> Point:
        """Velocity at a fraction of the length, m/s."""
        place = (1.0 - fraction) * np.array(self.start) + fraction * np.array(self.end)
        found = np.array(self.velocity) + turned(self.spin, place - self.center)
        return tuple(found.tolist())


def size_of(velocity: Callable[[float], Point]) -> float:
    """Largest component of a velocity at a few fractions, m/s; 1 where it vanishes."""
    return max(max(map(abs, velocity(s))) for s in np.linspace(0.0, 1.0, SAMPLES).tolist()) or 1.0


def second_derivative(velocity: Callable[[float], Point], fraction: float, elements: int) -> Array:
    """Second derivative of a velocity by the fraction, (dim,), m/s, at a node of so many equal elements.

    That of a polynomial through the velocities at points of both elements that meet there, or of the one at an end: as
    exact as a polynomial of degree five in each element needs it.
    """
    return _derivative(velocity, fraction, 1.0 / elements, 2)


def slope_of(velocity: Callable[[float], Any], fraction: float, size: float) -> tuple[Array, float]:
    """Derivative of a velocity by the fraction, (dim,), and its error, m/s; one-sided at the ends.

    It is looked for ever nearer until the error is rounding beside the velocity's size, m/s.
    """
    for reach in (0.1, 0.01, 1e-3):
        wide, found = (_derivative(velocity, fraction, r, 1) for r in (reach, 0.5 * reach))
        error = float(np.abs(wide - found).max())
        if error <= 1e-11 * max(size, float(np.abs(found).max())):
            break
    return found, error


def _derivative(velocity: Callable[[float], Any], fraction: float, reach: float, order: int) -> Array:
    """That of a polynomial through the velocities at points that are no farther away, (dim,), m/s."""
    low, high = max(0.0, fraction - reach), min(1.0, fraction + reach)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    nodes = np.cos(np.pi * np.arange(SAMPLES) / (SAMPLES - 1))
    values = np.array([velocity(min(max(middle + half * x, low), high)) for x in nodes.tolist()])
    fitted = np.polynomial.chebyshev.chebfit(nodes, values, SAMPLES - 1)
    bent = np.polynomial.chebyshev.chebder(fitted, order, scl=1.0 / half)
    return np.asarray(np.polynomial.chebyshev.chebval((fraction - middle) / half, bent))
