"""Forces of connectors and loads on the coordinates of a layout: values, derivatives, energies and work.

Written apart from ANC-TMM's, so that the two can disagree. Each force element has local coordinates `at`. What it
measures is a length or an angle s(q) with gradient and second derivatives; a connector with the tension N(s, s', t) has
the force −N ∇s.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray
from reference.global_dae.mechanisms.layout import Layout

from anctmm.model.connectors import Connector, Law, Spring, ends_of, free_of, law_value, name_of
from anctmm.model.places import Place
from reference.global_dae.mechanisms.vectors import Vector, together

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Relative step of the differences by which a law is derived.
STEP = 1e-6


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
    """Turn of a direction since the reference, less that of another, rad: continuous from state to state."""

    def __init__(self, reference: Array, second: Vector, first: Vector | None = None) -> None:
        self.vectors = [(1.0, second)] + ([(-1.0, first)] if first is not None else [])
        self.at = together(*(vector for _, vector in self.vectors))
        self.start = self._direction(reference)
        self.turns = 0.0
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


@dataclass
class Pull:
    """Tension or moment of a connector, split into a part with an energy and the rest.

    Parameters
    ----------
    stored, lost : float
        N = stored + lost.
    by_value, by_rate : float
        Derivatives of N.
    energy : float
        J.
    free : float
        Free length or angle.
    """

    stored: float
    lost: float
    by_value: float
    by_rate: float
    energy: float
    free: float


class ConnectorForce:
    """A spring or a rotational spring."""

    def __init__(self, layout: Layout, connector: Connector) -> None:
        first, second = ends_of(layout.scene, connector)
        self.connector, reference = connector, layout.reference
        self.measure: Distance | Angle
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
        at_rest = self._pull(self.placed, 0.0, 0.0)
        self.unloaded = at_rest.stored + (at_rest.lost if connector.law is not None else 0.0)

    def evaluate(self, q: Array, v: Array, t: float, factor: float = 1.0) -> tuple[Array, Array, Array]:
        """Force (k,) and its derivatives −∂f/∂q and −∂f/∂v, (k, k)."""
        s, gradient, second = self.measure(q)
        rate = float(gradient @ v[self.at])
        pull = self._pull(s, rate, t)
        tension = pull.stored + pull.lost - (1.0 - factor) * self.unloaded
        outer = np.outer(gradient, gradient)
        by_q = pull.by_value * outer + tension * second
        if pull.by_rate:
            by_q = by_q + pull.by_rate * np.outer(gradient, second @ v[self.at])
        return -tension * gradient, by_q, pull.by_rate * outer

    def energy(self, q: Array, t: float, factor: float = 1.0) -> float:
        """Energy stored, J; under a part of the load, less what the reference held back."""
        s = self.measure(q)[0]
        return self._pull(s, 0.0, t).energy - (1.0 - factor) * self.unloaded * (s - self.placed)

    def effort(self, q: Array, v: Array, t: float) -> tuple[Array, Array]:
        """What its work is summed up from: forces, and the values that they work along."""
        s, gradient, _ = self.measure(q)
        pull = self._pull(s, float(gradient @ v[self.at]), t)
        return np.array([-pull.lost, -pull.stored]), np.array([s, pull.free])

    def resistance(self, q: Array, v: Array, t: float) -> tuple[float, float]:
        """The part of the force on the elongation that changes its sign with its rate, and the elongation."""
        s, gradient, _ = self.measure(q)
        rate, free_rate = float(gradient @ v[self.at]), free_of(self.connector, self.placed, t)[1]
        pull, back = (self._pull(s, x, t) for x in (rate, 2.0 * free_rate - rate))
        return 0.5 * (back.lost - pull.lost), s - pull.free

    def keep(self, q: Array) -> None:
        """Accept a state."""
        self.measure.keep(q)

    def _pull(self, s: float, rate: float, t: float) -> Pull:
        c = self.connector
        free, free_rate = free_of(c, getattr(self, "placed", s), t)
        e, r = s - free, rate - free_rate
        if c.law is not None:
            return Pull(0.0, self._law(c.law, e, r, t), *self._slopes(c.law, e, r, t), 0.0, free)
        return Pull(
            c.stiffness * e + c.preload,
            c.damping * r,
            c.stiffness,
            c.damping,
            0.5 * c.stiffness * e * e + c.preload * e,
            free,
        )

    def _law(self, law: Law, e: float, r: float, t: float) -> float:
        return law_value(name_of(self.connector), law, e, r, t)

    def _slopes(self, law: Law, e: float, r: float, t: float) -> tuple[float, float]:
        """Derivatives of a law by elongation and rate, by central differences."""
        h = (
            STEP * max(1.0, abs(e))
            if not isinstance(self.connector, Spring)
            else STEP * max(self._size(), abs(e))
        )
        k = STEP * max(1.0, abs(r))
        by_e = (self._law(law, e + h, r, t) - self._law(law, e - h, r, t)) / (2.0 * h)
        by_r = (self._law(law, e, r + k, t) - self._law(law, e, r - k, t)) / (2.0 * k)
        return by_e, by_r

    def _size(self) -> float:
        return float(getattr(self, "placed", 1.0))
