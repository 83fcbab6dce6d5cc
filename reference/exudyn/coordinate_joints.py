"""Joints of two nodes that Exudyn does not provide: its general constraint of coordinates, with our equations.

For welds between beams and rigid bodies, driven welds, and guides fixed in rigid bodies. Exudyn's joints fix the
direction of a cable's end but not its stretch; here the whole gradient is fixed, as in the other solvers.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
History = Callable[[float], float]

#: Turn by +90°.
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True)
class Frame:
    """What joins to a node: a point that moves with it, and a direction.

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

    def position(self, q: Array) -> tuple[Array, Array]:
        """Position (2,), m, and its derivative by the coordinates, (2, width)."""
        slope = np.eye(2, self.width)
        if self.kind != "turning":
            return q[:2], slope
        turned = rotation(q[2] - self.angle) @ self.arm
        slope[:, 2] = QUARTER @ turned
        return q[:2] + turned, slope

    def gradient(self, q: Array) -> tuple[Array, Array]:
        """Direction, of a cable with its stretch, (2,), and its derivative."""
        slope = np.zeros((2, self.width))
        if self.kind == "cable":
            slope[:, 2:] = np.eye(2)
            return q[2:], slope
        turned = rotation(q[2] - self.angle) @ self.direction
        slope[:, 2] = QUARTER @ turned
        return turned, slope


Equations = Callable[[float, Array, Array], tuple[Array, Array]]
"""(t, coordinates of the one node, of the other) → residuals (n,) and their derivative, (n, both widths)."""


def coincide(one: Frame, two: Frame) -> Equations:
    """Both points at one place."""

    def equations(t: float, p: Array, q: Array) -> tuple[Array, Array]:
        (a, A), (b, B) = one.position(p), two.position(q)
        return b - a, np.hstack([-A, B])

    return equations


def aligned(one: Frame, two: Frame, turn: History) -> Equations:
    """The second direction is the first, turned as in the reference and by an angle of time."""
    between = complex(*two.direction) / complex(*one.direction)
    between /= abs(between)

    def equations(t: float, p: Array, q: Array) -> tuple[Array, Array]:
        R = rotation(turn(t)) @ np.array([[between.real, -between.imag], [between.imag, between.real]])
        (a, A), (b, B) = one.gradient(p), two.gradient(q)
        if "cable" in (one.kind, two.kind):
            return b - R @ a, np.hstack([-R @ A, B])
        angle = q[2] - two.angle - p[2] + one.angle - turn(t)
        return np.array([angle]), np.array([[0.0, 0.0, -1.0, 0.0, 0.0, 1.0]])

    return equations


def on_line(body: Frame, place: Frame, along: Array, position: History | None) -> Equations:
    """A place on a line of a body through that body's point, at a position of time along it if there is one."""
    across = QUARTER @ along
    rows = across[None] if position is None else np.stack([across, along])  # in the axes of the body

    def equations(t: float, p: Array, q: Array) -> tuple[Array, Array]:
        (a, A), (b, B) = body.position(p), place.position(q)
        R = rotation(p[2] - body.angle)
        into, apart = rows @ R.T, b - a
        slope = np.hstack([-into @ A, into @ B])
        slope[:, 2] -= into @ (QUARTER @ apart)
        values = into @ apart
        if position is not None:
            values[1] -= position(t)
        return values, slope

    return equations


def add(model: Any, one: Frame, two: Frame, *parts: Equations) -> Any:
    """Add equations between two nodes as one of Exudyn's constraints; its number."""
    width = one.width

    def split(q: Any) -> tuple[Array, Array]:
        q = np.asarray(q, dtype=float)
        return q[:width], q[width:]

    def value(mbs: Any, t: float, item: int, q: Any, q_t: Any, velocity_level: bool) -> Array:
        return np.concatenate([part(t, *split(q))[0] for part in parts])

    def slope(mbs: Any, t: float, item: int, q: Any, q_t: Any, velocity_level: bool) -> Array:
        return np.concatenate([part(t, *split(q))[1] for part in parts])

    count = sum(len(part(0.0, *(np.ones(f.width) for f in (one, two)))[0]) for part in parts)
    items = model.items
    return model.mbs.AddObject(
        items.ObjectConnectorCoordinateVector(
            markerNumbers=[
                model.mbs.AddMarker(items.MarkerNodeCoordinates(nodeNumber=frame.node))
                for frame in (one, two)
            ],
            scalingMarker0=np.zeros((count, one.width)),
            scalingMarker1=np.zeros((count, two.width)),
            constraintUserFunction=value,
            jacobianUserFunction=slope,
        )
    )


def rotation(angle: float) -> Array:
    """Matrix that turns by an angle, rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
