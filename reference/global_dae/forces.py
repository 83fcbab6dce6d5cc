"""Forces of springs, rotational springs and loads on the places and directions that they act on.

A connector measures a length or an angle s; with the tension N(s, s', t) its force is −N ∇s. Under a part f of the
load (statics) it pulls by N(s) − (1 − f) N(placed): the reference is an equilibrium at f = 0. The energy stored at f is
the integral of that force over the elongation s − free from the free length on. All other loads act by f times theirs.
"""

from collections.abc import Sequence
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import unknown_kind
from anctmm.model.connectors import Connector, Spring, ends_of, free_of, law_value, name_of
from anctmm.model.drives import value_at
from anctmm.model.loads import LOADS, LineLoad, load_text, width_of
from anctmm.model.places import Place
from anctmm.model.scene import Force, Load, Torque
from reference.global_dae.layout import Layout
from reference.global_dae.vectors import QUARTER, Vector

Array = NDArray[np.float64]
Parts = tuple[Array, Array, Array]

#: Relative step of the differences by which a law is derived.
STEP = 1e-6


class Effort(NamedTuple):
    """What work is summed up from: forces, and the values that they work along with the rates of these."""

    forces: Array
    values: Array
    rates: Array


class ForceElement:
    """What acts on vectors: their values are x, (k, 2), and the rates y."""

    vectors: Sequence[Vector]

    def evaluate(self, x: Array, y: Array, t: float, factor: float = 1.0) -> Parts:
        """Forces on the components of the vectors, (2k,), and their derivatives −∂f/∂x and −∂f/∂y, (2k, 2k)."""
        raise NotImplementedError

    def effort(self, x: Array, y: Array, t: float) -> Effort:
        """What its work is summed up from."""
        raise NotImplementedError

    def accept(self, x: Array) -> None:
        """Accept a state: whole turns are counted from here."""


# --- lengths and angles -----------------------------------------------------------------------------------------


class Distance:
    """Distance of two places, m."""

    def __call__(self, x: Array) -> tuple[float, Array, Array]:
        """Value, gradient (4,) and second derivatives (4, 4)."""
        d = x[1] - x[0]
        length = float(np.hypot(*d))
        n = d / length
        across = (np.eye(2) - np.outer(n, n)) / length
        return length, np.concatenate([-n, n]), np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), across)

    def accept(self, x: Array) -> None:
        """A length has no memory."""


class Angle:
    """Rotation of a direction since the reference x, less that of another if there are two, rad, with whole turns."""

    def __init__(self, x: Array) -> None:
        self.signs = [1.0, -1.0][: len(x)]
        self.start, self.last = self._direction(x), 0.0

    def __call__(self, x: Array) -> tuple[float, Array, Array]:
        """Value, gradient (2k,) and second derivatives (2k, 2k)."""
        gradient, second = np.zeros(2 * len(x)), np.zeros((2 * len(x),) * 2)
        for k, (sign, (a, b)) in enumerate(zip(self.signs, x, strict=True)):
            own, s = slice(2 * k, 2 * k + 2), a * a + b * b
            gradient[own] = sign / s * np.array([-b, a])
            second[own, own] = (
                sign / (s * s) * np.array([[2.0 * a * b, b * b - a * a], [b * b - a * a, -2.0 * a * b]])
            )
        return self._value(x), gradient, second

    def accept(self, x: Array) -> None:
        """From here on angles are counted within half a turn."""
        self.last = self._value(x)

    def _value(self, x: Array) -> float:
        turn = float(np.angle(self._direction(x) / self.start))
        return turn + 2.0 * pi * round((self.last - turn) / (2.0 * pi))

    def _direction(self, x: Array) -> complex:
        found = complex(*x[0]) * (complex(*x[1]).conjugate() if len(x) == 2 else 1.0)
        return found / abs(found)


# --- connectors -------------------------------------------------------------------------------------------------


class Pull(NamedTuple):
    """Tension or moment N = stored + lost, its derivatives, the energy stored, J, the free value and its rate."""

    stored: float
    lost: float
    by_value: float
    by_rate: float
    energy: float
    free: float
    free_rate: float


