"""Junctions: the places where ends of bodies meet, derived from the joints as edges of a graph."""

from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

from anctmm.errors import unknown_kind
from anctmm.model.bodies import BODIES, Beam, Body
from anctmm.model.connectors import Connector, ends_of
from anctmm.model.joints import (
    Clamp,
    Guide,
    Joint,
    Pin,
    Prismatic,
    Revolute,
    Slider,
    Weld,
    built_in,
    drive_of,
    unknown_joint,
)
from anctmm.model.kept import alike, kept
from anctmm.model.places import End, Place, Written
from anctmm.model.rigid_bodies import CENTER, PointMass, RigidBody

T = TypeVar("T", bound=Hashable)
#: What stands for the ground among names of bodies, which are texts.
GROUND = None


class Graph(Protocol):
    """The part of a scene that describes its topology, such as `anctmm.model.scene.Scene`."""

    @property
    def bodies(self) -> Sequence[Body]:
        """All bodies."""
        ...

    @property
    def joints(self) -> Sequence[Joint]:
        """All joints."""
        ...

    def body(self, name: str) -> Body:
        """The body of a name."""
        ...

    def place(self, place: Written) -> Place:
        """A place of a body."""
        ...


@dataclass(frozen=True, slots=True)
class Junction:
    """A place where ends meet: places of bodies that are connected by pins and welds, directly or through others.

    Parameters
    ----------
    groups : tuple of tuple of End
        Ends of one group are welded to each other, directly or through others; groups are hinged to each other.
    grounded : bool
        Whether the place is held.
    clamps : tuple of Clamp or None
        For each group the clamp, fixed or driven, that holds its direction.
    hinges : tuple of Weld or Clamp
        What holds directions, but no gradients: driven welds, each of which turns the group of its second end against
        that of its first, and welds and clamps that leave the stretch free.
    guides : tuple of Slider or Prismatic
        What guides it along lines.
    """

    groups: tuple[tuple[End, ...], ...]
    grounded: bool
    clamps: tuple[Clamp | None, ...]
    hinges: tuple[Weld | Clamp, ...] = ()
    guides: tuple[Guide, ...] = ()

    @property
    def ends(self) -> tuple[End, ...]:
        """All ends, group after group."""
        return tuple(end for group in self.groups for end in group)


class Sets(Generic[T]):
    """Disjoint sets that grow together (union-find)."""

    def __init__(self) -> None:
        self._parent: dict[T, T] = {}

    def of(self, thing: T) -> T:
        """The member that stands for the set of a thing; a thing not met before is a set of its own."""
        root = thing
        while (above := self._parent.get(root, root)) != root:
            root = above
        while thing != root:  # later searches are short
            self._parent[thing], thing = root, self._parent[thing]
        return root

    def unite(self, one: T, two: T) -> bool:
        """Make one set of two; False if they were one already."""
        a, b = self.of(one), self.of(two)
        if a != b:
            self._parent[b] = a
        return a != b

    def among(self, things: Iterable[T]) -> list[list[T]]:
        """Things by their sets, both in the order given."""
        sets: dict[T, list[T]] = {}
        for thing in things:
            sets.setdefault(self.of(thing), []).append(thing)
        return list(sets.values())


class HeldDirection(NamedTuple):
    """A joint, the place whose direction it holds, or turns, and the place against which; None is the ground."""

    joint: Joint
    by: Place | None
    place: Place


def held_directions(scene: Graph) -> list[HeldDirection]:
    """All directions that joints hold, or turn, against another body or against the ground."""
    found: list[HeldDirection] = []
    for joint in scene.joints:
        if joint.holds_direction:
            first, *others = [scene.place(end) for end in joint.ends]
            if isinstance(joint, Weld):
                found += [HeldDirection(joint, first, other) for other in others]
            else:
                body = joint.body if isinstance(joint, Guide) else None
                found.append(HeldDirection(joint, Place(scene.body(body), CENTER) if body else None, first))
    return found


