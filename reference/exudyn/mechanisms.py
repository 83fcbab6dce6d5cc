"""Rigid bodies, point masses, sliders, springs and rotational springs in Exudyn.

A rigid body has the angle as its coordinate here, and not a unit vector: with equal steps its motion differs from that
of the other solvers by the error of the step.
"""

from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError, UnsupportedError, shown, unknown_kind
from anctmm.model.connectors import CONNECTORS, Connector, ends_of, free_of, law_value, name_of
from anctmm.model.joints import JOINTS, Joint
from anctmm.model.needs import MECHANISMS, refuse
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Beam, Clamp, Pin, Prismatic, RotationalSpring, Scene, Slider, Spring, Weld
from anctmm.results.fields import RigidField
from reference.exudyn.histories import FAILED, undrifted

Array = NDArray[np.float64]

#: What Exudyn's models have of mechanisms, in implicit runs: the rest is refused.
OFFERED = frozenset(
    {"rigid-bodies", "point-masses", "sliders", "springs", "rotational-springs", "driven-springs", "laws"}
)
LACKS = (frozenset(MECHANISMS) - OFFERED) | {
    f"{name} + {other}" for name in OFFERED for other in ("zhai", "statics")
}


class Model(Protocol):
    """What is asked of a model here; `reference.exudyn.model.Model` has it."""

    mbs: Any
    items: Any
    scene: Scene
    run: Discretisation | None
    nodes: dict[str, list[Any]]
    objects: dict[str, Any]
    ground: Any
    ground_object: Any

    @property
    def beams(self) -> Any:
        """The kind of beams; its `width` is asked for."""
        ...

    def coordinate(self, node: Any, index: int) -> Any:
        """Marker of one coordinate of a node."""
        ...


def check_mechanisms(scene: Scene, mode: str) -> None:
    """Refuse what the models do not have.

    Parameters
    ----------
    scene : Scene
    mode : str
        "zhai", "generalized-alpha" or "statics".

    Raises
    ------
    UnsupportedError
    """
    refuse(scene, LACKS, "a model in Exudyn", mode)
    for joint in scene.joints:
        places = [scene.place(end) for end in joint.ends]
        rigid = [not isinstance(place.body, Beam) for place in places]
        if isinstance(joint, Weld) and any(rigid) and not all(rigid):
            raise UnsupportedError(
                f"{shown(joint)} welds a beam to a rigid body; Exudyn's joints hold the direction of a beam's end "
                f"there and not its stretch, which is another model: a weld of beams, or of rigid bodies, is allowed"
            )
        if isinstance(joint, Clamp) and joint.angle is not None and rigid[0]:
            raise UnsupportedError(f"{shown(joint)} turns a rigid body; a driven clamp of a beam is allowed")
    for connector in scene.connectors:
        if isinstance(connector, RotationalSpring):
            for end in connector.places:
                if isinstance(scene.place(end).body, Beam):
                    raise UnsupportedError(
                        f"{shown(connector)} acts on a beam; Exudyn's torsional springs act on rigid bodies"
                    )


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
    model.objects[body.name] = number
    for index, g in enumerate(model.scene.gravity):
        if g:
            mbs.AddLoad(items.LoadCoordinate(markerNumber=model.coordinate(node, index), load=body.mass * g))


def marker(model: Model, place: Place) -> Any:
    """Marker of a place: of its position and, of a rigid body, its turn."""
    items, mbs = model.items, model.mbs
    if isinstance(place.body, RigidBody):
        number, arm = model.objects[place.body.name], place.body.arm(str(place.key))
        return mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=number, localPosition=[*arm, 0.0]))
    node = model.nodes[place.body.name][-1 if place.key == 1 else 0]
    return mbs.AddMarker(items.MarkerNodePosition(nodeNumber=node))


def add_joint(model: Model, joint: Joint) -> None:
    """Add a joint of which a rigid body, a point mass or a line is part."""
    items, mbs = model.items, model.mbs
    places = [model.scene.place(end) for end in joint.ends]
    match joint:
        case Pin() | Weld() | Clamp():
            for one, two in pairwise(places):
                _join(model, marker(model, one), marker(model, two), turning=isinstance(joint, Pin))
            if joint.grounded:
                held = ground(model, places[0].position), marker(model, places[0])
                _join(model, *held, turning=not isinstance(joint, Clamp))
        case Slider():
            x, y = joint.direction
            place = places[0]
            if isinstance(place.body, RigidBody):
                turn = [[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]]
                mbs.AddObject(
                    items.GenericJoint(
                        markerNumbers=[ground(model, place.position), marker(model, place)],
                        constrainedAxes=[0, 1, 0, 0, 0, 0],
                        rotationMarker0=turn,
                    )
                )
                return
            # u = displacement: the component of which the line has less follows the other
            node = model.nodes[place.body.name][-1 if place.key == 1 else 0]
            steep = abs(y) > abs(x)
            along, across = (model.coordinate(node, index) for index in ((1, 0) if steep else (0, 1)))
            slope = x / y if steep else y / x
            tied = [across, along] if slope else [model.ground, across]
            mbs.AddObject(items.CoordinateConstraint(markerNumbers=tied, factorValue1=slope or 1.0))
        case Prismatic():
            raise UnsupportedError(f"{shown(joint)} is not offered in Exudyn")  # refused before
        case _:
            raise unknown_kind("joint", joint, JOINTS)