class ConnectorForce(ForceElement):
    """A spring or a rotational spring."""

    def __init__(self, layout: Layout, connector: Connector) -> None:
        self.connector = connector
        first, second = ends_of(layout.scene, connector)
        self.measure: Distance | Angle
        if isinstance(connector, Spring):
            assert second is not None  # a spring has two ends
            other = layout.position(second) if isinstance(second, Place) else Vector.fixed(second)
            self.vectors, self.measure = [layout.position(first), other], Distance()
        else:
            places = [second, first] if isinstance(second, Place) else [first]
            self.vectors = [layout.direction(place) for place in places]
            self.measure = Angle(self._placed(layout))
        self.placed = self.measure(self._placed(layout))[0]
        self.size = self.placed if isinstance(connector, Spring) else 1.0
        at_rest = self._pull(self.placed, 0.0, 0.0)
        self.unloaded = at_rest.stored + (at_rest.lost if connector.law is not None else 0.0)

    def evaluate(self, x: Array, y: Array, t: float, factor: float = 1.0) -> Parts:
        """Forces on the components of the vectors, (2k,), and their derivatives −∂f/∂x and −∂f/∂y, (2k, 2k)."""
        s, gradient, second = self.measure(x)
        rates = y.ravel()
        pull = self._pull(s, float(gradient @ rates), t)
        tension = pull.stored + pull.lost - (1.0 - factor) * self.unloaded
        outer = np.outer(gradient, gradient)
        by_x = pull.by_value * outer + tension * second
        by_x = by_x + pull.by_rate * np.outer(gradient, second @ rates)
        return -tension * gradient, by_x, pull.by_rate * outer

    def energy(self, x: Array, t: float, factor: float = 1.0) -> float:
        """Energy stored, J: the integral of the force at a part of the load over the elongation."""
        s = self.measure(x)[0]
        pull = self._pull(s, 0.0, t)
        return pull.energy - (1.0 - factor) * self.unloaded * (s - pull.free)

    def effort(self, x: Array, y: Array, t: float) -> Effort:
        """What its work is summed up from: that of the free length, and of what stores nothing."""
        s, rate, pull = self._state(x, y, t)
        forces, rates = np.array([-pull.lost, -pull.stored]), np.array([rate, pull.free_rate])
        return Effort(forces, np.array([s, pull.free]), rates)

    def resistance(self, x: Array, y: Array, t: float) -> Effort:
        """The part of the force that changes its sign with the rate of elongation, and the elongation."""
        s, rate, pull = self._state(x, y, t)
        back = self._pull(s, 2.0 * pull.free_rate - rate, t)
        parts = 0.5 * (back.lost - pull.lost), s - pull.free, rate - pull.free_rate
        return Effort(*(np.array([part]) for part in parts))

    def accept(self, x: Array) -> None:
        """Accept a state."""
        self.measure.accept(x)

    def _placed(self, layout: Layout) -> Array:
        return np.array([vector(layout.reference) for vector in self.vectors])

    def _state(self, x: Array, y: Array, t: float) -> tuple[float, float, Pull]:
        """Length or angle, its rate, and the pull there."""
        s, gradient, _ = self.measure(x)
        rate = float(gradient @ y.ravel())
        return s, rate, self._pull(s, rate, t)

    def _pull(self, s: float, rate: float, t: float) -> Pull:
        c = self.connector
        free, free_rate = free_of(c, self.placed, t)
        e, r = s - free, rate - free_rate
        if c.law is not None:
            h, k = STEP * max(self.size, abs(e)), STEP * max(1.0, abs(r))
            by_e = (self._law(e + h, r, t) - self._law(e - h, r, t)) / (2.0 * h)
            by_r = (self._law(e, r + k, t) - self._law(e, r - k, t)) / (2.0 * k)
            return Pull(0.0, self._law(e, r, t), by_e, by_r, 0.0, free, free_rate)
        stored, energy = c.stiffness * e + c.preload, 0.5 * c.stiffness * e * e + c.preload * e
        return Pull(stored, c.damping * r, c.stiffness, c.damping, energy, free, free_rate)

    def _law(self, e: float, r: float, t: float) -> float:
        assert self.connector.law is not None
        return law_value(name_of(self.connector), self.connector.law, e, r, t)


# --- loads ------------------------------------------------------------------------------------------------------


