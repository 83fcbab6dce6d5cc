"""A scene in other units, at another place or rotated: the same physics with other numbers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import cos, sin
from typing import Any

import numpy as np

import anctmm as at
from anctmm.errors import UnknownKindError

#: Powers of metre, kilogram and second in a quantity.
Powers = tuple[int, int, int]
NONE, LENGTH, MASS, TIME, VELOCITY = (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, -1)
FORCE, MOMENT, INERTIA, LINE_LOAD, PRESSURE = (1, 1, -2), (2, 1, -2), (2, 1, 0), (0, 1, -2), (-1, 1, -2)
STIFFNESS, DAMPING, TURNING_DAMPING = (0, 1, -2), (0, 1, -1), (2, 1, -1)


@dataclass(frozen=True)
class Changed:
    """A function of a user's with other numbers."""

    function: Callable[[Any], Any]  # of time, s, or of a fraction of a beam
    change: Callable[[Any], Any]  # of its answer
    second: float = 1.0  # units of time in a second

    def __call__(self, t: Any) -> Any:
        """The answer in the other units, at a time in those."""
        return self.change(self.function(t / self.second))

    @property
    def breaks(self) -> tuple[float, ...] | None:
        """Times at which it breaks, in the other unit; None where it does not say."""
        stated = getattr(self.function, "breaks", None)
        return None if stated is None else tuple(self.second * t for t in stated)


@dataclass(frozen=True)
class Change:
    """How many units a metre, a kilogram and a second have, where the origin is, and how the scene is turned."""

    metre: float = 1.0
    kilogram: float = 1.0
    second: float = 1.0
    place: tuple[float, float] = (0.0, 0.0)  # of the old origin, m
    turn: float = 0.0  # about the new origin, rad

    @property
    def exact(self) -> bool:
        """Whether only exponents change."""
        units = self.metre, self.kilogram, self.second
        return (*self.place, self.turn) == (0.0, 0.0, 0.0) and all(np.frexp(u)[0] == 0.5 for u in units)

    def scene(self, scene: at.Scene) -> at.Scene:
        """The scene with these numbers.

        Raises
        ------
        UnknownKindError
            If it has a part of a user's own kind.
        """
        parts: dict[str, Any] = {
            name: tuple(self._part(thing) for thing in getattr(scene, name))
            for name in ("bodies", "joints", "loads", "connectors")
        }
        return replace(scene, gravity=self._vector((1, 0, -2), scene.gravity), **parts)

    def _part(self, thing: Any) -> Any:
        """A part of a scene; what is not in `QUANTITIES` has no unit."""
        if type(thing) not in QUANTITIES:
            known = ", ".join(kind.__name__ for kind in QUANTITIES)
            raise UnknownKindError(f"{thing!r} has units that are not known; kinds with known ones: {known}")
        changed = {
            name: change(self, powers, getattr(thing, name))
            for name, (change, powers) in QUANTITIES[type(thing)].items()
        }
        if isinstance(thing, at.Weld):  # its places are positional arguments
            return at.Weld(*thing.ends, grounded=thing.grounded, stretch=thing.stretch, **changed)
        return replace(thing, **changed)

    def _unit(self, powers: Powers) -> float:
        metre, kilogram, second = powers
        return self.metre**metre * self.kilogram**kilogram * self.second**second

    def _number(self, powers: Powers, value: Any) -> Any:
        """A number, or a function of time that gives one."""
        if callable(value):
            return Changed(value, lambda found: self._unit(powers) * np.asarray(found), self.second)
        return self._unit(powers) * value

    def _vector(self, powers: Powers, value: Any) -> Any:
        """Components of a vector, turned, or a function of time that gives them."""
        if callable(value):
            return Changed(value, lambda found: self._vector(powers, found), self.second)
        x, y = value
        if self.turn:
            c, s = cos(self.turn), sin(self.turn)
            x, y = c * x - s * y, s * x + c * y
        unit = self._unit(powers)
        return unit * x, unit * y

    def _rates(self, powers: Powers, value: Any) -> Any:
        """A number that may be missing, or a function of time that gives it with its rates."""
        if not callable(value):
            return None if value is None else self._unit(powers) * value
        if self._unit(powers) == self.second == 1.0:
            return value

        def change(found: Any) -> tuple[Any, ...]:
            unit = self._unit(powers)
            return tuple(unit / self.second**k * np.asarray(v) for k, v in enumerate(found))

        return Changed(value, change, self.second)

    def _point(self, powers: Powers, value: Any) -> Any:
        """A place; a place of a body stays, and of several places each is changed."""
        if isinstance(value, Mapping):
            return {name: self._point(powers, point) for name, point in value.items()}
        if value is None or isinstance(value, str) or isinstance(value[0], str):
            return value
        return self._vector(powers, (value[0] + self.place[0], value[1] + self.place[1]))

    def _along(self, powers: Powers, value: Any) -> Any:
        """Vectors along a beam, a function of the fraction; None stays None."""
        return None if value is None else Changed(value, lambda found: self._vector(powers, found))

    def _section(self, powers: Powers, value: at.Section) -> at.Section:
        m = self.metre
        if m == 1.0:
            return value
        return at.Section(value.area * m**2, value.second_moment * m**4, value.fourth_moment * m**6)

    def _nested(self, powers: Powers, value: Any) -> Any:
        return self._part(value)


_C = Change
#: Of each kind of part of a scene the quantities: what becomes of each, and its unit.
QUANTITIES: Mapping[type, Mapping[str, tuple[Callable[[Change, Powers, Any], Any], Powers]]] = {
    at.Beam: {
        "start": (_C._point, LENGTH), "end": (_C._point, LENGTH), "section": (_C._section, LENGTH),
        "material": (_C._nested, NONE), "velocity": (_C._along, VELOCITY),
    },
    at.Material: {"E": (_C._number, PRESSURE), "density": (_C._number, (-3, 1, 0)), "damping": (_C._number, TIME)},
    at.RigidBody: {
        "mass": (_C._number, MASS), "inertia": (_C._number, INERTIA), "center": (_C._point, LENGTH),
        "points": (_C._point, LENGTH), "velocity": (_C._vector, VELOCITY), "spin": (_C._number, (0, 0, -1)),
    },
    at.PointMass: {
        "mass": (_C._number, MASS), "position": (_C._point, LENGTH), "velocity": (_C._vector, VELOCITY),
    },
    at.Pin: {},
    at.Clamp: {"angle": (_C._rates, NONE)},
    at.Weld: {"angle": (_C._rates, NONE)},
    at.Slider: {"direction": (_C._vector, NONE), "position": (_C._rates, LENGTH)},
    at.Prismatic: {"direction": (_C._vector, NONE), "position": (_C._rates, LENGTH)},
    at.Force: {"value": (_C._vector, FORCE)},
    at.LineLoad: {"value": (_C._vector, LINE_LOAD)},
    at.Torque: {"value": (_C._number, MOMENT)},
    at.Spring: {
        "second": (_C._point, LENGTH), "stiffness": (_C._number, STIFFNESS), "damping": (_C._number, DAMPING),
        "preload": (_C._number, FORCE), "length": (_C._rates, LENGTH),
    },
    at.RotationalSpring: {
        "stiffness": (_C._number, MOMENT), "damping": (_C._number, TURNING_DAMPING),
        "preload": (_C._number, MOMENT), "angle": (_C._rates, NONE),
    },
}  # fmt: skip
