"""A scene in other units and at another place: the same physics with other numbers."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from anctmm.errors import unknown_kind
from anctmm.model.bodies import BODIES, Body
from anctmm.model.connectors import CONNECTORS, Connector
from anctmm.model.joints import JOINTS, Joint
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


@dataclass(frozen=True)
class Scaled:
    """A function of time in other units.

    Parameters
    ----------
    function : callable
        t (s) → a value, or several.
    factors : tuple of float
        Of its values, one each; the only one of all.
    second : float
        Units of time in a second.
    """

    function: Callable[[Any], Any]
    factors: tuple[float, ...]
    second: float

    def __call__(self, t: Any) -> Any:
        """Value at a time, or times, in the other unit."""
        found = self.function(t / self.second)
        if isinstance(found, tuple | list):
            factors = self.factors if len(self.factors) == len(found) else self.factors * len(found)
            return tuple(f * v for f, v in zip(factors, found, strict=True))
        return np.asarray(found) * (
            self.factors[0] if len(set(self.factors)) == 1 else np.array(self.factors)
        )

    @property
    def breaks(self) -> tuple[float, ...] | None:
        """Times at which it breaks, in the other unit; None where it does not say."""
        stated = getattr(self.function, "breaks", None)
        return None if stated is None else tuple(self.second * t for t in stated)


@dataclass(frozen=True)
class Units:
    """How many units a metre, a kilogram and a second have, and where the origin is.

    Parameters
    ----------
    metre, kilogram, second : float
    place : (float, float)
        Place of the old origin, m.
    """

    metre: float = 1.0
    kilogram: float = 1.0
    second: float = 1.0
    place: Point = (0.0, 0.0)

    @property
    def newton(self) -> float:
        """Units of force."""
        return self.kilogram * self.metre / self.second**2

    @property
    def exact(self) -> bool:
        """Whether only exponents change."""
        return self.place == (0.0, 0.0) and all(
            np.frexp(unit)[0] == 0.5 for unit in (self.metre, self.kilogram, self.second)
        )

    def scene(self, scene: Scene) -> Scene:
        """The scene in these units."""
        return replace(
            scene,
            bodies=tuple(self._body(body) for body in scene.bodies),
            joints=tuple(self._joint(joint) for joint in scene.joints),
            loads=tuple(self._load(load) for load in scene.loads),
            gravity=_times(scene.gravity, self.metre / self.second**2),
            connectors=tuple(self._connector(connector) for connector in scene.connectors),
        )

    def point(self, point: Point) -> Point:
        """A place."""
        return tuple(self.metre * (a + b) for a, b in zip(point, self.place, strict=True))  # type: ignore[return-value]

    def _velocity(self, velocity: Point) -> Point:
        return _times(velocity, self.metre / self.second)

    def _body(self, body: Body) -> Body:
        match body:
            case Beam(velocity=v):
                velocity = None if v is None else lambda fraction: self._velocity(v(fraction))
                m, s, material = self.metre, body.section, body.material
                section = Section(s.area * m**2, s.second_moment * m**4, s.fourth_moment * m**6)
                stiff = Material(
                    material.E * self.newton / m**2, material.density * self.kilogram / m**3, material.poisson,
                    material.damping * self.second,
                )  # fmt: skip
                start, end = self.point(body.start), self.point(body.end)
                return Beam(body.name, start, end, section, stiff, velocity)
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
            case Weld():
                return Weld(*joint.ends, grounded=joint.grounded, angle=self._history(joint.angle, 1.0, 2))
            case Slider() | Prismatic():
                return replace(joint, position=self._history(joint.position, self.metre, 2))
            case _:
                raise unknown_kind("joint", joint, JOINTS)

    def _load(self, load: Load) -> Load:
        unit = {Force: self.newton, LineLoad: self.newton / self.metre, Torque: self.newton * self.metre}
        match load:
            case Force() | LineLoad() | Torque():
                value: Any = load.value
                factor = unit[type(load)]
                if callable(value):
                    value = Scaled(value, (factor,), self.second)
                else:
                    value = factor * value if isinstance(load, Torque) else _times(value, factor)
                return replace(load, value=value)
            case _:
                raise unknown_kind("load", load, LOADS)

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
        if function is None:
            return None
        return Scaled(function, tuple(factor / self.second**k for k in range(rates + 1)), self.second)


def _times(point: Point, factor: float) -> Point:
    return factor * point[0], factor * point[1]
