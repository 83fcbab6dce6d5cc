"""Forces of springs, rotational springs and loads on the places and directions that they act on.

A connector measures a length or an angle s; with the tension N(s, s', t) its force is −N ∇s. Under a part f of the
load (statics) it pulls by N(s) − (1 − f) N(placed): the reference is an equilibrium at f = 0. The energy stored at f is
the integral of that force from the free length placed + f (free − placed) on. All other loads act by f times theirs.
"""

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
    """Forces, and the values that they work along with the rates of these."""

    forces: Array
    values: Array
    rates: Array


class ForceElement:
    """What acts on vectors: their values are x, (k, 2), and the rates y."""

    vectors: list[Vector]

    def evaluate(self, x: Array, y: Array, t: float, factor: float = 1.0) -> Parts:
        """Forces on the components of the vectors, (2k,), and their derivatives −∂f/∂x and −∂f/∂y, (2k, 2k)."""
        raise NotImplementedError

    def effort(self, x: Array, y: Array, t: float) -> tuple[Effort, Effort]:
        """What does work and has no potential, and the part of damping in it."""
        return Effort(self.evaluate(x, y, t)[0], x.ravel(), y.ravel()), Effort(*np.zeros((3, 0)))

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

    def accept(self, x: Array) -> None:  # a length has no memory
        pass


class Angle:
    """Rotation of a direction since the reference x, less that of another if there are two, rad, with whole turns."""

    def __init__(self, x: Array) -> None:
        self.start, self.last = _direction(x), 0.0

    def __call__(self, x: Array) -> tuple[float, Array, Array]:
        """Value, gradient (2k,) and second derivatives (2k, 2k)."""
        gradient, second = np.zeros(2 * len(x)), np.zeros((2 * len(x),) * 2)
        for k, sign in enumerate((1.0, -1.0)[: len(x)]):
            own = slice(2 * k, 2 * k + 2)
            by_x, by_xx = turning(x[k])
            gradient[own], second[own, own] = sign * by_x, sign * by_xx
        return self._value(x), gradient, second

    def accept(self, x: Array) -> None:
        """From here on angles are counted within half a turn."""
        self.last = self._value(x)

    def _value(self, x: Array) -> float:
        turn = float(np.angle(_direction(x) / self.start))
        return turn + 2.0 * pi * round((self.last - turn) / (2.0 * pi))


def turning(x: Array) -> tuple[Array, Array]:
    """Gradient (2,) and second derivatives (2, 2) of the angle of a vector."""
    (a, b), s = x, x @ x
    mixed, difference = 2.0 * a * b, b * b - a * a
    return np.array([-b, a]) / s, np.array([[mixed, difference], [difference, -mixed]]) / (s * s)


def _direction(x: Array) -> complex:
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
            self.measure = Angle(layout.placed(self.vectors))
        self.placed = self.measure(layout.placed(self.vectors))[0]
        self.size = self.placed if isinstance(connector, Spring) else 1.0
        at_rest = self._pull(self.placed, 0.0, 0.0)
        self.unloaded = at_rest.stored + (at_rest.lost if connector.law is not None else 0.0)

    def evaluate(self, x: Array, y: Array, t: float, factor: float = 1.0) -> Parts:
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
        free = self.placed + factor * (pull.free - self.placed)
        at_free = self._pull(free, 0.0, t)
        return pull.energy - at_free.energy - (1.0 - factor) * self.unloaded * (s - free)

    def effort(self, x: Array, y: Array, t: float) -> tuple[Effort, Effort]:
        """The free length and what stores nothing do work; damping changes its sign with the rate."""
        s, gradient, _ = self.measure(x)
        rate = float(gradient @ y.ravel())
        pull = self._pull(s, rate, t)
        back = self._pull(s, 2.0 * pull.free_rate - rate, t)
        forces = [-pull.lost, -pull.stored]
        work = np.array([forces, [s, pull.free], [rate, pull.free_rate]])
        damping = 0.5 * (back.lost - pull.lost), s - pull.free, rate - pull.free_rate
        return Effort(*work), Effort(*np.array(damping)[:, None])

    def accept(self, x: Array) -> None:
        self.measure.accept(x)

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
    """One load: on a place, on a direction that a moment turns, or on both, of a force that turns with the direction.

    The place of a line load is the mean of the beam times its length.
    """

    def __init__(self, layout: Layout, load: Load) -> None:
        self.load, self.name, self.width = load, load_text(load), width_of(load)
        self.torque = isinstance(load, Torque)
        self.follower = isinstance(load, Force) and load.follower
        match load:
            case LineLoad(body=name):
                self.vectors = [layout.mean(name)]
            case Force(end=end) | Torque(end=end):
                place = layout.scene.place(end)
                self.vectors = [] if self.torque else [layout.position(place)]
                if self.torque or self.follower:
                    self.vectors.append(layout.direction(place))
                    start = self.vectors[-1](layout.reference)
                    self.start = start / np.hypot(*start)
            case _:
                raise unknown_kind("load", load, LOADS)

    @property
    def dead(self) -> bool:
        """Whether it has a potential."""
        return not (self.torque or self.follower or callable(self.load.value))

    def value(self, t: float) -> Array:
        """Value of the load at a time."""
        if callable(self.load.value):
            return value_at(self.name, self.load.value, t, self.width)
        return np.atleast_1d(np.asarray(self.load.value, dtype=float))

    def evaluate(self, x: Array, y: Array, t: float, factor: float = 1.0) -> Parts:
        F = factor * self.value(t)
        if self.torque:
            gradient, second = turning(x[0])
            return F[0] * gradient, -F[0] * second, np.zeros((2, 2))
        if not self.follower:
            return F, np.zeros((2, 2)), np.zeros((2, 2))
        size = float(np.hypot(*x[1]))
        u = x[1] / size
        # the force as a matrix on the unit vector that turns: along it and across it as in the reference
        components = (F @ self.start) * np.eye(2) + (F @ QUARTER @ self.start) * QUARTER
        by_x = np.zeros((4, 4))
        by_x[:2, 2:] = -components @ (np.eye(2) - np.outer(u, u)) / size
        return np.concatenate([components @ u, np.zeros(2)]), by_x, np.zeros((4, 4))
