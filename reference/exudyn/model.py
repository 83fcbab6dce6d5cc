"""Parts of a model that both Exudyn peers need: a quiet import, nodes, joints, loads, sensors.

Exudyn: Gerstmayr 2023, DOI 10.1007/s11044-023-09937-1. Its coordinates are displacements from the reference.
"""

import io
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import UnsupportedError
from anctmm.model.drives import Angle, Quintic, value_at
from anctmm.model.joints import Guide, unknown_joint
from anctmm.model.needs import not_offered
from anctmm.model.places import Written
from anctmm.model.scene import (
    Beam,
    Clamp,
    Joint,
    Pin,
    Prismatic,
    Scene,
    Slider,
    Weld,
)
from anctmm.model.topology import junctions_of
from anctmm.results.checks.mechanisms import is_mechanism
from anctmm.results.fields import Field
from reference.exudyn import mechanisms
from reference.exudyn.connectors import add_connector
from reference.exudyn.histories import remembered
from reference.exudyn.loads import add_load
from reference.exudyn.places import node_of

Array = NDArray[np.float64]

#: Inertia added to fixed coordinates in an explicit run, relative to the scene's mass, see `Model.hold`.
HUGE = 1e12


class Beams(Protocol):
    """One kind of Exudyn beam element, meshed over a scene; a node has x, y and further coordinates."""

    solver: str
    width: int
    """Coordinates of a node."""
    kind: str
    """What they are: of a `coordinate_joints.Frame`."""
    lacks: frozenset[str]
    """What is refused of mechanisms."""
    constant_torques: bool
    """Whether the generalized force of a torque does not depend on the coordinates."""

    def reference(self, body: Beam) -> Array:
        """Reference coordinates, (nodes, width)."""
        ...

    def velocity(self, body: Beam) -> Array:
        """Velocities of the coordinates at t = 0 as the body has them, (nodes, width); joints may change them."""
        ...

    def spin(self, body: Beam, rate: float) -> Array:
        """Velocities of the coordinates of a node at rest that turns with a rate (rad/s), (width,)."""
        ...

    def weight(self, body: Beam) -> Array:
        """Consistent forces of gravity, (nodes, width)."""
        ...

    def uniform(self, body: Beam, force: Array) -> Array:
        """Consistent forces of a force along the whole body, per length (N/m), (nodes, width)."""
        ...

    def add(self, model: "Model", body: Beam, velocity: Array) -> tuple[list[Any], list[Any]]:
        """Add a body's nodes, with their velocities at t = 0, and elements; both from its start to its end."""
        ...

    def welded(self, one: Beam, two: Beam) -> Array:
        """Matrix that turns displacement coordinates of one's end into those of two's, (width, width)."""
        ...

    def turned(self, body: Beam) -> dict[int, Callable[[Any, Any], Any]]:
        """Displacement of every coordinate a turning clamp drives, by (angle, module with sin and cos)."""
        ...

    def angle(self, coordinates: Array) -> Array:
        """Continuous angle of a node, (n,), rad; `coordinates` (n, width) are absolute."""
        ...

    def field(self, body: Beam, coordinates: Array, rates: Sequence[Array]) -> Field:
        """Motion of a body's axis; `coordinates` (n, nodes, width) are absolute.

        `rates` are like them: velocities and accelerations, as far as they are known.
        """
        ...

    def energies(self, body: Beam, coordinates: Array, velocities: Array) -> tuple[Array, Array]:
        """Kinetic and strain energy, each (n,), J."""
        ...


