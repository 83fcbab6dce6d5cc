"""Bodies of one node: rigid bodies in natural coordinates, and point masses.

A rigid body has the coordinates r, its centre of mass, and t, a unit vector that rotates with it, (1, 0) in the
reference. A point p of it, given relative to its centre in the reference, is r + p_x t + p_y t⊥. Since |ṫ| is the rate
of its angle while |t| = 1, its mass matrix is the constant diag(m, m, I, I). A point mass has r only.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import unknown_kind
from anctmm.model.bodies import BODIES, Beam, Body
from anctmm.model.places import Key
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.velocities import Point

Array = NDArray[np.float64]
#: Gauss points over a beam at which initial velocities are looked at.
POINTS = 8


@dataclass(frozen=True)
class NodeMesh:
    """A body of one node, beside `BodyMesh`.

    Parameters
    ----------
    body : Body
    mass : float
        kg.
    inertia : float or None
        About its centre of mass, kg m²; None of a point mass.
    center : (float, float)
        In the reference, m.
    velocity : (float, float)
        Of its centre at t = 0, m/s.
    spin : float
        At t = 0, rad/s.
    gravity : (float, float)
        m/s².
    """

    body: Body
    mass: float
    inertia: float | None
    center: Point
    velocity: Point
    spin: float
    gravity: tuple[float, float]
    elements = 0
    nodes = 1
    flipped = False
    damping = 0.0
    element_length = 0.0
    #: First component of the vector that a torque turns.
    turning_row = 2

    @property
    def vectors(self) -> int:
        """Number of coordinate vectors of its node."""
        return 1 if self.inertia is None else 2

    @property
    def held(self) -> int:
        """Components that joints can hold: all."""
        return 2 * self.vectors

    @property
    def reach(self) -> float:
        """Largest distance of its places from its centre, m; the radius of inertia where it has no others."""
        if self.inertia is None:
            return 0.0
        return max(self.body.extent, float(np.sqrt(self.inertia / self.mass)))

    @property
    def kernels(self) -> None:
        """It has no elements, and so no kernels."""
        return None

    @cached_property
    def reference(self) -> Array:
        """Coordinates in the reference, (1, vectors, 2)."""
        return np.array([[self.center, (1.0, 0.0)][: self.vectors]])

    @cached_property
    def initial_velocity(self) -> Array:
        """Velocities of the coordinates at t = 0, (1, vectors, 2)."""
        return np.array([[self.velocity, (0.0, self.spin)][: self.vectors]])

    @cached_property
    def weight(self) -> Array:
        """Force of gravity, (1, vectors, 2), N."""
        force = self.mass * self.gravity[0], self.mass * self.gravity[1]
        return np.array([[force, (0.0, 0.0)][: self.vectors]])

    @cached_property
    def scalar_mass(self) -> Array:
        """Mass of the node, a row and a column for each vector."""
        return np.diag([self.mass] if self.inertia is None else [self.mass, self.inertia])

    def node(self, key: Key) -> int:
        """Its one node, whatever the place."""
        return 0

    def stiffened(self, factor: float, stresses: bool = True) -> "NodeMesh":
        """Itself: it has no stiffness."""
        return self

    def unflipped(self, coordinates: Array) -> Array:
        """Coordinates as they are."""
        return coordinates


@dataclass(frozen=True)
class BarMesh(NodeMesh):
    """A beam without strain: a thin rigid bar, whose results are those of a beam of one element."""

    body: Beam

    def unflipped(self, coordinates: Array) -> Array:
        """Coordinates r, r_x of its start and its end, (…, 2, 2, 2)."""
        r, t = coordinates[..., 0, 0, :], coordinates[..., 0, 1, :]
        (x, y), (u, v) = self.body.start, self.body.end
        c, s = (u - x) / self.body.length, (v - y) / self.body.length
        along = np.stack([c * t[..., 0] - s * t[..., 1], s * t[..., 0] + c * t[..., 1]], axis=-1)
        half = 0.5 * self.body.length * along
        ends = [np.stack([r + sign * half, along], axis=-2) for sign in (-1.0, 1.0)]
        return np.stack(ends, axis=-3)

    def from_ends(self, ends: Array) -> Array:
        """Coordinates of its node, (1, 2, 2), from r, r_x of its start and its end, (2, 2, 2)."""
        (x, y), (u, v) = self.body.start, self.body.end
        c, s = (u - x) / self.body.length, (v - y) / self.body.length
        a, b = ends[0, 1]
        return np.array([[0.5 * (ends[0, 0] + ends[1, 0]), (c * a + s * b, c * b - s * a)]])


def node_mesh(body: Body, gravity: tuple[float, float]) -> NodeMesh:
    """The node of a rigid body, a point mass or a beam without strain."""
    match body:
        case RigidBody():
            return NodeMesh(body, body.mass, body.inertia, body.center, body.velocity, body.spin, gravity)
        case PointMass():
            return NodeMesh(body, body.mass, None, body.position, body.velocity, 0.0, gravity)
        case Beam():
            (x, y), (u, v) = body.start, body.end
            center = (0.5 * (x + u), 0.5 * (y + v))
            return BarMesh(
                body, body.mass, body.mass * body.length**2 / 12.0, center, *_mean_motion(body), gravity
            )
        case _:
            raise unknown_kind("body", body, BODIES)


def _mean_motion(body: Beam) -> tuple[Point, float]:
    """Velocity of the centre and spin with the momenta of a beam's initial velocities."""
    if body.velocity is None:
        return (0.0, 0.0), 0.0
    fractions, weights = np.polynomial.legendre.leggauss(POINTS)
    v = np.array([body.velocity_at(0.5 * (1.0 + x)) for x in fractions.tolist()])
    along = np.subtract(body.end, body.start) / body.length
    across = v @ np.array([-along[1], along[0]])
    x, y = 0.5 * weights @ v
    return (float(x), float(y)), float(3.0 * weights @ (across * fractions) / body.length)