def _join(model: Model, one: Any, two: Any, *, turning: bool) -> None:
    """One place for two markers, and, not turning, one direction."""
    items = model.items
    if turning:
        model.mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=[one, two]))
    else:
        model.mbs.AddObject(items.GenericJoint(markerNumbers=[one, two], constrainedAxes=[1, 1, 0, 0, 0, 1]))


def ground(model: Model, point: tuple[float, float]) -> Any:
    """Marker of a point of the ground."""
    return model.mbs.AddMarker(
        model.items.MarkerBodyRigid(bodyNumber=model.ground_object, localPosition=[*point, 0.0])
    )


def add_connector(model: Model, connector: Connector) -> None:
    """Add a spring."""
    items, mbs = model.items, model.mbs
    first, second = ends_of(model.scene, connector)
    one = marker(model, first)
    if isinstance(second, Place):
        two = marker(model, second)
    else:
        two = ground(model, (0.0, 0.0) if second is None else second)
    plain = connector.law is None and not _driven(connector)
    match connector:
        case Spring():
            placed = _distance(first, second)
            item = items.ObjectConnectorSpringDamper(
                markerNumbers=[one, two],
                referenceLength=free_of(connector, placed, 0.0)[0],
                stiffness=connector.stiffness,
                damping=connector.damping,
                force=connector.preload,
            )
            if not plain:
                item.springForceUserFunction = _tension(model, connector, placed)
        case RotationalSpring():
            # the angle counts from the second place to the first, and the moment works against it
            order = [one, two] if isinstance(second, Place) else [two, one]
            data = mbs.AddNode(items.NodeGenericData(numberOfDataCoordinates=1, initialCoordinates=[0.0]))
            item = items.ObjectConnectorTorsionalSpringDamper(
                markerNumbers=order,
                nodeNumber=data,
                stiffness=connector.stiffness,
                damping=connector.damping,
                offset=free_of(connector, 0.0, 0.0)[0],
                torque=connector.preload,
            )
            if not plain:
                item.springTorqueUserFunction = _moment(model, connector)
        case _:
            raise unknown_kind("connector", connector, CONNECTORS)
    mbs.AddObject(item)


def rigid_field(body: RigidBody | PointMass, q: Array, v: Array | None) -> RigidField:
    """Motion of a body from absolute coordinates (n, 1, 2 or 3) and their rates."""
    points = {key: body.arm(key) for key in body.points} if isinstance(body, RigidBody) else {}
    angle = q[:, 0, 2] if isinstance(body, RigidBody) else np.zeros(len(q))
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    coordinates = np.stack([q[:, 0, :2], turn], axis=1)
    if v is None:
        return RigidField(coordinates, points)
    spin = v[:, 0, 2] if isinstance(body, RigidBody) else np.zeros(len(q))
    rates = np.stack([v[:, 0, :2], spin[:, None] * np.stack([-turn[:, 1], turn[:, 0]], axis=1)], axis=1)
    return RigidField(coordinates, points, rates)


def reference_of(body: RigidBody | PointMass) -> Array:
    """Reference coordinates, (1, 2 or 3)."""
    return np.array([[*body.center, 0.0] if isinstance(body, RigidBody) else list(body.position)])


def _driven(connector: Connector) -> bool:
    return callable(connector.length if isinstance(connector, Spring) else connector.angle)


def _distance(first: Place, second: Place | tuple[float, float] | None) -> float:
    p, q = first.position, second.position if isinstance(second, Place) else second
    assert q is not None
    return float(np.hypot(q[0] - p[0], q[1] - p[1]))


def _pull(model: Model, connector: Connector, placed: float, value: float, rate: float, t: float) -> float:
    """Tension or moment of a driven connector or of one with a law."""
    t = t if model.run is None else undrifted(t, model.run)
    try:
        free, free_rate = free_of(connector, placed, t)
        e, r = value - free, rate - free_rate
        if connector.law is not None:
            return law_value(name_of(connector), connector.law, e, r, t)
    except AnctmmError as error:
        FAILED.append(error)
        raise
    return connector.stiffness * e + connector.damping * r + connector.preload


def _tension(model: Model, connector: Spring, placed: float) -> Any:
    start = free_of(connector, placed, 0.0)[0]  # Exudyn gives the distance less its reference length

    def force(
        mbs: Any, t: float, item: int, apart: float, rate: float, k: float, d: float, f: float
    ) -> float:
        return _pull(model, connector, placed, apart + start, rate, t)

    return force


def _moment(model: Model, connector: RotationalSpring) -> Any:
    def torque(
        mbs: Any, t: float, item: int, turn: float, rate: float, k: float, d: float, offset: float
    ) -> float:
        return _pull(model, connector, 0.0, turn, rate, t)

    return torque
