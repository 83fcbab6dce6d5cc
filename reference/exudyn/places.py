"""Places of bodies in Exudyn: nodes, markers and frames."""

from math import cos, sin
from typing import Any, Protocol

import numpy as np

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Beam, Scene
from reference.exudyn.coordinate_joints import Frame

#: How near a place lies to a node that counts as there, of an interval between nodes.
AT_NODE = 1e-9


class Model(Protocol):
    """The part of `reference.exudyn.model.Model` that this module needs."""

    exu: Any
    mbs: Any
    items: Any
    scene: Scene
    run: Discretisation | None
    static: bool
    nodes: dict[str, list[Any]]
    objects: dict[str, list[Any]]
    """By body: the elements of a beam, or the one object of another."""
    ground: Any
    ground_object: Any

    @property
    def beams(self) -> Any:
        """The kind of beams."""
        ...

    def coordinate(self, node: Any, index: int) -> Any:
        """Marker of one coordinate of a node."""
        ...

    def joined(self, joint: Any, number: Any) -> Any:
        """Remember an object as part of a joint; its number."""
        ...


def node_of(model: Model, place: Place) -> Any | None:
    """Node at a place of a beam, or of another body; None between the nodes of a beam."""
    nodes = model.nodes[place.body.name]
    if not isinstance(place.body, Beam):
        return nodes[0]
    along = float(place.key) * (len(nodes) - 1)
    return nodes[round(along)] if abs(along - round(along)) <= AT_NODE else None


def point_marker(model: Model, place: Place) -> Any:
    """Marker of the position of a place."""
    items, node = model.items, node_of(model, place)
    if isinstance(place.body, RigidBody) or node is None:
        return rigid_marker(model, place)
    return model.mbs.AddMarker(items.MarkerNodePosition(nodeNumber=node))


def rigid_marker(model: Model, place: Place) -> Any:
    """Marker of the position and the turn of a place."""
    items, objects, node = model.items, model.objects[place.body.name], node_of(model, place)
    if isinstance(place.body, RigidBody):
        at, number = [*place.body.arm(str(place.key)), 0.0], objects[0]
    elif node is None:
        index, along = model.beams.inside(place.body, float(place.key))
        at, number = [along, 0.0, 0.0], objects[index]
    else:
        return model.mbs.AddMarker(items.MarkerNodeRigid(nodeNumber=node))
    return model.mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=number, localPosition=at))


def ground_marker(model: Model, point: tuple[float, float]) -> Any:
    """Marker of a point of the ground."""
    return model.mbs.AddMarker(
        model.items.MarkerBodyRigid(bodyNumber=model.ground_object, localPosition=[*point, 0.0])
    )


def angle_of(place: Place | None) -> float:
    """Angle of the axes of a place's marker in the reference, rad; None is the ground."""
    return place.body.angle if place is not None and isinstance(place.body, Beam) else 0.0


def axes(angle: float) -> list[list[float]]:
    """Matrix in space that turns about z, rad."""
    c, s = cos(angle), sin(angle)
    return [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]


def frame_of(model: Model, place: Place) -> Frame:
    """A place with the coordinates of its node."""
    node, body = node_of(model, place), place.body
    assert node is not None  # joints between nodes are refused when the beams are cut
    angle = angle_of(place)
    kind, arm = model.beams.kind, np.zeros(2)
    if isinstance(body, PointMass):
        kind = "point"
    elif isinstance(body, RigidBody):
        kind, arm = "turning", np.array(body.arm(str(place.key)))
    return Frame(node, kind, arm, np.array([cos(angle), sin(angle)]), angle)
