"""The physics of a scene: bodies, joints, loads and gravity. It knows no mesh, no step and no solver."""

from collections import Counter
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from anctmm.errors import (
    DuplicateNameError,
    SceneError,
    UnknownKindError,
    UnknownNameError,
    listed,
    reason,
    shown,
)
from anctmm.model.bodies import BODIES, Beam, Material, Point, distance
from anctmm.model.joint_checks import check_joints
from anctmm.model.joints import END_NEEDED, JOINTS, SIDES, Clamp, Joint, Pin, Weld, check_angle, end_name
from anctmm.model.loads import LOADS, Force, Load, Torque, check_load
from anctmm.model.start import check_start
from anctmm.validation import is_pair, text, vector, within

__all__ = [
    "Beam",
    "Clamp",
    "Force",
    "Joint",
    "Load",
    "Material",
    "Pin",
    "Point",
    "Probe",
    "Scene",
    "Torque",
    "Weld",
    "checked_scene",
    "distance",
]

Probe = str | tuple[str, float]
#: Bodies, joints and loads, each, at most: an iterable without an end is told.
MOST = 1_000_000


@dataclass(frozen=True)
class Scene:
    """A planar system of beams, validated on construction.

    Parameters
    ----------
    name : str
    bodies : iterable of Beam
    joints : iterable of Pin, Weld, Clamp
        Edges of a graph, which may branch and close loops. A body without a joint is free.
    loads : iterable of Force, Torque
    gravity : (float, float)
        m/s².

    Raises
    ------
    SceneError
        Or one of its kinds, naming the thing, its value and what is allowed.
    """

    name: str
    bodies: tuple[Beam, ...]
    joints: tuple[Joint, ...] = ()
    loads: tuple[Load, ...] = ()
    gravity: Point = (0.0, 0.0)
    _by_name: dict[str, Beam] = field(init=False, repr=False, compare=False, hash=False)

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "name", text("scene name", self.name))
        set_(self, "bodies", _all_of("bodies", self.bodies, BODIES))
        set_(self, "joints", _all_of("joints", self.joints, JOINTS))
        set_(self, "loads", _all_of("loads", self.loads, LOADS))
        set_(self, "gravity", vector("gravity (m/s²)", self.gravity))
        if not self.bodies:
            raise SceneError(f"scene {self.name!r} has no bodies; at least one is needed")
        set_(self, "_by_name", {b.name: b for b in self.bodies})
        if len(self._by_name) < len(self.bodies):
            twice, times = Counter(b.name for b in self.bodies).most_common(1)[0]
            raise DuplicateNameError(f"body name {twice!r} is used {times} times; once is allowed")
        check_joints(self)
        for joint in self.joints:
            if isinstance(joint, Clamp):
                check_angle(joint)
        for load in self.loads:
            self.body_end(load.end)
            check_load(load)
        check_start(self)

    def body(self, name: str) -> Beam:
        """The body of a name; raises UnknownNameError."""
        body = self._by_name.get(name) if isinstance(name, str) else None
        if body is None:
            raise UnknownNameError(
                f"body {shown(name)} is not in scene {self.name!r}; it has {listed(self._by_name)}"
            )
        return body

    def body_end(self, end: str) -> tuple[Beam, int]:
        """Body and side (0 start, 1 end) of an end's name such as "crank.start"; raises UnknownNameError."""
        name, dot, side = end_name(end).rpartition(".")
        if not dot or side not in SIDES:
            raise UnknownNameError(f"end {shown(end)} is not a body's end; {END_NEEDED}")
        return self.body(name), SIDES.index(side)

    def probe(self, probe: Probe) -> tuple[str, float]:
        """Body and fraction of its undeformed length of a probe: "name.end" or ("name", fraction).

        Raises
        ------
        UnknownNameError
            If it is no probe, or not of the scene.
        PropertyError
            If the fraction lies outside [0, 1].
        """
        if isinstance(probe, str):
            body, side = self.body_end(probe)
            return body.name, float(side)
        if not is_pair(probe):
            raise UnknownNameError(
                f"probe is {shown(probe)}; 'name.start', 'name.end' or ('name', fraction) is needed"
            )
        name, fraction = probe
        return self.body(name).name, within(f"probe fraction on {shown(name)}", fraction, 0.0, 1.0, "[]")


def checked_scene(scene: object) -> Scene:
    """Return a scene, or refuse what is none.

    Raises
    ------
    UnknownKindError
        A subclass is none, either: it may mean something that no solver knows.
    """
    if type(scene) is not Scene:
        raise UnknownKindError(f"scene is {shown(scene)} of type {type(scene).__name__}; a Scene is needed")
    return scene


def _all_of(what: str, things: object, kinds: tuple[type, ...]) -> tuple[Any, ...]:
    """Things of an ordered iterable, each of exactly one of the kinds."""
    names = ", ".join(kind.__name__ for kind in kinds)
    needed = f"a list of {names} is needed"
    if isinstance(things, str | bytes | Set | Mapping) or not isinstance(things, Iterable):
        raise SceneError(f"scene {what} is {shown(things)}; {needed}")
    found: list[Any] = []
    try:
        for thing in islice(things, MOST + 1):
            if type(thing) not in kinds:
                raise SceneError(
                    f"scene {what} hold {shown(thing)} of type {type(thing).__name__}; allowed are {names}"
                )
            found.append(thing)
    except SceneError:
        raise
    except Exception as error:  # an iterable of the user's own
        raise SceneError(
            f"scene {what} is {shown(things)}, which raises {reason(error)}; {needed}"
        ) from error
    if len(found) > MOST:
        raise SceneError(
            f"scene {what} is {shown(things)} of more than {MOST} things; {needed}, no longer one"
        )
    return tuple(found)
