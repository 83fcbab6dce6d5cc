"""Rigid motions to which stiff beams converge: pendulum, uniform bar on a pin, two of them, and free flight."""

from dataclasses import dataclass
from math import cos, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipkm1

from anctmm.errors import PropertyError
from anctmm.model.scene import Point
from anctmm.validation import number, positive, vector, within

Array = NDArray[np.float64]
TOLERANCE = 1e-13


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


@dataclass(frozen=True)
class DoublePendulum:
    """Two uniform rigid thin bars in a chain, the first pinned to the ground.

    Parameters
    ----------
    lengths, masses : (float, float)
        m, kg.
    angles, rates : (float, float)
        Of the bars from the x axis at t = 0, rad, rad/s.
    gravity : (float, float)
        m/s².
    pivot : (float, float)
        m.
    """

    lengths: Point
    masses: Point
    angles: Point
    rates: Point = (0.0, 0.0)
    gravity: Point = (0.0, -9.81)
    pivot: Point = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("lengths", "masses", "angles", "rates", "gravity", "pivot"):
            values = vector(f"double pendulum {name}", getattr(self, name))
            if name in ("lengths", "masses"):
                for value in values:
                    positive(f"double pendulum {name}", value)

    def mass_matrix(self, angles: Array) -> Array:
        """Of the two angles, (2, 2), kg m²."""
        (l1, l2), (m1, m2) = self.lengths, self.masses
        coupling = 0.5 * m2 * l1 * l2 * np.cos(angles[0] - angles[1])
        return np.array([[(m1 / 3 + m2) * l1**2, coupling], [coupling, m2 * l2**2 / 3]])

    def accelerations(self, angles: Array, rates: Array) -> Array:
        """Of the angles, from Lagrange's equations, (2,), rad/s²."""
        (l1, l2), (m1, m2) = self.lengths, self.masses
        centrifugal = 0.5 * m2 * l1 * l2 * np.sin(angles[0] - angles[1])
        along = -np.sin(angles) * self.gravity[0] + np.cos(angles) * self.gravity[1]
        torque = np.array([(0.5 * m1 + m2) * l1, 0.5 * m2 * l2]) * along
        return np.linalg.solve(
            self.mass_matrix(angles), torque + centrifugal * np.array([-(rates[1] ** 2), rates[0] ** 2])
        )

    def motion(self, t: Array) -> tuple[Array, Array]:
        """Angles and rates at ascending times from 0 on, each (n, 2), rad and rad/s.

        DOP853 at its finest tolerance, its steps ending at the times asked for, since its interpolant is of a
        lower order.
        """
        t = np.asarray(t, float)
        if t.ndim != 1 or not len(t) or t[0] < 0.0 or (np.diff(t) <= 0.0).any():
            raise PropertyError(f"times (s) are {t!r}; ascending numbers from 0 on are needed")
        state, now, states = np.array([*self.angles, *self.rates]), 0.0, []
        for then in t:
            if then > now:
                run = solve_ivp(
                    lambda _, y: np.concatenate([y[2:], self.accelerations(y[:2], y[2:])]),
                    (now, then), state, method="DOP853", rtol=TOLERANCE, atol=TOLERANCE,
                )  # fmt: skip
                state, now = run.y[:, -1], then
            states.append(state)
        history = np.array(states)
        return history[:, :2], history[:, 2:]

    def position(self, bar: int, fraction: float, angles: Array) -> Array:
        """Place of a point of bar 0 or 1 at given angles (n, 2), (n, 2), m."""
        along = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        reach = np.array([self.lengths[0] * (fraction if bar == 0 else 1.0), 0.0])
        if bar == 1:
            reach[1] = self.lengths[1] * fraction
        return np.asarray(self.pivot) + np.einsum("b,...bc->...c", reach, along)

    def energy(self, angles: Array, rates: Array) -> Array:
        """Kinetic plus potential energy, zero potential at the pivot, (n,), J."""
        kinetic = [0.5 * r @ self.mass_matrix(a) @ r for a, r in zip(angles, rates, strict=True)]
        weight = np.asarray(self.gravity)
        middle = [self.position(bar, 0.5, angles) - self.pivot for bar in (0, 1)]
        return np.array(kinetic) - sum(m * (c @ weight) for m, c in zip(self.masses, middle, strict=True))


@dataclass(frozen=True)
class FreeBar:
    """A uniform rigid bar in free flight: its middle falls, its turn is steady.

    Parameters
    ----------
    start, end : (float, float)
        At t = 0, m.
    velocity : (float, float)
        Of its middle at t = 0, m/s.
    spin : float
        rad/s.
    gravity : (float, float)
        m/s².
    """

    start: Point
    end: Point
    velocity: Point = (0.0, 0.0)
    spin: float = 0.0
    gravity: Point = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("start", "end", "velocity", "gravity"):
            vector(f"free bar {name}", getattr(self, name))
        number("free bar spin (rad/s)", self.spin)

    def velocity_at(self, fraction: float) -> Point:
        """Initial velocity at a fraction of the length, m/s: what `Beam.velocity` takes."""
        x, y = (fraction - 0.5) * (np.asarray(self.end) - self.start)
        return self.velocity[0] - self.spin * y, self.velocity[1] + self.spin * x

    def position(self, fraction: float, t: Array) -> Array:
        """Positions at a fraction of the length, (n, 2), m."""
        t = np.atleast_1d(np.asarray(t, float))
        middle = 0.5 * (np.asarray(self.start) + self.end)
        fall = np.multiply.outer(t, self.velocity) + 0.5 * np.multiply.outer(t**2, self.gravity)
        x, y = (fraction - 0.5) * (np.asarray(self.end) - self.start)
        c, s = np.cos(self.spin * t), np.sin(self.spin * t)
        return middle + fall + np.stack([c * x - s * y, s * x + c * y], axis=-1)
