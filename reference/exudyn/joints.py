"""Joints in Exudyn: its own where it has them, else equations between two nodes that Python evaluates.

Hinges, guides and welds of rigid bodies are Exudyn's, with whatever drives them set at the beginning of each step. Its
joints fix the direction of a cable's end but not its stretch: where a cable is welded to a rigid body the whole
gradient is fixed by equations, as in the other solvers, and so are driven welds of beams (`needs_equations`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import atan2, cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.model.drives import Quintic
from anctmm.model.joints import Guide, Joint, Prismatic, Slider, drive_of, unknown_joint
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import CENTER, PointMass, RigidBody
from anctmm.model.scene import Beam, Clamp, Pin, Scene, Weld
from reference.exudyn.model import Model, angle_of, axes

Array = NDArray[np.float64]

#: Turn by +90°.
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


def needs_equations(scene: Scene, joint: Joint) -> bool:
    """Whether Python is called in the iteration because of a joint."""
    bodies = [scene.place(end).body for end in joint.places]
    beams = [isinstance(body, Beam) for body in bodies]
    match joint:
        case Weld():
            return any(beams) and not (all(beams) and joint.angle is None)
        case Slider() | Prismatic() if joint.body is not None:
            return isinstance(bodies[0], PointMass) or (isinstance(joint, Prismatic) and beams[0])
        case _:
            return False


def add_joint(model: Model, joint: Joint) -> None:
    """Add a joint."""
    places = [model.scene.place(end) for end in joint.places]
    drive = drive_of(joint)
    history = None if drive is None else model.history(drive[0], drive[1], 3)[:, 0]
    match joint:
        case Pin():
            _coincide(model, places, joint.grounded)
        case Weld():
            for one, two in pairwise(places):
                _weld(model, one, two, history)
            if joint.grounded:
                _coincide(model, places[:1], True)
        case Clamp():
            _clamp(model, joint, places[0], history)
        case Slider() | Prismatic():
            _guide(model, joint, places[0], history)
        case _:
            raise unknown_joint(joint)


def _coincide(model: Model, places: Sequence[Place], grounded: bool) -> None:
    """Places at one point: of nodes without an arm by their coordinates."""
    if grounded:
        node = model.node_at(places[0])
        if node is not None and not isinstance(places[0].body, RigidBody):
            _fix(model, node, range(2))
        else:
            _hinge(model, model.on_body(None, places[0].position), model.point(places[0]))
    for one, two in pairwise(places):
        if any(isinstance(place.body, RigidBody) for place in (one, two)):
            _hinge(model, model.point(one), model.point(two))
        else:
            for index in range(2):
                _tie(model, *(model.coordinate(model.node_at(place), index) for place in (one, two)))


def _hinge(model: Model, *markers: Any) -> None:
    """Two markers at one point."""
    model.mbs.AddObject(model.items.ObjectJointRevolute2D(markerNumbers=[*markers]))


def _tie(model: Model, *markers: Any, factor: float = 1.0) -> Any:
    """One coordinate is another one times a factor; the constraint."""
    item = model.items.CoordinateConstraint(markerNumbers=[*markers], factorValue1=factor)
    return model.mbs.AddObject(item)


def _fix(model: Model, node: Any, coordinates: Sequence[int]) -> list[Any]:
    """Hold coordinates of a node at their reference; the constraints."""
    return [_tie(model, model.ground, model.coordinate(node, index)) for index in coordinates]


def _clamp(model: Model, joint: Clamp, place: Place, history: Array | None) -> None:
    body, node = place.body, model.node_at(place)
    if isinstance(body, RigidBody):
        _coincide(model, [place], True)
        _set_at_steps(model, _fix(model, node, [2])[0], "offset", history)
        return
    assert isinstance(body, Beam)
    _fix(model, node, range(2))
    moves = model.beams.turned(body)
    for item, displacement in zip(_fix(model, node, [*moves]), moves.values(), strict=True):
        # what a subclass of the user's does is not known
        if type(joint.angle) is Quintic and not model.static:
            expression = _symbolic_offset(model.exu.symbolic, joint.angle, displacement)
            model.compiled.append((item, "offsetUserFunction", expression))
        elif history is not None:
            _set_at_steps(model, item, "offset", displacement(history, np))


def _set_at_steps(model: Model, item: Any, name: str, values: Array | None) -> None:
    """Set a parameter of an object at the beginning of each step; None has nothing to set."""
    if values is not None:
        steps = values.tolist()
        model.each_step(lambda k, t: k < len(steps) and model.mbs.SetObjectParameter(item, name, steps[k]))


def _symbolic_offset(
    esym: Any, drive: Quintic, displacement: Callable[[Any, Any], Any]
) -> Callable[..., Any]:
    real = esym.Real  # every number: a plain one in front of an expression is taken wrongly

    def offset(mbs: Any, t: Any, number: Any, constant: Any) -> Any:
        x = esym.min(t * real(1.0 / drive.duration), real(1.0))
        angle = real(drive.turn) * x * x * x * (real(10.0) + x * (real(6.0) * x - real(15.0)))
        return displacement(angle, esym)

    return offset


def _weld(model: Model, one: Place, two: Place, history: Array | None) -> None:
    """The second place at the first, turned as in the reference and by a history."""
    items, beams = model.items, [isinstance(place.body, Beam) for place in (one, two)]
    if all(beams) and history is None:
        _weld_beams(model, one, two)
    elif not any(beams):
        item = model.mbs.AddObject(
            items.GenericJoint(
                markerNumbers=[model.rigid(one), model.rigid(two)], constrainedAxes=[1, 1, 0, 0, 0, 1]
            )
        )
        turns = None if history is None else np.array([axes(angle) for angle in history])
        _set_at_steps(model, item, "rotationMarker0", turns)
    else:
        first, second = frame_of(model, one), frame_of(model, two)
        add_equations(
            model, first, second, coincide(first, second), aligned(first, second, _at(model, history))
        )


def _weld_beams(model: Model, one: Place, two: Place) -> None:
    """Coordinates of the second node are a matrix times those of the first."""
    nodes = [model.node_at(place) for place in (one, two)]
    matrix = model.beams.welded(angle_of(two) - angle_of(one))
    if np.array_equal(matrix, np.eye(len(matrix))):
        for index in range(len(matrix)):
            _tie(model, *(model.coordinate(node, index) for node in nodes))
        return
    markers = [model.items.MarkerNodeCoordinates(nodeNumber=node) for node in nodes]
    model.mbs.AddObject(
        model.items.ObjectConnectorCoordinateVector(
            markerNumbers=[model.mbs.AddMarker(marker) for marker in markers],
            scalingMarker0=matrix,
            scalingMarker1=np.eye(len(matrix)),
            offset=np.zeros(len(matrix)),
        )
    )


def _guide(model: Model, guide: Guide, place: Place, history: Array | None) -> None:
    """A place on a line of the ground or of a rigid body."""
    body = None if guide.body is None else model.scene.body(guide.body)
    assert body is None or isinstance(body, RigidBody)  # seen by the scene
    rigid = isinstance(place.body, RigidBody)
    if body is None and not rigid:
        _guide_of_node(model, guide, place, history)
    elif rigid or not needs_equations(model.scene, guide):
        _native_guide(model, guide, place, body, history)
    else:
        assert body is not None  # only then equations are needed
        one, two = frame_of(model, Place(body, CENTER)), frame_of(model, place)
        one = replace(one, arm=np.array(place.position) - body.center)
        parts = [
            on_line(one, two, np.array(guide.direction), None if history is None else _at(model, history))
        ]
        if isinstance(guide, Prismatic):
            parts.append(aligned(one, two, lambda t: 0.0))
        add_equations(model, one, two, *parts)


def _native_guide(
    model: Model, guide: Guide, place: Place, body: RigidBody | None, history: Array | None
) -> None:
    x, y = guide.direction
    line = np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])
    turning = int(isinstance(guide, Prismatic))
    item = model.items.GenericJoint(
        markerNumbers=[model.on_body(body, place.position), model.rigid(place)],
        constrainedAxes=[int(history is not None), 1, 0, 0, 0, turning],
        rotationMarker0=line,
        rotationMarker1=np.array(axes(-angle_of(place))) @ line,
    )
    if history is not None:
        position = _at(model, history)

        def offset(mbs: Any, t: float, number: Any, values: Any) -> list[float]:
            return [position(t), 0.0, 0.0, 0.0, 0.0, 0.0]

        item.offsetUserFunction = offset
    model.mbs.AddObject(item)


def _guide_of_node(model: Model, guide: Guide, place: Place, history: Array | None) -> None:
    """A node of a beam or a point mass on a line of the ground."""
    node, (x, y) = model.node_at(place), guide.direction
    if isinstance(guide, Prismatic):
        _fix(model, node, range(2, model.beams.width))
    if history is not None:
        for item, part in zip(_fix(model, node, range(2)), guide.direction, strict=True):
            _set_at_steps(model, item, "offset", part * history)
        return
    # the component of which the line has less follows the other
    steep = abs(y) > abs(x)
    along, across = (model.coordinate(node, index) for index in ((1, 0) if steep else (0, 1)))
    slope = x / y if steep else y / x
    _tie(model, *([across, along] if slope else [model.ground, across]), factor=slope or 1.0)


def _at(model: Model, history: Array | None) -> Callable[[float], float]:
    """A history by Exudyn's time."""
    if history is None:
        return lambda t: 0.0
    return lambda t: float(history[min(round(t / model.run.exact_dt), len(history) - 1)])


