"""Vectors in the plane that are linear in the coordinates: positions, directions fixed in bodies, sums along beams.

A vector is Σ (a g + b g⊥) + constant over vectors g of nodes, where g⊥ is g rotated by +90°. A point of an element has
this form by its shape functions, a point of a rigid body by r + p_x t + p_y t⊥. A force on it gives a generalized force
by the transposed sum. All loads and connectors are therefore treated alike, wherever they act.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Bodies
from anctmm.discretise.mesh import BodyMesh
from anctmm.discretise.node_mesh import NodeMesh
from anctmm.errors import unknown_kind
from anctmm.jit.compiling import embedded, uncompiled
from anctmm.model.loads import LOADS
from anctmm.model.places import Place
from anctmm.model.scene import Force, LineLoad, Point, Scene, Torque

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Distance of a place from a node, of an element's length, at which it is the node.
AT_NODE = 1e-9
#: Part of a force that is pushed alike below which what is there has no direction of its own.
NOISE = 1e-9


class Term(NamedTuple):
    """a g + b g⊥ of the vector g in rows `row`, `row` + 1 of a node."""

    node: int
    row: int
    a: float
    b: float = 0.0


@dataclass(frozen=True)
class Map:
    """One vector.

    Parameters
    ----------
    terms : tuple of Term
    constant : (float, float)
    """

    terms: tuple[Term, ...] = ()
    constant: tuple[float, float] = (0.0, 0.0)

    @property
    def site(self) -> int:
        """The first node that it depends on; −1 without one."""
        return min((term.node for term in self.terms), default=-1)

    @property
    def width(self) -> int:
        """Number of nodes in a row that it depends on."""
        return max((term.node for term in self.terms), default=-1) - self.site + 1 if self.terms else 0


class Maps(NamedTuple):
    """Vectors for kernels.

    Parameters
    ----------
    start : ndarray of int, shape (vectors + 1,)
        Where the terms of each begin.
    node, row : ndarray of int, shape (terms,)
    a, b : ndarray, shape (terms,)
    constant : ndarray, shape (vectors, 2)
    """

    start: Ints
    node: Ints
    row: Ints
    a: Array
    b: Array
    constant: Array


def maps(vectors: Sequence[Map]) -> Maps:
    """Vectors as kernels want them."""
    terms = [term for vector in vectors for term in vector.terms]
    node, row = (np.array([term[k] for term in terms], dtype=np.int64) for k in (0, 1))
    a, b = (np.array([term[k] for term in terms], dtype=np.float64) for k in (2, 3))
    start = np.cumsum([0, *(len(vector.terms) for vector in vectors)]).astype(np.int64)
    constant = np.array([vector.constant for vector in vectors], dtype=np.float64).reshape(-1, 2)
    return Maps(start, node, row, a, b, constant)


def position_of(bodies: Bodies, place: Place) -> Map:
    """Position of a place."""
    if isinstance(rigid := bodies.mesh(place.body.name), NodeMesh):
        x, y = np.subtract(place.position, rigid.center).tolist()
        node, turning = bodies.first_node(place.body.name), rigid.inertia is not None and (x or y)
        return Map((Term(node, 0, 1.0), *((Term(node, 2, x, y),) if turning else ())))
    mesh, first = bodies.mesh(place.body.name), bodies.first_node(place.body.name)
    if mesh.nodes == 1:
        return Map(_of_one_node(mesh, first, place))
    node, inside = _within(mesh, place)
    if inside == 0.0:
        return Map((Term(first + node, 0, 1.0),))
    return _weighted(mesh, first + node, mesh.element.axis(inside)[0])


def _weighted(mesh: BodyMesh, node: int, weights: Array) -> Map:
    """A sum over the vectors of the element behind a node."""
    return Map(
        tuple(
            Term(node + k // mesh.vectors, 2 * (k % mesh.vectors), float(w))
            for k, w in enumerate(weights)
            if w != 0.0
        )
    )


def direction_of(bodies: Bodies, place: Place) -> Map:
    """The vector that a torque turns at a place: r_x of a cable, r_y of a shear element, t of a rigid body."""
    if isinstance(bodies.mesh(place.body.name), NodeMesh):
        return Map((Term(bodies.first_node(place.body.name), 2, 1.0),))
    mesh, first = bodies.mesh(place.body.name), bodies.first_node(place.body.name)
    if mesh.nodes == 1:
        return Map((Term(first, 2, 1.0),))
    node, inside = _within(mesh, place)
    if inside == 0.0:
        return Map((Term(first + node, bodies.turning_row(place.body.name), 1.0),))
    return _weighted(mesh, first + node, mesh.element.turning(inside)[0])


def sum_along(bodies: Bodies, name: str) -> Map:
    """∫ r dx along a beam, x its undeformed length: what a force per length acts on."""
    mesh, first = bodies.mesh(name), bodies.first_node(name)
    if mesh.nodes == 1:
        return Map((Term(first, 0, mesh.body.length),))
    weights = np.zeros((mesh.nodes, mesh.vectors))
    of_element = mesh.element.load.reshape(2, mesh.vectors)
    weights[:-1] += of_element[0]
    weights[1:] += of_element[1]
    return Map(
        tuple(
            Term(first + i, 2 * k, float(w))
            for i, of_node in enumerate(weights)
            for k, w in enumerate(of_node)
            if w != 0.0
        )
    )


def constant_forces_on(scene: Scene, bodies: Bodies) -> Iterator[tuple[Map, Point]]:
    """Loads that never change, and the vectors that they act on."""
    for load in scene.loads:
        match load:
            case Force(value=(x, y), follower=False):
                yield position_of(bodies, scene.place(load.end)), (x, y)
            case LineLoad(value=(x, y)):
                yield sum_along(bodies, load.body), (x, y)
            case Force() | LineLoad() | Torque():
                pass
            case _:
                raise unknown_kind("load", load, LOADS)


def add_force(vector: Map, force: Point, f: Array) -> None:
    """Add the generalized force of a force on a vector to f, (rows, nodes)."""
    uncompiled(push)(maps([vector]), 0, *force, f)


def _of_one_node(mesh: BodyMesh, first: int, place: Place) -> tuple[Term, ...]:
    """A point of a body of one node, whose vectors are its centre and, of a rigid body, (1, 0) in the reference."""
    center = mesh.reference[0, 0]
    x, y = place.position[0] - float(center[0]), place.position[1] - float(center[1])
    if mesh.vectors == 1 or x == y == 0.0:
        return (Term(first, 0, 1.0),)
    return Term(first, 0, 1.0), Term(first, 2, x, y)


def _within(mesh: BodyMesh, place: Place) -> tuple[int, float]:
    """Node before a place of a beam, and the part of the element behind it; 0 at the node."""
    key = float(place.key)
    along = (1.0 - key if mesh.flipped else key) * mesh.elements
    nearest = round(along)
    if abs(along - nearest) <= AT_NODE:
        return nearest, 0.0
    return int(along), along - int(along)


@embedded
def vector_at(maps, n, q):  # type: ignore[no-untyped-def]
    """Vector n at coordinates q, (rows, nodes)."""
    x, y = rate_at(maps, n, q)
    return x + maps.constant[n, 0], y + maps.constant[n, 1]


@embedded
def rate_at(maps, n, v):  # type: ignore[no-untyped-def]
    """Rate of vector n at velocities v, (rows, nodes)."""
    x = y = 0.0
    for k in range(maps.start[n], maps.start[n + 1]):
        gx, gy = v[maps.row[k], maps.node[k]], v[maps.row[k] + 1, maps.node[k]]
        x += maps.a[k] * gx - maps.b[k] * gy
        y += maps.a[k] * gy + maps.b[k] * gx
    return x, y


@embedded
def push(maps, n, x, y, f):  # type: ignore[no-untyped-def]
    """Add the generalized force of a force (x, y) on vector n to f, (rows, nodes)."""
    for k in range(maps.start[n], maps.start[n + 1]):
        f[maps.row[k], maps.node[k]] += maps.a[k] * x + maps.b[k] * y
        f[maps.row[k] + 1, maps.node[k]] += maps.a[k] * y - maps.b[k] * x


@embedded
def push_alike(maps, n, x, y, f):  # type: ignore[no-untyped-def]
    """The same of a force of this size, in the directions that f has: the two do not cancel, whatever the axes."""
    for k in range(maps.start[n], maps.start[n + 1]):
        i, row = maps.node[k], maps.row[k]
        here, beside = maps.a[k] * x + maps.b[k] * y, maps.a[k] * y - maps.b[k] * x
        size, there = np.sqrt(here * here + beside * beside), np.sqrt(f[row, i] ** 2 + f[row + 1, i] ** 2)
        if there > NOISE * size:
            here, beside = size / there * f[row, i], size / there * f[row + 1, i]
        f[row, i] += here
        f[row + 1, i] += beside
