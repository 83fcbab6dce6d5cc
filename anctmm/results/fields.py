"""Motion of a body: its nodes at each output, and interpolation between them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import ElementKind
from anctmm.elements.shapes import quintic
from anctmm.errors import ResultError
from anctmm.model.bodies import Beam

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


#: Why there is no angle.
IN_SPACE = "angles are of the plane; in space `rotation` gives the turn of a rigid body"


class Field(Protocol):
    """Motion of a body, at each of n times.

    A place is a fraction of a beam's undeformed length, from its start to its end, or the name of a rigid body's point.
    """

    def position(self, place: Any) -> Array:
        """Positions, (n, 2), m."""
        ...


class MovingField(Field, Protocol):
    """A field that knows velocities and angles, too."""

    def velocity(self, place: Any) -> Array:
        """Velocities, (n, 2), m/s."""
        ...

    def angle(self, place: Any, t: Array) -> Array:
        """Angles since t = 0, (n,), rad, continuous."""
        ...

    def spin(self, place: float) -> Array:
        """Rates of the angles, (n,), rad/s."""
        ...


class Root(NamedTuple):
    """A place of a body whose angles since the undeformed scene are known, (n,), rad, whole turns included."""

    place: Any
    angles: Array


@dataclass(frozen=True)
class HermiteField:
    """Axis of an ANCF body.

    Parameters
    ----------
    coordinates : ndarray, shape (n, nodes, 2 or 3, 2)
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

    def position(self, place: float) -> Array:
        """Positions at a fraction of the undeformed length, (n, 2), m."""
        return self._axis(self.coordinates, place)

    def velocity(self, place: float) -> Array:
        """Velocities at a fraction of the undeformed length, (n, 2), m/s.

        Raises
        ------
        ResultError
            If the solver keeps none.
        """
        return self._axis(_known(self.velocities), place)

    def angle(self, place: float, t: Array) -> Array:
        """Angle of the section since t = 0, (n,), rad: of the axis' tangent or, for the shear element, of r_y.

        Of a motion alone, without what holds the body: see `anctmm.results.whole_turns`.
        """
        known = self._counted(place) if self.counted(t) else self.angle_from(place, self.own_root(t))
        return np.asarray(known - known[:1])

    def counted(self, t: Array) -> bool:
        """Whether angles are counted at all outputs."""
        return self.turned is not None and len(self.turned) == len(t)

    def direction_angle(self, place: float) -> Array:
        """Angle of the section since the undeformed scene, (n,), rad, up to whole turns."""
        vectors = self._direction(self.coordinates, place)
        return np.asarray(np.angle(vectors * np.conj(vectors[:1])) + self.turned_before(place))

    def own_root(self, t: Array) -> Root:
        """The start, whose angle is as counted, or follows the mean rate of all nodes from one output to the next."""
        if self.start_angle is not None:
            return Root(0.0, self.turned_before(0.0) + self.start_angle - self.start_angle[:1])
        vectors, rates = self._direction(self.coordinates, 0.0), None
        if self.velocities is not None:
            r, v = _complex(self.coordinates[:, :, 0]), _complex(self.velocities[:, :, 0])
            rates = 1j * vectors * mean_spin(r, v)
        return Root(0.0, self.turned_before(0.0) + continuous(vectors, rates, t))

    def angle_from(self, place: float, root: Root) -> Array:
        """Angle of the section since the undeformed scene, (n,), rad, from that of another of the body."""
        node = round(place * (self.coordinates.shape[1] - 1))
        return nearest(self.direction_angle(place), self.node_angles(root)[:, node])

    def node_angles(self, root: Root) -> Array:
        """Angles of all nodes' sections since the undeformed scene, (n, nodes), rad, from that of one section.

        From node to node sections turn by less than half a turn.
        """
        vectors = _complex(self.coordinates[:, :, 2 if self.sections else 1])
        angles = np.angle(vectors * np.conj(vectors[:1]))
        if self.turned is not None:
            angles += self.turned[:1]
        k = round(root.place * (self.coordinates.shape[1] - 1))
        angles[:, k] = nearest(angles[:, k], root.angles)
        angles[:, k:] = np.unwrap(angles[:, k:], axis=1)
        angles[:, k::-1] = np.unwrap(angles[:, k::-1], axis=1)
        return np.asarray(angles)

    def turned_before(self, place: float) -> float:
        """Angle of the section at the first output since the undeformed scene, rad."""
        return float(self._counted(place)[:1].sum())

    def _counted(self, place: float) -> Array:
        """Angles since the undeformed scene at the outputs where they are counted, (k,), rad."""
        if self.turned is None:
            return np.empty(0)
        i = self._at(place)[0]
        here, node = (
            self._direction(self.coordinates[: len(self.turned)], x) for x in (place, self._fraction(i))
        )
        return np.asarray(self.turned[:, i] + np.angle(here * np.conj(node)))

    def spin(self, place: float) -> Array:
        """Rate of the section's angle, (n,), rad/s.

        Raises
        ------
        ResultError
            If the solver keeps none.
        """
        rates = self._direction(_known(self.velocities), place)
        return spin_of(self._direction(self.coordinates, place), rates)

    def until(self, outputs: int) -> "HermiteField":
        """The first outputs."""
        q, v, a = self.coordinates, self.velocities, self.accelerations
        kept = (_first(series, outputs) for series in (v, a, self.turned, self.start_angle))
        return type(self)(q[:outputs], self.length, *kept)

    @property
    def sections(self) -> bool:
        """Whether nodes have an r_y, which turns with the section."""
        return self.coordinates.shape[2] == 3

    def _fraction(self, node: int) -> float:
        return node / (self.coordinates.shape[1] - 1)

    def _at(self, fraction: float) -> tuple[int, float, float]:
        """Element, place in it from 0 to 1, and its length, m."""
        elements = self.coordinates.shape[1] - 1
        i = min(int(fraction * elements), elements - 1)
        return i, fraction * elements - i, self.length / elements

    def _axis(self, q: Array, fraction: float) -> Array:
        i, x, l = self._at(fraction)  # noqa: E741
        if x in (0.0, 1.0):  # a node, as most places that are asked for
            return q[:, i + int(x), 0].copy()
        return (
            (1.0 - 3.0 * x**2 + 2.0 * x**3) * q[:, i, 0]
            + l * (x - 2.0 * x**2 + x**3) * q[:, i, 1]
            + (3.0 * x**2 - 2.0 * x**3) * q[:, i + 1, 0]
            + l * (x**3 - x**2) * q[:, i + 1, 1]
        )

    def _direction(self, q: Array, fraction: float) -> Complex:
        """The vector that turns with the section, as complex numbers, (n,)."""
        i, x, l = self._at(fraction)  # noqa: E741
        if self.sections:
            vector = (1.0 - x) * q[:, i, 2] + x * q[:, i + 1, 2]
        else:
            vector = (
                6.0 * (x**2 - x) / l * (q[:, i, 0] - q[:, i + 1, 0])
                + (1.0 - 4.0 * x + 3.0 * x**2) * q[:, i, 1]
                + (3.0 * x**2 - 2.0 * x) * q[:, i + 1, 1]
            )
        return _complex(vector)


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

    def _axis(self, q: Array, fraction: float) -> Array:
        return self._sum(q, fraction, 0)

    def _direction(self, q: Array, fraction: float) -> Complex:
        return _complex(self._sum(q, fraction, 1))

    def _sum(self, q: Array, fraction: float, order: int) -> Array:
        i, x, l = self._at(fraction)  # noqa: E741
        weights = quintic(x, l, order)[0]
        return np.einsum("i,nic->nc", weights, q[:, i : i + 2].reshape(len(q), 6, 2))


