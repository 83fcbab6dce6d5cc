"""Forces of springs and rotational springs.

A connector measures a length or an angle s(q); with the tension N(s, s', t) its force is −N ∇s. Under a part f of the
load (statics) it pulls by N(s) − (1 − f) N(placed): the reference is an equilibrium at f = 0. The energy stored at f is
the integral of that force over the elongation s − free from the free length on.
"""

from math import pi
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from anctmm.model.connectors import Connector, Spring, ends_of, free_of, law_value, name_of
from anctmm.model.places import Place
from reference.global_dae.layout import Layout
from reference.global_dae.vectors import Vector, together

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Relative step of the differences by which a law is derived.
STEP = 1e-6


class Effort(NamedTuple):
    """What work is summed up from: forces, and the values that they work along with the rates of these."""

    forces: Array
    values: Array
    rates: Array


class Measure(Protocol):
    """A length or an angle that depends on coordinates `at`."""

    at: Ints

    def __call__(self, q: Array) -> tuple[float, Array, Array]:
        """Value, gradient (k,) and second derivatives (k, k)."""
        ...

    def keep(self, q: Array) -> None:
        """Accept a state."""
        ...


class Distance:
    """Distance of two places, m."""

    def __init__(self, first: Vector, second: Vector) -> None:
        self.apart = second.minus(first)
        self.at = self.apart.at

    def __call__(self, q: Array) -> tuple[float, Array, Array]:
        """Value, gradient (k,) and second derivatives (k, k)."""
        d, A = self.apart(q), self.apart.A
        length = float(np.hypot(*d))
        n = d / length
        return length, n @ A, A.T @ (np.eye(2) - np.outer(n, n)) @ A / length

    def keep(self, q: Array) -> None:
        """A length has no memory."""


class Angle:
    """Rotation of a direction since the reference, less that of another, rad, with whole turns."""

    def __init__(self, reference: Array, second: Vector, first: Vector | None = None) -> None:
        self.vectors = [(1.0, second)] + ([(-1.0, first)] if first is not None else [])
        self.at = together(*(vector for _, vector in self.vectors))
        self.start = self._direction(reference)
        self.last = 0.0

    def __call__(self, q: Array) -> tuple[float, Array, Array]:
        """Value, gradient (k,) and second derivatives (k, k)."""
        gradient, second = np.zeros(len(self.at)), np.zeros((len(self.at),) * 2)
        for sign, vector in self.vectors:
            x, y = vector(q)
            A, s = vector.on(self.at), x * x + y * y
            gradient += sign / s * (np.array([-y, x]) @ A)
            H = np.array([[2.0 * x * y, y * y - x * x], [y * y - x * x, -2.0 * x * y]]) / (s * s)
            second += sign * A.T @ H @ A
        return self._value(q), gradient, second

    def keep(self, q: Array) -> None:
        """From here on angles are counted within half a turn."""
        self.last = self._value(q)

    def _value(self, q: Array) -> float:
        turn = float(np.angle(self._direction(q) / self.start))
        return turn + 2.0 * pi * round((self.last - turn) / (2.0 * pi))

    def _direction(self, q: Array) -> complex:
        found = 1.0 + 0.0j
        for sign, vector in self.vectors:
            g = complex(*vector(q))
            found *= g if sign > 0.0 else g.conjugate()
        return found / abs(found)


class Pull(NamedTuple):
    """Tension or moment N = stored + lost, its derivatives, the energy stored, J, the free value and its rate."""

    stored: float
    lost: float
    by_value: float
    by_rate: float
    energy: float
    free: float
    free_rate: float


