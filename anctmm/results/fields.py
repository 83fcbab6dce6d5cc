"""Motion of a body: its nodes at each output, and interpolation between them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import ElementKind
from anctmm.elements.shapes import hermite, quintic
from anctmm.errors import ResultError
from anctmm.model.bodies import Beam
from anctmm.model.expressions import QUARTER_TURN

Array = NDArray[np.float64]


class Field(Protocol):
    """Motion of a body, at each of n times; those that know more have `velocity`, `angle` and `spin`, too.

    A place is a fraction of a beam's undeformed length, from its start to its end, or the name of a rigid body's point.
    """

    def position(self, place: Any) -> Array:
        """Positions, (n, dim), m."""
        ...


class _Series:
    """What all fields share: series of numbers at outputs, and vectors that are linear in them."""

    def until(self, outputs: int) -> Self:
        """The first outputs."""
        series = ((f.name, getattr(self, f.name)) for f in fields(self))  # type: ignore[arg-type]
        return replace(self, **{name: x[:outputs] for name, x in series if isinstance(x, np.ndarray)})  # type: ignore[type-var]


class NodalField(_Series):
    """Motion that nodes with vectors give; see `HermiteField` and `RigidField`.

    `velocity` and `spin` raise ResultError if the solver keeps no velocities.
    """

    coordinates: Array
    velocities: Array | None
    accelerations: Array | None
    turned: Array | None
    start_angle: Array | None

    def position(self, place: Any) -> Array:
        """Positions of a place, (n, dim), m."""
        return self._vector(self.coordinates, place, 0)

    def velocity(self, place: Any) -> Array:
        """Velocities of a place, (n, dim), m/s."""
        return self._vector(_known(self.velocities), place, 0)

    def direction(self, place: Any) -> Array:
        """The vector that turns with a place: the tangent of an axis, r_y of a shear element; (n, dim)."""
        return self._vector(self.coordinates, place, 1)

    def spin(self, place: Any) -> Array:
        """Rate of the angle of a place, (n,), rad/s."""
        vectors, rates = self.direction(place), self._vector(_known(self.velocities), place, 1)
        return np.asarray(cross(vectors, rates) / np.square(vectors).sum(axis=1))

    def _vector(self, q: Array, place: Any, order: int) -> Array:
        raise NotImplementedError


@dataclass(frozen=True)
class HermiteField(NodalField):
    """Axis of an ANCF body.

    Parameters
    ----------
    coordinates : ndarray, shape (n, nodes, 2 or 3, dim)
        r (m), r_x and, for the shear element, r_y of each node at each time.
    length : float
        Undeformed length of the body, m.
    velocities, accelerations : ndarray, shape like coordinates, optional
        Their rates, per s and s².
    turned : ndarray, shape (k, nodes), optional
        Angles of the nodes' sections since the undeformed scene at the first k outputs, rad, where they are counted: in
        statics at each, in a motion that starts from an equilibrium at the first.
    start_angle : ndarray, shape (n,), optional
        Angle of the body's start, rad, from any direction, whole turns included, as the solver counted them at each
        step.
    """

    coordinates: Array
    length: float
    velocities: Array | None = None
    accelerations: Array | None = None
    turned: Array | None = None
    start_angle: Array | None = None

    @property
    def sections(self) -> bool:
        """Whether nodes have an r_y, which turns with the section."""
        return self.coordinates.shape[2] == 3

    @property
    def node_directions(self) -> Array:
        """The vectors that turn with the nodes, (n, nodes, dim)."""
        return self.coordinates[:, :, 2 if self.sections else 1]

    def node(self, place: float) -> int:
        """Number of the node next to a place."""
        return round(place * (self.coordinates.shape[1] - 1))

    def gradients(self, place: float) -> list[Array]:
        """r_x at a place and, of the shear element, r_y, each (n, dim)."""
        return [self._axis(self.coordinates, place, 1), *([self.direction(place)] if self.sections else [])]

    def _vector(self, q: Array, place: float, order: int) -> Array:
        if order and self.sections:
            i, x = self._at(place)
            return np.asarray((1.0 - x) * q[:, i, 2] + x * q[:, i + 1, 2])
        return self._axis(q, place, order)

    def _axis(self, q: Array, place: float, order: int) -> Array:
        """The axis, or its derivative."""
        i, x = self._at(place)
        if x in (0.0, 1.0):  # a node, as most places that are looked at
            return q[:, i + int(x), order].copy()
        weights = self._shape(x, self.length / (q.shape[1] - 1), order)
        vectors = q[:, i : i + 2, : len(weights) // 2].reshape(len(q), len(weights), -1)
        return np.einsum("i,nic->nc", weights, vectors)

    def _shape(self, x: float, l: float, order: int) -> Array:  # noqa: E741
        return hermite(x, l, order)[0]

    def _at(self, place: float) -> tuple[int, float]:
        """Element, and place in it from 0 to 1."""
        elements = self.coordinates.shape[1] - 1
        i = min(int(place * elements), elements - 1)
        return i, place * elements - i


@dataclass(frozen=True)
class InterpolatedField(HermiteField):
    """Axis through the nodes of elements of another kind, in the directions that these give: its forces are not known.

    Its parameters are those of `HermiteField`.
    """


@dataclass(frozen=True)
class QuinticField(HermiteField):
    """Axis of a body of quintic cables, whose nodes have r (m), r_x and l r_xx; l is the length of an element.

    Its parameters are those of `HermiteField`.
    """

    @property
    def sections(self) -> bool:
        """Whether nodes have an r_y: no."""
        return False

    def _shape(self, x: float, l: float, order: int) -> Array:  # noqa: E741
        return quintic(x, l, order)[0]


#: Fields of beams, by the degree of their axes in an element.
_BEAM_FIELDS = {3: HermiteField, 5: QuinticField}


def beam_field(kind: ElementKind, body: Beam, q: Array, *rates: Array | None) -> HermiteField:
    """Motion of a beam cut into elements of a kind, from its coordinates, their rates and the angles counted."""
    return _BEAM_FIELDS[kind.element.degree](q, body.length, *rates)


@dataclass(frozen=True)
class RigidField(NodalField):
    """Motion of a rigid body or a point mass.

    Parameters
    ----------
    coordinates : ndarray, shape (n, 2, 2), or (n, 4, 3) in space
        Place of the centre of mass, m, and the unit vector t that turns with the body, (1, 0) before the start; in
        space those along the principal axes.
    points : mapping of str to tuple of float
        Where its points stand from the centre, before the start, m; in space along the principal axes.
    velocities, accelerations, turned, start_angle
        As of `HermiteField`, of one node.
    axes : tuple, shape (3, 3)
        In space the principal axes in the reference, as rows.
    """

    coordinates: Array
    points: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    velocities: Array | None = None
    accelerations: Array | None = None
    turned: Array | None = None
    start_angle: Array | None = None
    axes: tuple[tuple[float, ...], ...] = ()

    def rotation(self) -> Array:
        """In space the matrices that turn vectors of the reference into those of the body, (n, 3, 3)."""
        return self.coordinates[:, 1:].transpose(0, 2, 1) @ np.array(self.axes)

    @property
    def node_directions(self) -> Array:
        """The vector that turns with the body, (n, 1, dim)."""
        return self.coordinates[:, 1:2]

    def node(self, place: str) -> int:
        """Number of the node: 0."""
        return 0

    def gradients(self, place: str) -> list[Array]:
        """The vector that turns with the body, in space e_x, e_y and e_z as they turn with it, each (n, dim)."""
        return list(self.rotation().transpose(2, 0, 1)) if self.axes else [self.coordinates[:, 1]]

    def _vector(self, q: Array, place: str, order: int) -> Array:
        return q[:, 1] if order else self._point(q, place)

    def _point(self, q: Array, place: str) -> Array:
        if place == "center":
            return q[:, 0].copy()
        axes = [q[:, 1], q[:, 1] @ QUARTER_TURN.T] if q.shape[2] == 2 else [q[:, k] for k in (1, 2, 3)]
        return np.asarray(q[:, 0] + sum(a * axis for a, axis in zip(self.points[place], axes, strict=True)))


@dataclass(frozen=True)
class LagrangeField(_Series):
    """Axis interpolated from equally spaced nodes: elements of `order` + 1 nodes each.

    Parameters
    ----------
    positions : ndarray, shape (n, elements * order + 1, 2)
        m.
    order : int
        1 or 2.
    velocities : ndarray, shape like positions, optional
        m/s.
    angles : ndarray, shape (n, elements * order + 1), optional
        Turns of the sections, rad.
    """

    positions: Array
    order: int = 1
    velocities: Array | None = None
    angles: Array | None = None

    def position(self, place: float) -> Array:
        """Positions at a fraction of the undeformed length, (n, 2), m."""
        return self._between(self.positions, place)

    def velocity(self, place: float) -> Array:
        """Velocities at a fraction of the undeformed length, (n, 2), m/s; errors as of `HermiteField`."""
        return self._between(_known(self.velocities), place)

    def angle(self, place: float, t: Array) -> Array:
        """Angle of the section since t = 0, (n,), rad; errors as of `HermiteField`."""
        found = self._between(_known(self.angles, "angles"), place)
        return np.asarray(found - found[:1])

    def _between(self, nodal: Array, fraction: float) -> Array:
        elements = (nodal.shape[1] - 1) // self.order
        i = min(int(fraction * elements), elements - 1)
        x, first = fraction * elements - i, i * self.order
        quadratic = ((1.0 - x) * (1.0 - 2.0 * x), 4.0 * x * (1.0 - x), x * (2.0 * x - 1.0))
        weights = (1.0 - x, x) if self.order == 1 else quadratic
        return sum(w * nodal[:, first + k] for k, w in enumerate(weights))  # type: ignore[return-value]


def as_complex(vectors: Array) -> NDArray[np.complex128]:
    """Vectors of the plane as complex numbers."""
    return np.asarray(vectors[..., 0] + 1j * vectors[..., 1])


def cross(a: Array, b: Array) -> Array:
    """a × b of vectors of the plane, (…, 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _known(series: Array | None, what: str = "velocities") -> Array:
    if series is None:
        raise ResultError(f"{what} are not part of this solution: its solver stores none, or it is static")
    return series
