"""A scene turned about the origin: the same physics with other numbers, by which rounding is measured."""

from collections.abc import Callable
from dataclasses import replace
from math import cos, sin
from typing import Any

from anctmm.errors import unknown_kind
from anctmm.model.bodies import BODIES, Body
from anctmm.model.connectors import CONNECTORS, Connector
from anctmm.model.joints import JOINTS, Joint
from anctmm.model.loads import LOADS, Load
from anctmm.model.scene import (
    Beam,
    Clamp,
    Force,
    LineLoad,
    Pin,
    Point,
    PointMass,
    Prismatic,
    RigidBody,
    RotationalSpring,
    Scene,
    Slider,
    Spring,
    Torque,
    Weld,
)

Turn = Callable[[Point], Point]


def turned(scene: Scene, angle: float) -> Scene:
    """A scene turned by an angle, rad."""

    def turn(point: Point) -> Point:
        c, s = cos(angle), sin(angle)
        return c * point[0] - s * point[1], s * point[0] + c * point[1]

    return replace(
        scene,
        bodies=tuple(_body(b, turn) for b in scene.bodies),
        joints=tuple(_joint(j, turn) for j in scene.joints),
        loads=tuple(_load(x, turn) for x in scene.loads),
        gravity=turn(scene.gravity),
        connectors=tuple(_connector(c, turn) for c in scene.connectors),
    )


def _body(body: Body, turn: Turn) -> Body:
    match body:
        case Beam(velocity=v):
            velocity = None if v is None else lambda fraction: turn(v(fraction))
            return replace(body, start=turn(body.start), end=turn(body.end), velocity=velocity)
        case RigidBody():
            points = {key: turn(point) for key, point in body.points.items()}
            return replace(body, center=turn(body.center), points=points, velocity=turn(body.velocity))
        case PointMass():
            return replace(body, position=turn(body.position), velocity=turn(body.velocity))
        case _:
            raise unknown_kind("body", body, BODIES)


def _joint(joint: Joint, turn: Turn) -> Joint:
    match joint:
        case Pin() | Weld() | Clamp():
            return joint
        case Slider() | Prismatic():
            return replace(joint, direction=turn(joint.direction))
        case _:
            raise unknown_kind("joint", joint, JOINTS)


def _load(load: Load, turn: Turn) -> Load:
    match load:
        case Force() | LineLoad():
            value: Any = load.value
            return replace(load, value=(lambda t: turn(value(t))) if callable(value) else turn(value))
        case Torque():
            return load
        case _:
            raise unknown_kind("load", load, LOADS)


def _connector(connector: Connector, turn: Turn) -> Connector:
    match connector:
        case Spring():
            return (
                connector if connector.ground is None else replace(connector, second=turn(connector.ground))
            )
        case RotationalSpring():
            return connector
        case _:
            raise unknown_kind("connector", connector, CONNECTORS)
