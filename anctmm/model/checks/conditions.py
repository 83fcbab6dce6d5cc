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


def axes_of(place: Any) -> Array:
    """Axes of a place, or of a point of the ground, in the reference, (axes, dim)."""
    if not isinstance(place, Place):
        return np.eye(len(place))[: 1 if len(place) == 2 else 3]
    if isinstance(place.body, Beam):
        return np.subtract(place.body.end, place.body.start)[None] / place.body.length
    return axes_of(place.position)[: None if place.turns else 0]


def ends_of(scene: Graph, joint: Joint) -> list[Any]:
    """What a joint is attached to: places, and points of the ground."""
    return [end if is_point(end) else scene.place(end) for end in joint.attached]


def as_vectors(
    ends: Sequence[Any], axes: Sequence[Array], rigid: Sequence[bool]
) -> tuple[list[VectorPlace], list[tuple[int, int]]]:
    """Places with axes in the reference, and points of the ground, by vectors that are numbered one after another.

    Beside them: of each vector the number of its place, and which one of it it is, 0 the position, k the axis k.
    """
    known = [np.vstack([getattr(end, "position", end), *x]) for end, x in zip(ends, axes, strict=True)]
    owners = [(n, k) for n, x in enumerate(known) if isinstance(ends[n], Place) for k in range(len(x))]
    at = np.array([known[n][k] for n, k in owners]).reshape(-1, known[0].shape[1])
    number, eye = {owner: v for v, owner in enumerate(owners)}, np.eye(at.shape[1])
    found = []
    for n, x in enumerate(known):
        vectors = [
            Vector(at, {(number[n, k], None): eye}) if (n, k) in number else Vector(at, {}, {None: of})
            for k, of in enumerate(x)
        ]
        found.append(VectorPlace(vectors[0], vectors[1:], rigid[n]))
    return found, owners


def conditions_of(scene: Graph, joint: Joint) -> list[Condition]:
    """Equations of a joint at the start; PropertyError if those of a user's own kind raise, or are none."""
    ends = ends_of(scene, joint)
    rigid = [not (isinstance(end, Place) and isinstance(end.body, Beam)) for end in ends]
    seen, owners = as_vectors(ends, list(map(axes_of, ends)), rigid)
    vectors = [(ends[n], k) for n, k in owners]
    try:
        return [_condition(joint, equation, vectors) for equation in flat(joint.equations(*seen))]
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


def _condition(joint: Joint, equation: Vector | Scalar, vectors: Sequence[tuple[Place, int]]) -> Condition:
    value, slopes, signals = equation.linearised()
    factors = [(*vectors[v], J[0]) for v, J in slopes.items() if J.any()]
    return Condition(joint, value[0], factors, {w: b[0] for w, b in signals.items()})


def rate_of(w: Signal) -> float:
    """Rate of a signal at the start."""
    return float(w.at(np.array(w.history(0.0), dtype=float)[:, None])[1, 0])


def slope_of(w: Signal) -> float:
    """Derivative of a signal by its history at the start."""
    return float(w.at(np.array([[w.history(0.0)[0]], [1.0], [0.0]], dtype=float))[1, 0])
