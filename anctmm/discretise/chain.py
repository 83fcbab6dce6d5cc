"""A scene as ANC-TMM uses it: a row of nodes, the link behind each body's last node, and data computed in advance.

Bodies are in the order of elimination, and in the direction in which they are eliminated (see `plan`). Every end has
its own node, also where ends are joined.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, TypeGuard

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.junctions.as_written import as_written, body_as_written
from anctmm.discretise.junctions.segments import Segments
from anctmm.discretise.junctions.structure import Facts, common, facts_of, shared
from anctmm.discretise.junctions.vertices import Vertex, vertices_of
from anctmm.discretise.kept import KeptUnknowns, Port
from anctmm.discretise.lacking import LACKING
from anctmm.discretise.maps import add_force, constant_forces_on
from anctmm.discretise.mesh import passed_meshes
from anctmm.discretise.node_mesh import BarMesh
from anctmm.discretise.plan import BREAK, TANGENT, WELD, Kept, Plan, plan_of
from anctmm.discretise.singular_positions.dead_centres import check_dead_centres
from anctmm.discretise.singular_positions.rigid_loops import check_rigid_loops, rigid_loops
from anctmm.elements.kinds import kind_of
from anctmm.errors import DiscretisationError
from anctmm.model.bodies import Beam, Point
from anctmm.model.joints import Weld
from anctmm.model.needs import refuse
from anctmm.model.places import End
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Scene
from anctmm.model.topology import Junction, end_of, junctions_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Turn of a weld below which its two frames count as one, rad.
ALIGNED = 1e-12


#: Guides up to which an explicit step restores their lines one by one; it takes full blocks for more.
FEW_GUIDES = 4


class Start(NamedTuple):
    """An equilibrium: coordinates, (rows, nodes), the angles by which the nodes' sections have turned, (nodes,), and
    whether it is a stable one of this very scene, so that nothing moves.
    """

    q: Array
    turned: Array
    rests: bool = False


class Guided(NamedTuple):
    """Ends at a place that moves on a line in the ground, the one whose node is eliminated there, and the direction."""

    ends: tuple[End, ...]
    carrier: End
    direction: Point


@dataclass(frozen=True)
class Chain:
    """A scene cut into elements, its bodies in the order of elimination.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    start : Start, optional
        The equilibrium that the motion starts from.

    Raises
    ------
    MeshError
        If the discretisation does not fit the scene's bodies, or a joint is where no node lies.
    UnsupportedError
        If the scene needs what ANC-TMM lacks.
    DiscretisationError
        If a weld joins kinds of element of which it would hold different vectors, or rigid bodies stand in a singular
        position.
    """

    scene: Scene
    run: Discretisation
    start: Start | None = field(default=None, compare=False, kw_only=True)

    def __post_init__(self) -> None:
        refuse(self.scene, LACKING, "ANC-TMM")
        common(self, _check_welds)
        check_rigid_loops(self.parts, common(self, _rigid_loops), self.rigid)
        check_dead_centres(self.kept)

    @cached_property
    def segments(self) -> Segments:
        """Beams cut at the joints between their ends."""
        return Segments(self.scene, self.run)

    @property
    def parts(self) -> Scene:
        """The scene as it is passed: where joints act between the ends of beams, their parts are bodies."""
        return self.segments.scene

    @cached_property
    def found(self) -> Facts:
        """What has been found of this chain, see `kept_chains.once`."""
        return {}

    @cached_property
    def facts(self) -> Facts:
        """What follows from the structure of the parts alone, and so is that of all chains alike.

        Where connectors are coupled, the plan follows from their places, too: those of the last chain are kept.
        """
        found = facts_of(self.parts, self.segments.run)
        if not self.segments.coupled:
            return found
        coupled = (self.parts.connectors[n] for n in sorted(self.segments.coupled))
        places = tuple((type(connector), connector.places) for connector in coupled)
        kept = found.get(Segments)
        if kept is None or kept[0] != places:
            kept = found[Segments] = places, {}
        return kept[1]  # type: ignore[no-any-return]

    def coarser(self, most: int) -> "Chain":
        """The same scene with so many elements of each body, or of each part of it, at most."""
        run = self.segments.run
        mesh = {name: min(elements, most) for name, (elements, _) in run.of(self.parts).items()}
        return Chain(self.parts, replace(run, mesh=mesh))

    @cached_property
    def junctions(self) -> tuple[Junction, ...]:
        """Places where ends meet."""
        return junctions_of(self.parts)

    @shared
    def vertices(self) -> list[Vertex]:
        """Junctions, less what the ground holds apart."""
        return vertices_of(self.parts, self.junctions, self.rigid, self.segments.coupled_ends)

    @shared
    def plan(self) -> Plan:
        """Order and links of the bodies."""
        nodes = {body.name for body in self.parts.bodies if isinstance(body, PointMass)} | self.rigid.keys()
        return plan_of([body.name for body in self.parts.bodies], self.vertices, nodes)

    @cached_property
    def bodies(self) -> Bodies:
        """Bodies in the order and direction in which they are passed."""
        passed = [(step.body, step.reversed) for step in self.plan.steps]
        return Bodies(passed_meshes(self.parts, self.segments.run, passed))

    @cached_property
    def kept(self) -> KeptUnknowns:
        """Kept unknowns, and what holds between them."""
        return KeptUnknowns(self)

    @shared
    def rigid(self) -> dict[str, None]:
        """Names of the rigid bodies, beams without strain among them, in the order of the scene."""
        cut = self.segments.run.of(self.parts)
        return {
            body.name: None
            for body in self.parts.bodies
            if isinstance(body, RigidBody) or (body.name in cut and kind_of(cut[body.name][1]).rigid)
        }

    def node(self, end: End) -> int:
        """Node at an end of a body."""
        return self.bodies.node(*end)

    @shared
    def link(self) -> Ints:
        """BREAK, PIN, WELD or TANGENT behind the last node of each body."""
        found = np.array([step.link for step in self.plan.steps], dtype=np.int64)
        if self.released:
            held = np.array([mesh.held for mesh in self.bodies.meshes])
            found[(found == WELD) & (held < self.bodies.rows)] = TANGENT
        return found

    @shared
    def released(self) -> bool:
        """Whether welds leave a vector of some body free at its ends."""
        return any(mesh.held < 2 * mesh.vectors for mesh in self.bodies.meshes)

    @shared
    def onward(self) -> Ints:
        """Node that each body's last node passes on to; −1 where that is none or a kept junction."""
        return np.array(
            [self.node(step.to) if _is_end(step.to) else -1 for step in self.plan.steps], dtype=np.int64
        )

    @cached_property
    def turn(self) -> Array:
        """Cosine and sine of the turn from each body's frame to that of the end it is welded to, (bodies, 2)."""
        table = np.zeros((len(self.plan.steps), 2))
        table[:, 0] = 1.0
        for b in common(self, _welded):
            step = self.plan.steps[b]
            assert step.to is not None  # a weld leads somewhere
            table[b] = self.turn_between(step.outboard, self.frame_of(step.to))
        return table

    def frame_of(self, to: End | Kept) -> End:
        """The end whose frame is that of an end, or of the gradients of a kept junction's group: the group's first."""
        if isinstance(to, Kept):
            return self.plan.kept[to.junction].welded[to.group or 0][0]
        return to

    def turn_between(self, one: End, two: End) -> tuple[float, float]:
        """Cosine and sine of the turn from the frame of an end to that of another, both as passed."""
        a, c = (self.bodies.mesh(name).reference[0, 1] for name, _ in (one, two))
        cosine, sine = float(a @ c), float(a[0] * c[1] - a[1] * c[0])
        return (1.0, 0.0) if cosine > 0.0 and abs(sine) < ALIGNED else (cosine, sine)

    @cached_property
    def split(self) -> bool:
        """Whether x and y, and a third vector and the rest, do not mix in the mass, except by a few guides or kept
        unknowns: no weld at an angle elsewhere, and no quintic cable. Of kept places there may be any number.
        """
        if self.released or self.bodies.coupled:
            return False
        turn = self.turn[[not isinstance(step.to, Kept) for step in self.plan.steps]]
        straight = (turn[:, 1] == 0.0).all() and (turn[:, 0] > 0.0).all()
        few = len(self.guided) <= FEW_GUIDES
        return bool(straight and (self.kept.few or self.kept.pinned if self.plan.kept else few))

    @shared
    def guided(self) -> list[Guided]:
        """Places on lines in the ground that are eliminated like others, in the frames of these lines."""
        kept = {end for vertex in self.plan.kept for group in vertex.groups for end in group}
        last = {step.inboard for step in self.plan.steps}
        last |= {step.outboard for step in self.plan.steps if step.link == BREAK}
        found = []
        for vertex in self.vertices:
            ends = tuple(end for group in vertex.groups for end in group)
            if vertex.line is not None and ends[0] not in kept:
                found.append(Guided(ends, next(end for end in ends if end in last), vertex.line))
        return found

    @shared
    def single(self) -> bool:
        """Whether all bodies stand in one chain."""
        return not self.plan.kept and bool((self.onward[:-1] == self.bodies.first[1:-1]).all())

    @shared
    def held(self) -> NDArray[np.bool_]:
        """Components of ends that follow from kept unknowns, or with them from guides, (rows, nodes)."""
        mask = np.zeros((self.bodies.rows, self.bodies.nodes), dtype=bool)
        for step in self.plan.steps:
            for end, to in ((step.inboard, step.start), (step.outboard, step.to)):
                if isinstance(to, Kept):
                    mask[: 2 if to.group is None else None, self.node(end)] = True
        if self.plan.kept:
            mask[:2, [self.node(guided.carrier) for guided in self.guided]] = True
        return mask

    @shared
    def prescribed(self) -> NDArray[np.bool_]:
        """Components whose motion is known, (rows, nodes); so are those that a cable has not."""
        bodies = self.bodies
        mask = np.zeros((bodies.rows, bodies.nodes), dtype=bool)
        for i, mesh in enumerate(bodies.meshes):
            mask[2 * mesh.vectors :, bodies.first[i] : bodies.first[i + 1]] = True
        for junction in self.junctions:
            for group, clamp in zip(junction.groups, junction.clamps, strict=True):
                beams = [end for end in group if end[0] not in self.rigid]  # those have constraints
                fixed = len(beams) == len(group) and self._does_not_turn(junction, group)
                for end in beams:
                    held, node = bodies.mesh(end[0]).held, self.node(end)
                    mask[: held if clamp is not None else 2 if junction.grounded else 0, node] = True
                    mask[2 : held if fixed else 2, node] = True
        return mask

    def start_coordinates(self) -> Array:
        """Coordinates at t = 0, (rows, nodes)."""
        return self.bodies.reference() if self.start is None else self.start.q.copy()

    def _does_not_turn(self, junction: Junction, group: tuple[End, ...]) -> bool:
        """Whether a prismatic joint in the ground holds the gradients of a group."""
        return any(
            guide.holds_direction and guide.body is None and end_of(self.parts, guide.place) in group
            for guide in junction.guides
        )

    @cached_property
    def dead_load(self) -> Array:
        """Gravity and constant forces, (rows, nodes), N."""
        f = self.bodies.weight()
        for vector, force in constant_forces_on(self.parts, self.bodies):
            add_force(vector, force, f)
        return f

    def initial_velocity(self) -> Array:
        """Velocities at t = 0 that the joints allow, (rows, nodes).

        Bodies' velocities are made to fit with the least change: what is held rests, joined ends share the mean.
        """
        v = self.bodies.initial_velocity()
        if not v.any():  # rest fits all joints
            return v
        for row, ends in self.shared_vectors():
            nodes = [self.node(end) for end in ends]
            turns = [complex(*self.turn_between(ends[0], end)) if row else 1.0 for end in ends]
            mean = np.mean(
                [complex(*v[row : row + 2, i]) * np.conj(w) for i, w in zip(nodes, turns, strict=True)]
            )
            for i, w in zip(nodes, turns, strict=True):
                v[row : row + 2, i] = (mean * w).real, (mean * w).imag
        for guided in self.guided:
            x, y = guided.direction
            for i in map(self.node, guided.ends):
                v[:2, i] = (x * v[0, i] + y * v[1, i]) * np.array([x, y])
        for end, port in self.on_bodies():
            at = self.kept.homes[:, port.unknowns[port.unknowns >= 0]]
            v[port.shared, self.node(end)] = (port.map[:, port.unknowns >= 0] @ v[at[0], at[1]])[port.shared]
        v[self.prescribed] = 0.0
        return v

    def on_bodies(self) -> Iterator[tuple[End, Port]]:
        """Ends that are joined to rigid bodies, and what they take from these."""
        for j, vertex in enumerate(self.plan.kept):
            for group in vertex.groups if vertex.body is not None else ():
                kept = Kept(j, 0 if group == vertex.groups[0] else None)
                yield from (
                    (end, self.kept.port(kept, end, True)) for end in group if end != (vertex.body, 1)
                )

    def shared_vectors(self) -> Iterator[tuple[int, list[End]]]:
        """Vectors that several ends share, by their first rows: places of joined ends, gradients of welded ones.

        Those that ends share with rigid bodies are left out: `on_bodies` has them.
        """
        for vertex in self.vertices:
            if vertex.body is not None:
                continue
            shared = [(0, [end for group in vertex.groups for end in group])]
            shared += [
                (row, list(g)) for g in vertex.groups for row in range(2, self.bodies.mesh(g[0][0]).held, 2)
            ]
            yield from ((row, ends) for row, ends in shared if len(ends) > 1)

    def by_body(self, flat: Array) -> dict[str, Array]:
        """(…, rows, nodes) → (…, nodes, vectors, 2) of every body of the scene, in the body's own direction."""
        return self.segments.joined(self.bodies.by_body(flat))

    def flat(self, fields: Mapping[str, Array]) -> Array:
        """One state, (rows, nodes), from the coordinates of every body, (nodes, vectors, 2), in its own direction."""
        parts = self.segments.cut(fields)
        meshes = self.bodies.meshes
        return self.bodies.flat([
            mesh.from_ends(parts[mesh.body.name])
            if isinstance(mesh, BarMesh)
            else mesh.unflipped(parts[mesh.body.name][:, : mesh.vectors])
            for mesh in meshes
        ])  # fmt: skip

    def element_at(self, node: int) -> tuple[str, int | None]:
        """Body of the scene and element, counted from the body's start, next to a node; none of a body of one node."""
        name, element = self.bodies.element_at(node)
        body, first = self.segments.owner(name)
        return body, first + element if isinstance(self.scene.body(body), Beam) else None

    @property
    def length(self) -> float:
        """Length of all bodies, m: the scale of positions."""
        return self.scene.length

    @property
    def dofs(self) -> int:
        """Coordinates of all nodes, known ones included."""
        return sum(2 * m.vectors * m.nodes for m in self.bodies.meshes)


