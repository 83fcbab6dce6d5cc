"""The static problem that all rod models here solve: a cantilever under dead loads, and its arc under a moment."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from anctmm.model.scene import Point
from anctmm.validation import number, positive, vector

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cantilever:
    """A straight rod, clamped at its start, under loads that keep their direction.

    `length` is undeformed, m; `force` (N) and `moment` (N m, counter-clockwise) act on the end, `weight` per undeformed
    length, N/m. `start` is the place of the clamp, m, and `angle` the direction of the undeformed rod, rad.

    Raises
    ------
    PropertyError
        If a value is not finite, or the length is not positive.
    """

    length: float
    force: Point = (0.0, 0.0)
    moment: float = 0.0
    weight: Point = (0.0, 0.0)
    start: Point = (0.0, 0.0)
    angle: float = 0.0

    def __post_init__(self) -> None:
        positive("cantilever length (m)", self.length)
        vector("cantilever force (N)", self.force)
        number("cantilever moment (N m)", self.moment)
        vector("cantilever weight (N/m)", self.weight)
        vector("cantilever start (m)", self.start)
        number("cantilever angle (rad)", self.angle)

    def internal_force(self, fraction: Array) -> Array:
        """Force the outer part exerts at fractions of the length, (n, 2), N: statically determinate."""
        beyond = self.length * (1.0 - np.asarray(fraction, float))
        return np.asarray(self.force) + np.multiply.outer(beyond, self.weight)

    def undeformed(self, fraction: float) -> Array:
        """Position before the loads, (2,), m."""
        along = self.length * fraction * np.array([np.cos(self.angle), np.sin(self.angle)])
        return np.asarray(self.start) + along


def moment_arc(length: float, bending: float, moment: float, fraction: float) -> Array:
    """Position on a cantilever along x under an end moment, (2,), m.

    There is no force, so neither stretch nor shear: a circle of curvature M/EI, for every rod model here.
    """
    turn = positive("length (m)", length) * number("moment (N m)", moment)
    half = 0.5 * fraction * turn / positive("bending (N m²)", bending)
    return length * fraction * float(np.sinc(half / np.pi)) * np.array([np.cos(half), np.sin(half)])
