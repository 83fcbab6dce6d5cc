"""Junctions: the places where ends of bodies meet, derived from the joints as edges of a graph."""

from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

from scipy.cluster.hierarchy import DisjointSet

from anctmm.model.bodies import Beam, Body
from anctmm.model.connectors import Connector, ends_of
from anctmm.model.joints import Clamp, Weld, built_in
from anctmm.model.places import End, Place
from anctmm.model.rigid_bodies import PointMass
from anctmm.model.scene import Scene
from anctmm.validation import is_point

T = TypeVar("T", bound=Hashable)
#: What stands for the ground among names of bodies, which are texts.
GROUND = None


@dataclass(frozen=True, slots=True)
class Junction:
    """A place where ends meet: places of bodies that are connected by pins and welds, directly or through others.

    Ends of one group are welded to each other, groups are hinged to each other; each group has the clamp, fixed or
    driven, that holds its direction.
    """

    groups: tuple[tuple[End, ...], ...]
    grounded: bool
    clamps: tuple[Clamp | None, ...]

    @property
    def ends(self) -> tuple[End, ...]:
        """All ends, group after group."""
        return tuple(end for group in self.groups for end in group)


class Sets(DisjointSet):
    """Disjoint sets that grow together; a thing not met before is a set of its own."""

    def of(self, thing: T) -> T:
        """The member that stands for the set of a thing."""
        self.add(thing)
        return self[thing]  # type: ignore[no-any-return]

    def unite(self, one: T, two: T) -> None:
        """Make one set of two."""
        self.merge(self.of(one), self.of(two))

    def among(self, things: Iterable[T]) -> list[list[T]]:
        """Things by their sets, both in the order given."""
        sets: dict[T, list[T]] = {}
        for thing in things:
            sets.setdefault(self.of(thing), []).append(thing)
        return list(sets.values())


def turning_bodies(scene: Scene) -> list[str]:
    """Names of the bodies whose turns are counted: all that have a direction."""
    return [body.name for body in scene.bodies if not isinstance(body, PointMass)]


def joined_bodies(scene: Scene, connectors: Iterable[Connector]) -> Iterator[tuple[str, str | None]]:
    """Pairs of bodies that joints, or these connectors, join to each other; None is the ground."""
    for joint in scene.joints:
        first = scene.place(joint.places[0]).body.name
        yield from (
            (first, GROUND if is_point(end) else scene.place(end).body.name) for end in joint.attached
        )
        if joint.grounded:
            yield first, GROUND
    for connector in connectors:
        one, two = ends_of(scene, connector)
        yield one.body.name, two.body.name if isinstance(two, Place) else GROUND


def junctions_of(scene: Scene) -> tuple[Junction, ...]:
    """All junctions of a scene, in the order of its bodies, and of each body's places from start to end.

    Every end of a beam is in one, also without a joint; other places are there if a joint names them.
    """
    places, directions = Sets(), Sets()
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
