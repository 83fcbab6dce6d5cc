"""Beams divided into parts where joints act between their ends, because the recursion joins bodies at ends only.

A node between the ends of a beam becomes a weld of two parts, so a joint there is a joint of ends. The rest of the
solver (plan, recursion, integrators) needs no special treatment; results are assembled for the whole beam again.
Beams are divided, too, at nodes that connectors couple with distant ones (`couplings`).
"""

from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.junctions.as_written import Names, at_places, name_parts, places_of
from anctmm.discretise.junctions.couplings import AT_NODE, coupled_connectors, nodes_at
from anctmm.elements.kinds import kind_of
from anctmm.errors import MeshError, listed, shown
from anctmm.model.bodies import Beam, Body
from anctmm.model.joints import Joint, Weld
from anctmm.model.kept import alike
from anctmm.model.loads import LineLoad, Load
from anctmm.model.places import SIDES, End, Place, Written
from anctmm.model.rigid_bodies import PointMass
from anctmm.model.scene import Scene, Spring, unchecked_scene
from anctmm.model.velocities import PartVelocity

Array = NDArray[np.float64]

#: Elements up to which a mesh is looked for that has the nodes needed.
SEARCHED = 10_000
#: How many such meshes a message names.
NAMED = 3


class Part(NamedTuple):
    """A part of a beam: its name, and the first of its elements and that behind its last, from the beam's start."""

    name: str
    first: int
    end: int


@dataclass(frozen=True)
class Segments:
    """A scene whose beams are cut at the joints between their ends, and where coupled connectors act.

    Parameters
    ----------
    whole : Scene
    whole_run : Discretisation

    Raises
    ------
    MeshError
        If a joint is where no node lies.
    """

    whole: Scene
    whole_run: Discretisation

    @cached_property
    def coupled(self) -> frozenset[int]:
        """Numbers of the connectors whose places are kept."""
        return coupled_connectors(self.whole, self.whole_run)

    @cached_property
    def coupled_ends(self) -> dict[End, bool]:
        """Ends of bodies where these act, as they are passed, and whether on the gradients there."""
        found, cut = dict[End, bool](), self.run.of(self.scene)
        for connector in (self.scene.connectors[n] for n in self.coupled):
            for place in map(self.scene.place, connector.places):
                name, at = place.body.name, nodes_at(place, cut)
                if at is not None:
                    turns = at[0] != at[1] or not isinstance(connector, Spring)
                    for end in {(name, 0 if node == 0 else 1) for node in at}:
                        found[end] = found.get(end, False) or turns
                elif isinstance(place.body, PointMass):
                    found[name, 1] = False
        return found

    def _cuts(self) -> dict[str, set[int]]:
        """Nodes at which beams are cut, not all between their ends."""
        inside = _inside(self.whole)
        if not inside and not self.coupled:
            return {}
        meshes = self.whole_run.of(self.whole)
        found = {
            name: set(_nodes(self.whole.beam(name), meshes[name][0], places))
            for name, places in inside.items()
            if not kind_of(meshes[name][1]).rigid  # any of its places is one of a rigid body
        }
        for connector in (self.whole.connectors[n] for n in self.coupled):
            for place in map(self.whole.place, connector.places):
                found.setdefault(place.body.name, set()).update(nodes_at(place, meshes) or ())
        return found

    @cached_property
    def parts(self) -> Mapping[str, tuple[Part, ...]]:
        """Parts of each beam that is cut, from its start to its end."""
        found = dict[str, tuple[Part, ...]]()
        taken = {body.name for body in self.whole.bodies}
        for name, nodes in self._cuts().items():
            elements, _ = self.whole_run.of(self.whole).get(name, (0, ""))
            edges = [0, *sorted(nodes - {0, elements}), elements]
            if len(edges) == 2:
                continue
            found[name] = tuple(
                Part(_unused(f"{name} from {a / elements:.6g} to {b / elements:.6g}", taken), a, b)
                for a, b in pairwise(edges)
            )
        return found

    @cached_property
    def scene(self) -> Scene:
        """The scene of parts, welded to each other; the whole one where nothing is cut."""
        if not self.parts:
            return self.whole
        whole = self.whole
        welds = [
            Weld(f"{one.name}.end", f"{two.name}.start")
            for parts in self.parts.values()
            for one, two in pairwise(parts)
        ]
        found = unchecked_scene(
            whole.name,
            [piece for body in whole.bodies for piece in self._pieces(body)],
            [*(at_places(joint, self._place) for joint in whole.joints), *welds],
            [piece for load in whole.loads for piece in self._loads(load)],
            whole.gravity,
            [at_places(connector, self._place) for connector in whole.connectors],
        )
        name_parts(found, self._names())
        return found

    @cached_property
    def run(self) -> Discretisation:
        """The discretisation of the parts."""
        if not self.parts:
            return self.whole_run
        mesh, element = dict[str, int](), dict[str, str]()
        for name, (elements, kind) in self.whole_run.of(self.whole).items():
            for part in self.parts.get(name, (Part(name, 0, elements),)):
                mesh[part.name], element[part.name] = part.end - part.first, kind
        return replace(self.whole_run, mesh=mesh, element=element)

    def joined(self, fields: Mapping[str, Array]) -> dict[str, Array]:
        """Values at the nodes of each body, (…, nodes, vectors, 2), from those of the parts."""
        if not self.parts:
            return dict(fields)
        found = dict[str, Array]()
        for body in self.whole.bodies:
            first, *others = (
                fields[part.name] for part in self.parts.get(body.name, (Part(body.name, 0, 0),))
            )
            found[body.name] = np.concatenate([first, *(x[..., 1:, :, :] for x in others)], axis=-3)
        return found

    def cut(self, fields: Mapping[str, Array]) -> dict[str, Array]:
        """Values at the nodes of the parts, from those of whole bodies."""
        found = dict[str, Array]()
        for name, x in fields.items():
            for part in self.parts.get(name, (Part(name, 0, x.shape[-3] - 1),)):
                found[part.name] = x[..., part.first : part.end + 1, :, :]
        return found

    def owner(self, name: str) -> tuple[str, int]:
        """The body that a part belongs to, and its first element there; a body that is not cut itself, and 0."""
        return self._owners.get(name, (name, 0))

    @cached_property
    def _owners(self) -> dict[str, tuple[str, int]]:
        return {part.name: (name, part.first) for name, parts in self.parts.items() for part in parts}

    def _elements(self, name: str) -> int:
        return self.parts[name][-1].end

    def _pieces(self, body: Body) -> Iterator[Body]:
        if body.name not in self.parts:
            yield body
            return
        beam, elements = self.whole.beam(body.name), self._elements(body.name)
        for part in self.parts[body.name]:
            first, last = part.first / elements, part.end / elements
            velocity = None if beam.velocity is None else PartVelocity(beam, first, last)
            start, end = beam.position_at(first), beam.position_at(last)
            yield replace(beam, name=part.name, start=start, end=end, velocity=velocity)

    def _place(self, written: Written) -> Written:
        """A place, as one of a part where its beam is cut: at a cut that before it."""
        place = self.whole.place(written)
        if place.body.name not in self.parts:
            return written
        along = float(place.key) * self._elements(place.body.name)
        parts = self.parts[place.body.name]
        part = parts[bisect_left(parts, along - AT_NODE, key=lambda p: p.end)]
        inside = (along - part.first) / (part.end - part.first)
        for side, name in enumerate(SIDES):
            if abs(inside - side) * (part.end - part.first) <= AT_NODE:
                return f"{part.name}.{name}"
        return part.name, inside

    def _loads(self, load: Load) -> Iterator[Load]:
        if not isinstance(load, LineLoad):
            yield at_places(load, self._place)
            return
        names = [part.name for part in self.parts.get(load.body, ())] or [load.body]
        yield from (replace(load, body=name) for name in names)

    def _names(self) -> Names:
        """What the user wrote in place of names of parts."""
        found: dict[Written, Written] = {}
        for name, parts in self.parts.items():
            n = self._elements(name)
            for part in parts:
                for side, edge in zip(SIDES, (part.first, part.end), strict=True):
                    ends = {0: f"{name}.start", n: f"{name}.end"}
                    found[f"{part.name}.{side}"] = ends.get(edge, (name, edge / n))
        found |= {self._place(place): place for place in places_of(self.whole)}
        return Names(found, {part: name for part, (name, _) in self._owners.items()})