class ConnectorForce:
    """A spring or a rotational spring."""

    def __init__(self, layout: Layout, connector: Connector) -> None:
        first, second = ends_of(layout.scene, connector)
        self.connector, reference = connector, layout.reference
        self.measure: Measure
        if isinstance(connector, Spring):
            assert second is not None  # a spring has two ends
            other = layout.position(second) if isinstance(second, Place) else Vector.fixed(second)
            self.measure = Distance(layout.position(first), other)
        elif isinstance(second, Place):
            self.measure = Angle(reference, layout.direction(second), layout.direction(first))
        else:
            self.measure = Angle(reference, layout.direction(first))
        self.at = self.measure.at
        self.placed = self.measure(reference)[0]
        self.size = self.placed if isinstance(connector, Spring) else 1.0
        at_rest = self._pull(self.placed, 0.0, 0.0)
        self.unloaded = at_rest.stored + (at_rest.lost if connector.law is not None else 0.0)

    def evaluate(self, q: Array, v: Array, t: float, factor: float = 1.0) -> tuple[Array, Array, Array]:
        """Force (k,) and its derivatives −∂f/∂q and −∂f/∂v, (k, k)."""
        s, gradient, second = self.measure(q)
        pull = self._pull(s, float(gradient @ v[self.at]), t)
        tension = pull.stored + pull.lost - (1.0 - factor) * self.unloaded
        outer = np.outer(gradient, gradient)
        by_q = pull.by_value * outer + tension * second
        if pull.by_rate:
            by_q = by_q + pull.by_rate * np.outer(gradient, second @ v[self.at])
        return -tension * gradient, by_q, pull.by_rate * outer

    def energy(self, q: Array, t: float, factor: float = 1.0) -> float:
        """Energy stored, J: the integral of the force at a part of the load over the elongation."""
        s = self.measure(q)[0]
        pull = self._pull(s, 0.0, t)
        return pull.energy - (1.0 - factor) * self.unloaded * (s - pull.free)

    def effort(self, q: Array, v: Array, t: float) -> Effort:
        """What its work is summed up from: that of the free length, and of what stores nothing."""
        s, gradient, _ = self.measure(q)
        rate = float(gradient @ v[self.at])
        pull = self._pull(s, rate, t)
        forces, rates = np.array([-pull.lost, -pull.stored]), np.array([rate, pull.free_rate])
        return Effort(forces, np.array([s, pull.free]), rates)

    def resistance(self, q: Array, v: Array, t: float) -> Effort:
        """The part of the force that changes its sign with the rate of elongation, and the elongation."""
        s, gradient, _ = self.measure(q)
        rate = float(gradient @ v[self.at])
        pull = self._pull(s, rate, t)
        back = self._pull(s, 2.0 * pull.free_rate - rate, t)
        parts = 0.5 * (back.lost - pull.lost), s - pull.free, rate - pull.free_rate
        return Effort(*(np.array([part]) for part in parts))

    def keep(self, q: Array) -> None:
        """Accept a state."""
        self.measure.keep(q)

    def _pull(self, s: float, rate: float, t: float) -> Pull:
        c = self.connector
        free, free_rate = free_of(c, self.placed, t)
        e, r = s - free, rate - free_rate
        if c.law is not None:
            return Pull(0.0, self._law(e, r, t), *self._slopes(e, r, t), 0.0, free, free_rate)
        energy = 0.5 * c.stiffness * e * e + c.preload * e
        return Pull(
            c.stiffness * e + c.preload, c.damping * r, c.stiffness, c.damping, energy, free, free_rate
        )

    def _law(self, e: float, r: float, t: float) -> float:
        assert self.connector.law is not None
        return law_value(name_of(self.connector), self.connector.law, e, r, t)

    def _slopes(self, e: float, r: float, t: float) -> tuple[float, float]:
        """Derivatives of a law by elongation and rate, by central differences."""
        h, k = STEP * max(self.size, abs(e)), STEP * max(1.0, abs(r))
        by_e = (self._law(e + h, r, t) - self._law(e - h, r, t)) / (2.0 * h)
        by_r = (self._law(e, r + k, t) - self._law(e, r - k, t)) / (2.0 * k)
        return by_e, by_r
