"""Order of elimination of the bodies of a scene: from leaves to a root; loops are closed by kept junctions.

Bodies are the edges of a graph; the places where their ends meet are its vertices. A tree is eliminated from its leaves
to its root: everything inboard of a junction is condensed, and the condensed matrices of all arriving ends are summed,
S = Σ S_child (Rui et al. 2020, 10.1007/s11044-019-09711-2). A loop has no leaf, so some of its junctions are kept: the
stretches between them are condensed to both their ends, and the small graph of kept junctions is solved at the end.

Kept are the junctions where three or more stretches of loops meet, and one junction in each loop that has none; always
kept are rigid bodies, and junctions with constraints (guides and driven hinges). A guide on the ground at a junction of
a tree is no constraint: the node there is eliminated in the frame of the line.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from anctmm.discretise.junctions.vertices import Vertex
from anctmm.model.places import End

#: What leads from a body's outboard node onwards: nothing, the place alone, all vectors, or, where an element has one
#: that a weld leaves free, the place and r_x (which a chain knows, not its plan).
BREAK, PIN, WELD, TANGENT = 0, 1, 2, 3


class Kept(NamedTuple):
    """Where an end leads to at a kept vertex: its number, and the welded group whose gradients it shares, or None."""

    junction: int
    group: int | None


@dataclass(frozen=True)
class Step:
    """A body, passed from its inboard to its outboard end.

    Parameters
    ----------
    body : str
    reversed : bool
        Whether its inboard end is the body's end.
    link : int
        BREAK, PIN or WELD.
    to : End, Kept or None
        What its outboard end is linked to: an end passed later, or a kept junction.
    start : Kept or None
        The kept junction at its inboard end.
    """

    body: str
    reversed: bool
    link: int = BREAK
    to: End | Kept | None = None
    start: Kept | None = None

    @property
    def inboard(self) -> End:
        """The end passed first."""
        return self.body, int(self.reversed)

    @property
    def outboard(self) -> End:
        """The end passed last."""
        return self.body, int(not self.reversed)


@dataclass(frozen=True)
class Plan:
    """Bodies in the order of elimination.

    Parameters
    ----------
    steps : tuple of Step
    kept : tuple of Vertex
    """

    steps: tuple[Step, ...]
    kept: tuple[Vertex, ...]


def plan_of(bodies: Sequence[str], vertices: Sequence[Vertex], nodes: Collection[str] = ()) -> Plan:
    """Order of elimination of bodies, in the order of their first ends that are leaves.

    Parameters
    ----------
    bodies : sequence of str
    vertices : sequence of Vertex
        Every end of every body is in one of them.
    nodes : collection of str
        Of the bodies those of one node, whose one end is their end 1.
    """
    planner = _Planner(bodies, vertices, frozenset(nodes))
    planner.order_bodies()
    return planner.linked()


class _Planner:
    """Bodies put in order one after another, and then linked."""

    def __init__(self, bodies: Sequence[str], vertices: Sequence[Vertex], nodes: frozenset[str]) -> None:
        self.bodies, self.vertices, self.nodes = bodies, vertices, nodes
        self.ends = [[end for group in vertex.groups for end in group] for vertex in vertices]
        self.at = {end: v for v, ends in enumerate(self.ends) for end in ends}
        #: Ends of bodies that lead on to another vertex.
        self.edges = [[end for end in ends if end[0] not in nodes] for ends in self.ends]
        self.core = self._core()
        self.kept: dict[int, int] = {}
        self.order: dict[str, Step] = {}

    def order_bodies(self) -> None:
        """Put the bodies of every component in order: chains and trees from their first leaf, then what has none."""
        ends: list[End] = [
            (name, side) for name in self.bodies for side in ((1,) if name in self.nodes else (0, 1))
        ]
        for end in [e for e in ends if len(self.edges[self.at[e]]) == 1] + ends:
            if end[0] not in self.order:
                self._component(self._reached(self.at[end]))

    def linked(self) -> Plan:
        """The plan, with the links that the order of the bodies makes."""
        place = {name: i for i, name in enumerate(self.order)}
        steps = list(self.order.values())
        for v, vertex in enumerate(self.vertices):
            arriving = sorted(
                (e for e in self.ends[v] if steps[place[e[0]]].outboard == e), key=lambda e: place[e[0]]
            )
            leaving = [e for e in self.ends[v] if steps[place[e[0]]].inboard == e]
            links = self._to_kept(v, arriving) if v in self.kept else _to_end(vertex, arriving, leaving)
            for (name, _), (link, to) in links.items():
                steps[place[name]] = replace(steps[place[name]], link=link, to=to)
            if v in self.kept:
                for end, (_, to) in self._to_kept(v, leaving).items():
                    steps[place[end[0]]] = replace(steps[place[end[0]]], start=to)
        return Plan(tuple(steps), tuple(self.vertices[v] for v in self.kept))

    def _core(self) -> set[str]:
        """Bodies that are part of a loop, or lie between loops: what is left when leaves are taken off."""
        degree = [len(ends) for ends in self.edges]
        left = set(self.bodies) - self.nodes
        leaves = [v for v, d in enumerate(degree) if d == 1 and not self.vertices[v].forced]
        while leaves:
            end = next((e for e in self.edges[leaves.pop()] if e[0] in left), None)
            if end is None:
                continue
            left.remove(end[0])
            for side in (0, 1):
                v = self.at[end[0], side]
                degree[v] -= 1
                if degree[v] == 1 and not self.vertices[v].forced:
                    leaves.append(v)
        return left

    def _reached(self, first: int) -> list[int]:
        """Vertices of a component, nearest to the first one first."""
        found = {first: None}
        queue = [first]
        for v in queue:  # it grows
            for name, side in self.edges[v]:
                u = self.at[name, 1 - side]
                if u not in found:
                    found[u] = None
                    queue.append(u)
        return queue

    def _component(self, reached: list[int]) -> None:
        """Put the bodies of one component in order."""
        core = {v: [e for e in self.ends[v] if e[0] in self.core] for v in reached}
        core = {v: ends for v, ends in core.items() if ends or self.vertices[v].forced}
        if not core:
            self._tree(self._root(reached))
            return
        kept = [v for v, ends in core.items() if len(ends) > 2 or self._constrained(v)] or [min(core)]
        self.kept |= {v: len(self.kept) + i for i, v in enumerate(kept)}
        for v in core:
            self._tree(v)
        for v in kept:
            for end in core[v]:
                if end[0] not in self.order:
                    self._path(end, core)

    def _root(self, reached: list[int]) -> int:
        """Where a tree ends: far from its first leaf, so that a chain runs from end to end.

        At an end that is guided, which costs explicit steps least; else at one where a mass hangs: that is then the
        last node of all, and what the bodies before it pass on goes to the next node.
        """
        leaves = [v for v in reached if len(self.edges[v]) == 1]
        guided = [v for v in leaves if self.vertices[v].line is not None]
        laden = [v for v in leaves if len(self.ends[v]) > 1]
        return (guided or laden or reached)[-1]

    def _constrained(self, v: int) -> bool:
        """Whether constraints act on a vertex of a loop: a line in the ground holds one of a tree without them."""
        return self.vertices[v].forced or self.vertices[v].line is not None

    def _tree(self, root: int) -> None:
        """Put the bodies that hang from a vertex in order, each behind those that hang from it."""
        outboard = []
        stack = [e for e in reversed(self.ends[root]) if e[0] not in self.core]
        stack.sort(key=lambda end: end[0] in self.nodes)  # these are the last that are put in order
        while stack:
            name, side = stack.pop()
            outboard.append((name, side))
            if name not in self.nodes:
                beyond: End = (name, 1 - int(side))
                stack += [e for e in reversed(self.ends[self.at[beyond]]) if e != beyond]
        for name, side in reversed(outboard):
            self.order[name] = Step(name, reversed=side == 0)

    def _path(self, end: End, core: dict[int, list[End]]) -> None:
        """Put the bodies of a stretch in order, from a kept junction to the next."""
        while True:
            name, side = end
            self.order[name] = Step(name, reversed=side == 1)
            v = self.at[name, 1 - side]
            if v in self.kept:
                return
            end = next(e for e in core[v] if e != (name, 1 - side))

    def _to_kept(self, v: int, ends: list[End]) -> dict[End, tuple[int, Kept]]:
        """What ends are linked to at a kept junction."""
        group = {e: g for g, members in enumerate(self.vertices[v].welded) for e in members}
        return {e: (WELD if e in group else PIN, Kept(self.kept[v], group.get(e))) for e in ends}


def _to_end(vertex: Vertex, arriving: list[End], leaving: list[End]) -> dict[End, tuple[int, End]]:
    """What the ends that arrive at a vertex are linked to.

    One end carries all to the root: the one that leaves or, at the root, the last one that arrives. Ends welded to it
    pass all on to it; of another group all pass to its last end, which passes the place on.
    """
    if not arriving:
        return {}
    carrier = leaving[0] if leaving else arriving[-1]
    links: dict[End, tuple[int, End]] = {}
    for group in vertex.groups:
        members = [end for end in arriving if end in group and end != carrier]
        if carrier in group:
            links |= dict.fromkeys(members, (WELD, carrier))
        elif members:
            links |= dict.fromkeys(members[:-1], (WELD, members[-1]))
            links[members[-1]] = (BREAK, carrier) if vertex.held else (PIN, carrier)
    return links
