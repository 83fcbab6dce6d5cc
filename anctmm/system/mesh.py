"""The nodes of a scene, laid body after body, and its places as vectors of expressions.

Component k of vector s of node i is q[s · dim + k, i]. A vector has the number i · slots + s; slots is the number of
vectors that a node has room for.
"""

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import kind_of
from anctmm.errors import DiscretisationError
from anctmm.model.bodies import Beam
from anctmm.model.expressions import Key, Vector
from anctmm.model.joints import Weld
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import PointMass
from anctmm.model.scene import Scene
from anctmm.system.body_meshes import BeamMesh, BodyMesh, Form, MassMesh, RigidMesh, SpatialMesh, rigid_mesh

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Mesh:
    """A scene divided into nodes.

    Parameters
    ----------
    scene : Scene
    run : Discretisation

    Attributes
    ----------
    dim, slots, rows, nodes : int
        Components of a vector, vectors of a node, components of a node, number of nodes.
    bodies : dict of str to BodyMesh
    first : dict of str to int
        First node of each body.
    """

    def __init__(self, scene: Scene, run: Discretisation) -> None:
        self.scene, self.run, self.dim = scene, run, scene.dim
        _check_welds(scene, run)
        self.bodies = _meshes(scene, run)
        self.slots = max(2, *(mesh.vectors for mesh in self.bodies.values()))
        self.rows = self.slots * self.dim
        ends = np.cumsum([0, *(mesh.nodes for mesh in self.bodies.values())]).tolist()
        self.first = dict(zip(self.bodies, ends, strict=False))
        self.nodes = ends[-1]

    @property
    def beams(self) -> list[BeamMesh]:
        """Meshes of the bodies that deform."""
        return [mesh for mesh in self.bodies.values() if isinstance(mesh, BeamMesh)]

    def flat(self, fields: Mapping[str, Array]) -> Array:
        """(nodes, vectors, dim) of every body → one array, (rows, nodes); zero where nothing is given."""
        out = np.zeros((self.rows, self.nodes))
        for name, values in fields.items():
            mesh, first = self.bodies[name], self.first[name]
            out[: self.dim * mesh.vectors, first : first + mesh.nodes] = values.reshape(mesh.nodes, -1).T
        return out

    def by_body(self, flat: Array) -> dict[str, Array]:
        """(…, rows, nodes) → (…, nodes, vectors, dim) of every body."""
        out = {}
        for name, mesh in self.bodies.items():
            first = self.first[name]
            part = flat[..., : self.dim * mesh.vectors, first : first + mesh.nodes].swapaxes(-1, -2)
            out[name] = part.reshape(*flat.shape[:-2], mesh.nodes, mesh.vectors, self.dim)
        return out

    def vectors_of(self, flat: Array) -> Array:
        """(rows, nodes) → all vectors by number, (nodes · slots, dim)."""
        return flat.reshape(self.slots, self.dim, self.nodes).transpose(2, 0, 1).reshape(-1, self.dim)

    def flat_of(self, vectors: Array) -> Array:
        """All vectors by number → (rows, nodes)."""
        grid = vectors.reshape(self.nodes, self.slots, self.dim)
        return np.ascontiguousarray(grid.transpose(1, 2, 0).reshape(self.rows, self.nodes))

    @cached_property
    def lengths(self) -> NDArray[np.bool_]:
        """Which components are those of positions, (rows, nodes); all others have no unit."""
        found = np.zeros((self.slots, self.dim, self.nodes), dtype=bool)
        found[0] = True
        for name, body in self.bodies.items():
            if isinstance(body, SpatialMesh):  # its second node has axes alone
                found[0, :, self.first[name] + 1] = False
            elif isinstance(body, RigidMesh) and body.anchors is not None:
                found[1, :, self.first[name]] = True
        return found.reshape(self.rows, self.nodes)

    @cached_property
    def units(self) -> Array:
        """What changes of components are compared by, (rows, nodes): 1 over the scene's length (1/m), or 1."""
        return np.where(self.lengths, 1.0 / self.scene.length, 1.0)

    @cached_property
    def reference(self) -> Array:
        """Coordinates of the undeformed scene, (rows, nodes)."""
        return self.flat({name: mesh.reference for name, mesh in self.bodies.items()})

    @cached_property
    def initial_velocity(self) -> Array:
        """Velocities that the bodies state, (rows, nodes)."""
        moving = {n: m.initial_velocity for n, m in self.bodies.items() if m.body.moving}
        return self.flat(moving)

    @cached_property
    def weight(self) -> Array:
        """Forces of gravity, (rows, nodes), N."""
        g, parts = np.asarray(self.scene.gravity), {}
        for name, mesh in self.bodies.items():
            match mesh:
                case RigidMesh():
                    parts[name] = mesh.weight_matrix @ g
                case SpatialMesh():
                    parts[name] = np.kron([mesh.body.mass, 0.0, 0.0, 0.0], g)
                case _:
                    parts[name] = mesh.weight[..., None] * g
        return self.flat({name: np.asarray(part) for name, part in parts.items()})

    def number(self, body: str, k: int) -> int:
        """Number of vector k of a body among those of all."""
        vectors = self.bodies[body].vectors
        return (self.first[body] + k // vectors) * self.slots + k % vectors

    def expression(self, body: str, form: Form, at: Array | None = None) -> Vector:
        """A vector of a body as one of expressions."""
        terms: dict[Key, Array] = {(self.number(body, k), None): A for k, A in form.items()}
        return Vector(self._start if at is None else at, terms)

    @cached_property
    def _start(self) -> Array:
        return self.vectors_of(self.reference)

    def constant(self, value: Any) -> Vector:
        """A vector that is fixed in the ground."""
        return Vector(self._start, {}, {None: np.asarray(value, dtype=float)})

    def body_at(self, node: int) -> tuple[str, int | None]:
        """Body and element next to a node; None of a body without elements."""
        name = [n for n, first in self.first.items() if first <= node][-1]
        elements = self.bodies[name].elements
        return name, max(0, min(node - self.first[name], elements - 1)) if elements else None


class JointPlace:
    """A place of a body as equations of joints see it.

    Parameters
    ----------
    mesh : Mesh
    place : Place
    """

    def __init__(self, mesh: Mesh, place: Place) -> None:
        self._mesh, self._place, self._name = mesh, place, place.body.name
        self._body = mesh.bodies[self._name]

    def _vector(self, form: Form) -> Vector:
        return self._mesh.expression(self._name, form)

    @cached_property
    def position(self) -> Vector:
        """Where it is."""
        return self._vector(self._body.position(self._place.key))

    @cached_property
    def gradients(self) -> list[Vector]:
        """Vectors that turn with it and that a weld holds: r_x, and r_y of a shear element; axes of a rigid body."""
        return [self._vector(form) for form in self._body.gradients(self._place.key)]  # type: ignore[union-attr]

    @cached_property
    def direction(self) -> Vector:
        """The vector that a torque turns: r_x of a cable, r_y of a shear element."""
        return self._vector(self._body.direction(self._place.key))  # type: ignore[union-attr]

    def axis(self, k: int) -> Vector:
        """A vector that turns with the place.

        Unit vector k of the reference in a rigid body; of a beam r_x (k = 0), and in the plane its normal, or the r_y
        of a shear element (k = 1).
        """
        if isinstance(self._body, BeamMesh) and k == len(self.gradients) == 1 and self._mesh.dim == 2:
            return self.gradients[0].normal
        if isinstance(self._body, RigidMesh) and k == 1:
            return self.gradients[0].normal
        return self.gradients[k]

    def fixed_point(self, point: Any) -> Vector:
        """A point that is fixed in the rigid body, by its place in the reference."""
        return self._vector(self._body.point(np.asarray(point)))  # type: ignore[union-attr]

    @property
    def rigid(self) -> bool:
        """Whether it is a place of a rigid body."""
        return isinstance(self._body, RigidMesh | SpatialMesh)


class GroundPlace:
    """A point of the ground as equations of joints see it.

    Parameters
    ----------
    mesh : Mesh
    point : sequence of float
    """

    rigid = True

    def __init__(self, mesh: Mesh, point: Iterable[float]) -> None:
        self._mesh = mesh
        self.position = mesh.constant(list(point))

    def axis(self, k: int) -> Vector:
        """Unit vector k."""
        return self._mesh.constant(np.eye(self._mesh.dim)[k])

    @property
    def gradients(self) -> list[Vector]:
        """In the plane e_x; in space e_x, e_y and e_z."""
        return [self.axis(k) for k in range(1 if self._mesh.dim == 2 else 3)]

    @property
    def direction(self) -> Vector:
        """e_x."""
        return self.axis(0)

    def fixed_point(self, point: Any) -> Vector:
        """A point of the ground."""
        return self._mesh.constant(point)


def _meshes(scene: Scene, run: Discretisation) -> dict[str, BodyMesh]:
    """Meshes of all bodies, in their order."""
    cut, joined, found = run.of(scene), _joined(scene), dict[str, BodyMesh]()
    for body in scene.bodies:
        elements, kind = cut.get(body.name, (0, ""))
        if isinstance(body, PointMass):
            found[body.name] = MassMesh(body)
        elif not isinstance(body, Beam) or kind_of(kind).rigid:
            found[body.name] = rigid_mesh(body, list(joined.get(body.name, {}).values()))
        else:
            of_kind = kind_of(kind)
            element = of_kind.element_of(body, elements, run.quadrature)
            found[body.name] = BeamMesh(body, of_kind, elements, element)
    return found


def _joined(scene: Scene) -> dict[str, dict[tuple[float, ...], Array]]:
    """Places in the reference of each body whose positions joints share, each once.

    None of a body whose direction a joint holds: what holds the vector u needs no row, what holds that between two
    places repeats their distance.
    """
    found: dict[str, dict[tuple[float, ...], Array]] = {}
    for joint in scene.joints:
        if not joint.shares_position:
            continue
        for end in joint.ends:
            if isinstance(end, str) or isinstance(end[0], str):
                place = scene.place(end)
                point = tuple(place.position)
                found.setdefault(place.body.name, {})[point] = np.array(point)
    for joint in scene.joints:
        for end in joint.attached if joint.holds_direction else ():
            if isinstance(end, str) or isinstance(end[0], str):
                found.pop(scene.place(end).body.name, None)
    return found


def _check_welds(scene: Scene, run: Discretisation) -> None:
    """Refuse welds between kinds of element of which they would hold different vectors.

    Raises
    ------
    DiscretisationError
    """
    kinds = {name: kind for name, (_, kind) in run.of(scene).items() if not kind_of(kind).rigid}
    for joint in scene.joints:
        if isinstance(joint, Weld) and joint.stretch == "held":
            names = [n for n in (scene.place(end).body.name for end in joint.ends) if n in kinds]
            if not all(kind_of(kinds[names[0]]).welds_to(kind_of(kinds[n])) for n in names):
                raise DiscretisationError(
                    f"{joint!r} joins elements {', '.join(f'{kinds[n]!r} of {n!r}' for n in names)}; a weld needs one "
                    f"kind on both sides, or kinds of which it holds the same vectors (a pin does not)"
                )