@alike
def _inside(scene: Scene) -> dict[str, dict[float, Joint]]:
    """Fractions of beams, between their ends, where joints act, each with one of these."""
    found = dict[str, dict[float, Joint]]()
    for joint in scene.joints:
        for place in map(scene.place, joint.ends):
            if place.interior:
                found.setdefault(place.body.name, {}).setdefault(float(place.key), joint)
    return found


def _nodes(beam: Beam, elements: int, places: Mapping[float, Joint]) -> list[int]:
    """Nodes at fractions of a beam's length."""
    found = dict[int, float]()
    for fraction, joint in places.items():
        node = round(fraction * elements)
        if abs(fraction * elements - node) > AT_NODE:
            raise MeshError(
                f"{shown(joint)} acts at {Place(beam, fraction)}, where no node lies with {elements} elements of "
                f"{beam.name!r}; fraction times elements must be whole: {_fitting(beam, places)}"
            )
        same = {0: f"{beam.name}.start", elements: f"{beam.name}.end"}.get(node) or (
            str(Place(beam, found[node])) if node in found else None
        )
        if same is not None:
            raise MeshError(
                f"{shown(joint)} acts at {Place(beam, fraction)}, which is the node of {same}; all joints there "
                f"need the place written in one way"
            )
        found[node] = fraction
    return list(found)


def _fitting(beam: Beam, places: Mapping[float, Joint]) -> str:
    """Meshes that have nodes at all places of a beam, for a message."""
    counts = np.arange(1, SEARCHED + 1)
    whole = np.ones(SEARCHED, dtype=bool)
    for fraction in places:
        along = fraction * counts
        whole &= (np.abs(along - np.round(along)) <= AT_NODE) & (along > 0.5) & (along < counts - 0.5)
    fitting = counts[whole][:NAMED].tolist()
    if not fitting:
        return f"no mesh up to {SEARCHED} has nodes at {listed(places)} of {beam.name!r}"
    return f"mesh {', '.join(map(str, fitting))}, … of {beam.name!r} can be used"


def _unused(name: str, taken: set[str]) -> str:
    """A name that is not taken, which is taken then."""
    while name in taken:
        name += "'"
    taken.add(name)
    return name
