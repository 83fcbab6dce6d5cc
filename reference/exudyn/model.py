"""A scene as an Exudyn system: nodes, beams, rigid bodies, markers, and what is set anew at each step.

Histories of time are tabulated at the steps before the run; at the beginning of a step their values are put into
Exudyn's own objects, so that its iteration calls no Python. Drives and pulses of known form are compiled by Exudyn.
"""

import io
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from importlib import import_module
from math import cos, sin
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError
from anctmm.model.accepted import Point
from anctmm.model.bodies import Beam
from anctmm.model.drives import tabulate
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Scene
from anctmm.model.topology import junctions_of
from anctmm.results.fields import Field, RigidField
from reference.adapters import not_installed

Array = NDArray[np.float64]

#: How near a place lies to a node that counts as there, of an interval between nodes.
AT_NODE = 1e-9
#: What the user's functions raised while Exudyn called them: some of its modules wrap it in an error of their own.
FAILED: list[AnctmmError] = []


class Beams(Protocol):
    """One kind of Exudyn's beam elements, meshed over a scene; a node has x, y and further coordinates."""

    width: ClassVar[int]
    """Coordinates of a node."""

    def reference(self, body: Beam) -> Array:
        """Reference coordinates, (nodes, width)."""

    def velocity(self, body: Beam) -> Array:
        """Velocities of the coordinates at t = 0 as the body has them, (nodes, width); joints may change them."""

    def spin(self, body: Beam, rate: float) -> Array:
        """Velocities of the coordinates of a node at rest that turns with a rate (rad/s), (width,)."""

    def uniform(self, body: Beam, force: Array) -> Array:
        """Consistent forces of a force along the whole body, per length (N/m), (nodes, width)."""

    def inside(self, body: Beam, fraction: float) -> tuple[int, float]:
        """Element at a fraction of a body, and the place in it as Exudyn counts it."""

    def add(self, model: "Model", body: Beam, velocity: Array) -> tuple[list[Any], list[Any]]:
        """Add a body's nodes, with their velocities at t = 0, and elements; both from its start to its end."""

    def welded(self, angle: float) -> Array:
        """Matrix that takes coordinates of a node into those of one that is turned by an angle, (width, width)."""

    def turned(self, body: Beam) -> dict[int, Callable[[Any, Any], Any]]:
        """Displacement of every coordinate a turning clamp drives, by (angle, module with sin and cos)."""

    def field(self, body: Beam, coordinates: Array, rates: Sequence[Array]) -> Field:
        """Motion of a body's axis; `coordinates` (n, nodes, width) and their rates, as far as known, are absolute."""


def load_exudyn() -> Any:
    """Exudyn's fast module (no range checks), silent; raises UnsupportedError where it cannot be loaded."""
    if "exudyn" not in sys.modules:
        sys.exudynFast = True  # type: ignore[attr-defined]
    try:
        with redirect_stdout(io.StringIO()):
            exu = import_module("exudyn")
            import_module("exudyn.itemInterface")
            import_module("exudyn.advancedUtilities")
    except ImportError as error:
        raise not_installed(("exudyn",), error) from error
    return exu


@contextmanager
def silence(exu: Any) -> Iterator[None]:
    """No output and no warnings of Exudyn inside; its switches are put back."""
    before = exu.config.printToConsole, exu.config.suppressWarnings
    exu.config.printToConsole, exu.config.suppressWarnings = False, True
    try:
        yield
    finally:
        exu.config.printToConsole, exu.config.suppressWarnings = before


def joined_velocities(scene: Scene, beams: Beams) -> dict[str, Array]:
    """Velocities at t = 0 that the joints allow, (nodes, width) by body.

    Ends welded to each other turn with the mean of their rates, with a clamp as the clamp does.
    """
    velocities = {body.name: beams.velocity(body).copy() for body in scene.beams}
    for junction in junctions_of(scene):
        for group, clamp in zip(junction.groups, junction.clamps, strict=True):
            ends = [(name, key) for name, key in group if name in velocities]
            if not ends:
                continue
            bodies = [scene.beam(name) for name, _ in ends]
            nodes = [velocities[name][round(key * (len(velocities[name]) - 1))] for name, key in ends]
            to_each = [beams.welded(body.angle - bodies[0].angle) for body in bodies]
            if clamp is not None:
                shared = beams.spin(bodies[0], float(clamp.angle(0.0)[1]) if clamp.angle else 0.0)
            else:
                own = zip(to_each, nodes, strict=True)
                shared = np.mean([np.linalg.solve(matrix, node) for matrix, node in own], axis=0)
            for matrix, node in zip(to_each, nodes, strict=True):
                node[2:] = (matrix @ shared)[2:]
    return velocities


