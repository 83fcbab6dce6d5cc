"""The physics of a scene: bodies, joints, loads and gravity. It knows no mesh, no step and no solver."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from anctmm.errors import (
    DuplicateNameError,
    SceneError,
    UnknownKindError,
    UnknownNameError,
    UnsupportedError,
    listed,
    shown,
)
from anctmm.model.accepted import BodyKind, ConnectorKind, JointKind, LoadKind, Point
from anctmm.model.bodies import Beam, Body, Material, beam_of
from anctmm.model.checks.parts import check_parts, parts_of
from anctmm.model.checks.start import check_start
from anctmm.model.connectors import Connector
from anctmm.model.joints import Clamp, Joint, Pin, Weld
from anctmm.model.loads import Force, Load, Torque
from anctmm.model.places import Key, Place, Written, place_of
from anctmm.validation import text, vector

__all__ = [
    "Beam", "Clamp", "Force", "Joint", "Load", "Material", "Pin", "Point", "Probe", "Scene", "Torque", "Weld",
    "checked_scene",
]  # fmt: skip

Probe = Written


@dataclass(frozen=True)
class Scene:
    """A system of bodies in the plane or in space, validated on construction.

    The plane has places of two components, space of three. What is offered in space says `anctmm.model.checks.parts`.

    Parameters
    ----------
    name : str
    bodies : iterable of Beam, RigidBody, PointMass
    joints : iterable of Pin, Weld, Clamp, Slider, Prismatic, Revolute
        Edges of a graph, which may branch and close loops. A body without a joint is free.
    loads : iterable of Force, Torque, LineLoad
    gravity : (float, float), or (float, float, float) in space, optional
        m/s². Default: none.
    connectors : iterable of Spring, RotationalSpring

    Raises
    ------
    SceneError
        Or one of its kinds, naming the thing, its value and what is allowed.
    """

    name: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...] = ()
    loads: tuple[Load, ...] = ()
    gravity: Point = None  # type: ignore[assignment]
    connectors: tuple[Connector, ...] = ()
    _by_name: dict[str, Body] = field(init=False, repr=False, compare=False, hash=False)

    if TYPE_CHECKING:  # what is accepted; attributes hold what became of it

        def __init__(
            self,
            name: str,
            bodies: Iterable[BodyKind],
            joints: Iterable[JointKind] = ...,
            loads: Iterable[LoadKind] = ...,
            gravity: Point | None = ...,
            connectors: Iterable[ConnectorKind] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        self._check()
        check_start(self)

    def _check(self) -> None:
        """Check and keep everything, but whether the initial velocities fit the joints."""
        set_ = object.__setattr__
        set_(self, "name", text("scene name", self.name))
        for what in ("bodies", "joints", "loads", "connectors"):
            set_(self, what, parts_of(what, getattr(self, what)))
        if not self.bodies:
            raise SceneError(f"scene {self.name!r} has no bodies; at least one is needed")
        gravity = (0.0,) * self.dim if self.gravity is None else self.gravity
        set_(self, "gravity", vector("gravity (m/s²)", gravity, dims=(self.dim,)))
        set_(self, "_by_name", {b.name: b for b in self.bodies})
        if len(self._by_name) < len(self.bodies):
            twice, times = Counter(b.name for b in self.bodies).most_common(1)[0]
            raise DuplicateNameError(f"body name {twice!r} is used {times} times; once is allowed")
        check_parts(self)

    @property
    def dim(self) -> int:
        """Components of a place, those of the first body: 2 in the plane, 3 in space."""
        return self.bodies[0].dim

    @cached_property
    def beams(self) -> tuple[Beam, ...]:
        """Its beams: the bodies that a mesh cuts."""
        return tuple(body for body in self.bodies if isinstance(body, Beam))

    @cached_property
    def length(self) -> float:
        """Length that positions are compared with: of all beams, with the extents of rigid bodies, m.

        Of point masses alone it is the size of the box around them and the points of the ground that hold them.
        """
        length = sum(body.extent for body in self.bodies)
        if length > 0.0:
            return length
        points = [place for body in self.bodies for place in map(body.position_at, body.keys)]  # type: ignore[union-attr]
        points += [c.ground for c in self.connectors if c.ground is not None]
        spread = max(max(axis) - min(axis) for axis in zip(*points, strict=True))
        return spread or 1.0

    def body(self, name: str) -> Body:
        """The body of a name; raises UnknownNameError."""
        body = self._by_name.get(name) if isinstance(name, str) else None
        if body is None:
            raise UnknownNameError(
                f"body {shown(name)} is not in scene {self.name!r}; it has {listed(self._by_name)}"
            )
        return body

    def beam(self, name: str) -> Beam:
        """The beam of a name; UnknownNameError if there is no such body, UnknownKindError if it is of another kind."""
        return beam_of(self.body(name))

    def place(self, place: Written) -> Place:
        """What a place is: "name.start", ("name", fraction), "name.point"; errors as of `places.place_of`."""
        return place_of(self, place)

    def body_end(self, end: Written) -> tuple[Beam, int]:
        """Beam and side (0 start, 1 end) of an end such as "crank.start"; UnknownNameError if it is another place."""
        place = self.place(end)
        if not isinstance(place.body, Beam) or place.interior:
            raise UnknownNameError(
                f"place {shown(end)} is no end of a beam; 'name.start' or 'name.end' is needed here"
            )
        return place.body, int(place.key)

    def probe(self, probe: Probe) -> tuple[str, Key]:
        """Body and key of a probe: of a beam the fraction of its undeformed length, of others a point's name."""
        place = self.place(probe)
        return place.body.name, place.key if isinstance(place.key, str) else float(place.key)


class SceneToBeStarted(Scene):
    """A scene checked except for its initial velocities, which may not fit joints and drives yet."""

    def __post_init__(self) -> None:
        self._check()


def checked_scene(scene: object, space: bool = False) -> Scene:
    """Return a scene, in space only if `space`, or refuse what is none.

    A subclass is none, either: it may mean something that no solver knows.
    """
    if type(scene) is not Scene:
        raise UnknownKindError(f"scene is {shown(scene)} of type {type(scene).__name__}; a Scene is needed")
    if scene.dim == 3 and not space:
        raise UnsupportedError(f"scene {scene.name!r} is in space; a scene in the plane is needed here")
    return scene
