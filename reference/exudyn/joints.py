"""Joints in Exudyn: hinges, guides and welds of rigid bodies are its own, what drives them is set at each step.

Its joints fix the direction of a cable's end but not its stretch: where a cable is welded to a rigid body the whole
gradient is fixed by equations in Python, as in the other solvers, and so are driven welds of beams (`needs_equations`).
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import UnsupportedError, shown
from anctmm.model.drives import Quintic
from anctmm.model.joints import Guide, Joint, Prismatic, Slider, drive_of, unknown_joint
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Beam, Clamp, Pin, Scene, Weld
from reference.exudyn.model import Model, angle_of, axes

Array = NDArray[np.float64]


def needs_equations(scene: Scene, joint: Joint) -> bool:
    """Whether Python is called in the iteration because of a joint."""
    beams = [isinstance(scene.place(end).body, Beam) for end in joint.places]
    return isinstance(joint, Weld) and any(beams) and not (all(beams) and joint.angle is None)


def refuse_guides(scene: Scene) -> None:
    """Refuse, by UnsupportedError, guides of moving bodies for which Exudyn has no joint."""
    for joint in scene.joints:
        if isinstance(joint, Guide) and joint.body is not None:
            body = scene.place(joint.places[0]).body
            if isinstance(body, PointMass) or (isinstance(joint, Prismatic) and isinstance(body, Beam)):
                raise UnsupportedError(
                    f"{shown(joint)} guides {body.name!r} on a moving body; Exudyn has no joint for that: a rigid "
                    f"body, or the slider of a beam, is allowed"
                )


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
        _weld_by_equations(model, one, two, _at(model, history))


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
    if body is None and not isinstance(place.body, RigidBody):
        _guide_of_node(model, guide, place, history)
    else:
        _native_guide(model, guide, place, body, history)


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


# --- welds by equations -----------------------------------------------------------------------------------------


def _weld_by_equations(model: Model, one: Place, two: Place, turn: Callable[[float], float]) -> None:
    """Positions and directions as one of Exudyn's constraints; its derivative is found by complex steps."""
    (node, width, first), (other, more, second) = (_end(model, place) for place in (one, two))
    between, steps, cables = angle_of(two) - angle_of(one), 1e-30j * np.eye(width + more), 4 in (width, more)

    def residuals(t: float, q: Array) -> Array:
        (r, d), (s, e) = first(q[..., :width]), second(q[..., width:])
        wanted = turned(d, turn(t) + between)
        across = wanted[..., :1] * e[..., 1:] - wanted[..., 1:] * e[..., :1]
        return np.concatenate([s - r, e - wanted if cables else across], axis=-1)

    def value(mbs: Any, t: float, item: int, q: Any, q_t: Any, velocity_level: bool) -> Array:
        return residuals(t, np.asarray(q, dtype=float))

    def slope(mbs: Any, t: float, item: int, q: Any, q_t: Any, velocity_level: bool) -> Array:
        return np.ascontiguousarray(residuals(t, np.asarray(q, dtype=float) + steps).imag.T / 1e-30)

    items, count = model.items, 4 if cables else 3
    markers = [
        model.mbs.AddMarker(items.MarkerNodeCoordinates(nodeNumber=number)) for number in (node, other)
    ]
    model.mbs.AddObject(
        items.ObjectConnectorCoordinateVector(
            markerNumbers=markers,
            scalingMarker0=np.zeros((count, width)),
            scalingMarker1=np.zeros((count, more)),
            constraintUserFunction=value,
            jacobianUserFunction=slope,
        )
    )


def _end(model: Model, place: Place) -> tuple[Any, int, Callable[[Array], tuple[Array, Array]]]:
    """Node, number of its coordinates, and its position and direction by these, of a cable with its stretch."""
    node, body, angle = model.node_at(place), place.body, angle_of(place)
    if isinstance(body, Beam) and model.beams.width == 4:
        return node, 4, lambda q: (q[..., :2], q[..., 2:])
    arm = np.array(body.arm(str(place.key))) if isinstance(body, RigidBody) else np.zeros(2)
    start = np.array([cos(angle), sin(angle)])
    return node, 3, lambda q: (q[..., :2] + turned(arm, q[..., 2] - angle), turned(start, q[..., 2] - angle))


def turned(vector: Array, angle: Any) -> Array:
    """Vectors, (…, 2), turned by angles, (…,), rad."""
    c, s, x, y = np.cos(angle), np.sin(angle), vector[..., 0], vector[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)
