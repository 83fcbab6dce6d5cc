"""What joints demand of their places at the start: their equations, linearised, of a scene without a mesh.

A place moves by its position and its axes: those of the reference in a rigid body, r_x of a beam, none of a point mass.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import AnctmmError, PropertyError, reason, shown
from anctmm.model.bodies import Beam
from anctmm.model.expressions import Scalar, Signal, Vector
from anctmm.model.joints import Joint
from anctmm.model.places import Graph, Place
from anctmm.validation import is_point

Array = NDArray[np.float64]


class Condition(NamedTuple):
    """An equation of a joint at the start: its value, (m,), zero where the joint holds.

    `factors`: derivatives, (m, dim), by the position of a place (0), or by one of its axes (from 1 on); `drives`: those
    by signals, (m,).
    """

    joint: Joint
    value: Array
    factors: list[tuple[Place, int, Array]]
    drives: Mapping[Signal, Array]

    @property
    def driven(self) -> Array:
        """Its rate by drives alone, (m,)."""
        return sum((b * rate_of(w) for w, b in self.drives.items()), np.zeros(len(self.value)))

    @property
    def directs(self) -> bool:
        """Whether it holds axes, and no positions."""
        return all(axis for _, axis, _ in self.factors)

    @property
    def places(self) -> list[Place]:
        """All places in it, each once."""
        return list({place.end: place for place, _, _ in self.factors}.values())


@dataclass(frozen=True)
class VectorPlace:
    """A place by its vectors, as equations of joints see it: see `anctmm.model.joints.Joint.equations`."""

    position: Vector
    gradients: list[Vector]
    rigid: bool

    @property
    def direction(self) -> Vector:
        """The vector that a torque turns: r_y of a shear element, which has two gradients, of others the first."""
        return self.gradients[1] if len(self.gradients) == 2 else self.gradients[0]

    def axis(self, k: int) -> Vector:
        """Axis k; where there is one, the second is normal to it."""
        return self.gradients[0].normal if k == len(self.gradients) == 1 else self.gradients[k]

    def fixed_point(self, point: Any) -> Vector:
        """A point that is fixed in the rigid body of the place."""
        found = self.position
        for k, x in enumerate(np.subtract(point, self.position.start)):
            found = found + float(x) * self.axis(k)
        return found


def axes_of(place: Place) -> Array:
    """Axes of a place in the reference, (axes, dim)."""
    if isinstance(place.body, Beam):
        return np.subtract(place.body.end, place.body.start)[None] / place.body.length
    dim = len(place.position)
    return np.eye(dim)[: 0 if not place.turns else 1 if dim == 2 else 3]


def conditions_of(scene: Graph, joint: Joint) -> list[Condition]:
    """Equations of a joint at the start; PropertyError if those of a user's own kind raise, or are none."""
    ends = [end if is_point(end) else scene.place(end) for end in joint.attached]
    vectors = [
        (end, k, x)
        for end in ends
        if isinstance(end, Place)
        for k, x in enumerate([np.array(end.position), *axes_of(end)])
    ]
    at = np.array([x for _, _, x in vectors])
    try:
        return [_condition(joint, equation, vectors) for equation in flat(joint.equations(*_seen(ends, at)))]
    except AnctmmError:
        raise
    except Exception as error:  # of a user's own kind
        raise PropertyError(
            f"{shown(joint)} has equations that raise {reason(error)}; a list of vectors and scalars is needed"
        ) from error


def flat(equations: Sequence[Any]) -> Iterator[Vector | Scalar]:
    """Equations, those of sequences one by one."""
    for equation in equations:
        yield from [equation] if isinstance(equation, Vector | Scalar) else flat(equation)


def _seen(ends: Sequence[Any], at: Array) -> list[VectorPlace]:
    """Places of bodies, whose vectors have numbers one after another, and of the ground."""
    found, first, (_, dim) = list[VectorPlace](), 0, at.shape
    for end in ends:
        if not isinstance(end, Place):
            position, *axes = (Vector(at, {}, {None: x}) for x in (np.array(end), *np.eye(dim)))
            found.append(VectorPlace(position, axes[: 1 if dim == 2 else 3], True))
            continue
        count = 1 + len(axes_of(end))
        position, *axes = (Vector(at, {(k, None): np.eye(dim)}) for k in range(first, first + count))
        found.append(VectorPlace(position, axes, not isinstance(end.body, Beam)))
        first += count
    return found


def _condition(
    joint: Joint, equation: Vector | Scalar, vectors: Sequence[tuple[Place, int, Any]]
) -> Condition:
    factors = [
        (*vectors[x][:2], np.atleast_2d(J)) for x, J in equation.by_vector().items() if np.asarray(J).any()
    ]
    drives = {w: np.atleast_1d(b) for w, b in equation.by_signal().items() if w is not None}
    return Condition(joint, np.atleast_1d(equation.start), factors, drives)


def rate_of(w: Signal) -> float:
    """Rate of a signal at the start."""
    return float(w.at(np.array(w.history(0.0), dtype=float)[:, None])[1, 0])


def slope_of(w: Signal) -> float:
    """Derivative of a signal by its history at the start."""
    return float(w.at(np.array([[w.history(0.0)[0]], [1.0], [0.0]], dtype=float))[1, 0])