# --- equations between two nodes ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Frame:
    """What joins to a node: a point that moves with it, and a direction, by its coordinates (…, width).

    Parameters
    ----------
    node : int
    kind : str
        "cable": coordinates x, y and a gradient; "turning": x, y and an angle; "point": x and y.
    arm : ndarray, shape (2,)
        Offset of the point from the node in the reference, of one that turns, m.
    direction : ndarray, shape (2,)
        In the reference; of a cable its gradient.
    angle : float
        Angle coordinate in the reference, rad.
    """

    node: Any
    kind: str
    arm: Array
    direction: Array
    angle: float = 0.0

    @property
    def width(self) -> int:
        """Number of its coordinates."""
        return {"cable": 4, "turning": 3, "point": 2}[self.kind]

    def position(self, q: Array) -> Array:
        """Position, (…, 2), m."""
        return q[..., :2] + turned(self.arm, q[..., 2] - self.angle) if self.kind == "turning" else q[..., :2]

    def gradient(self, q: Array) -> Array:
        """Direction, of a cable with its stretch, (…, 2)."""
        return q[..., 2:] if self.kind == "cable" else turned(self.direction, q[..., 2] - self.angle)


Equations = Callable[[float, Array, Array], Array]
"""(t, coordinates of the one node, of the other) → residuals (…, n)."""