def load_exudyn() -> Any:
    """Exudyn's fast module (no range checks), silent; raises UnsupportedError where it is not installed."""
    if "exudyn" not in sys.modules:
        sys.exudynFast = True  # type: ignore[attr-defined]
    try:
        with redirect_stdout(io.StringIO()):
            exu = import_module("exudyn")
            import_module("exudyn.itemInterface")
            import_module("exudyn.advancedUtilities")
    except ImportError as error:
        raise UnsupportedError(f"exudyn is not installed; pip install 'anctmm[peers]' ({error})") from error
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
            to_each = [beams.welded(bodies[0], body) for body in bodies]
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
    """A scene as an Exudyn system, not yet assembled.

    Parameters
    ----------
    exu : module
    scene : Scene
    beams : Beams
    run : Discretisation, optional
        Whose times histories are asked at: Exudyn adds its steps up, which drifts by rounding.
    static : bool
        Whether loads are held at their values of t = 0 and drives at their start.
    """

    exu: Any
    scene: Scene
    beams: Beams
    run: Discretisation | None = None
    static: bool = False
    nodes: dict[str, list[Any]] = field(default_factory=dict)
    objects: dict[str, list[Any]] = field(default_factory=dict)
    """By body: the elements of a beam, or the one object of another."""
    parts: list[tuple[Joint, Any]] = field(default_factory=list)
    """Exudyn's objects of mechanisms' joints."""
    held: dict[int, set[int]] = field(default_factory=dict)
    drives: list[tuple[str, int, int, Any]] = field(default_factory=list)
    """Driven coordinates: body, number of the node, coordinate and the sensor of its multiplier."""
    symbolic: list[tuple[Any, str, Callable[..., Any]]] = field(default_factory=list)
    kept: list[Any] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.items = self.exu.itemInterface
        self.container = self.exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.ground_node = self.mbs.AddNode(self.items.NodePointGround())
        self.ground = self.coordinate(self.ground_node, 0)
        if is_mechanism(self.scene):
            self.ground_object = self.mbs.AddObject(self.items.ObjectGround())
        velocities = joined_velocities(self.scene, self.beams)
        for body in self.scene.beams:
            self.nodes[body.name], self.objects[body.name] = self.beams.add(self, body, velocities[body.name])
            self._add_weight(body)
        for other in self.scene.bodies:
            if not isinstance(other, Beam):
                mechanisms.add_body(self, other)
        for joint in self.scene.joints:
            driven_weld = isinstance(joint, Weld) and joint.angle is not None
            if isinstance(joint, Guide) or driven_weld or not self._of_beams(joint):
                mechanisms.add_joint(self, joint)
            else:
                self._add_joint(joint)
        for connector in self.scene.connectors:
            add_connector(self, connector)
        for load in self.scene.loads:
            add_load(self, load)
        variables = self.exu.OutputVariableType
        kinds = [variables.Coordinates, variables.Coordinates_t]
        if self.knows_accelerations:
            kinds.append(variables.Coordinates_tt)
        self.sensors = {
            name: [[self._sensor(node, kind) for node in nodes] for kind in kinds]
            for name, nodes in self.nodes.items()
        }

    @property
    def knows_accelerations(self) -> bool:
        """Whether they are kept, for reactions: of mechanisms in implicit runs."""
        return is_mechanism(self.scene) and self.run is not None and not self.run.explicit

    def assemble(self) -> None:
        """Assemble, then put compiled expressions in the place of Python callables where they are known."""
        self.mbs.Assemble()
        make = self.exu.advancedUtilities.CreateSymbolicUserFunction
        for item, name, function in self.symbolic:
            compiled = make(self.mbs, function, name, item)
            setter = self.mbs.SetLoadParameter if "oad" in name else self.mbs.SetObjectParameter
            setter(item, name, compiled)
            self.kept.append(compiled)  # it holds the expression tree that Exudyn only points to

    def coordinate(self, node: Any, index: int) -> Any:
        """Marker of one coordinate of a node."""
        return self.mbs.AddMarker(self.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=index))

    def node(self, end: Written) -> tuple[Beam, Any]:
        """Beam and node of a place where a node lies."""
        place = self.scene.place(end)
        assert isinstance(place.body, Beam)  # joints of other bodies are made elsewhere
        return place.body, node_of(self, place)

    def joined(self, joint: Joint, number: Any) -> Any:
        """Remember an object as part of a joint; its number."""
        self.parts.append((joint, number))
        return number

    def hold(self) -> None:
        """Add a huge inertia to every fixed coordinate.

        Exudyn's explicit solvers solve with the whole mass matrix and zero the fixed coordinates afterwards,
        as if they were free while the others accelerate; the inertia keeps them still in the solve itself.
        """
        mass = sum(beam.mass for beam in self.scene.beams)
        for node, coordinates in self.held.items():
            diagonal = np.zeros(self.beams.width)
            diagonal[list(coordinates)] = HUGE * mass
            self.mbs.AddObject(
                self.items.ObjectGenericODE2(
                    nodeNumbers=[node],
                    massMatrix=np.diag(diagonal),
                    stiffnessMatrix=np.zeros((self.beams.width,) * 2),
                    dampingMatrix=np.zeros((self.beams.width,) * 2),
                )
            )

    def _of_beams(self, joint: Joint) -> bool:
        return all(isinstance(self.scene.place(end).body, Beam) for end in joint.ends)

    def _sensor(self, node: Any, kind: Any) -> Any:
        keep = {"storeInternal": True, "writeToFile": False}
        return self.mbs.AddSensor(self.items.SensorNode(nodeNumber=node, outputVariableType=kind, **keep))

    def _add_weight(self, body: Beam) -> None:
        weight = self.beams.weight(body)
        negligible = 1e-13 * np.abs(weight).max()  # gradients' forces cancel between equal elements
        for node, forces in zip(self.nodes[body.name], weight, strict=True):
            for index in np.flatnonzero(np.abs(forces) > negligible):
                marker = self.coordinate(node, int(index))
                self.mbs.AddLoad(self.items.LoadCoordinate(markerNumber=marker, load=float(forces[index])))

    def _add_joint(self, joint: Joint) -> None:
        body, node = self.node(joint.ends[0])
        width = self.beams.width
        match joint:
            case Clamp(angle=angle) if angle is not None and not self.static:
                self._fix(node, range(2))
                self._turn(joint, body, node)
            case Clamp():
                self._fix(node, range(width))
            case Pin() | Weld():
                for end in joint.ends[1:]:
                    other_body, other = self.node(end)
                    weld = isinstance(joint, Weld)
                    self._tie(node, other, self.beams.welded(body, other_body) if weld else np.eye(2, width))
                if joint.grounded:
                    self._fix(self.node(joint.ends[-1])[1], range(2))
            case Slider() | Prismatic():
                raise not_offered(joint)
            case _:
                raise unknown_joint(joint)

    def _fix(self, node: Any, coordinates: range) -> None:
        self.held.setdefault(node, set()).update(coordinates)
        for index in coordinates:
            markers = [self.ground, self.coordinate(node, index)]
            self.mbs.AddObject(self.items.CoordinateConstraint(markerNumbers=markers))

    def _tie(self, one: Any, two: Any, matrix: Array) -> None:
        """Tie the first coordinates of `two` to `matrix` times those of `one`."""
        if np.array_equal(matrix, np.eye(*matrix.shape)):
            for index in range(len(matrix)):
                markers = [self.coordinate(one, index), self.coordinate(two, index)]
                self.mbs.AddObject(self.items.CoordinateConstraint(markerNumbers=markers))
            return
        markers = [self.mbs.AddMarker(self.items.MarkerNodeCoordinates(nodeNumber=n)) for n in (one, two)]
        self.mbs.AddObject(
            self.items.ObjectConnectorCoordinateVector(
                markerNumbers=markers,
                scalingMarker0=matrix,
                scalingMarker1=np.eye(*matrix.shape),
                offset=np.zeros(len(matrix)),
            )
        )

    def _turn(self, clamp: Clamp, body: Beam, node: Any) -> None:
        number, drive = self.nodes[body.name].index(node), cast(Angle, clamp.angle)
        name = f"clamp {clamp.end!r} angle"
        angle = remembered(lambda t: float(value_at(name, drive, t, 3)[0]), self.run)
        for index, displacement in self.beams.turned(body).items():
            function = _offset(angle, displacement)
            constraint = self.mbs.AddObject(
                self.items.CoordinateConstraint(
                    markerNumbers=[self.ground, self.coordinate(node, index)], offsetUserFunction=function
                )
            )
            if type(drive) is Quintic:  # what a subclass of the user's does is not known
                compiled = _symbolic_offset(self.exu.symbolic, drive, displacement)
                self.symbolic.append((constraint, "offsetUserFunction", compiled))
            sensor = self.items.SensorObject(
                objectNumber=constraint,
                outputVariableType=self.exu.OutputVariableType.Force,
                storeInternal=True,
                writeToFile=False,
            )
            self.drives.append((body.name, number, index, self.mbs.AddSensor(sensor)))


def _offset(angle: Callable[[float], float], displacement: Callable[[Any, Any], Any]) -> Callable[..., float]:
    def offset(mbs: Any, t: float, number: Any, constant: float) -> float:
        return float(displacement(angle(t), math))

    return offset


def _symbolic_offset(
    esym: Any, drive: Quintic, displacement: Callable[[Any, Any], Any]
) -> Callable[..., Any]:
    real = esym.Real  # every number: a plain one in front of an expression is taken wrongly

    def offset(mbs: Any, t: Any, number: Any, constant: Any) -> Any:
        x = esym.min(t * real(1.0 / drive.duration), real(1.0))
        angle = real(drive.turn) * x * x * x * (real(10.0) + x * (real(6.0) * x - real(15.0)))
        return displacement(angle, esym)

    return offset