@dataclass
class Model:
    """A scene as an Exudyn system, not yet assembled; joints, connectors and loads are added by other modules.

    `static`: whether loads are held at their values of t = 0 and drives at their start.
    """

    exu: Any
    scene: Scene
    beams: Beams
    run: Discretisation
    static: bool
    nodes: dict[str, list[Any]] = field(default_factory=dict)
    objects: dict[str, list[Any]] = field(default_factory=dict)
    """By body: the elements of a beam, or the one object of another."""
    updates: list[Callable[[int, float], Any]] = field(default_factory=list)
    """What is set at the beginning of a step, by its number and time; in statics by the load factor as time."""
    compiled: list[tuple[Any, str, Callable[..., Any]]] = field(default_factory=list)
    """Items, their user functions and expressions that Exudyn compiles after it has assembled."""
    expressions: list[Any] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.items = self.exu.itemInterface
        self.container = self.exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.ground = self.coordinate(self.mbs.AddNode(self.items.NodePointGround()), 0)
        self.ground_object = self.mbs.AddObject(self.items.ObjectGround())
        velocities = joined_velocities(self.scene, self.beams)
        for body in self.scene.bodies:
            if isinstance(body, Beam):
                nodes, self.objects[body.name] = self.beams.add(self, body, velocities[body.name])
                per_length = body.material.density * body.section.area * np.array(self.scene.gravity)
                self.add_forces(nodes, self.beams.uniform(body, per_length))
                self.nodes[body.name] = nodes
            else:
                self._add_body(body)
        variables = self.exu.OutputVariableType
        kinds = (variables.Coordinates, variables.Coordinates_t, variables.Coordinates_tt)
        self.sensors = {
            name: [[self._sensor(node, kind) for node in nodes] for kind in kinds[: 1 if self.static else 3]]
            for name, nodes in self.nodes.items()
        }

    def assemble(self) -> None:
        """Assemble, then put compiled expressions in the place of histories of known form."""
        self.mbs.Assemble()
        make = self.exu.advancedUtilities.CreateSymbolicUserFunction
        for item, name, function in self.compiled:
            expression = make(self.mbs, function, name, item)
            setter = self.mbs.SetLoadParameter if "oad" in name else self.mbs.SetObjectParameter
            setter(item, name, expression)
            self.expressions.append(expression)  # it holds the expression tree that Exudyn only points to
        if self.updates:
            self.mbs.SetPreStepUserFunction(self._update)

    def history(self, name: str, function: Callable[[Any], Any], width: int) -> Array:
        """Values of a history at the steps, (steps + 1, width); in statics at the start alone."""
        steps = np.arange(1 if self.static else self.run.steps + 1)
        return tabulate(name, function, self.run.times(steps), width)

    def each_step(self, update: Callable[[int, float], Any]) -> None:
        """Set something now and at the beginning of each step, by its number (0 in statics) and time."""
        update(0, 0.0)
        self.updates.append(update)

    def add_forces(self, nodes: Sequence[Any], forces: Array) -> list[tuple[Any, int, int]]:
        """Constant generalized forces on nodes, (nodes, width): loads with the node's and the coordinate's number."""
        found, negligible = (
            [],
            1e-13 * np.abs(forces).max(),
        )  # those of gradients cancel between equal elements
        for k, node in enumerate(nodes):
            for index in np.flatnonzero(np.abs(forces[k]) > negligible).tolist():
                load = self.items.LoadCoordinate(
                    markerNumber=self.coordinate(node, index), load=float(forces[k, index])
                )
                found.append((self.mbs.AddLoad(load), k, index))
        return found

    def rows(self) -> dict[str, list[Array]]:
        """Absolute coordinates and, of motions, their rates, (outputs, nodes, width), by body."""
        found = {}
        for name, kinds in self.sensors.items():
            series = [
                np.stack([self.mbs.GetSensorStoredData(s)[:, 1:] for s in kind], axis=1) for kind in kinds
            ]
            body = self.scene.body(name)
            start = self.beams.reference(body) if isinstance(body, Beam) else reference_of(body)
            found[name] = [series[0] + start, *series[1:]]
        return found

    def output_times(self) -> Array:
        """Times, or load factors, of the rows."""
        first = next(iter(self.sensors.values()))[0][0]
        return np.asarray(self.mbs.GetSensorStoredData(first)[:, 0])

    # --- markers -------------------------------------------------------------------------------------------

    def coordinate(self, node: Any, index: int) -> Any:
        """Marker of one coordinate of a node."""
        return self.mbs.AddMarker(self.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=index))

    def node_at(self, place: Place) -> Any | None:
        """Node at a place of a beam, or of another body; None between the nodes of a beam."""
        nodes = self.nodes[place.body.name]
        if not isinstance(place.body, Beam):
            return nodes[0]
        along = float(place.key) * (len(nodes) - 1)
        return nodes[round(along)] if abs(along - round(along)) <= AT_NODE else None

    def point(self, place: Place) -> Any:
        """Marker of the position of a place."""
        node = self.node_at(place)
        if isinstance(place.body, RigidBody) or node is None:
            return self.rigid(place)
        return self.mbs.AddMarker(self.items.MarkerNodePosition(nodeNumber=node))

    def rigid(self, place: Place) -> Any:
        """Marker of the position and the rotation of a place."""
        body, node = place.body, self.node_at(place)
        if isinstance(body, RigidBody):
            return self.on_body(body, place.position)
        if node is not None:
            return self.mbs.AddMarker(self.items.MarkerNodeRigid(nodeNumber=node))
        assert isinstance(body, Beam)  # a point mass has a node
        index, along = self.beams.inside(body, float(place.key))
        number, at = self.objects[body.name][index], [along, 0.0, 0.0]
        return self.mbs.AddMarker(self.items.MarkerBodyRigid(bodyNumber=number, localPosition=at))

    def on_body(self, body: RigidBody | None, position: Point) -> Any:
        """Marker of a point of a rigid body, or of the ground, by its position in the reference."""
        number = self.ground_object if body is None else self.objects[body.name][0]
        x, y = position if body is None else np.subtract(position, body.center).tolist()
        return self.mbs.AddMarker(self.items.MarkerBodyRigid(bodyNumber=number, localPosition=[x, y, 0.0]))

    # --- parts ---------------------------------------------------------------------------------------------

    def _update(self, mbs: Any, t: float) -> bool:
        step = 0 if self.static else round(t / self.run.exact_dt)
        for update in self.updates:
            update(step, t)
        return True

    def _add_body(self, body: RigidBody | PointMass) -> None:
        """A body's node, mass and weight."""
        items, mbs, start = self.items, self.mbs, reference_of(body)[0]
        if isinstance(body, RigidBody):
            rates = [*body.velocity, body.spin]
            node = mbs.AddNode(items.NodeRigidBody2D(referenceCoordinates=start, initialVelocities=rates))
            item = items.ObjectRigidBody2D(mass=body.mass, inertia=body.inertia, nodeNumber=node)
        else:
            node = mbs.AddNode(
                items.NodePoint2D(referenceCoordinates=start, initialVelocities=list(body.velocity))
            )
            item = items.ObjectMassPoint2D(mass=body.mass, nodeNumber=node)
        self.nodes[body.name], self.objects[body.name] = [node], [mbs.AddObject(item)]
        weight = np.zeros((1, len(start)))
        weight[0, :2] = body.mass * np.array(self.scene.gravity)
        self.add_forces([node], weight)

    def _sensor(self, node: Any, kind: Any) -> Any:
        sensor = self.items.SensorNode(
            nodeNumber=node, outputVariableType=kind, storeInternal=True, writeToFile=False
        )
        return self.mbs.AddSensor(sensor)


