"""Numbering of a scene with mechanisms: coordinates of beams as `reference.global_dae.model` has them, then rigid ones.

A rigid body has its centre r and a unit vector t that turns with it, (1, 0) in the reference; a point mass has r only.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from warnings import warn

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import kind_of
from anctmm.errors import MeshError, StartWarning
from anctmm.model.bodies import Beam
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.scene import Scene
from reference.global_dae.mechanisms.vectors import Vector
from reference.global_dae.model import Model

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Distance of a place from a node, in elements, that counts as none.
AT_NODE = 1e-9
#: Stretching of a rigid beam's initial velocity, of its size, that counts as none.
STRETCHING = 1e-9


@dataclass(frozen=True)
class Layout:
    """A scene as discretised, without its joints and forces.

    Parameters
    ----------
    scene : Scene
    run : Discretisation
    """

    scene: Scene
    run: Discretisation

    @cached_property
    def cut(self) -> Mapping[str, tuple[int, str]]:
        """Elements of each beam, by number and kind."""
        return self.run.of(self.scene)

    @cached_property
    def beams(self) -> Model | None:
        """Beams that bend, with gravity, and without joints and loads; None if there are none."""
        bending = tuple(b for b in self.scene.beams if not kind_of(self.cut[b.name][1]).rigid)
        if not bending:
            return None
        scene = Scene(self.scene.name, bending, gravity=self.scene.gravity)
        mesh = {b.name: self.cut[b.name][0] for b in bending}
        element = {b.name: self.cut[b.name][1] for b in bending}
        return Model.of(scene, replace(self.run, mesh=mesh, element=element))

    @cached_property
    def rigid(self) -> dict[str, RigidBody | PointMass]:
        """Bodies that do not bend, thin bars in place of beams of element "rigid" among them."""
        found: dict[str, RigidBody | PointMass] = {}
        for body in self.scene.bodies:
            if isinstance(body, RigidBody | PointMass):
                found[body.name] = body
            elif kind_of(self.cut[body.name][1]).rigid:
                found[body.name] = _bar(body)
        return found

    @cached_property
    def first(self) -> dict[str, int]:
        """First coordinate of each rigid body."""
        number, found = 0 if self.beams is None else self.beams.dofs, {}
        for name, body in self.rigid.items():
            found[name] = number
            number += 4 if isinstance(body, RigidBody) else 2
        return found

    @cached_property
    def bending(self) -> int:
        """Number of coordinates of the beams that bend: they are the first."""
        return 0 if self.beams is None else self.beams.dofs

    @cached_property
    def size(self) -> int:
        """Number of coordinates."""
        return self.bending + sum(4 if isinstance(body, RigidBody) else 2 for body in self.rigid.values())

    @cached_property
    def numbers(self) -> Ints:
        """Flat places of the beams' coordinates in arrays (rows, nodes) of their model."""
        assert self.beams is not None
        return self.beams.places(1).reshape(-1)[: self.beams.dofs]

    @cached_property
    def reference(self) -> Array:
        """Coordinates of the undeformed scene."""
        q = np.zeros(self.size)
        if self.beams is not None:
            q[: self.bending] = self.beams.bodies.reference().reshape(-1)[self.numbers]
        for name, body in self.rigid.items():
            at = self.first[name]
            q[at : at + 2] = body.position_at("center")
            if isinstance(body, RigidBody):
                q[at + 2] = 1.0
        return q

    @cached_property
    def velocity(self) -> Array:
        """Velocities at t = 0, as the bodies have them."""
        v = np.zeros(self.size)
        if self.beams is not None:
            v[: self.bending] = self.beams.bodies.initial_velocity().reshape(-1)[self.numbers]
        for name, body in self.rigid.items():
            at = self.first[name]
            v[at : at + 2] = body.velocity
            if isinstance(body, RigidBody):
                v[at + 3] = body.spin
        return v

    @cached_property
    def unit(self) -> Array:
        """What a correction of each coordinate is compared with: the scene's length, m, or 1 of gradients."""
        unit = np.ones(self.size)
        if self.beams is not None:
            rows = np.repeat(np.arange(self.beams.bodies.rows), self.beams.bodies.nodes)
            unit[: self.bending][rows[self.numbers] < 2] = self.scene.length
        for at in self.first.values():
            unit[at : at + 2] = self.scene.length
        return unit

    def owner(self, number: int) -> tuple[str, int | None]:
        """Body, and of a beam the element, that a coordinate belongs to."""
        if number < self.bending:
            assert self.beams is not None
            return self.beams.bodies.element_at(int(self.numbers[number]) % self.beams.bodies.nodes)
        return max((at, name) for name, at in self.first.items() if at <= number)[1], None

    # --- places --------------------------------------------------------------------------------------------

    def position(self, place: Place) -> Vector:
        """Position of a place."""
        if isinstance(place.body, Beam) and place.body.name not in self.rigid:
            node, x = self._at(place)
            if x == 0.0:
                return Vector.of([(self._vector(place, 0, node), 1.0)])
            return self._weighted(place, node, self._mesh(place).element.axis(x)[0])
        at = self.first[place.body.name]
        body = self.rigid[place.body.name]
        if isinstance(body, PointMass):
            return Vector.of([(at, 1.0)])
        x, y = np.subtract(place.position, body.center).tolist()  # any place of a beam that is rigid
        return Vector(np.arange(at, at + 4), np.array([[1.0, 0.0, x, -y], [0.0, 1.0, y, x]]), np.zeros(2))

    def direction(self, place: Place) -> Vector:
        """The vector that a moment turns there: r_x of a cable, r_y of a shear element, t of a rigid body."""
        name = place.body.name
        if name in self.rigid:
            return Vector.of([(self.first[name] + 2, 1.0)])
        node, x = self._at(place)
        if x == 0.0:
            return Vector.of([(self._vector(place, self._mesh(place).turning_row // 2, node), 1.0)])
        return self._weighted(place, node, self._mesh(place).element.turning(x)[0])

    def gradients(self, place: Place) -> list[Vector]:
        """All gradients that joints hold at a node of a beam that bends, r_x first.

        Raises
        ------
        MeshError
            If no node lies there.
        """
        node, x = self._at(place)
        if x != 0.0:
            raise MeshError(
                f"{place} is in a joint and lies between nodes of {self.cut[place.body.name][0]} elements; a node is "
                f"needed there: fraction times elements must be whole"
            )
        return [
            Vector.of([(self._vector(place, k, node), 1.0)]) for k in range(1, self._mesh(place).held // 2)
        ]

    def is_rigid(self, place: Place) -> bool:
        """Whether a place is of a body that does not bend."""
        return place.body.name in self.rigid

    def _mesh(self, place: Place):  # type: ignore[no-untyped-def]
        assert self.beams is not None
        return self.beams.bodies.mesh(place.body.name)

    def _weighted(self, place: Place, node: int, weights: Array) -> Vector:
        """A sum over the vectors of the element behind a node."""
        vectors = self._mesh(place).vectors
        pairs = ((k, float(w)) for k, w in enumerate(weights) if w != 0.0)
        return Vector.of([(self._vector(place, k % vectors, node + k // vectors), w) for k, w in pairs])

    def _at(self, place: Place) -> tuple[int, float]:
        """Node before a place of a beam, and the fraction of the element behind it."""
        mesh = self._mesh(place)
        assert self.beams is not None
        first, along = self.beams.bodies.node(place.body.name, 0), float(place.key) * mesh.elements
        near = round(along)
        if abs(along - near) <= AT_NODE:
            return first + near, 0.0
        return first + int(along), along - int(along)

    def _vector(self, place: Place, k: int, node: int) -> int:
        """Number of the x component of vector k (0 r, 1 r_x, 2 r_y) of a node."""
        assert self.beams is not None
        return 2 * int(self.beams.numbers[k, node])


def _bar(beam: Beam) -> RigidBody:
    """A thin bar in place of a beam of element "rigid"."""
    one, two = (complex(*beam.velocity_at(s)) for s in (0.0, 1.0))
    axis = complex(beam.end[0] - beam.start[0], beam.end[1] - beam.start[1])
    turning = (two - one) / axis
    if abs(turning.real) * beam.length > STRETCHING * max(abs(one), abs(two)):
        warn(
            f"rigid body {beam.name!r} has initial velocities that stretch it; only their rigid part is kept",
            StartWarning,
            stacklevel=2,
        )
    center, mean = beam.position_at(0.5), 0.5 * (one + two)
    points = {"start": beam.start, "end": beam.end}
    inertia = beam.mass * beam.length**2 / 12.0
    return RigidBody(beam.name, beam.mass, inertia, center, points, (mean.real, mean.imag), turning.imag)
