"""Initial velocities as functions of the fraction of a body's length: rigid motions, and derivatives of any."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from anctmm.validation import LONGEST, number, vector

Array = NDArray[np.float64]
Point = tuple[float, ...]
"""Two numbers in the plane, three in space."""
#: Points at which the size of a velocity is looked for.
SAMPLES = 9
#: Error of a slope's last digits, of the velocity's size.
FINEST = 1e-12


@dataclass(frozen=True)
class RigidVelocity:
    """Velocity field of a rigid motion, for `Beam(velocity=...)`.

    Parameters
    ----------
    start, end : (float, float)
        Of the body, m.
    center : (float, float)
        Reference point of the rotation, m.
    spin : float
        Angular velocity, rad/s.
    velocity : (float, float)
        Velocity of the reference point, m/s.

    Raises
    ------
    PropertyError
        If a number is not finite.
    """

    start: Point
    end: Point
    center: Point
    spin: float
    velocity: Point = (0.0, 0.0)

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        for name in ("start", "end", "center"):
            set_(self, name, vector(f"RigidVelocity {name} (m)", getattr(self, name), high=LONGEST))
        set_(self, "spin", number("RigidVelocity spin (rad/s)", self.spin))
        set_(self, "velocity", vector("RigidVelocity velocity (m/s)", self.velocity))

    def __call__(self, fraction: float) -> Point:
        """Velocity at a fraction of the length, m/s."""
        x, y = (
            (1.0 - fraction) * a + fraction * b - c
            for a, b, c in zip(self.start, self.end, self.center, strict=True)
        )
        return self.velocity[0] - self.spin * y, self.velocity[1] + self.spin * x


class HasVelocity(Protocol):
    """The part of a beam that this module needs."""

    @property
    def name(self) -> str:
        """Its name."""
        ...

    def velocity_at(self, fraction: float) -> Point:
        """Initial velocity at a fraction of the length, m/s."""
        ...


@dataclass(frozen=True)
class PartVelocity:
    """Initial velocity of a part of a beam between two fractions of its length."""

    beam: HasVelocity
    first: float
    last: float

    def __call__(self, fraction: float) -> Point:
        """Velocity at a fraction of the part's length, m/s."""
        return self.beam.velocity_at(self.whole(fraction))

    def whole(self, fraction: float) -> float:
        """Fraction of the beam's length at one of the part's."""
        return (1.0 - fraction) * self.first + fraction * self.last


def size_of(velocity: Callable[[float], Point]) -> float:
    """Largest component of a velocity at a few fractions, m/s; 1 where it vanishes."""
    return max(max(map(abs, velocity(s))) for s in np.linspace(0.0, 1.0, SAMPLES).tolist()) or 1.0


def second_derivative(velocity: Callable[[float], Point], fraction: float, elements: int) -> Array:
    """Second derivative of a velocity by the fraction, (dim,), m/s, at a node of so many equal elements.

    That of a polynomial through the velocities at points of both elements that meet there, or of the one at an end: as
    exact as a polynomial of degree five in each element needs it.
    """
    reach = 1.0 / elements
    low, high = max(0.0, fraction - reach), min(1.0, fraction + reach)
    nodes = np.cos(np.pi * (np.arange(SAMPLES) + 0.5) / SAMPLES)
    values = np.array([velocity(0.5 * (low + high) + 0.5 * (high - low) * x) for x in nodes.tolist()])
    scale = 2.0 / (high - low)
    fitted = np.polynomial.chebyshev.chebfit(nodes, values, SAMPLES - 1)
    bent = np.polynomial.chebyshev.chebder(fitted, 2, scl=scale)
    return np.asarray(np.polynomial.chebyshev.chebval(scale * (fraction - 0.5 * (low + high)), bent))


def slope_of(velocity: Callable[[float], Point], fraction: float, size: float) -> tuple[Point, float]:
    """Derivative of a velocity by the fraction, and its error, m/s; one-sided at the ends.

    Parameters
    ----------
    velocity : callable
    fraction : float
    size : float
        Of the velocity, m/s: the unit must not decide how well its slope is found.
    """
    dim = len(velocity(fraction))
    side = 1.0 if fraction == 0.0 else -1.0 if fraction == 1.0 else 0.0
    step = min(0.5, *(d for d in (fraction, 1.0 - fraction) if d > 0.0)) / 2.0

    def component(s: Array, axis: Array) -> Array:
        values = [velocity(float(x))[int(a)] for x, a in np.broadcast(s, axis)]
        return np.reshape(values, np.broadcast(s, axis).shape)

    from scipy.differentiate import derivative  # takes long to load, and only functions of the user's need it

    slope: Any = derivative  # its stubs do not know a direction given as a number
    found = slope(
        component,
        np.full(dim, fraction),
        args=(np.arange(dim),),
        initial_step=step,
        step_direction=side,
        tolerances={"atol": FINEST * size, "rtol": FINEST},
    )
    return tuple(found.df.tolist()), float(np.max(found.error))
