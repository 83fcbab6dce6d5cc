"""A scene at another place or turned: the same physics with other numbers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import cos, sin
from typing import Any

import anctmm as at
from anctmm.errors import UnknownKindError

#: Of each kind of part of a scene its places and its vectors; all else is the same anywhere.
NUMBERS: Mapping[type, tuple[tuple[str, ...], tuple[str, ...]]] = {
    at.Beam: (("start", "end"), ("velocity",)), at.RigidBody: (("center", "points"), ("velocity",)),
    at.PointMass: (("position",), ("velocity",)), at.Slider: ((), ("direction",)), at.Prismatic: ((), ("direction",)),
    at.Force: ((), ("value",)), at.LineLoad: ((), ("value",)), at.Spring: (("second",), ()),
    **dict.fromkeys((at.Pin, at.Clamp, at.Weld, at.Torque, at.RotationalSpring), ((), ())),
}  # fmt: skip


def changed(function: Callable[[Any], Any], change: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A function of a user's, of time (s) or of a fraction of a beam, with its answer changed; its breaks stay."""
    breaks = getattr(function, "breaks", None)

    def other(x: float) -> Any:
        return change(function(x))

    return other if breaks is None else at.History(other, breaks)


@dataclass(frozen=True)
class Change:
    """Where the old origin is, m, and how the scene is turned about the new one, rad."""

    place: tuple[float, float] = (0.0, 0.0)
    turn: float = 0.0

    def scene(self, scene: at.Scene) -> at.Scene:
        """The scene with these numbers; UnknownKindError if it has a part of a user's own kind."""
        parts: dict[str, Any] = {
            name: tuple(self._part(thing) for thing in getattr(scene, name))
            for name in ("bodies", "joints", "loads", "connectors")
        }
        return replace(scene, gravity=self._vector(scene.gravity), **parts)

    def _part(self, thing: Any) -> Any:
        if type(thing) not in NUMBERS:
            known = ", ".join(kind.__name__ for kind in NUMBERS)
            raise UnknownKindError(f"{thing!r} is of a kind that is not known; known kinds: {known}")
        places, vectors = NUMBERS[type(thing)]
        changed = {name: self._place(getattr(thing, name)) for name in places}
        changed |= {name: self._vector(getattr(thing, name)) for name in vectors}
        return replace(thing, **changed) if changed else thing

    def _place(self, value: Any) -> Any:
        """A place; a place of a body stays, and of several places each is changed."""
        if isinstance(value, Mapping):
            return {name: self._place(point) for name, point in value.items()}
        if isinstance(value, str) or isinstance(value[0], str):
            return value
        return self._vector((value[0] + self.place[0], value[1] + self.place[1]))

    def _vector(self, value: Any) -> Any:
        """Components of a vector, turned, or a function that gives them; None stays None."""
        if value is None or not self.turn:
            return value
        if callable(value):
            return changed(value, self._vector)
        c, s, (x, y) = cos(self.turn), sin(self.turn), value
        return c * x - s * y, s * x + c * y
