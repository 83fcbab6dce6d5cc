"""A scene in other units, at another place or rotated: the same physics with other numbers."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, sin
from typing import Any

import numpy as np

from anctmm.errors import unknown_kind
from anctmm.model.bodies import BODIES, Body
from anctmm.model.connectors import CONNECTORS, Connector
from anctmm.model.joints import Joint, unknown_joint
from anctmm.model.loads import LOADS, Load
from anctmm.model.scene import (
    Beam,
    Clamp,
    Force,
    LineLoad,
    Material,
    Pin,
    Point,
    PointMass,
    Prismatic,
    RigidBody,
    RotationalSpring,
    Scene,
    Slider,
    Spring,
    Torque,
    Weld,
)
from anctmm.model.sections import Section


class _OfTime:
    """A function of time in another unit of it."""

    function: Callable[[Any], Any]
    second: float

    @property
    def breaks(self) -> tuple[float, ...] | None:
        """Times at which it breaks, in the other unit; None where it does not say."""
        stated = getattr(self.function, "breaks", None)
        return None if stated is None else tuple(self.second * t for t in stated)


@dataclass(frozen=True)
class Driving(_OfTime):
    """A value with its rates, with other numbers.

    Parameters
    ----------
    function : callable
        t (s) → the value and its rates.
    factors : tuple of float
        One each.
    second : float
        Units of time in a second.
    """

    function: Callable[[Any], Any]
    factors: tuple[float, ...]
    second: float

    def __call__(self, t: Any) -> tuple[Any, ...]:
        """The value and its rates at a time, or times, in the other units."""
        found = self.function(t / self.second)
        return tuple(f * np.asarray(v) for f, v in zip(self.factors, found, strict=True))


@dataclass(frozen=True)
class Acting(_OfTime):
    """A load with other numbers.

    Parameters
    ----------
    function : callable
        t (s) → a moment, or the components of a force.
    factor : float
    second : float
        Units of time in a second.
    turn : float or None
        By which a force is turned, rad; None for a moment.
    """

    function: Callable[[Any], Any]
    factor: float
    second: float
    turn: float | None

    def __call__(self, t: Any) -> Any:
        """The load at a time, or times, in the other units."""
        found = self.function(t / self.second)
        return (
            self.factor * np.asarray(found) if self.turn is None else _vector(found, self.factor, self.turn)
        )


@dataclass(frozen=True)
class Change:
    """How many units a metre, a kilogram and a second have, where the origin is, and how the scene is turned.

    Parameters
    ----------
    metre, kilogram, second : float
    place : (float, float)
        Place of the old origin, m.
    turn : float
        About the new origin, rad.
    """

    metre: float = 1.0
    kilogram: float = 1.0
    second: float = 1.0
    place: Point = (0.0, 0.0)
    turn: float = 0.0

    @property
    def newton(self) -> float:
        """Units of force."""
        return self.kilogram * self.metre / self.second**2

    @property
    def exact(self) -> bool:
        """Whether only exponents change."""
        return (
            self.place == (0.0, 0.0)
            and self.turn == 0.0
            and all(np.frexp(unit)[0] == 0.5 for unit in (self.metre, self.kilogram, self.second))
        )

    def scene(self, scene: Scene) -> Scene:
        """The scene with these numbers."""
        return replace(
            scene,
            bodies=tuple(self._body(body) for body in scene.bodies),
            joints=tuple(self._joint(joint) for joint in scene.joints),
            loads=tuple(self._load(load) for load in scene.loads),
            gravity=self._vector(scene.gravity, self.metre / self.second**2),
            connectors=tuple(self._connector(connector) for connector in scene.connectors),
        )

    def point(self, point: Point) -> Point:
        """A place."""
        return self._vector((point[0] + self.place[0], point[1] + self.place[1]), self.metre)

    def _vector(self, vector: Point, factor: float = 1.0) -> Point:
        return _vector(vector, factor, self.turn)

    def _velocity(self, velocity: Point) -> Point:
        return self._vector(velocity, self.metre / self.second)

    def _section(self, s: Section) -> Section:
        m = self.metre
        return s if m == 1.0 else Section(s.area * m**2, s.second_moment * m**4, s.fourth_moment * m**6)

    def _material(self, material: Material) -> Material:
        m = self.metre
        return replace(
            material, E=material.E * self.newton / m**2, density=material.density * self.kilogram / m**3,
            damping=material.damping * self.second,
        )  # fmt: skip

    def _body(self, body: Body) -> Body:
        match body:
            case Beam(velocity=v):
                return replace(
                    body, start=self.point(body.start), end=self.point(body.end),
                    section=self._section(body.section), material=self._material(body.material),
                    velocity=None if v is None else lambda fraction: self._velocity(v(fraction)),
                )  # fmt: skip
            case RigidBody():
                return replace(
                    body, mass=body.mass * self.kilogram, inertia=body.inertia * self.kilogram * self.metre**2,
                    center=self.point(body.center), points={k: self.point(p) for k, p in body.points.items()},
                    velocity=self._velocity(body.velocity), spin=body.spin / self.second,
                )  # fmt: skip
            case PointMass():
                return replace(
                    body, mass=body.mass * self.kilogram, position=self.point(body.position),
                    velocity=self._velocity(body.velocity),
                )  # fmt: skip
            case _:
                raise unknown_kind("body", body, BODIES)

    def _joint(self, joint: Joint) -> Joint:
        match joint:
            case Pin():
                return joint
            case Clamp():
                return replace(joint, angle=self._history(joint.angle, 1.0, 2))
            case Weld(ends=ends, grounded=grounded, stretch=stretch):
                angle = self._history(joint.angle, 1.0, 2)
                return Weld(*ends, grounded=grounded, angle=angle, stretch=stretch)
            case Slider() | Prismatic():
                position = self._history(joint.position, self.metre, 2)
                return replace(joint, direction=self._vector(joint.direction), position=position)
            case _:
                raise unknown_joint(joint)

    def _load(self, load: Load) -> Load:
        match load:
            case Force():
                return replace(load, value=self._acting(load.value, self.newton, self.turn))
            case LineLoad():
                return replace(load, value=self._acting(load.value, self.newton / self.metre, self.turn))
            case Torque():
                return replace(load, value=self._acting(load.value, self.newton * self.metre, None))
            case _:
                raise unknown_kind("load", load, LOADS)

    def _acting(self, value: Any, factor: float, turn: float | None) -> Any:
        """What a load gives, or the function of time that gives it."""
        if callable(value):
            return Acting(value, factor, self.second, turn)
        return factor * value if turn is None else _vector(value, factor, turn)

    def _connector(self, connector: Connector) -> Connector:
        newton, metre = self.newton, self.metre
        match connector:
            case Spring():
                free: Any = connector.length
                ground = connector.ground
                return replace(
                    connector, second=connector.second if ground is None else self.point(ground),
                    stiffness=connector.stiffness * newton / metre,
                    damping=connector.damping * newton * self.second / metre,
                    preload=connector.preload * newton,
                    length=self._history(free, metre, 1) if callable(free) else free if free is None else free * metre,
                )  # fmt: skip
            case RotationalSpring():
                turn: Any = connector.angle
                return replace(
                    connector, stiffness=connector.stiffness * newton * metre,
                    damping=connector.damping * newton * metre * self.second,
                    preload=connector.preload * newton * metre,
                    angle=self._history(turn, 1.0, 1) if callable(turn) else turn,
                )  # fmt: skip
            case _:
                raise unknown_kind("connector", connector, CONNECTORS)

    def _history(self, function: Any, factor: float, rates: int) -> Any:
        """A value with its rates; None stays None."""
        if function is None or (factor == self.second == 1.0):
            return function
        return Driving(function, tuple(factor / self.second**k for k in range(rates + 1)), self.second)


def _vector(vector: Any, factor: float, turn: float) -> Any:
    """Components of a vector, or of many, turned and with other units."""
    x, y = vector
    if turn:
        c, s = cos(turn), sin(turn)
        x, y = c * x - s * y, s * x + c * y
    return factor * x, factor * y
