"""Places of bodies: their notation and meaning."""

from dataclasses import dataclass
from typing import Any, Protocol

from anctmm.errors import UnknownNameError, listed, shown
from anctmm.model.bodies import Beam, Body
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.velocities import Point
from anctmm.validation import has_length, within

#: How a place is written.
Written = str | tuple[str, float]
#: Which place of a body: 0 and 1 a beam's start and end, another number the fraction of its length; a point's name.
Key = float | str
#: A body's name and the key of a place of it; the key is an int at the ends of beams.
End = tuple[str, Any]
#: Sides of a beam, as the names of its ends have them.
SIDES = ("start", "end")
PLACE_NEEDED = (
    "allowed is 'name.start', 'name.end' or ('name', fraction) of a beam, 'name.point' of a rigid body, "
    "'name.center' of it or of a point mass"
)


def written(place: object) -> Written:
    """A place as it is written, of plain values; whether it is there is seen by the scene.

    UnknownNameError if it is neither a string nor a pair of a name and a fraction, PropertyError if the fraction lies
    outside [0, 1].
    """
    if isinstance(place, str):
        return str.__str__(place)
    pair: Any = place
    if not has_length(place, (2,)) or not isinstance(pair[0], str) or isinstance(pair[1], str):
        raise UnknownNameError(f"place {shown(place)} is no place of a body; {PLACE_NEEDED}")
    name = str.__str__(pair[0])
    return name, within(f"place fraction on {shown(name)}", pair[1], 0.0, 1.0, "[]")


def place_text(place: Written | End) -> str:
    """A place as messages name it."""
    if isinstance(place, str):
        return shown(place)
    name, key = place
    if isinstance(key, str):
        return shown(f"{name}.{key}")
    return shown(f"{name}.{SIDES[int(key)]}" if key in (0, 1) else (name, key))


@dataclass(frozen=True)
class Place:
    """A place of a body.

    `key`: 0 or 1 a beam's start or end, a number between them the fraction of its length; the name of another's point.
    """

    body: Body
    key: Key

    @property
    def end(self) -> End:
        """Body's name and key."""
        return self.body.name, self.key

    @property
    def position(self) -> Point:
        """In the reference, m."""
        return self.body.position_at(self.key)  # type: ignore[arg-type]

    @property
    def velocity(self) -> Point:
        """At t = 0, m/s."""
        return self.body.velocity_at(self.key)  # type: ignore[arg-type]

    @property
    def turns(self) -> bool:
        """Whether there is a direction that turns with it: a point mass has none."""
        return not isinstance(self.body, PointMass)

    @property
    def interior(self) -> bool:
        """Whether it lies between the ends of a beam."""
        return isinstance(self.body, Beam) and 0.0 < float(self.key) < 1.0

    @property
    def canonical(self) -> End:
        """The same for all points of a rigid body that coincide: its first one there."""
        if not isinstance(self.body, RigidBody):
            return self.end
        return self.body.name, self.body.first_at[self.position]

    def __str__(self) -> str:
        return place_text(self.end)


class Graph(Protocol):
    """What functions of the model need of a scene: `anctmm.model.scene.Scene` has it."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies."""

    @property
    def beams(self) -> tuple[Beam, ...]:
        """All beams."""

    @property
    def joints(self) -> tuple[Any, ...]:
        """All joints."""

    @property
    def dim(self) -> int:
        """Components of a place."""

    @property
    def length(self) -> float:
        """Length that positions are compared with, m."""

    def body(self, name: str) -> Body:
        """The body of a name."""

    def beam(self, name: str) -> Beam:
        """The beam of a name."""

    def place(self, place: Any) -> Place:
        """A place of a body."""


def place_of(scene: Graph, place: object) -> Place:
    """What a place is: "name.start", ("name", fraction), "name.point".

    UnknownNameError if it is no place, or not of the scene; PropertyError if a fraction lies outside [0, 1].
    """
    given: Any = written(place)
    name, dot, key = given.rpartition(".") if isinstance(given, str) else (given[0], ".", given[1])
    if not dot:
        raise UnknownNameError(f"place {shown(place)} is no place of a body; {PLACE_NEEDED}")
    body = scene.body(name)
    keys = SIDES if isinstance(body, Beam) else body.keys
    if key in keys:
        return Place(body, SIDES.index(key) if isinstance(body, Beam) else key)
    if isinstance(body, Beam) and not isinstance(key, str):
        return Place(body, int(key) if key in (0.0, 1.0) else key)
    raise UnknownNameError(
        f"place {shown(place)} is not in scene {scene.name!r}; {type(body).__name__} {name!r} has "
        f"{listed(f'{name}.{known}' for known in keys)}{' and fractions' if isinstance(body, Beam) else ''}"
    )
