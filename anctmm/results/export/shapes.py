"""Geometry for pictures: shapes of bodies, springs and guides at all outputs, and supports."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.model.accepted import Point
from anctmm.model.bodies import Beam
from anctmm.model.connectors import Connector, RotationalSpring
from anctmm.model.joints import Clamp, Guide, Pin, Weld
from anctmm.model.rigid_bodies import WithPoints

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """A line or an outline that moves: the name of its body, empty of what is none, and points, (n, k, 2), m.

    Kinds are "beam", "rigid" (an outline, closed), "mass" and "rotational spring" (one point), "spring" and "guide".
    """

    name: str
    kind: str
    points: Array


def shapes_of(solution: Any) -> list[Shape]:
    """Everything that moves, of a solution with an output: bodies in the scene's order, springs, guides."""
    scene = solution.scene
    bodies = [_body(solution, body) for body in scene.bodies if body.name in solution.fields]
    springs = [_spring(solution, connector) for connector in scene.connectors]
    low, high = box(np.concatenate([shape.points.reshape(-1, 2) for shape in bodies]))
    return [*bodies, *springs, *_guides(solution, float((high - low).max()) or 1.0)]


def box(points: Array) -> tuple[Array, Array]:
    """Lower left and upper right of the points that are finite."""
    points = points[np.isfinite(points).all(axis=1)]
    return points.min(axis=0), points.max(axis=0)


def supports_of(scene: Any) -> Iterator[tuple[str, Point]]:
    """What the ground holds, "clamp" or "pin", and where, m: clamps, grounded hinges, and fixed ends of springs."""
    for joint in scene.joints:  # guides are drawn elsewhere; of a user's own kind nothing is known
        if joint.grounded and isinstance(joint, Clamp | Pin | Weld):
            yield "clamp" if isinstance(joint, Clamp) else "pin", scene.place(joint.ends[0]).position
    yield from (("pin", c.ground) for c in scene.connectors if c.ground is not None)


def _body(solution: Any, body: Any) -> Shape:
    if isinstance(body, Beam):
        return Shape(body.name, "beam", solution.position(body.name, np.linspace(0.0, 1.0, 41)))
    keys = outline(body)
    points = [solution.position(f"{body.name}.{key}") for key in keys]
    return Shape(body.name, "rigid" if len(keys) > 1 else "mass", np.stack(points, axis=1))


def outline(body: WithPoints) -> list[str]:
    """A body's points in their order around their middle, the first again at the end; of one or two, the centre, too.

    Of a point mass, and of a body whose points all are its centre, it is the centre alone.
    """
    keys = list(body.points)
    if not any(any(body.arm(key)) for key in keys):
        return ["center"]
    if len(keys) < 3:
        keys = ["center", *keys]
    arms = np.array([body.arm(key) for key in keys])
    x, y = (arms - arms.mean(axis=0)).T
    around = [keys[k] for k in np.argsort(np.arctan2(y, x), kind="stable")]
    return [*around, around[0]]


def _spring(solution: Any, connector: Connector) -> Shape:
    first = solution.position(connector.first)
    if isinstance(connector, RotationalSpring):
        return Shape("", "rotational spring", first[:, None])
    ground = connector.ground
    last = solution.position(connector.second) if ground is None else np.full_like(first, ground)
    return Shape("", "spring", np.stack([first, last], axis=1))


def _guides(solution: Any, size: float) -> Iterator[Shape]:
    """The lines of sliders: fixed in the ground, or in a rigid body with which they move."""
    scene = solution.scene
    for joint in scene.joints:
        if isinstance(joint, Guide):
            place = np.array(scene.place(joint.ends[0]).position)
            line = place + 0.12 * size * np.array([[-1.0], [1.0]]) * joint.direction
            points = np.broadcast_to(line, (len(solution.t), 2, 2))
            if joint.body is not None:  # the line is fixed in that body
                arms = line - np.array(scene.body(joint.body).center)
                center, u = np.moveaxis(solution.fields[joint.body].coordinates, 1, 0)[:, :, None]
                across = np.stack([-u[..., 1], u[..., 0]], axis=-1)
                points = center + arms[:, :1] * u + arms[:, 1:] * across
            yield Shape("", "guide", points)
