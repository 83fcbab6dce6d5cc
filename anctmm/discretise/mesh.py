"""A scene divided into elements: nodes, reference coordinates, initial velocities and constant loads of every body.

This module knows no joints: each body has its own nodes, in its own direction, as a global solver needs them.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.node_mesh import NodeMesh, node_mesh
from anctmm.elements.dispatch import number_of
from anctmm.elements.kinds import VECTORS, Element, ElementKind, kind_of
from anctmm.errors import unknown_kind
from anctmm.model.loads import LOADS, varies
from anctmm.model.needs import not_offered
from anctmm.model.places import Key
from anctmm.model.scene import Beam, Force, LineLoad, Load, Scene, Torque
from anctmm.model.velocities import second_derivative

Array = NDArray[np.float64]
#: Elements up to which a body's mesh is kept for the next run: building it takes longer than the steps of a short one.
KEPT = 256


@dataclass(frozen=True)
class BodyMesh:
    """One body's equal elements.

    Parameters
    ----------
    body : Beam
    kind : ElementKind
    elements : int
    element : Element
        Every one of them.
    gravity : (float, float)
        m/s².
    flipped : bool
        Whether the nodes run from the body's end to its start, as the order of elimination may need it.
    """

    body: Beam
    kind: ElementKind
    elements: int
    element: Element
    gravity: tuple[float, float]
    flipped: bool = False

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return self.elements + 1

    @property
    def vectors(self) -> int:
        """Number of coordinate vectors of a node."""
        return len(self.kind.vectors)

    @cached_property
    def reference(self) -> Array:
        """Coordinates of the undeformed body, (nodes, vectors, 2)."""
        (x, y), (u, v) = start, end = self._ends(self.body.start, self.body.end)
        along = (u - x) / self.body.length, (v - y) / self.body.length
        before, behind = (_kept_shares if self.elements <= KEPT else _shares)(self.elements)
        q = np.zeros((self.nodes, self.vectors, 2))
        for k, vector in enumerate(self.kind.vectors):
            match VECTORS[vector].derivative:
                case None:
                    q[:, k] = -along[1], along[0]
                case 0:
                    q[:, k] = before * start + behind * end
                case 1:
                    q[:, k] = along
        return q

    @cached_property
    def initial_velocity(self) -> Array:
        """Velocities of the coordinates at t = 0, (nodes, vectors, 2).

        The gradient's is the velocity's derivative along the axis, and so on; the director turns with the axis.
        """
        v = np.zeros((self.nodes, self.vectors, 2))
        if self.body.velocity is None:
            return v
        first, last = self._ends(0.0, 1.0)
        fractions = np.linspace(first, last, self.nodes)
        sign, length = -1.0 if self.flipped else 1.0, self.body.length
        for k, vector in enumerate(self.kind.vectors):
            match VECTORS[vector].derivative:
                case None:
                    along, normal = self.reference[0, 1], self.reference[0, k]
                    v[:, k] = -(v[:, 1] @ normal)[:, None] * along
                case 0:
                    v[:, k] = [self.body.velocity_at(float(s)) for s in fractions]
                case 1:
                    v[:, k] = [self.body.velocity_slope_at(float(s)) for s in fractions]
                    v[:, k] *= sign / length
                case 2:
                    v[:, k] = [
                        second_derivative(self.body.velocity_at, float(s), self.elements) for s in fractions
                    ]
                    v[:, k] *= self.element.l / length**2
                case other:
                    raise AssertionError(f"no velocity of derivative {other} of the axis")
        return v

    @cached_property
    def weight(self) -> Array:
        """Consistent forces of gravity, (nodes, vectors, 2), N."""
        f = np.zeros((self.nodes, self.vectors, 2))
        per_element = np.multiply.outer(self.element.gravity, self.gravity).reshape(2, self.vectors, 2)
        f[:-1] += per_element[0]
        f[1:] += per_element[1]
        return f

    @property
    def kernels(self) -> int:
        """Number of the kernels that its elements have."""
        return number_of(self.kind)

    @property
    def held(self) -> int:
        """Components of a node that joints can hold: the first ones."""
        return 2 * len(self.kind.held)

    @property
    def turning_row(self) -> int:
        """First component of the vector that a torque turns."""
        return self.kind.turning_row

    @property
    def damping(self) -> float:
        """Kelvin-Voigt damping, s."""
        return self.element.damping

    @property
    def element_length(self) -> float:
        """Length of an element, m."""
        return self.element.l

    @property
    def scalar_mass(self) -> Array:
        """Mass of an element, a row and a column for each vector of its two nodes."""
        return self.element.mass

    def stiffened(self, factor: float, stresses: bool = True) -> "BodyMesh":
        """The same with so many times its stiffness, and, as far as the tangent goes, its stresses."""
        return replace(self, element=self.element.stiffened(factor, stresses))

    def node(self, side: Key) -> int:
        """Node at the body's start (0) or end (1)."""
        return self.nodes - 1 if bool(side) != self.flipped else 0

    def unflipped(self, coordinates: Array) -> Array:
        """Coordinates (…, nodes, vectors, 2) in the body's own direction."""
        if not self.flipped:
            return coordinates
        return _signs(self.kind.vectors) * coordinates[..., ::-1, :, :]

    def _ends(self, start, end):  # type: ignore[no-untyped-def]
        return (end, start) if self.flipped else (start, end)


