"""Rigid bodies, point masses, guides and driven welds in Exudyn.

A rigid body has the angle as its coordinate here, and not a unit vector: with equal steps its motion differs from that
of the other solvers by the error of the step.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.model.bodies import Body
from anctmm.model.drives import value_at
from anctmm.model.joints import Guide, Joint, drive_of, unknown_joint
from anctmm.model.needs import MECHANISMS
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import CENTER, PointMass, RigidBody
from anctmm.model.scene import Clamp, Pin, Prismatic, Slider, Weld
from anctmm.results.fields import RigidField
from reference.exudyn import coordinate_joints
from reference.exudyn.histories import remembered
from reference.exudyn.places import Model, frame_of, ground_marker, node_of, point_marker, rigid_marker

Array = NDArray[np.float64]
History = Callable[[float], float]

#: The models have mechanisms in implicit runs and in statics; Exudyn's explicit solvers have no algebraic joints. All
#: their clamps and welds hold the stretch.
LACKS = frozenset(f"{name} + zhai" for name in MECHANISMS) | {"free-stretch", "esdirk"}


def add_body(model: Model, body: RigidBody | PointMass) -> None:
    """Add a body's node, mass and weight."""
    items, mbs = model.items, model.mbs
    if isinstance(body, RigidBody):
        node = mbs.AddNode(
            items.NodeRigidBody2D(
                referenceCoordinates=[*body.center, 0.0], initialVelocities=[*body.velocity, body.spin]
            )
        )
        number = mbs.AddObject(items.ObjectRigidBody2D(mass=body.mass, inertia=body.inertia, nodeNumber=node))
    else:
        node = mbs.AddNode(
            items.NodePoint2D(referenceCoordinates=list(body.position), initialVelocities=list(body.velocity))
        )
        number = mbs.AddObject(items.ObjectMassPoint2D(mass=body.mass, nodeNumber=node))
    model.nodes[body.name] = [node]
    model.objects[body.name] = [number]
    for index, g in enumerate(model.scene.gravity):
        if g:
            mbs.AddLoad(items.LoadCoordinate(markerNumber=model.coordinate(node, index), load=body.mass * g))


def add_joint(model: Model, joint: Joint) -> None:
    """Add a joint of which a rigid body, a point mass, a line or a drive is part."""
    places = [model.scene.place(end) for end in joint.ends]
    match joint:
        case Pin():
            _pinned(model, joint, places)
        case Weld():
            _welded(model, joint, places)
        case Clamp():
            _clamped(model, joint, places[0])
        case Slider() | Prismatic():
            body = None if joint.body is None else model.scene.body(joint.body)
            if isinstance(places[0].body, RigidBody):
                _guide_of_body(model, joint, places[0], body)
            elif body is None:
                _guide_of_node(model, joint, places[0])
            else:
                _guide_in_body(model, joint, places[0], body)
        case _:
            raise unknown_joint(joint)


def _pinned(model: Model, joint: Pin | Weld, places: list[Place]) -> None:
    for one, two in pairwise(places):
        _hinge(model, joint, point_marker(model, one), point_marker(model, two))
    if joint.grounded:
        _hinge(model, joint, ground_marker(model, places[0].position), point_marker(model, places[0]))


def _hinge(model: Model, joint: Joint, one: Any, two: Any) -> None:
    item = model.items.ObjectJointRevolute2D(markerNumbers=[one, two])
    model.joined(joint, model.mbs.AddObject(item))


def _welded(model: Model, joint: Weld, places: list[Place]) -> None:
    turn = _drive(model, joint) or (lambda t: 0.0)
    for one, two in pairwise(places):
        first, second = frame_of(model, one), frame_of(model, two)
        parts = coordinate_joints.coincide(first, second), coordinate_joints.aligned(first, second, turn)
        model.joined(joint, coordinate_joints.add(model, first, second, *parts))
    if joint.grounded:
        _hinge(model, joint, ground_marker(model, places[0].position), point_marker(model, places[0]))


def _clamped(model: Model, joint: Clamp, place: Place) -> None:
    """A rigid body held at a place."""
    _hinge(model, joint, ground_marker(model, place.position), rigid_marker(model, place))
    _fix(model, joint, model.nodes[place.body.name][0], 2, _drive(model, joint))


def _fix(model: Model, joint: Joint, node: Any, index: int, history: History | None = None) -> None:
    """Hold a coordinate at its reference, or a history from there."""
    item = model.items.CoordinateConstraint(markerNumbers=[model.ground, model.coordinate(node, index)])
    if history is not None:
        item.offsetUserFunction = lambda mbs, t, number, offset: history(t)
    model.joined(joint, model.mbs.AddObject(item))


