"""Coordinates of a scene: every body has its own, beam after beam, node after node, then bodies that do not deform.

A node of a beam has the vectors of its kind of element. A rigid body has its centre r and a unit vector t that turns
with it, (1, 0) in the reference configuration; a point mass has r alone. Places, gradients and directions are linear
in the coordinates.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from warnings import warn

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import VECTORS, ElementKind, check_kinds, kind_of
from anctmm.errors import StartWarning
from anctmm.model.accepted import Point
from anctmm.model.bodies import Beam
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Scene
from anctmm.model.velocities import second_derivative
from reference.adapters import nodes_of, slopes_of
from reference.global_dae.vectors import Vector

Array = NDArray[np.float64]

#: Kinds of element that the solver has.
ELEMENTS = ("cable", "shear", "quintic", "rigid")
#: Distance of a place from a node, in elements, that counts as none.
AT_NODE = 1e-9
#: Stretching of a rigid beam's initial velocity, of its size, that counts as none.
STRETCHING = 1e-9


@dataclass(frozen=True)
class Mesh:
    """A flexible beam in equal elements; `first` is the number of its first coordinate."""

    body: Beam
    kind: ElementKind
    elements: int
    element: Any
    first: int

    @property
    def vectors(self) -> int:
        """Coordinate vectors of a node."""
        return len(self.kind.vectors)

    @property
    def orders(self) -> list[int | None]:
        """Order of the derivative of the axis that each vector of a node is, None of the director."""
        return [VECTORS[name].derivative for name in self.kind.vectors]

    @property
    def own(self) -> slice:
        """Its coordinates."""
        return slice(self.first, self.first + 2 * self.vectors * (self.elements + 1))

    def number(self, node: int, vector: int) -> int:
        """Number of the x component of a vector of a node."""
        return self.first + 2 * (node * self.vectors + vector)

    def reference(self) -> Array:
        """Coordinates of the undeformed beam, (nodes, vectors, 2)."""
        along = (np.array(self.body.end) - self.body.start) / self.body.length
        vectors = {0: nodes_of(self.body, self.elements)[0], 1: along, None: np.array([-along[1], along[0]])}
        q = np.zeros((self.elements + 1, self.vectors, 2))
        for k, order in enumerate(self.orders):
            q[:, k] = vectors.get(order, 0.0)
        return q

    def velocity(self) -> Array:
        """Rates of the coordinates at t = 0, (nodes, vectors, 2), as of the beam; the director turns with the axis."""
        body, v = self.body, np.zeros((self.elements + 1, self.vectors, 2))
        if body.velocity is None:
            return v
        q, slopes = self.reference()[0], slopes_of(body, self.elements)
        vectors = {0: nodes_of(body, self.elements)[1], 1: slopes, None: -(slopes @ q[-1])[:, None] * q[1]}
        if 2 in self.orders:
            s = np.linspace(0.0, 1.0, self.elements + 1).tolist()
            bend = [second_derivative(body.velocity_at, x, self.elements) for x in s]
            vectors[2] = np.array(bend) * self.element.l / body.length**2
        for k, order in enumerate(self.orders):
            v[:, k] = vectors[order]
        return v


class Layout:
    """A scene as discretised, without its joints and forces.

    `meshes` has the flexible beams by name, `rigid` the bodies that do not deform, thin bars in place of beams of
    element "rigid" among them, and `first` the number of the first coordinate of each of these. `reference` and
    `velocity` are all coordinates of the undeformed scene and their rates at t = 0, (size,), `unit` is the size that a
    correction of each is compared with: the scene's length, m, or 1 of gradients. The first `flexible` coordinates are
    those of beams.

    Raises
    ------
    DiscretisationError
        Where a kind of element is not known here.
    """

    def __init__(self, scene: Scene, run: Discretisation) -> None:
        self.scene, self.run = scene, run
        self.meshes: dict[str, Mesh] = {}
        self.rigid: dict[str, RigidBody | PointMass] = {}
        self.first: dict[str, int] = {}
        parts: list[tuple[Array, Array, list[bool]]] = []
        cut, self.size = run.of(scene), 0
        check_kinds(cut, ELEMENTS, "the global solver")
        kinds = {name: kind_of(element) for name, (_, element) in cut.items()}
        flexible = [body for body in scene.beams if not kinds[body.name].rigid]
        for body in flexible:
            kind, count = kinds[body.name], cut[body.name][0]
            mesh = Mesh(body, kind, count, kind.element_of(body, count, run.quadrature), self.size)
            self.meshes[body.name], self.size = mesh, mesh.own.stop
            places = ([True] * 2 + [False] * (2 * mesh.vectors - 2)) * (count + 1)
            parts.append((mesh.reference().ravel(), mesh.velocity().ravel(), places))
        self.flexible = self.size
        for other in (body for body in scene.bodies if body.name not in self.meshes):
            solid = thin_bar(other) if isinstance(other, Beam) else other
            turns, rates = ([1.0, 0.0], [0.0, solid.spin]) if isinstance(solid, RigidBody) else ([], [])
            self.rigid[other.name], self.first[other.name] = solid, self.size
            start, v = np.array([*solid.position_at("center"), *turns]), np.array([*solid.velocity, *rates])
            parts.append((start, v, [True] * 2 + [False] * len(turns)))
            self.size += len(start)
        self.reference, self.velocity, self.places = (np.concatenate(p) for p in zip(*parts, strict=True))
        self.unit = np.where(self.places, scene.length, 1.0)

    def owner(self, number: int) -> tuple[str, int | None]:
        """Body, and of a flexible beam the element, that a coordinate belongs to."""
        for name, mesh in self.meshes.items():
            if mesh.own.start <= number < mesh.own.stop:
                return name, min((number - mesh.first) // (2 * mesh.vectors), mesh.elements - 1)
        return max((at, name) for name, at in self.first.items() if at <= number)[1], None

    # --- places --------------------------------------------------------------------------------------------

    def position(self, place: Place) -> Vector:
        """Position of a place."""
        body = self.rigid.get(place.body.name)
        if body is None:
            return self._axis(place, 0)
        if isinstance(body, PointMass):
            return Vector.of([(self.first[place.body.name], 1.0)])
        return self.point(place.body.name, place.position)

    def point(self, name: str, position: Point) -> Vector:
        """The point of a rigid body that is at a position in the reference."""
        x, y = np.subtract(position, self.rigid[name].position_at("center")).tolist()
        at = np.arange(4) + self.first[name]
        return Vector(at, np.array([[1.0, 0.0, x, -y], [0.0, 1.0, y, x]]), np.zeros(2))

    def turning(self, name: str) -> Vector:
        """The unit vector of a rigid body."""
        return Vector.of([(self.first[name] + 2, 1.0)])

    def direction(self, place: Place) -> Vector:
        """The vector that a moment turns there: r_x of a cable, r_y of a shear element, t of a rigid body."""
        if self.is_rigid(place):
            return self.turning(place.body.name)
        kind = self.meshes[place.body.name].kind
        return self._axis(place, VECTORS[kind.turned].derivative)

    def gradients(self, place: Place) -> list[Vector]:
        """All vectors beside the position that joints hold at a place of a flexible beam, r_x first."""
        kind = self.meshes[place.body.name].kind
        return [self._axis(place, VECTORS[name].derivative) for name in kind.held[1:]]

    def placed(self, vectors: Sequence[Vector]) -> Array:
        """Vectors in the reference, (k, 2)."""
        return np.array([vector(self.reference) for vector in vectors])

    def is_rigid(self, place: Place) -> bool:
        """Whether a place is of a body that does not deform."""
        return place.body.name in self.rigid

    def mean(self, name: str) -> Vector:
        """∫ r dx of a beam: the place that a force per length works along, m²."""
        if name in self.rigid:
            return Vector.of([(self.first[name], self.scene.beam(name).length)])
        mesh = self.meshes[name]
        weights = np.zeros((mesh.elements + 1) * mesh.vectors)
        for e in range(mesh.elements):
            weights[e * mesh.vectors : (e + 2) * mesh.vectors] += mesh.element.load
        return _weighted(mesh.first, weights)

    def _axis(self, place: Place, order: int | None) -> Vector:
        """The axis of a flexible beam at a place, or its derivative of an order; of None the director."""
        mesh = self.meshes[place.body.name]
        along = float(place.key) * mesh.elements
        near = round(along)
        if abs(along - near) <= AT_NODE:
            return Vector.of([(mesh.number(near, mesh.orders.index(order)), 1.0)])
        node = int(along)
        element, xi = mesh.element, along - node
        weights = (element.turning(xi) if order is None else element.axis(xi, order))[0]
        return _weighted(mesh.number(node, 0), weights)


def _weighted(first: int, weights: Array) -> Vector:
    """A sum of vectors that follow one another, each with its weight."""
    return Vector.of((first + 2 * int(k), float(weights[k])) for k in np.flatnonzero(weights))


def thin_bar(beam: Beam) -> RigidBody:
    """A rigid thin bar in place of a beam."""
    one, two = (complex(*beam.velocity_at(s)) for s in (0.0, 1.0))
    turning = (two - one) / complex(*np.subtract(beam.end, beam.start))
    if abs(turning.real) * beam.length > STRETCHING * max(abs(one), abs(two)):
        warn(
            f"rigid body {beam.name!r} has initial velocities that stretch it; only their rigid part is used",
            StartWarning,
            stacklevel=2,
        )
    center, mean = beam.position_at(0.5), 0.5 * (one + two)
    points = {"start": beam.start, "end": beam.end}
    inertia = beam.mass * beam.length**2 / 12.0
    return RigidBody(beam.name, beam.mass, inertia, center, points, (mean.real, mean.imag), turning.imag)