def _shares(elements: int) -> tuple[Array, Array]:
    """Shares of a body's start and end in the place of each node, (nodes, 1) each: nobody writes into them."""
    # np.linspace would take longer than all else here
    x = np.asarray(np.arange(elements + 1)[:, None] * (1.0 / elements), dtype=np.float64)
    x[-1] = 1.0
    return 1.0 - x, x


_kept_shares = lru_cache(maxsize=64)(_shares)


@lru_cache
def _signs(vectors: tuple[str, ...]) -> Array:
    """Of the vectors of a node, seen from the other end of its body, (vectors, 1)."""
    return np.array([[VECTORS[vector].sign] for vector in vectors])


def body_meshes(
    scene: Scene, run: Discretisation, passed: Iterable[tuple[str, bool]] | None = None
) -> list[BodyMesh]:
    """Meshes of bodies, by name and whether flipped; of all, in their own direction, without `passed`.

    Raises
    ------
    MeshError
        If the discretisation does not fit the scene's bodies.
    """
    cut = run.of(scene)  # once for all bodies: it looks at all of them
    passed = ((body.name, False) for body in scene.beams) if passed is None else passed
    return [_body_mesh(scene, run.quadrature, name, *cut[name], flipped) for name, flipped in passed]


def passed_meshes(
    scene: Scene, run: Discretisation, passed: Iterable[tuple[str, bool]]
) -> list[BodyMesh | NodeMesh]:
    """Meshes of bodies by name and whether flipped; rigid bodies, stiff beams among them, and masses are single nodes.

    Raises
    ------
    MeshError
        If the discretisation does not fit the scene's bodies.
    """
    cut, found = run.of(scene), list[BodyMesh | NodeMesh]()
    for name, flipped in passed:
        elements, kind = cut.get(name, (0, ""))
        if not elements or kind_of(kind).rigid:
            found.append(node_mesh(scene.body(name), scene.gravity))
        else:
            found.append(_body_mesh(scene, run.quadrature, name, elements, kind, flipped))
    return found


def _body_mesh(scene: Scene, quadrature: str, name: str, elements: int, kind: str, flipped: bool) -> BodyMesh:
    body = scene.beam(name)
    # only small meshes are kept between runs, and none whose velocities a function of the user's gives
    make = _kept_mesh if elements <= KEPT and body.velocity is None else _mesh
    return make(body, quadrature, elements, kind, scene.gravity, flipped)


def _mesh(
    body: Beam, quadrature: str, elements: int, kind: str, gravity: tuple[float, float], flipped: bool
) -> BodyMesh:
    found = kind_of(kind, f"element of body {body.name!r}")
    return BodyMesh(body, found, elements, found.element_of(body, elements, quadrature), gravity, flipped)


_kept_mesh = lru_cache(maxsize=128)(_mesh)


def build(scene: Scene, run: Discretisation) -> dict[str, BodyMesh]:
    """Meshes of all bodies, each in its own direction.

    Raises
    ------
    MeshError
        If the discretisation does not fit the scene's bodies.
    """
    return {mesh.body.name: mesh for mesh in body_meshes(scene, run)}


def constant_forces(scene: Scene) -> list[tuple[str, Key, tuple[float, float]]]:
    """Constant forces as (body, key of the place, force)."""
    found = []
    for load in scene.loads:
        match load:
            case Force(value=(x, y)):
                name, key = scene.place(load.end).end
                found.append((name, key, (x, y)))
            case Force() | Torque():
                pass
            case LineLoad():
                raise not_offered(load)
            case _:
                raise unknown_kind("load", load, LOADS)
    return found


def varying_loads(scene: Scene) -> list[Load]:
    """Loads whose generalized force changes: those of time, and what turns with its place: torques and followers."""
    return [load for load in scene.loads if varies(load)]
