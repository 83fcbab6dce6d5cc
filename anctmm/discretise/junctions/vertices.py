"""Vertices of the graph of bodies: ends that share unknowns.

A place fixed to the ground connects nothing: each group of ends that are welded to each other there is a separate
vertex, and so is each clamped end. Ends joined to a rigid body, at any of its points, form one vertex: the body. A body
of one node (a point mass or a rigid body) is at the vertex of its node, as its end 1.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from anctmm.model.bodies import Point
from anctmm.model.places import End
from anctmm.model.rigid_bodies import PointMass
from anctmm.model.scene import Scene
from anctmm.model.topology import Junction, end_of


class Vertex(NamedTuple):
    """Ends that share what is unknown.

    Parameters
    ----------
    groups : tuple of tuple of End
        Ends welded to each other; groups are hinged to each other.
    held : bool
        Whether their place is known.
    body : str or None
        The rigid body that they are joined to; it is the first end of the first group, whose others are welded to it.
    forced : bool
        Whether it is kept whatever meets there.
    turning : tuple of tuple of End
        Of its groups those of one end whose gradients are kept like those of several.
    line : (float, float) or None
        Direction of the line in the ground on which it moves, where that is all that guides it.
    """

    groups: tuple[tuple[End, ...], ...]
    held: bool
    body: str | None = None
    forced: bool = False
    turning: tuple[tuple[End, ...], ...] = ()
    line: Point | None = None

    @property
    def welded(self) -> tuple[tuple[End, ...], ...]:
        """Groups whose gradients are kept, if the vertex is: another end's gradients are its own."""
        return tuple(group for group in self.groups if len(group) > 1 or group in self.turning)


def vertices_of(
    scene: Scene,
    junctions: Iterable[Junction],
    rigid: Iterable[str] = (),
    coupled: Mapping[End, bool] | None = None,
) -> list[Vertex]:
    """Vertices of the graph of a scene's junctions.

    Parameters
    ----------
    scene : Scene
    junctions : iterable of Junction
    rigid : iterable of str, optional
        Bodies that are rigid.
    coupled : mapping of End to bool, optional
        Ends that connectors couple with distant ones, and whether by their gradients.
    """
    found = _Vertices(scene, rigid, coupled or {})
    for junction in junctions:
        found.add(junction)
    return found.whole()


class _Vertices:
    """Vertices found junction by junction; what is joined to rigid bodies is gathered on the way."""

    def __init__(self, scene: Scene, rigid: Iterable[str], coupled: Mapping[End, bool]) -> None:
        self.scene, self.coupled = scene, coupled
        self.masses = {body.name for body in scene.bodies if isinstance(body, PointMass)}
        self.welded: dict[str, list[End]] = {name: [(name, 1)] for name in rigid}
        self.pinned: dict[str, list[End]] = {name: [] for name in self.welded}
        self.free = {body.name: None for body in scene.bodies if isinstance(body, PointMass)}
        self.found: list[Vertex] = []

    def add(self, junction: Junction) -> None:
        """Add the vertices of a junction."""
        for name, _ in junction.ends:
            self.free.pop(name, None)
        carrier = next((name for name, _ in junction.ends if name in self.welded), None)
        if carrier is None and not junction.grounded:
            groups = tuple(map(self._passed, junction.groups))
            turning = tuple(self._passed(group) for group in junction.groups if self._turns(junction, group))
            line = None if turning else _line(junction)
            forced = bool(turning or (junction.guides and line is None)) or self._coupled(groups)
            self.found.append(Vertex(groups, False, None, forced, turning, line))
            return
        apart: list[tuple[End, ...]] = []
        for group, clamp in zip(junction.groups, junction.clamps, strict=True):
            bodies = [name for name, _ in group if name in self.welded]
            ends, turns = self._passed(group), self._turns(junction, group)
            if clamp is not None:
                self.found += [Vertex(((end,),), True) for end in ends]
            elif bodies:
                self.welded[bodies[0]] += ends
            elif carrier is None or junction.grounded:
                self.found.append(Vertex((ends,), True, None, turns, (ends,) if turns else ()))
            elif len(ends) > 1 or turns:
                apart.append(ends)
            else:
                self.pinned[carrier] += ends
        if apart:  # they have gradients of their own; their place is tied to that of the body by constraints
            self.found.append(Vertex(tuple(apart), False, None, True, tuple(apart)))

    def whole(self) -> list[Vertex]:
        """All vertices."""
        alone = [Vertex((((name, 1),),), False, None, (name, 1) in self.coupled) for name in self.free]
        bodies = [
            Vertex((tuple(ends), *((end,) for end in self.pinned[name])), False, name, True, (tuple(ends),))
            for name, ends in self.welded.items()
        ]
        return self.found + alone + bodies

    def _passed(self, group: Sequence[End]) -> tuple[End, ...]:
        """Ends of a group that are passed there, those of point masses by the name that they have here."""
        return tuple(
            (name, 1) if name in self.masses else (name, key)
            for name, key in group
            if name not in self.welded
        )

    def _turns(self, junction: Junction, group: Sequence[End]) -> bool:
        """Whether constraints act on the gradients of a group, or connectors couple them with distant ones."""
        turned = [place for weld in junction.hinges for place in weld.ends]
        turned += [g.place for g in junction.guides if g.holds_direction and g.body is not None]
        return any(end_of(self.scene, place) in group for place in turned) or any(
            self.coupled.get(end, False) for end in group
        )

    def _coupled(self, groups: tuple[tuple[End, ...], ...]) -> bool:
        return any(end in self.coupled for group in groups for end in group)


def _line(junction: Junction) -> Point | None:
    """Direction of the one line in the ground that guides a junction and does not drive it; None otherwise."""
    if len(junction.guides) != 1:
        return None
    (guide,) = junction.guides
    return guide.direction if guide.body is None and guide.position is None else None
