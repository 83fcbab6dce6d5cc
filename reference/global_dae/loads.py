"""Forces, moments and line loads on the coordinates of a layout."""

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import unknown_kind
from anctmm.model.drives import value_at
from anctmm.model.loads import LOADS, load_text, width_of
from anctmm.model.scene import Force, LineLoad, Load, Torque
from reference.global_dae.connectors import Angle, Effort
from reference.global_dae.layout import Layout
from reference.global_dae.vectors import QUARTER, Vector, together

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Parts = tuple[Array, Array, Array]


class LoadForce:
    """One load on local coordinates `at`."""

    def __init__(self, load: Load, at: Ints) -> None:
        self.load, self.at = load, at
        self.name, self.width = load_text(load), width_of(load)

    @property
    def dead(self) -> bool:
        """Whether it has a potential."""
        return False

    def value(self, t: float) -> Array:
        """Value of the load at a time."""
        if callable(self.load.value):
            return value_at(self.name, self.load.value, t, self.width)
        return np.atleast_1d(np.asarray(self.load.value, dtype=float))

    def evaluate(self, q: Array, v: Array, t: float, factor: float = 1.0) -> Parts:
        """Force (k,) and its derivatives −∂f/∂q and −∂f/∂v, (k, k)."""
        raise NotImplementedError

    def effort(self, q: Array, v: Array, t: float) -> Effort:
        """What its work is summed up from."""
        raise NotImplementedError

    def keep(self, q: Array) -> None:
        """Accept a state."""


class PointForce(LoadForce):
    """A force that keeps its direction, on a linear place: of a point, or the mean of a beam times its length."""

    def __init__(self, load: Force | LineLoad, place: Vector) -> None:
        super().__init__(load, place.at)
        self.place = place

    @property
    def dead(self) -> bool:
        """Whether it has a potential."""
        return not callable(self.load.value)

    def evaluate(self, q: Array, v: Array, t: float, factor: float = 1.0) -> Parts:
        """Force (k,) and its derivatives −∂f/∂q and −∂f/∂v, (k, k)."""
        none = np.zeros((len(self.at),) * 2)
        return factor * self.value(t) @ self.place.A, none, none

    def effort(self, q: Array, v: Array, t: float) -> Effort:
        """What its work is summed up from."""
        return Effort(self.value(t), self.place(q), self.place.rate(v))


class Follower(LoadForce):
    """A force that turns with its place: components are those of the reference."""

    def __init__(self, load: Force, place: Vector, direction: Vector, reference: Array) -> None:
        super().__init__(load, together(place, direction))
        self.place, self.direction = place, direction
        g = direction(reference)
        self.start = g / np.hypot(*g)

    def evaluate(self, q: Array, v: Array, t: float, factor: float = 1.0) -> Parts:
        """Force (k,) and its derivatives −∂f/∂q and −∂f/∂v, (k, k)."""
        P, G = self.place.on(self.at), self.direction.on(self.at)
        u, by_g = self._unit(q)
        matrix = self._components(t)
        none = np.zeros((len(self.at),) * 2)
        return factor * (matrix @ u) @ P, -factor * P.T @ matrix @ by_g @ G, none

    def effort(self, q: Array, v: Array, t: float) -> Effort:
        """What its work is summed up from."""
        return Effort(self._components(t) @ self._unit(q)[0], self.place(q), self.place.rate(v))

    def _components(self, t: float) -> Array:
        """F as a matrix on the unit vector that turns: along it and across it as in the reference."""
        F = self.value(t)
        along, across = F @ self.start, F @ QUARTER @ self.start
        return np.asarray(along * np.eye(2) + across * QUARTER)

    def _unit(self, q: Array) -> tuple[Array, Array]:
        g = self.direction(q)
        size = float(np.hypot(*g))
        u = g / size
        return u, (np.eye(2) - np.outer(u, u)) / size


class Moment(LoadForce):
    """A moment on the direction of a place."""

    def __init__(self, load: Torque, direction: Vector, reference: Array) -> None:
        self.direction, self.angle = direction, Angle(reference, direction)
        super().__init__(load, self.angle.at)

    def evaluate(self, q: Array, v: Array, t: float, factor: float = 1.0) -> Parts:
        """Force (k,) and its derivatives −∂f/∂q and −∂f/∂v, (k, k)."""
        _, gradient, second = self.angle(q)
        moment = factor * float(self.value(t)[0])
        return moment * gradient, -moment * second, np.zeros_like(second)

    def effort(self, q: Array, v: Array, t: float) -> Effort:
        """What its work is summed up from."""
        angle, gradient, _ = self.angle(q)
        return Effort(self.value(t), np.array([angle]), np.array([gradient @ v[self.at]]))

    def keep(self, q: Array) -> None:
        """Accept a state."""
        self.angle.keep(q)


def loads_of(layout: Layout) -> list[LoadForce]:
    """All loads of a scene."""
    found: list[LoadForce] = []
    for load in layout.scene.loads:
        match load:
            case Force():
                place = layout.scene.place(load.end)
                position = layout.position(place)
                if load.follower:
                    found.append(Follower(load, position, layout.direction(place), layout.reference))
                else:
                    found.append(PointForce(load, position))
            case Torque():
                found.append(Moment(load, layout.direction(layout.scene.place(load.end)), layout.reference))
            case LineLoad():
                found.append(PointForce(load, layout.mean(load.body)))
            case _:
                raise unknown_kind("load", load, LOADS)
    return found