@alike
def turning_bodies(scene: Graph) -> list[str]:
    """Names of bodies whose turns are to be counted: those of all others follow.

    They are the first of each set whose directions joints hold to each other and not to the ground, drives apart: a
    file may not have their functions.
    """
    sets, found = Sets[str | None](), dict[str | None, str]()
    for joint, by, place in held_directions(scene):
        if joint.on_line or drive_of(joint) is None:
            sets.unite(by.body.name if by else GROUND, place.body.name)
    for body in scene.bodies:
        if not isinstance(body, PointMass):  # it has no direction
            found.setdefault(sets.of(body.name), body.name)
    held = sets.of(GROUND)
    return [name for one, name in found.items() if one != held]


def joined_bodies(scene: Graph, connectors: Iterable[Connector]) -> Iterator[tuple[str, str | None]]:
    """Pairs of bodies that joints, or these connectors, join to each other; None is the ground."""
    for joint in scene.joints:
        first, *others = [scene.place(end).body.name for end in joint.places]
        yield from ((first, other) for other in others)
        if isinstance(joint, Guide):
            yield first, joint.body
        elif joint.grounded:
            yield first, GROUND
    for connector in connectors:
        one, two = ends_of(scene, connector)
        yield one.body.name, two.body.name if isinstance(two, Place) else GROUND


def end_of(scene: Graph, place: Written) -> End:
    """Body's name and key of a place."""
    return scene.place(place).end


@kept
def junctions_of(scene: Graph) -> tuple[Junction, ...]:
    """All junctions of a scene.

    Junctions, their groups and the groups' ends stand in the order of the scene's bodies, and of each body's places,
    from start to end. An end of a beam without a joint is a junction of its own, and every end is in one junction;
    other places are there if a joint names them.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    tuple of Junction
    """
    places, directions = Sets[End](), Sets[End]()
    held: list[End] = []
    clamps: list[tuple[End, Clamp]] = []
    hinges: list[tuple[End, Weld | Clamp]] = []
    guides: list[tuple[End, Guide]] = []
    named: dict[str, set[End]] = {}
    for joint in built_in(scene.joints):
        ends = [end_of(scene, place) for place in joint.ends]
        for end in ends:
            named.setdefault(end[0], set()).add(end)
        first, *others = ends
        for other in others:
            places.unite(first, other)
        if joint.grounded:
            held.append(first)
        match joint:
            case Pin() | Revolute():
                pass
            case Weld(angle=None, stretch="held"):
                for other in others:
                    directions.unite(first, other)
            case Clamp(stretch="held"):
                clamps.append((first, joint))
            case Weld() | Clamp():
                hinges.append((first, joint))
            case Slider() | Prismatic():
                guides.append((first, joint))
            case _:
                raise unknown_joint(joint)
    grounded = {places.of(end) for end in held}
    clamped = {directions.of(end): clamp for end, clamp in clamps}
    ends = [end for body in scene.bodies for end in _ends_of(body, named.get(body.name, set()))]
    turned, guided = _by_set(places, hinges), _by_set(places, guides)
    junctions = []
    for members in places.among(ends):
        groups, place = tuple(map(tuple, directions.among(members))), places.of(members[0])
        junctions.append(
            Junction(
                groups,
                place in grounded,
                tuple(clamped.get(directions.of(group[0])) for group in groups),
                tuple(turned.get(place, ())),
                tuple(guided.get(place, ())),
            )
        )
    return tuple(junctions)


def _ends_of(body: Body, named: set[End]) -> list[End]:
    """Places of a body that are in junctions, in their order."""
    match body:
        case Beam():
            return sorted({(body.name, 0), (body.name, 1), *named}, key=lambda end: float(end[1]))
        case RigidBody() | PointMass():
            return [(body.name, key) for key in body.keys if (body.name, key) in named]
        case _:
            raise unknown_kind("body", body, BODIES)


J = TypeVar("J", bound=Joint)


def _by_set(places: Sets[End], joints: Iterable[tuple[End, J]]) -> dict[End, list[J]]:
    found: dict[End, list[J]] = {}
    for end, joint in joints:
        found.setdefault(places.of(end), []).append(joint)
    return found
