"""Bodies cut into nodes: beams into equal elements, rigid bodies and point masses into one node or two.

The coordinates of a node are vectors: r and r_x of a cable, r, r_x and r_y of a shear element, r, r_x and l r_xx of a
quintic cable, r of a point mass. A rigid body in the plane has its centre r and a unit vector u, (1, 0) in the
reference, or, where two of its points are joined, the places of these two: a pin is then a shared vector. In space it
has r, u, v, w, the unit vectors along its principal axes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import VECTORS, Element, ElementKind
from anctmm.model.bodies import Beam
from anctmm.model.expressions import QUARTER_TURN, Scalar, Vector
from anctmm.model.rigid_bodies import CENTER, PointMass, RigidBody
from anctmm.model.velocities import second_derivative

Array = NDArray[np.float64]
Form = dict[int, Array]
"""A vector of a body, linear in its coordinate vectors: the (dim, dim) matrix of each, by number in the body."""

#: Distance of a place from a node, in lengths of an element, at which it is the node.
AT_NODE = 1e-9
#: Gauss points over a bar at which initial velocities are taken.
POINTS = 8


@dataclass(frozen=True)
class BeamMesh:
    """A beam cut into equal elements.

    Parameters
    ----------
    body : Beam
    kind : ElementKind
    elements : int
    element : Element
        Every one of them.
    """

    body: Beam
    kind: ElementKind
    elements: int
    element: Element

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return self.elements + 1

    @property
    def vectors(self) -> int:
        """Coordinate vectors of a node."""
        return len(self.kind.vectors)

    @cached_property
    def along(self) -> Array:
        """Unit vector from start to end in the reference, (dim,)."""
        return np.subtract(self.body.end, self.body.start) / self.body.length

    @cached_property
    def reference(self) -> Array:
        """Coordinates of the undeformed body, (nodes, vectors, dim)."""
        x = np.arange(self.nodes)[:, None] / self.elements
        found = np.zeros((self.nodes, self.vectors, len(self.along)))
        for k, name in enumerate(self.kind.vectors):
            match VECTORS[name].derivative:
                case None:
                    found[:, k] = QUARTER_TURN @ self.along
                case 0:
                    found[:, k] = (1.0 - x) * self.body.start + x * self.body.end
                case 1:
                    found[:, k] = self.along
        return found

    @cached_property
    def initial_velocity(self) -> Array:
        """Velocities of the coordinates at t = 0, (nodes, vectors, dim).

        Those of derivatives of the axis are derivatives of the velocity; a director turns with the axis.
        """
        found, body = np.zeros_like(self.reference), self.body
        if body.velocity is None:
            return found
        fractions = np.linspace(0.0, 1.0, self.nodes).tolist()
        for k, name in enumerate(self.kind.vectors):
            match VECTORS[name].derivative:
                case None:
                    normal = self.reference[0, k]
                    found[:, k] = -(found[:, 1] @ normal)[:, None] * self.along
                case 0:
                    found[:, k] = [body.velocity_at(s) for s in fractions]
                case 1:
                    found[:, k] = [np.divide(body.velocity_slope_at(s), body.length) for s in fractions]
                case 2:
                    rates = [second_derivative(body.velocity_at, s, self.elements) for s in fractions]
                    found[:, k] = np.array(rates) * self.element.l / body.length**2
        return found

    @cached_property
    def weight(self) -> Array:
        """Consistent nodal masses, (nodes, vectors), kg: times gravity they are the weight."""
        return self.spread(self.element.gravity)

    def spread(self, of_element: Array) -> Array:
        """A number of each nodal vector of an element, summed over all elements, (nodes, vectors)."""
        found, parts = np.zeros((self.nodes, self.vectors)), of_element.reshape(2, self.vectors)
        found[:-1] += parts[0]
        found[1:] += parts[1]
        return found

    def position(self, fraction: Any) -> Form:
        """The position of a place."""
        node, inside = self.within(fraction)
        return self._form(node, self.element.axis(inside)[0]) if inside else {node * self.vectors: self._one}

    def gradients(self, fraction: Any) -> list[Form]:
        """The vectors that joints hold at a place beside its position: r_x, and r_y of a shear element."""
        node, inside = self.within(fraction)
        if not inside:
            return [{node * self.vectors + k: self._one} for k in range(1, len(self.kind.held))]
        found = [self._form(node, self.element.axis(inside, 1)[0])]
        return found if len(self.kind.held) == 2 else [*found, self.direction(fraction)]

    def direction(self, fraction: Any) -> Form:
        """The vector that a torque turns at a place: r_x, or r_y of a shear element."""
        node, inside = self.within(fraction)
        if not inside:
            return {node * self.vectors + self.kind.turned_vector: self._one}
        return self._form(node, self.element.turning(inside)[0])

    def within(self, fraction: Any) -> tuple[int, float]:
        """Node before a place, and the part of the element behind it; 0 at the node."""
        along = float(fraction) * self.elements
        nearest = round(along)
        return (nearest, 0.0) if abs(along - nearest) <= AT_NODE else (int(along), along - int(along))

    @property
    def _one(self) -> Array:
        return np.eye(len(self.along))

    def _form(self, node: int, weights: Array) -> Form:
        first = node * self.vectors
        return {first + k: float(w) * self._one for k, w in enumerate(weights) if w != 0.0}


@dataclass(frozen=True)
class MassMesh:
    """A point mass."""

    body: PointMass
    vectors = 1
    nodes = 1
    elements = 0

    @property
    def reference(self) -> Array:
        """Its place, (1, 1, dim)."""
        return np.array([[self.body.position]])

    @property
    def initial_velocity(self) -> Array:
        """Its velocity, (1, 1, dim)."""
        return np.array([[self.body.velocity]])

    @property
    def mass_matrix(self) -> Array:
        """Mass, (dim, dim)."""
        return self.body.mass * np.eye(len(self.body.position))

    @property
    def weight(self) -> Array:
        """The mass, (1, 1), kg."""
        return np.array([[self.body.mass]])

    def position(self, key: Any) -> Form:
        """Its place."""
        return {0: np.eye(len(self.body.position))}


@dataclass(frozen=True)
class RigidMesh:
    """A rigid body, or a beam of element "rigid", in the plane.

    Parameters
    ----------
    body : RigidBody or Beam
    mass, inertia : float
        kg; about the centre of mass, kg m².
    center, velocity : ndarray, shape (2,)
        In the reference, m; at t = 0, m/s.
    spin : float
        rad/s.
    anchors : pair of ndarray, shape (2,), or None
        Places in the reference whose positions are its coordinates; r and u without them.
    """

    body: Any
    mass: float
    inertia: float
    center: Array
    velocity: Array
    spin: float
    anchors: tuple[Array, Array] | None = None
    vectors = 2
    nodes = 1
    elements = 0

    def place(self, key: Any) -> Array:
        """A point in the reference, (2,)."""
        return np.asarray(self.body.position_at(key))

    @cached_property
    def reference(self) -> Array:
        """Coordinates, (1, 2, 2)."""
        return np.array([[self.center, (1.0, 0.0)] if self.anchors is None else self.anchors])

    @cached_property
    def initial_velocity(self) -> Array:
        """Velocities of the coordinates, (1, 2, 2)."""
        if self.anchors is None:
            return np.array([[self.velocity, (0.0, self.spin)]])
        return np.array([[self._velocity(point) for point in self.anchors]])

    def _velocity(self, point: Array) -> Array:
        return self.velocity + self.spin * (QUARTER_TURN @ (point - self.center))

    def point(self, place: Array) -> Form:
        """A point that is fixed in the body, by its place in the reference."""
        eye = np.eye(2)
        if self.anchors is None:
            x, y = place - self.center
            turn = x * eye + y * QUARTER_TURN
            return {0: eye, 1: turn} if turn.any() else {0: eye}
        for k, anchor in enumerate(self.anchors):
            if not (place - anchor).any():
                return {k: eye}
        turn = self._turn(place - self.anchors[0])
        return {0: eye - turn, 1: turn}

    def position(self, key: Any) -> Form:
        """One of its points, by name or fraction."""
        return self.point(self.place(key))

    def direction(self, key: Any = None) -> Form:
        """The unit vector u that is (1, 0) in the reference."""
        if self.anchors is None:
            return {1: np.eye(2)}
        turn = self._turn(np.array([1.0, 0.0]))
        return {0: -turn, 1: turn}

    def gradients(self, key: Any = None) -> list[Form]:
        """The vectors that joints hold: u."""
        return [self.direction()]

    def frame(self) -> list[Form]:
        """The unit vector u."""
        return [self.direction()]

    def shape(self, axes: Sequence[Vector]) -> list[Scalar]:
        """What is zero of u, which stays a unit vector."""
        u = axes[0]
        return [0.5 * (u @ u - float(u.start @ u.start))]

    def _turn(self, vector: Array) -> Array:
        """Matrix that makes a vector fixed in the body of the difference of both anchors."""
        assert self.anchors is not None  # as the callers have checked
        x, y = self.anchors[1] - self.anchors[0]
        a, b = vector
        return ((a * x + b * y) * np.eye(2) + (b * x - a * y) * QUARTER_TURN) / (x * x + y * y)

    @cached_property
    def mass_matrix(self) -> Array:
        """Constant mass matrix of the node, (4, 4): |u̇| is the angular velocity."""
        center, turn = (_matrix(form) for form in (self.point(self.center), self.direction()))
        return self.mass * center.T @ center + self.inertia * turn.T @ turn

    @cached_property
    def weight_matrix(self) -> Array:
        """Matrix, (4, 2), kg: times gravity it is the weight."""
        return self.mass * _matrix(self.point(self.center)).T


@dataclass(frozen=True)
class SpatialMesh:
    """A rigid body in space: two nodes, (r, u) and (v, w), with the principal axes u, v, w.

    Parameters
    ----------
    body : RigidBody
    axes : ndarray, shape (3, 3)
        Principal axes in the reference, as rows.
    moments : ndarray, shape (3,)
        Principal moments of inertia about the centre of mass, kg m².
    """

    body: RigidBody
    axes: Array
    moments: Array
    vectors = 2
    nodes = 2
    elements = 0

    @cached_property
    def reference(self) -> Array:
        """Coordinates, (2, 2, 3)."""
        return np.array([[self.body.center, self.axes[0]], self.axes[1:]])

    @cached_property
    def initial_velocity(self) -> Array:
        """Velocities of the coordinates, (2, 2, 3)."""
        spin = np.asarray(self.body.spin)
        rates = np.cross(spin, self.axes)
        return np.array([[self.body.velocity, rates[0]], rates[1:]])

    def _fixed(self, vector: Array) -> Form:
        """A vector that is fixed in the body."""
        return {k + 1: float(a) * np.eye(3) for k, a in enumerate(self.axes @ vector) if a != 0.0}

    def point(self, place: Array) -> Form:
        """A point that is fixed in the body, by its place in the reference."""
        return {0: np.eye(3), **self._fixed(place - np.asarray(self.body.center))}

    def position(self, key: Any) -> Form:
        """One of its points, by name."""
        return self.point(np.asarray(self.body.position_at(key)))

    def gradients(self, key: Any = None) -> list[Form]:
        """The vectors that joints hold: u, v and w, which are e_x, e_y and e_z in the reference."""
        return [self._fixed(axis) for axis in np.eye(3)]

    def direction(self, key: Any = None) -> Form:
        """The vector that is e_x in the reference."""
        return self._fixed(np.array([1.0, 0.0, 0.0]))

    def shape(self, axes: Sequence[Vector]) -> list[list[Scalar]]:
        """What is zero of u, v and w, which stay unit vectors at right angles."""
        u, v, w = axes
        return [[*(0.5 * (a @ a - 1.0) for a in axes), u @ v, v @ w, w @ u]]

    def frame(self) -> list[Form]:
        """The coordinate vectors u, v and w."""
        return [{k: np.eye(3)} for k in (1, 2, 3)]

    @property
    def second_moments(self) -> Array:
        """Those of u, v and w, ½ tr J − J_k, kg m²."""
        return 0.5 * self.moments.sum() - self.moments

    @cached_property
    def mass_matrix(self) -> Array:
        """Diagonal mass matrix of both nodes, (12, 12)."""
        diagonal = np.diag([self.body.mass, *self.second_moments])
        return np.asarray(np.kron(diagonal, np.eye(3)), dtype=np.float64)


BodyMesh = BeamMesh | MassMesh | RigidMesh | SpatialMesh


def _matrix(form: Form) -> Array:
    """A form of two vectors as a matrix, (dim, 2 dim)."""
    zero = np.zeros_like(next(iter(form.values())))
    return np.hstack([form.get(k, zero) for k in range(2)])


def rigid_mesh(body: RigidBody | Beam, joined: Sequence[Array]) -> RigidMesh | SpatialMesh:
    """Mesh of a rigid body, with the two of its joined places that are farthest apart as coordinates, if there are two.

    joined: places in the reference that joints hold the position of, each (dim,).
    """
    if isinstance(body, Beam):
        start, end = np.array(body.start), np.array(body.end)
        inertia = body.mass * body.length**2 / 12.0
        motion = _mean_motion(body)
        return RigidMesh(
            body, body.mass, inertia, 0.5 * (start + end), *motion, _anchors(body.length, joined)
        )
    if len(body.center) == 3:
        moments, axes = np.linalg.eigh(np.asarray(body.inertia))
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        return SpatialMesh(body, axes.T.copy(), moments)
    center, velocity = np.array(body.center), np.array(body.velocity)
    return RigidMesh(
        body, body.mass, float(body.inertia), center, velocity, body.spin, _anchors(body.extent, joined)
    )


def _anchors(extent: float, joined: Sequence[Array]) -> tuple[Array, Array] | None:
    """The two places that are farthest apart, none where they are close beside the extent of the body."""
    pairs = [
        (float(np.hypot(*(b - a))), k, m) for k, a in enumerate(joined) for m, b in enumerate(joined[:k])
    ]
    distance, k, m = max(pairs, default=(0.0, 0, 0))
    return (joined[m], joined[k]) if distance > 0.1 * extent else None


def _mean_motion(body: Beam) -> tuple[Array, float]:
    """Velocity of the centre and spin with the momenta of a beam's initial velocities."""
    if body.velocity is None:
        return np.zeros(2), 0.0
    fractions, weights = np.polynomial.legendre.leggauss(POINTS)
    v = np.array([body.velocity_at(0.5 * (1.0 + x)) for x in fractions.tolist()])
    across = v @ (QUARTER_TURN @ (np.subtract(body.end, body.start) / body.length))
    return 0.5 * weights @ v, float(3.0 * weights @ (across * fractions) / body.length)


__all__ = ["CENTER", "BeamMesh", "BodyMesh", "Form", "MassMesh", "RigidMesh", "SpatialMesh", "rigid_mesh"]
