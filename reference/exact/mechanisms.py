"""Mechanisms of rigid bodies with known motion: closed forms, and minimal equations of motion, integrated to round-off.

None of them uses the bodies' natural coordinates: the unknowns are angles.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from anctmm.model.connectors import RotationalSpring, Spring
from anctmm.model.joints import Slider
from anctmm.model.rigid_bodies import PointMass, RigidBody
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
        return _integrated(self._rates, [0.0, 0.0, *self.spins], t)[:, :2]

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


@dataclass(frozen=True)
class Oscillator:
    """A mass on a line, or a body about a hinge, on a spring with a damper: x'' + 2 ζ ω x' + ω² x = 0.

    Parameters
    ----------
    inertia : float
        kg or kg m².
    stiffness, damping : float
        N/m and N s/m, or N m/rad and N m s/rad; less than critically damped.
    speed : float
        At t = 0, from where the spring is free, m/s or rad/s.
    """

    inertia: float = 0.5
    stiffness: float = 80.0
    damping: float = 0.9
    speed: float = 1.3

    def mass_on_a_line(self) -> Scene:
        """A point mass "m" on a slider."""
        mass = PointMass("m", self.inertia, (0.0, 0.0), (self.speed, 0.0))
        spring = Spring("m.center", (-1.0, 0.0), stiffness=self.stiffness, damping=self.damping)
        return Scene("mass on a line", (mass,), (Slider("m.center"),), connectors=(spring,))

    def torsion_pendulum(self) -> Scene:
        """A rigid body "b" hinged beside its centre, whose inertia about the hinge is the oscillator's."""
        arm, mass = 0.2, 1.5
        speed = (0.0, self.speed * arm)
        body = RigidBody(
            "b", mass, self.inertia - mass * arm**2, (arm, 0.0), {"o": (0.0, 0.0)}, speed, self.speed
        )
        spring = RotationalSpring("b.o", stiffness=self.stiffness, damping=self.damping)
        return Scene("torsion pendulum", (body,), (Pin("b.o"),), connectors=(spring,))

    def motion(self, t: Array) -> Array:
        """x at times, (n,), m or rad."""
        decay = self.damping / (2.0 * self.inertia)
        frequency = np.sqrt(self.stiffness / self.inertia - decay**2)
        return np.asarray(self.speed / frequency * np.exp(-decay * t) * np.sin(frequency * t))


def slider_crank(crank: float, rod: float, angle: Array) -> Array:
    """Distance of the slider from the crank's hinge, m, at angles of the crank from the slider's line, rad.

    Parameters
    ----------
    crank, rod : float
        Lengths, m; the rod is the longer one.
    angle : ndarray
    """
    return np.asarray(crank * np.cos(angle) + np.sqrt(rod**2 - (crank * np.sin(angle)) ** 2))


def _point(z: complex) -> Point:
    return z.real, z.imag


def _integrated(rates: Callable[[float, Array], Array], start: list[float], t: Array) -> Array:
    span = (0.0, float(t[-1]))
    found = solve_ivp(rates, span, start, "DOP853", t_eval=t, rtol=TOLERANCE, atol=TOLERANCE)
    return np.asarray(found.y.T)