def frame_of(model: Model, place: Place) -> Frame:
    """A place with the coordinates of its node."""
    node, body, angle = model.node_at(place), place.body, angle_of(place)
    kind, arm = model.beams.kind, np.zeros(2)
    if isinstance(body, PointMass):
        kind = "point"
    elif isinstance(body, RigidBody):
        kind, arm = "turning", np.array(body.arm(str(place.key)))
    return Frame(node, kind, arm, np.array([cos(angle), sin(angle)]), angle)


def coincide(one: Frame, two: Frame) -> Equations:
    """Both points at one place."""
    return lambda t, p, q: two.position(q) - one.position(p)


def aligned(one: Frame, two: Frame, turn: Callable[[float], float]) -> Equations:
    """The second direction is the first, turned as in the reference and by an angle of time."""
    (a, b), (x, y) = one.direction, two.direction
    between = atan2(a * y - b * x, a * x + b * y)

    def equations(t: float, p: Array, q: Array) -> Array:
        if "cable" in (one.kind, two.kind):
            return two.gradient(q) - turned(one.gradient(p), turn(t) + between)
        return (q[..., 2] - two.angle - p[..., 2] + one.angle - turn(t))[..., None]

    return equations


def on_line(body: Frame, place: Frame, along: Array, position: Callable[[float], float] | None) -> Equations:
    """A place on a line of a body through that body's point, at a position of time along it if there is one."""

    def equations(t: float, p: Array, q: Array) -> Array:
        apart = turned(
            place.position(q) - body.position(p), body.angle - p[..., 2]
        )  # in the axes of the body
        across = apart @ (QUARTER @ along)
        return np.stack([across] if position is None else [across, apart @ along - position(t)], axis=-1)

    return equations


def add_equations(model: Model, one: Frame, two: Frame, *parts: Equations) -> None:
    """Add equations between two nodes as one of Exudyn's constraints; their derivative is found by complex steps."""
    width, items = one.width, model.items
    steps = 1e-30j * np.eye(one.width + two.width)

    def residuals(t: float, q: Array) -> Array:
        return np.concatenate([part(t, q[..., :width], q[..., width:]) for part in parts], axis=-1)

    def value(mbs: Any, t: float, item: int, q: Any, q_t: Any, velocity_level: bool) -> Array:
        return residuals(t, np.asarray(q, dtype=float))

    def slope(mbs: Any, t: float, item: int, q: Any, q_t: Any, velocity_level: bool) -> Array:
        return np.ascontiguousarray(residuals(t, np.asarray(q, dtype=float) + steps).imag.T / 1e-30)

    count = len(residuals(0.0, np.ones(one.width + two.width)))
    markers = [items.MarkerNodeCoordinates(nodeNumber=frame.node) for frame in (one, two)]
    model.mbs.AddObject(
        items.ObjectConnectorCoordinateVector(
            markerNumbers=[model.mbs.AddMarker(marker) for marker in markers],
            scalingMarker0=np.zeros((count, one.width)),
            scalingMarker1=np.zeros((count, two.width)),
            constraintUserFunction=value,
            jacobianUserFunction=slope,
        )
    )


def turned(vector: Array, angle: Any) -> Array:
    """Vectors, (…, 2), turned by angles, (…,), rad."""
    c, s, x, y = np.cos(angle), np.sin(angle), vector[..., 0], vector[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)
