"""Junctions: the places where ends of bodies meet, derived from the joints as edges of a graph."""

from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from anctmm.model.bodies import Beam, Body
from anctmm.model.connectors import Connector, ends_of
from anctmm.model.joints import Clamp, Guide, Weld, built_in
from anctmm.model.places import End, Graph, Place
from anctmm.model.rigid_bodies import PointMass

T = TypeVar("T", bound=Hashable)
#: What stands for the ground among names of bodies, which are texts.
GROUND = None


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


def turning_bodies(scene: Graph) -> list[str]:
    """Names of the bodies whose turns are counted: all that have a direction."""
    return [body.name for body in scene.bodies if not isinstance(body, PointMass)]


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
    joined = [(joint, [scene.place(place).end for place in joint.ends]) for joint in built_in(scene.joints)]
    for joint, (first, *others) in joined:
        for other in others:
            places.unite(first, other)
            if isinstance(joint, Weld) and joint.angle is None and joint.stretch == "held":
                directions.unite(first, other)
    clamps, grounded, named = dict[End, Clamp](), set[End](), dict[str, set[End]]()
    for joint, ends in joined:
        if joint.grounded:
            grounded.add(places.of(ends[0]))
        if isinstance(joint, Clamp) and joint.stretch == "held":
            clamps[directions.of(ends[0])] = joint
        for end in ends:
            named.setdefault(end[0], set()).add(end)
    found = []
    ends = [end for body in scene.bodies for end in _ends_of(body, named.get(body.name, set()))]
    for members in places.among(ends):
        groups = tuple(map(tuple, directions.among(members)))
        held = tuple(clamps.get(directions.of(group[0])) for group in groups)
        found.append(Junction(groups, places.of(members[0]) in grounded, held))
    return tuple(found)


def _ends_of(body: Body, named: set[End]) -> list[End]:
    """Places of a body that are in junctions, in their order."""
    if not isinstance(body, Beam):
        return [(body.name, key) for key in body.keys if (body.name, key) in named]
    return sorted({(body.name, 0), (body.name, 1), *named}, key=lambda end: float(end[1]))