def _rigid_loops(chain: Chain) -> list[set[str]]:
    return rigid_loops(chain.junctions, chain.rigid)


def _welded(chain: Chain) -> list[int]:
    """Numbers of the bodies that pass gradients on."""
    return [int(b) for b in np.flatnonzero(chain.link >= WELD)]


def _is_end(to: End | Kept | None) -> TypeGuard[End]:
    return to is not None and not isinstance(to, Kept)


def _check_welds(chain: Chain) -> None:
    """Refuse welds between kinds of element of which they would hold different vectors."""
    kinds = chain.segments.run.of(chain.parts)
    for joint in chain.parts.joints:
        if isinstance(joint, Weld) and joint.stretch == "held":
            bodies = [chain.parts.place(end).body for end in joint.ends]
            names = [body.name for body in bodies if isinstance(body, Beam) and body.name not in chain.rigid]
            if names and not all(kind_of(kinds[names[0]][1]).welds_to(kind_of(kinds[n][1])) for n in names):
                found = [f"{kinds[n][1]!r} of {body_as_written(chain.parts, n)!r}" for n in names]
                raise DiscretisationError(
                    f"{as_written(chain.parts, joint)!r} joins elements {', '.join(found)}; "
                    f"a weld needs one kind on both sides, or kinds of which it holds the same vectors "
                    f"(a pin does not)"
                )
