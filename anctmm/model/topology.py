"""Junctions: the places where ends of bodies meet, found from the joints as edges of a graph."""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from anctmm.errors import unknown_kind
from anctmm.model.joints import JOINTS, Clamp, Joint, Pin, Weld

End = tuple[str, int]
"""Body and side: 0 its start, 1 its end."""

T = TypeVar("T", bound=Hashable)


class Named(Protocol):
    """A body, as far as the graph knows it."""

    @property
    def name(self) -> str:
        """Unique in its scene."""
        ...


class Graph(Protocol):
    """What a scene tells of its topology; `anctmm.model.scene.Scene` does."""

    @property
    def bodies(self) -> Sequence[Named]:
        """All bodies."""
        ...

    @property
    def joints(self) -> Sequence[Joint]:
        """All joints."""
        ...

    def body_end(self, end: str) -> tuple[Named, int]:
        """Body and side of an end's name."""
        ...


@dataclass(frozen=True, slots=True)
class Junction:
    """A place where ends meet: ends that are connected by pins and welds, directly or through others.

    Parameters
    ----------
    groups : tuple of tuple of End
        Ends of one group are welded to each other, directly or through others; groups are hinged to each other.
    grounded : bool
        Whether the place is held.
    clamps : tuple of Clamp or None
        For each group the clamp, fixed or driven, that holds its direction.
    """

    groups: tuple[tuple[End, ...], ...]
    grounded: bool
    clamps: tuple[Clamp | None, ...]

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


def end_of(scene: Graph, name: str) -> End:
    """Body's name and side of an end's name."""
    body, side = scene.body_end(name)
    return body.name, side


def junctions_of(scene: Graph) -> tuple[Junction, ...]:
    """All junctions of a scene.

    Junctions, their groups and the groups' ends stand in the order of the scene's bodies, start before end. An end
    without a joint is a junction of its own, and every end is in one junction.

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
    for joint in scene.joints:
        first, *others = (end_of(scene, name) for name in joint.ends)
        for other in others:
            places.unite(first, other)
        if joint.grounded:
            held.append(first)
        match joint:
            case Pin():
                pass
            case Weld():
                for other in others:
                    directions.unite(first, other)
            case Clamp():
                clamps.append((first, joint))
            case _:
                raise unknown_kind("joint", joint, JOINTS)
    grounded = {places.of(end) for end in held}
    clamped = {directions.of(end): clamp for end, clamp in clamps}
    ends = [(body.name, side) for body in scene.bodies for side in (0, 1)]
    junctions = []
    for members in places.among(ends):
        groups = tuple(map(tuple, directions.among(members)))
        junctions.append(
            Junction(
                groups,
                places.of(members[0]) in grounded,
                tuple(clamped.get(directions.of(group[0])) for group in groups),
            )
        )
    return tuple(junctions)
