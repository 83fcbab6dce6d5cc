"""A double pendulum of rigid bodies by its two angles, integrated to round-off."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from anctmm.model.rigid_bodies import RigidBody
from anctmm.model.scene import Pin, Point, Scene

Array = NDArray[np.float64]

#: Relative error of the integrated references in each step.
TOLERANCE = 1e-13


@dataclass(frozen=True)
class OffsetDoublePendulum:
    """Two rigid bodies in a row, whose centres of mass lie beside the lines through their hinges.

    Parameters
    ----------
    masses, inertias : (float, float)
        kg, and kg m² about the centres.
    centers : (complex, complex)
        Centre of each body from its first hinge in the reference, m.
    hinge : complex
        Second hinge of the first body from its first, m.
    gravity : complex
        m/s².
    spins : (float, float)
        Rates at t = 0, rad/s.
    """

    masses: tuple[float, float] = (1.2, 0.7)
    inertias: tuple[float, float] = (0.05, 0.03)
    centers: tuple[complex, complex] = (0.3 + 0.1j, 0.25 - 0.15j)
    hinge: complex = 0.8 - 0.05j
    gravity: complex = 8.6 - 4.7j
    spins: tuple[float, float] = (0.5, -0.7)

    def scene(self) -> Scene:
        """The scene; its bodies are "one" and "two", its place to look at "two.tip"."""
        (m, M), (i, j), (c, d), p = self.masses, self.inertias, self.centers, self.hinge
        w, u = self.spins
        one = RigidBody("one", m, i, _point(c), {"o": (0.0, 0.0), "p": _point(p)}, _point(1j * w * c), w)
        points = {"p": _point(p), "tip": _point(p + 2.0 * d)}
        two = RigidBody("two", M, j, _point(p + d), points, _point(1j * w * p + 1j * u * d), u)
        joints = (Pin("one.o"), Pin("one.p", "two.p"))
        return Scene("double pendulum", (one, two), joints, gravity=_point(self.gravity))

    def angles(self, t: Array) -> Array:
        """Turns of both bodies since t = 0, (n, 2), rad."""
        start, span = [0.0, 0.0, *self.spins], (0.0, float(t[-1]))
        found = solve_ivp(self._rates, span, start, "DOP853", t_eval=t, rtol=TOLERANCE, atol=TOLERANCE)
        return np.asarray(found.y[:2].T)

    def tip(self, t: Array) -> Array:
        """Path of "two.tip", (n, 2), m."""
        one, two = np.exp(1j * self.angles(t)).T
        z = one * self.hinge + two * 2.0 * self.centers[1]
        return np.stack([z.real, z.imag], axis=1)

    def _rates(self, t: float, y: Array) -> Array:
        (m, M), (i, j) = self.masses, self.inertias
        turns, w = np.exp(1j * y[:2]), y[2:]
        c, p, d = turns[0] * self.centers[0], turns[0] * self.hinge, turns[1] * self.centers[1]
        both = np.conj(p) * d
        mass = np.array(
            [
                [i + m * abs(c) ** 2 + M * abs(p) ** 2, M * both.real],
                [M * both.real, j + M * abs(d) ** 2],
            ]
        )
        g = np.conj(self.gravity)
        right = np.array(
            [
                (g * 1j * (m * c + M * p)).real + M * both.imag * w[1] ** 2,
                (g * 1j * M * d).real - M * both.imag * w[0] ** 2,
            ]
        )
        return np.concatenate([w, np.linalg.solve(mass, right)])


def _point(z: complex) -> Point:
    return z.real, z.imag