#: Fields of beams, by the degree of their axes in an element.
_BEAM_FIELDS = {3: HermiteField, 5: QuinticField}


def beam_field(kind: ElementKind, body: Beam, q: Array, *rates: Array | None) -> HermiteField:
    """Motion of a beam cut into elements of a kind, from its coordinates, their rates and the angles counted."""
    return _BEAM_FIELDS[kind.element.degree](q, body.length, *rates)


@dataclass(frozen=True)
class LagrangeField:
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
        """Velocities at a fraction of the undeformed length, (n, 2), m/s.

        Raises
        ------
        ResultError
            If the solver keeps none.
        """
        return self._between(_known(self.velocities), place)

    def angle(self, place: float, t: Array) -> Array:
        """Angle of the section since t = 0, (n,), rad.

        Raises
        ------
        ResultError
            If the solver keeps none.
        """
        found = self._between(_known(self.angles, "angles"), place)
        return np.asarray(found - found[:1])

    def until(self, outputs: int) -> "LagrangeField":
        """The first outputs."""
        v, angles = _first(self.velocities, outputs), _first(self.angles, outputs)
        return replace(self, positions=self.positions[:outputs], velocities=v, angles=angles)

    def _between(self, nodal: Array, fraction: float) -> Array:
        elements = (nodal.shape[1] - 1) // self.order
        i = min(int(fraction * elements), elements - 1)
        x = fraction * elements - i
        weights = (
            (1.0 - x, x) if self.order == 1 else ((1 - x) * (1 - 2 * x), 4 * x * (1 - x), x * (2 * x - 1))
        )
        first = i * self.order
        return sum(w * nodal[:, first + k] for k, w in enumerate(weights))  # type: ignore[return-value]


