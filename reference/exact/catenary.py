"""The elastic catenary: a heavy extensible cable without bending stiffness between two points.

Per undeformed length s the tension is T(s) with the constant horizontal part H and the vertical part V − w s, V that at
the start; the cable stretches by T/EA along T. Integrated (Irvine 1981, "Cable Structures", MIT Press, section 2.3):

    x(s) = H s/EA + H/w [asinh(V/H) − asinh((V − w s)/H)],
    y(s) = −s/EA (V − w s/2) − 1/w [√(H² + V²) − √(H² + (V − w s)²)].
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from anctmm.errors import PropertyError
from anctmm.validation import positive, vector

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Catenary:
    """A cable that hangs between two points, its weight along −y.

    `end` is the way from its start to its end, m, x > 0, `length` undeformed, m, `weight` per undeformed length, N/m,
    and `axial` EA, N.

    Raises
    ------
    PropertyError
        If a value is none that a cable can have.
    """

    end: tuple[float, float]
    length: float
    weight: float
    axial: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "end", vector("catenary end (m)", self.end))
        for name, unit in (("length", "m"), ("weight", "N/m"), ("axial", "N")):
            object.__setattr__(self, name, positive(f"catenary {name} ({unit})", getattr(self, name)))
        if self.end[0] <= 0.0:
            raise PropertyError(f"catenary end (m) is {self.end!r}; x greater than 0 is needed")

    @cached_property
    def forces(self) -> tuple[float, float]:
        """Horizontal and vertical force H and V on the cable's start, to the left and upwards, N."""
        w, length = self.weight, self.length
        x, y = self.end
        slack = 3.0 * ((length**2 - y**2) / x**2 - 1.0)
        shape = np.sqrt(slack) if slack > 0.0 else 0.2
        guess = np.array([np.log(0.5 * w * x / shape), 0.5 * w * (length + y / np.tanh(shape))])

        def miss(unknowns: Array) -> Array:
            here = self._position(length, float(np.exp(unknowns[0])), unknowns[1] * w * length)
            return (here - self.end) / length

        guess[1] /= w * length
        found = root(miss, guess, method="hybr", options={"xtol": 1e-14})
        if np.abs(found.fun).max() > 1e-12:
            raise PropertyError(f"no catenary is found for {self!r}: {found.message}")
        return float(np.exp(found.x[0])), float(found.x[1] * w * length)

    def position(self, fraction: float) -> Array:
        """Place of a material point at a fraction of the undeformed length, (2,), m."""
        return self._position(fraction * self.length, *self.forces)

    def tension(self, fraction: float) -> float:
        """Tension there, N."""
        horizontal, vertical = self.forces
        return float(np.hypot(horizontal, vertical - self.weight * fraction * self.length))

    def _position(self, s: float, horizontal: float, vertical: float) -> Array:
        w, here = self.weight, vertical - self.weight * s
        x = horizontal * s / self.axial
        x += horizontal / w * (np.arcsinh(vertical / horizontal) - np.arcsinh(here / horizontal))
        y = -s / self.axial * (vertical - 0.5 * w * s)
        y -= (np.hypot(horizontal, vertical) - np.hypot(horizontal, here)) / w
        return np.array([x, y])
