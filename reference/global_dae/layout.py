"""Coordinates of a scene: every body has its own, beam after beam, node after node, then bodies that do not deform.

A node of a beam has the vectors of its kind of element. A rigid body has its centre r and a unit vector t that turns
with it, (1, 0) in the reference configuration; a point mass has r alone. Places, gradients and directions are linear
in the coordinates.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any
from warnings import warn

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import VECTORS, ElementKind, check_kinds, kind_of
from anctmm.errors import StartWarning
from anctmm.model.bodies import Beam
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Scene
from anctmm.model.velocities import second_derivative
from reference.global_dae.vectors import Vector

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

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
    def size(self) -> int:
        """Number of its coordinates."""
        return 2 * self.vectors * (self.elements + 1)

    @property
    def starts(self) -> Ints:
        """First coordinate of each element, whose coordinates follow one another, (elements,)."""
        return self.first + 2 * self.vectors * np.arange(self.elements)

    def number(self, node: int, vector: int) -> int:
        """Number of the x component of a vector of a node."""
        return self.first + 2 * (node * self.vectors + vector)

    def reference(self) -> Array:
        """Coordinates of the undeformed beam, (nodes, vectors, 2)."""
        s = np.linspace(0.0, 1.0, self.elements + 1)[:, None]
        one, two = np.array(self.body.start), np.array(self.body.end)
        along = (two - one) / self.body.length
        vectors = {0: (1.0 - s) * one + s * two, 1: along, None: np.array([-along[1], along[0]])}
        q = np.zeros((self.elements + 1, self.vectors, 2))
        for k, name in enumerate(self.kind.vectors):
            q[:, k] = vectors.get(VECTORS[name].derivative, 0.0)
        return q

    def velocity(self) -> Array:
        """Rates of the coordinates at t = 0, (nodes, vectors, 2), as of the beam; the director turns with the axis."""
        body, v = self.body, np.zeros((self.elements + 1, self.vectors, 2))
        if body.velocity is None:
            return v
        fractions = np.linspace(0.0, 1.0, self.elements + 1).tolist()
        q = self.reference()[0]
        for k, name in enumerate(self.kind.vectors):
            match VECTORS[name].derivative:
                case None:
                    v[:, k] = -(v[:, 1] @ q[k])[:, None] * q[1]
                case 0:
                    v[:, k] = [body.velocity_at(s) for s in fractions]
                case 1:
                    v[:, k] = np.array([body.velocity_slope_at(s) for s in fractions]) / body.length
                case 2:
                    bend = [second_derivative(body.velocity_at, s, self.elements) for s in fractions]
                    v[:, k] = np.array(bend) * self.element.l / body.length**2
        return v


@dataclass(frozen=True)
class Layout:
    """A scene as discretised, without its joints and forces.

    Parameters
    ----------
    scene : Scene
    run : Discretisation

    Raises
    ------
    DiscretisationError
        Where a kind of element is not known here.
    """

    scene: Scene
    run: Discretisation

    @cached_property
    def meshes(self) -> dict[str, Mesh]:
        """Flexible beams, by name."""
        cut, found, first = self.run.of(self.scene), dict[str, Mesh](), 0
        check_kinds(cut, ELEMENTS, "the global solver")
        for body in self.scene.beams:
            count, name = cut[body.name]
            kind = kind_of(name)
            if not kind.rigid:
                element = kind.element_of(body, count, self.run.quadrature)
                found[body.name] = Mesh(body, kind, count, element, first)
                first += found[body.name].size
        return found

    @cached_property
    def rigid(self) -> dict[str, RigidBody | PointMass]:
        """Bodies that do not deform, thin bars in place of beams of element "rigid" among them."""
        bodies = [body for body in self.scene.bodies if body.name not in self.meshes]
        return {body.name: thin_bar(body) if isinstance(body, Beam) else body for body in bodies}

    @cached_property
    def first(self) -> dict[str, int]:
        """First coordinate of each body that does not deform."""
        number, found = self.flexible, dict[str, int]()
        for name, body in self.rigid.items():
            found[name] = number
            number += 4 if isinstance(body, RigidBody) else 2
        return found

    @cached_property
    def flexible(self) -> int:
        """Number of coordinates of flexible beams: they are the first."""
        return sum(mesh.size for mesh in self.meshes.values())

    @cached_property
    def size(self) -> int:
        """Number of coordinates."""
        return self.flexible + sum(4 if isinstance(b, RigidBody) else 2 for b in self.rigid.values())

    @cached_property
    def reference(self) -> Array:
        """Coordinates of the undeformed scene."""
        q = [mesh.reference().ravel() for mesh in self.meshes.values()]
        for body in self.rigid.values():
            q.append(np.array(body.position_at("center")))
            q += [np.array([1.0, 0.0])] if isinstance(body, RigidBody) else []
        return np.concatenate(q)

    @cached_property
    def velocity(self) -> Array:
        """Velocities at t = 0, as the bodies have them."""
        v = [mesh.velocity().ravel() for mesh in self.meshes.values()]
        for body in self.rigid.values():
            v.append(np.array(body.velocity))
            v += [np.array([0.0, body.spin])] if isinstance(body, RigidBody) else []
        return np.concatenate(v)

    @cached_property
    def unit(self) -> Array:
        """Size that a correction of each coordinate is compared with: the scene's length, m, or 1 of gradients."""
        unit = np.ones(self.size)
        for mesh in self.meshes.values():
            nodes = unit[mesh.first : mesh.first + mesh.size].reshape(-1, 2 * mesh.vectors)
            nodes[:, :2] = self.scene.length
        for at in self.first.values():
            unit[at : at + 2] = self.scene.length
        return unit

    def owner(self, number: int) -> tuple[str, int | None]:
        """Body, and of a flexible beam the element, that a coordinate belongs to."""
        for name, mesh in self.meshes.items():
            if mesh.first <= number < mesh.first + mesh.size:
                return name, min((number - mesh.first) // (2 * mesh.vectors), mesh.elements - 1)
        return max((at, name) for name, at in self.first.items() if at <= number)[1], None

    # --- places --------------------------------------------------------------------------------------------

    def position(self, place: Place) -> Vector:
        """Position of a place."""
        body = self.rigid.get(place.body.name)
        if body is None:
            return self._axis(place, 0)
        at = self.first[place.body.name]
        if isinstance(body, PointMass):
            return Vector.of([(at, 1.0)])
        return self.point(place.body.name, place.position)

    def point(self, name: str, position: tuple[float, float]) -> Vector:
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
        return Vector.of((mesh.first + 2 * int(k), float(weights[k])) for k in np.flatnonzero(weights))

    def _axis(self, place: Place, order: int | None) -> Vector:
        """The axis of a flexible beam at a place, or its derivative of an order; of None the director."""
        mesh = self.meshes[place.body.name]
        along = float(place.key) * mesh.elements
        near = round(along)
        if abs(along - near) <= AT_NODE:
            names = [VECTORS[name].derivative for name in mesh.kind.vectors]
            return Vector.of([(mesh.number(near, names.index(order)), 1.0)])
        node = int(along)
        element, xi = mesh.element, along - node
        weights = (element.turning(xi) if order is None else element.axis(xi, order))[0]
        first = mesh.number(node, 0)
        return Vector.of((first + 2 * int(k), float(weights[k])) for k in np.flatnonzero(weights))


def thin_bar(beam: Beam) -> RigidBody:
    """A rigid thin bar in place of a beam."""
    one, two = (complex(*beam.velocity_at(s)) for s in (0.0, 1.0))
    axis = complex(beam.end[0] - beam.start[0], beam.end[1] - beam.start[1])
    turning = (two - one) / axis
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