def _guide_of_body(model: Model, guide: Guide, place: Place, body: Body | None) -> None:
    """A rigid body's point on a line of the ground or of another body."""
    x, y = guide.direction
    line = [[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]]
    drive, turning = _drive(model, guide), int(isinstance(guide, Prismatic))
    item = model.items.GenericJoint(
        markerNumbers=[_line_marker(model, place, body), rigid_marker(model, place)],
        constrainedAxes=[int(drive is not None), 1, 0, 0, 0, turning],
        rotationMarker0=line,
        rotationMarker1=line,
    )
    if drive is not None:
        item.offsetUserFunction = lambda mbs, t, number, values: [drive(t), 0.0, 0.0, 0.0, 0.0, 0.0]
    model.joined(guide, model.mbs.AddObject(item))


def _line_marker(model: Model, place: Place, body: Body | None) -> Any:
    """Where a line passes through the reference of a place: in the ground or in a body."""
    if body is None:
        return ground_marker(model, place.position)
    assert isinstance(body, RigidBody)  # seen by the scene
    at = [p - c for p, c in zip(place.position, body.center, strict=True)]
    marker = model.items.MarkerBodyRigid(bodyNumber=model.objects[body.name][0], localPosition=[*at, 0.0])
    return model.mbs.AddMarker(marker)


def _guide_of_node(model: Model, guide: Guide, place: Place) -> None:
    """A node of a beam or a point mass on a line of the ground."""
    node, (x, y), drive = node_of(model, place), guide.direction, _drive(model, guide)
    if isinstance(guide, Prismatic):
        for index in range(2, model.beams.width):
            _fix(model, guide, node, index)
    if drive is not None:
        for index, part in enumerate(guide.direction):
            _fix(model, guide, node, index, partial(_scaled, drive, part))
        return
    # the component of which the line has less follows the other
    steep = abs(y) > abs(x)
    along, across = (model.coordinate(node, index) for index in ((1, 0) if steep else (0, 1)))
    slope = x / y if steep else y / x
    tied = [across, along] if slope else [model.ground, across]
    item = model.items.CoordinateConstraint(markerNumbers=tied, factorValue1=slope or 1.0)
    model.joined(guide, model.mbs.AddObject(item))


def _scaled(history: History, factor: float, t: float) -> float:
    return factor * history(t)


def _guide_in_body(model: Model, guide: Guide, place: Place, body: Body) -> None:
    """A node of a beam or a point mass on a line of a rigid body."""
    assert isinstance(body, RigidBody)  # seen by the scene
    one, two = frame_of(model, Place(body, CENTER)), frame_of(model, place)
    one = replace(one, arm=np.array(place.position) - body.center)
    parts = [coordinate_joints.on_line(one, two, np.array(guide.direction), _drive(model, guide))]
    if isinstance(guide, Prismatic):
        parts.append(coordinate_joints.aligned(one, two, lambda t: 0.0))
    model.joined(guide, coordinate_joints.add(model, one, two, *parts))


def _drive(model: Model, joint: Joint) -> History | None:
    """Angle or position of a driven joint, at the times of the run; at its start in statics."""
    if (drive := drive_of(joint)) is None:
        return None
    name, history, _ = drive
    if model.static:
        return lambda t: 0.0
    return remembered(lambda t: float(value_at(name, history, t, 3)[0]), model.run)


def rigid_field(body: RigidBody | PointMass, q: Array, rates: Sequence[Array]) -> RigidField:
    """Motion of a body from absolute coordinates (n, 1, 2 or 3) and their rates, as far as they are known."""
    points = {key: body.arm(key) for key in body.points} if isinstance(body, RigidBody) else {}
    none = np.zeros(len(q))
    angle, spin, spinning = (
        kept[:, 0, 2] if kept is not None and isinstance(body, RigidBody) else none
        for kept in (q, *rates, *(None,) * (2 - len(rates)))
    )
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normal = np.stack([-turn[:, 1], turn[:, 0]], axis=1)
    vectors = [spin[:, None] * normal, spinning[:, None] * normal - spin[:, None] ** 2 * turn]
    moved = [np.stack([kept[:, 0, :2], vector], axis=1) for kept, vector in zip(rates, vectors, strict=False)]
    return RigidField(np.stack([q[:, 0, :2], turn], axis=1), points, *moved)


def reference_of(body: RigidBody | PointMass) -> Array:
    """Reference coordinates, (1, 2 or 3)."""
    return np.array([[*body.center, 0.0] if isinstance(body, RigidBody) else list(body.position)])