def angle_of(place: Place | None) -> float:
    """Angle of the axes of a place's marker in the reference, rad; None is the ground."""
    return place.body.angle if place is not None and isinstance(place.body, Beam) else 0.0


def axes(angle: float) -> list[list[float]]:
    """Matrix in space that turns about z, rad."""
    c, s = cos(angle), sin(angle)
    return [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]


def reference_of(body: RigidBody | PointMass) -> Array:
    """Reference coordinates, (1, 2 or 3)."""
    return np.array([[*body.center, 0.0] if isinstance(body, RigidBody) else list(body.position)])


def rigid_field(body: RigidBody | PointMass, q: Array, rates: Sequence[Array]) -> RigidField:
    """Motion of a body from absolute coordinates (n, 1, 2 or 3) and their rates, as far as they are known.

    A rigid body has the angle as its coordinate here, and not a unit vector: with equal steps its motion differs from
    that of the other solvers by the error of the step.
    """
    points = {key: body.arm(key) for key in body.points} if isinstance(body, RigidBody) else {}
    none, turns = np.zeros(len(q)), isinstance(body, RigidBody)
    angle, spin, spinning = (
        [x[:, 0, 2] if turns else none for x in (q, *rates)] + [none] * (2 - len(rates))
    )  # fmt: skip
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normal = np.stack([-turn[:, 1], turn[:, 0]], axis=1)
    vectors = [spin[:, None] * normal, spinning[:, None] * normal - spin[:, None] ** 2 * turn]
    moved = [np.stack([x[:, 0, :2], vector], axis=1) for x, vector in zip(rates, vectors, strict=False)]
    return RigidField(np.stack([q[:, 0, :2], turn], axis=1), points, *moved)  # type: ignore[arg-type]