class LoadForce(ForceElement):
    """One load."""

    def __init__(self, load: Load, *vectors: Vector) -> None:
        self.load, self.vectors = load, vectors
        self.name, self.width = load_text(load), width_of(load)

    @property
    def dead(self) -> bool:
        """Whether it has a potential."""
        return isinstance(self, PointForce) and not callable(self.load.value)

    def value(self, t: float) -> Array:
        """Value of the load at a time."""
        if callable(self.load.value):
            return value_at(self.name, self.load.value, t, self.width)
        return np.atleast_1d(np.asarray(self.load.value, dtype=float))


class PointForce(LoadForce):
    """A force that keeps its direction, on a linear place: of a point, or the mean of a beam times its length."""

    def evaluate(self, x: Array, y: Array, t: float, factor: float = 1.0) -> Parts:
        """Forces on the components of the vectors, (2k,), and their derivatives −∂f/∂x and −∂f/∂y, (2k, 2k)."""
        return factor * self.value(t), np.zeros((2, 2)), np.zeros((2, 2))

    def effort(self, x: Array, y: Array, t: float) -> Effort:
        """What its work is summed up from."""
        return Effort(self.value(t), x[0], y[0])


class Follower(LoadForce):
    """A force on a place (first vector) that turns with a direction (second)."""

    def __init__(self, load: Force, place: Vector, direction: Vector, start: Array) -> None:
        super().__init__(load, place, direction)
        self.start = start / np.hypot(*start)

    def evaluate(self, x: Array, y: Array, t: float, factor: float = 1.0) -> Parts:
        """Forces on the components of the vectors, (2k,), and their derivatives −∂f/∂x and −∂f/∂y, (2k, 2k)."""
        u, size = self._unit(x)
        by_x, components = np.zeros((4, 4)), factor * self._components(t)
        by_x[:2, 2:] = -components @ (np.eye(2) - np.outer(u, u)) / size
        return np.concatenate([components @ u, np.zeros(2)]), by_x, np.zeros((4, 4))

    def effort(self, x: Array, y: Array, t: float) -> Effort:
        """What its work is summed up from."""
        return Effort(self._components(t) @ self._unit(x)[0], x[0], y[0])

    def _components(self, t: float) -> Array:
        """F as a matrix on the unit vector that turns: along it and across it as in the reference."""
        F = self.value(t)
        return np.asarray((F @ self.start) * np.eye(2) + (F @ QUARTER @ self.start) * QUARTER)

    def _unit(self, x: Array) -> tuple[Array, float]:
        size = float(np.hypot(*x[1]))
        return x[1] / size, size


class Moment(LoadForce):
    """A moment on the direction of a place."""

    def __init__(self, load: Torque, direction: Vector, start: Array) -> None:
        super().__init__(load, direction)
        self.angle = Angle(start[None])

    def evaluate(self, x: Array, y: Array, t: float, factor: float = 1.0) -> Parts:
        """Forces on the components of the vectors, (2k,), and their derivatives −∂f/∂x and −∂f/∂y, (2k, 2k)."""
        _, gradient, second = self.angle(x)
        moment = factor * float(self.value(t)[0])
        return moment * gradient, -moment * second, np.zeros((2, 2))

    def effort(self, x: Array, y: Array, t: float) -> Effort:
        """What its work is summed up from."""
        angle, gradient, _ = self.angle(x)
        return Effort(self.value(t), np.array([angle]), np.array([gradient @ y[0]]))

    def accept(self, x: Array) -> None:
        """Accept a state."""
        self.angle.accept(x)


def loads_of(layout: Layout) -> list[LoadForce]:
    """All loads of a scene."""
    found: list[LoadForce] = []
    for load in layout.scene.loads:
        if isinstance(load, LineLoad):
            found.append(PointForce(load, layout.mean(load.body)))
            continue
        if not isinstance(load, Force | Torque):
            raise unknown_kind("load", load, LOADS)
        place = layout.scene.place(load.end)
        if isinstance(load, Force) and not load.follower:
            found.append(PointForce(load, layout.position(place)))
            continue
        direction = layout.direction(place)
        start = direction(layout.reference)
        if isinstance(load, Force):
            found.append(Follower(load, layout.position(place), direction, start))
        else:
            found.append(Moment(load, direction, start))
    return found