@dataclass(frozen=True)
class RigidField:
    """Motion of a rigid body or a point mass.

    Parameters
    ----------
    coordinates : ndarray, shape (n, 2, 2)
        Place of the centre of mass, m, and the unit vector t that turns with the body, (1, 0) before the start.
    points : mapping of str to (float, float)
        Where its points stand from the centre, before the start, m.
    velocities, accelerations : ndarray, shape (n, 2, 2), optional
        Rates, per s and s².
    turned, start_angle : ndarray, shapes (k, 1) and (n,), optional
        As of `HermiteField`.
    """

    coordinates: Array
    points: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    velocities: Array | None = None
    accelerations: Array | None = None
    turned: Array | None = None
    start_angle: Array | None = None

    def position(self, place: str = "center") -> Array:
        """Positions of a point, (n, 2), m."""
        return self._point(self.coordinates, place)

    def velocity(self, place: str = "center") -> Array:
        """Velocities of a point, (n, 2), m/s.

        Raises
        ------
        ResultError
            If the solver keeps none.
        """
        return self._point(_known(self.velocities), place)

    def angle(self, place: str, t: Array) -> Array:
        """Angle of the body since t = 0, (n,), rad; the same at all its points.

        Of a motion alone, without what holds the body: see `anctmm.results.whole_turns`.
        """
        known = self.own_root(t).angles if self.turned is None or not self.counted(t) else self.turned[:, 0]
        return np.asarray(known - known[:1])

    def counted(self, t: Array) -> bool:
        """Whether angles are counted at all outputs."""
        return self.turned is not None and len(self.turned) == len(t)

    def direction_angle(self, place: str = "center") -> Array:
        """Angle of the body since the undeformed scene, (n,), rad, up to whole turns."""
        vectors = _complex(self.coordinates[:, 1])
        return np.asarray(np.angle(vectors * np.conj(vectors[:1])) + self.turned_before(place))

    def own_root(self, t: Array) -> Root:
        """The body, whose angle is as counted, or follows its rate from one output to the next."""
        if self.start_angle is not None:
            return Root("center", self.turned_before() + self.start_angle - self.start_angle[:1])
        rates = None if self.velocities is None else _complex(self.velocities[:, 1])
        return Root("center", self.turned_before() + continuous(_complex(self.coordinates[:, 1]), rates, t))

    def angle_from(self, place: str, root: Root) -> Array:
        """Angle since the undeformed scene, (n,), rad: the same at all points."""
        return root.angles

    def node_angles(self, root: Root) -> Array:
        """The same, (n, 1)."""
        return root.angles[:, None]

    def turned_before(self, place: Any = "center") -> float:
        """Angle of the body at the first output since the undeformed scene, rad; the same at all its points."""
        return 0.0 if self.turned is None else float(self.turned[:1].sum())

    def spin(self, place: str = "center") -> Array:
        """Rate of the body's angle, (n,), rad/s.

        Raises
        ------
        ResultError
            If the solver keeps none.
        """
        return spin_of(_complex(self.coordinates[:, 1]), _complex(_known(self.velocities)[:, 1]))

    def until(self, outputs: int) -> "RigidField":
        """The first outputs."""
        q, v, a = self.coordinates, self.velocities, self.accelerations
        kept = (_first(series, outputs) for series in (v, a, self.turned, self.start_angle))
        return RigidField(q[:outputs], self.points, *kept)

    def _point(self, q: Array, place: str) -> Array:
        if place == "center":
            return q[:, 0].copy()
        center, turn = np.ascontiguousarray(q).view(np.complex128)[..., 0].T
        return np.asarray((center + complex(*self.points[place]) * turn).view(np.float64).reshape(-1, 2))


