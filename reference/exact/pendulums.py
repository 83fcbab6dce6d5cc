"""Rigid motions to which stiff beams converge: the pendulum, and the uniform bar on a pin."""

from dataclasses import dataclass
from math import cos, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipj, ellipkm1

from anctmm.validation import positive, within

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pendulum:
    """Mathematical pendulum let go at rest, θ'' = −(g/l) sin θ.

    Parameters
    ----------
    length : float
        m; of a rigid body its reduced length, see `bar_reduced_length`.
    amplitude : float
        Angle from hanging straight down at t = 0, rad, in (−π, π).
    gravity : float
        m/s².

    References
    ----------
    Whittaker & Watson 1927, section 22; NIST DLMF 22.19(i):
    sin(θ/2) = k cd(√(g/l) t, k), k = sin(θ₀/2).
    """

    length: float
    amplitude: float
    gravity: float = 9.81

    def __post_init__(self) -> None:
        positive("pendulum length (m)", self.length)
        positive("pendulum gravity (m/s²)", self.gravity)
        within("pendulum amplitude (rad)", self.amplitude, -pi, pi, "()")

    @property
    def period(self) -> float:
        """4 K(k) √(l/g), s."""
        return 4.0 * float(ellipkm1(np.cos(0.5 * self.amplitude) ** 2)) * sqrt(self.length / self.gravity)

    def angle(self, t: Array) -> Array:
        """θ at times t, rad."""
        k = sin(0.5 * self.amplitude)
        _, cn, dn, _ = self._jacobi(t)
        return np.asarray(2.0 * np.arcsin(k * cn / dn))

    def rate(self, t: Array) -> Array:
        """θ' at times t, rad/s."""
        k = sin(0.5 * self.amplitude)
        sn, _, dn, _ = self._jacobi(t)
        fastest = 2.0 * k * cos(0.5 * self.amplitude) * sqrt(self.gravity / self.length)
        return np.asarray(-fastest * sn / dn)

    def _jacobi(self, t: Array) -> tuple[Array, Array, Array, Array]:
        whole = np.remainder(np.asarray(t, float), self.period)
        sn, cn, dn, ph = ellipj(sqrt(self.gravity / self.length) * whole, sin(0.5 * self.amplitude) ** 2)
        return sn, cn, dn, ph


def bar_reduced_length(length: float, gyration: float = 0.0) -> float:
    """Length of the mathematical pendulum that swings like a uniform bar pinned at its end, m.

    Parameters
    ----------
    length : float
        m.
    gyration : float
        √(I/A) of the section, m, if its rotary inertia counts: the shear element's does, the cable has none.
    """
    length = positive("bar length (m)", length)
    return 2.0 / 3.0 * length + 2.0 * within("gyration (m)", gyration, 0.0, np.inf, "[)") ** 2 / length
