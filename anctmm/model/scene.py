"""The physics of a scene: bodies, joints, loads and gravity. It knows no mesh, no step and no solver."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from anctmm.errors import (
    DuplicateNameError,
    SceneError,
    UnknownKindError,
    UnknownNameError,
    UnsupportedError,
    listed,
    shown,
)
from anctmm.model.accepted import BodyKind, ConnectorKind, JointKind, LoadKind, PairLike
from anctmm.model.bodies import BODIES, Beam, Body, Material, Point, beam_of, distance
from anctmm.model.checks.joints import check_joints
from anctmm.model.checks.space import check_dimension
from anctmm.model.checks.start import check_start
from anctmm.model.connectors import CONNECTORS, Connector, RotationalSpring, Spring, check_connector
from anctmm.model.joints import JOINTS, Clamp, Joint, Pin, Prismatic, Revolute, Slider, Weld
from anctmm.model.loads import LOADS, Force, LineLoad, Load, Torque, check_load
from anctmm.model.places import PLACE_NEEDED, SIDES, Key, Place, Written, place_in, written
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.validation import several, text, vector

__all__ = [
    "Beam",
    "Clamp",
    "Connector",
    "Force",
    "Joint",
    "LineLoad",
    "Load",
    "Material",
    "Pin",
    "Point",
    "PointMass",
    "Prismatic",
    "Probe",
    "Revolute",
    "RigidBody",
    "RotationalSpring",
    "Scene",
    "Slider",
    "Spring",
    "Torque",
    "Weld",
    "checked_scene",
    "distance",
]

Probe = Written
#: Largest number of bodies, joints, connectors and loads, each: an infinite iterable is refused.
MOST = 1_000_000


@dataclass(frozen=True)
class Scene:
    """A system of bodies in the plane or in space, validated on construction.

    The plane has places of two components, space of three. What is offered in space says `anctmm.model.checks.space`.

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
            gravity: PairLike | None = ...,
            connectors: Iterable[ConnectorKind] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        self._check()
        check_start(self)

    def _check(self) -> None:
        """Check and keep everything, but whether the initial velocities fit the joints."""
        set_ = object.__setattr__
        set_(self, "name", text("scene name", self.name))
        set_(self, "bodies", _all_of("bodies", self.bodies, BODIES))
        set_(self, "joints", _all_of("joints", self.joints, JOINTS, Joint))
        set_(self, "loads", _all_of("loads", self.loads, LOADS))
        set_(self, "connectors", _all_of("connectors", self.connectors, CONNECTORS))
        if not self.bodies:
            raise SceneError(f"scene {self.name!r} has no bodies; at least one is needed")
        gravity = (0.0,) * self.dim if self.gravity is None else self.gravity
        set_(self, "gravity", vector("gravity (m/s²)", gravity, dims=(self.dim,)))
        set_(self, "_by_name", {b.name: b for b in self.bodies})
        if len(self._by_name) < len(self.bodies):
            twice, times = Counter(b.name for b in self.bodies).most_common(1)[0]
            raise DuplicateNameError(f"body name {twice!r} is used {times} times; once is allowed")
        check_dimension(self)
        check_joints(self)
        for connector in self.connectors:
            check_connector(self, connector)
        for load in self.loads:
            check_load(self, load)

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
        points += [c.ground for c in self.connectors if isinstance(c, Spring) and c.ground is not None]
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
        """The beam of a name.

        Raises
        ------
        UnknownNameError
            If the scene has no body of that name.
        UnknownKindError
            If the body is of another kind.
        """
        return beam_of(self.body(name))

    def place(self, place: Written) -> Place:
        """What a place is: "name.start", ("name", fraction), "name.point".

        Raises
        ------
        UnknownNameError
            If it is no place, or not of the scene.
        PropertyError
            If a fraction lies outside [0, 1].
        """
        given: Any = written(place)
        name, dot, key = given.rpartition(".") if isinstance(given, str) else (given[0], ".", given[1])
        if not dot:
            whole = self._by_name.get(given)
            needed = PLACE_NEEDED if whole is None else f"allowed is {_places_in_words(whole)}"
            raise UnknownNameError(f"place {shown(place)} is no place of a body; {needed}")
        body = self.body(name)
        if (found := place_in(body, key)) is None:
            raise UnknownNameError(
                f"place {shown(place)} is not in scene {self.name!r}; {type(body).__name__} {name!r} has "
                f"{_places_in_words(body)}"
            )
        return Place(body, found)

    def body_end(self, end: Written) -> tuple[Beam, int]:
        """Beam and side (0 start, 1 end) of an end such as "crank.start", for what knows no other places.

        Raises
        ------
        UnknownNameError
            If it is another place, or none.
        """
        place = self.place(end)
        if not isinstance(place.body, Beam) or place.interior:
            raise UnknownNameError(
                f"place {shown(end)} is no end of a beam; 'name.start' or 'name.end' is needed here"
            )
        return place.body, int(place.key)

    def probe(self, probe: Probe) -> tuple[str, Key]:
        """Body and key of a probe: of a beam the fraction of its undeformed length, of others a point's name.

        Raises
        ------
        UnknownNameError
            If it is no place, or not of the scene.
        PropertyError
            If a fraction lies outside [0, 1].
        """
        place = self.place(probe)
        return place.body.name, place.key if isinstance(place.key, str) else float(place.key)


class SceneToBeStarted(Scene):
    """A scene checked except for its initial velocities, which may not fit joints and drives yet."""

    def __post_init__(self) -> None:
        self._check()


def checked_scene(scene: object, space: bool = False) -> Scene:
    """Return a scene, or refuse what is none.

    space: whether it may be in space.

    Raises
    ------
    UnknownKindError
        A subclass is none, either: it may mean something that no solver knows.
    UnsupportedError
        If it is in space, and may not be.
    """
    if type(scene) is not Scene:
        raise UnknownKindError(f"scene is {shown(scene)} of type {type(scene).__name__}; a Scene is needed")
    if scene.dim == 3 and not space:
        raise UnsupportedError(f"scene {scene.name!r} is in space; a scene in the plane is needed here")
    return scene


def _places_in_words(body: Body) -> str:
    """Places of a body as they are written."""
    if isinstance(body, Beam):
        return f"{listed(f'{body.name}.{side}' for side in SIDES)} and ({shown(body.name)}, fraction)"
    return listed(f"{body.name}.{key}" for key in body.keys)


def _all_of(what: str, things: object, kinds: tuple[type, ...], base: type | None = None) -> tuple[Any, ...]:
    """Things of an ordered iterable, each of exactly one of the kinds, or of a user's own subclass of the base."""
    names = ", ".join(kind.__name__ for kind in kinds)
    found = several(f"scene {what} is", things, MOST, f"a list of {names} is needed", SceneError)
    for thing in found:
        own = base is not None and isinstance(thing, base) and not isinstance(thing, kinds)
        if type(thing) not in kinds and not own:
            raise SceneError(
                f"scene {what} hold {shown(thing)} of type {type(thing).__name__}; allowed are {names}"
            )
    return tuple(found)