@dataclass(frozen=True)
class SpatialRigidField:
    """Motion of a rigid body in space.

    Parameters
    ----------
    coordinates : ndarray, shape (n, 4, 3)
        Centre of mass, m, and the unit vectors along the principal axes.
    axes : ndarray, shape (3, 3)
        These unit vectors in the reference, as rows.
    points : mapping of str to ndarray, shape (3,)
        Where its points stand from the centre in the reference, m.
    velocities, accelerations : ndarray, shape (n, 4, 3), optional
        Rates, per s and s².
    """

    coordinates: Array
    axes: Array
    points: Mapping[str, Array] = field(default_factory=dict)
    velocities: Array | None = None
    accelerations: Array | None = None

    def position(self, place: str = "center") -> Array:
        """Positions of a point, (n, 3), m."""
        return self._point(self.coordinates, place)

    def velocity(self, place: str = "center") -> Array:
        """Velocities of a point, (n, 3), m/s.

        Raises
        ------
        ResultError
            If the solver keeps none.
        """
        return self._point(_known(self.velocities), place)

    def rotation(self) -> Array:
        """Matrices that turn vectors of the reference into those of the body, (n, 3, 3)."""
        return self.coordinates[:, 1:].transpose(0, 2, 1) @ self.axes

    def angle(self, place: str, t: Array) -> Array:
        """Raises ResultError: in space a turn is a matrix."""
        raise ResultError(IN_SPACE)

    def spin(self, place: str = "center") -> Array:
        """Raises ResultError."""
        raise ResultError(IN_SPACE)

    def until(self, outputs: int) -> "SpatialRigidField":
        """The first outputs."""
        v, a = _first(self.velocities, outputs), _first(self.accelerations, outputs)
        return SpatialRigidField(self.coordinates[:outputs], self.axes, self.points, v, a)

    def _point(self, q: Array, place: str) -> Array:
        if place == "center":
            return q[:, 0].copy()
        return q[:, 0] + np.einsum("k,nkc->nc", self.axes @ self.points[place], q[:, 1:])


def nearest(angle: Array, about: Array) -> Array:
    """The angles, rad, with those whole turns that bring them nearest to others."""
    return np.asarray(angle + 2.0 * np.pi * np.round((about - angle) / (2.0 * np.pi)))


def continuous(vectors: Complex, rates: Complex | None, t: Array) -> Array:
    """Angle that a vector has turned by since the first time, (n,), rad.

    From one time to the next a direction determines the rotation up to whole turns. These follow from the rates;
    without rates the rotation is less than half a turn.

    Parameters
    ----------
    vectors, rates : ndarray of complex, shape (n,)
        The vector and its rate at each time.
    t : ndarray, shape (n,)
        s.
    """
    angle = np.zeros(len(vectors))
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.angle(vectors[1:] * np.conj(vectors[:-1]))
        if rates is not None:
            spin = spin_of(vectors, rates)
            turned = 0.5 * (spin[1:] + spin[:-1]) * np.diff(t)
            steps = steps + 2.0 * np.pi * np.round((turned - steps) / (2.0 * np.pi))
    angle[1:] = np.cumsum(steps)
    return angle


def spin_of(vectors: Complex, rates: Complex) -> Array:
    """Rate at which a vector turns, (n,), rad/s."""
    return np.asarray(np.imag(rates * np.conj(vectors)) / np.abs(vectors) ** 2)


def mean_spin(positions: Complex, velocities: Complex) -> Array:
    """Rate at which a body's nodes, (n, nodes), turn about their middle in the mean, (n,), rad/s."""
    arms, rates = (x - x.mean(axis=1, keepdims=True) for x in (positions, velocities))
    return np.asarray(np.imag(rates * np.conj(arms)).sum(axis=1) / (np.abs(arms) ** 2).sum(axis=1))


def _complex(vectors: Array) -> Complex:
    if vectors.shape[-1] == 3:
        raise ResultError(IN_SPACE)
    return np.asarray(vectors[..., 0] + 1j * vectors[..., 1])


def _first(series: Array | None, outputs: int) -> Array | None:
    return None if series is None else series[:outputs]


def _known(series: Array | None, what: str = "velocities") -> Array:
    if series is None:
        raise ResultError(f"{what} are not part of this solution: its solver stores none, or it is static")
    return series
