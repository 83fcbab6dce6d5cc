"""The equations of a model in independent coordinates: joints are solved for the others, and no multiplier is left.

Joints are Φ q = b(t) with a constant Φ. With q = B z + p(t), Φ B = 0 and Φ p = b, the equations M q̈ + Φᵀμ = F become
BᵀM B z̈ = Bᵀ(F − M p̈): ordinary differential equations, for methods that lose order with multipliers.

A clamp that leaves the stretch free holds the direction of a vector of z, which may turn: z = R(t) y takes this vector
from its length, R holding its direction, and Rᵀ[BᵀM B (R ÿ + 2 Ṙ ẏ + R̈ y) − Bᵀ(F − M p̈)] = 0.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import qr
from scipy.sparse.linalg import splu

from anctmm.discretise.assembly import elastic_forces
from anctmm.elements.tangent_blocks import TANGENT_BUFFER
from anctmm.errors import UnsupportedError
from reference.global_dae.assemble import System, assemble, matrix_of, system_of
from reference.global_dae.constraints import Direction, Rows, directions_of
from reference.global_dae.model import Matrix, Model

Array = NDArray[np.float64]
#: Part of the largest pivot of the joints' rows below which a row says nothing new.
REDUNDANT = 1e-12


class Given(NamedTuple):
    """What is known at a time, with two derivatives each: p, and directions that clamps hold, (3, directions, 2)."""

    p: Array
    along: Array


@dataclass(frozen=True)
class Reduced:
    """A model in independent coordinates y: some of its coordinates, and lengths of vectors whose direction is held.

    Parameters
    ----------
    model : Model
        Without damping: forces depend on coordinates and time.
    """

    model: Model

    @cached_property
    def directions(self) -> list[Direction]:
        """Vectors whose direction is held."""
        return directions_of(self.model.scene, self.model.bodies)

    @cached_property
    def _held(self) -> NDArray[np.int64]:
        """Numbers of their components among the coordinates, (directions, 2)."""
        numbers = np.array([self.model.numbers[d.vector, d.node] for d in self.directions], dtype=np.int64)
        return 2 * numbers[:, None] + np.arange(2)

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """Flat places of the coordinates, (dofs,)."""
        return self.model.places(1).reshape(-1)[: self.model.dofs]

    @cached_property
    def _split(self) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
        """Dependent and independent coordinates, Φ⁺ of the dependent ones, and what y gives to these."""
        phi = self.model.constraints.toarray()
        if not len(phi):
            none = np.zeros((0, self.model.dofs))
            return np.zeros(0, np.int64), np.arange(self.model.dofs), np.zeros((0, 0)), none
        others = np.setdiff1d(np.arange(self.model.dofs), self._held)
        rank, _ = _independent(phi)
        solved, order = _independent(phi[:, others])
        if solved < rank:
            raise UnsupportedError(
                f"integrator is 'esdirk' for scene {self.model.scene.name!r}, where welds join ends whose directions "
                f"clamps hold; the global solver's steps of high order have one such end at a place: "
                f"'generalized-alpha' is needed"
            )
        dependent = np.sort(others[order[:rank]])
        independent = np.setdiff1d(np.arange(self.model.dofs), dependent)
        inverse = np.linalg.pinv(phi[:, dependent])
        return dependent, independent, inverse, -inverse @ phi[:, independent]

    @cached_property
    def basis(self) -> Matrix:
        """B, (dofs, independent coordinates)."""
        dependent, independent, _, shares = self._split
        B = sparse.lil_array((self.model.dofs, len(independent)))
        B[independent, np.arange(len(independent))] = 1.0
        if len(dependent):
            B[dependent, :] = shares
        return Matrix(B)

    @cached_property
    def mass(self) -> Matrix:
        """BᵀM B."""
        return Matrix(self.basis.T @ self.model.mass @ self.basis)

    @cached_property
    def _turned(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Numbers in z of what is in y as it is, and of the components of vectors whose direction is held."""
        independent = self._split[1]
        held = np.searchsorted(independent, self._held)
        return np.setdiff1d(np.arange(len(independent)), held), held

    def spread(self, y: Array, along: Array) -> Array:
        """R y of directions `along`, (directions, 2)."""
        plain, held = self._turned
        z = np.empty(len(plain) + 2 * len(held))
        z[plain] = y[: len(plain)]
        z[held] = along * y[len(plain) :, None]
        return z

    def carried(self, y: Array, along: Array) -> Array:
        """Ṙ y or R̈ y, of derivatives of the directions: what does not turn is zero."""
        plain, held = self._turned
        z = np.zeros(len(plain) + 2 * len(held))
        z[held] = along * y[len(plain) :, None]
        return z

    def gather(self, z: Array, along: Array) -> Array:
        """Rᵀz."""
        plain, held = self._turned
        return np.concatenate([z[plain], (along * z[held]).sum(axis=1)])

    def between(self, A: Matrix, along: Array) -> Matrix:
        """RᵀA R."""
        plain, held = self._turned
        if not len(held):
            return A
        count = len(plain) + len(held)
        row = np.concatenate([plain, held.ravel()])
        column = np.concatenate([np.arange(len(plain)), np.repeat(np.arange(len(plain), count), 2)])
        R = Matrix(
            (np.concatenate([np.ones(len(plain)), along.ravel()]), (row, column)), shape=(A.shape[0], count)
        )
        return Matrix(R.T @ A @ R)

    @cached_property
    def _rows(self) -> Rows:
        return self.model.rows(1.0)

    @cached_property
    def _reference(self) -> Array:
        return self.model.bodies.reference()

    @cached_property
    def _buffer(self) -> Array:
        return self.model.bodies.buffer()

    @cached_property
    def _system(self) -> System:
        return system_of(self.model, 1.0)

    def given(self, drives: Array) -> Given:
        """What is known at a time, from cos θ, sin θ, θ' and θ'' of the drives, (drives, 4)."""
        dependent, _, inverse, _ = self._split
        rows = self._rows
        b = np.zeros((3, len(self.model.joints), 2))
        b[0] = rows.reference
        for j, d in zip(rows.driven, rows.drive, strict=True):
            b[:, j] = _turning(complex(*rows.reference[j]), drives[d])
        p = np.zeros((3, self.model.dofs))
        if len(dependent):
            p[:, dependent] = b.reshape(3, -1) @ inverse.T
        along = np.zeros((3, len(self.directions), 2))
        for k, direction in enumerate(self.directions):
            still = np.array([1.0, 0.0, 0.0, 0.0])
            along[:, k] = _turning(
                direction.along, drives[direction.drive] if direction.drive >= 0 else still
            )
        return Given(p, along)

    def independent(self, coordinates: Array, given: Given) -> Array:
        """y of all coordinates, (dofs,)."""
        return self.gather(coordinates[self._split[1]], given.along[0])

    def speeds(self, velocities: Array, y: Array, given: Given) -> Array:
        """ẏ of velocities, (dofs,), or of those nearest to them that joints and drives allow."""
        B, (p, along) = self.basis, given
        left = B.T @ (velocities - p[1] - B @ self.carried(y, along[1]))
        return splu(self.between(Matrix(B.T @ B), along[0])).solve(self.gather(left, along[0]))  # type: ignore[no-any-return]

    def motion(self, y: Array, speed: Array, second: Array, given: Given) -> tuple[Array, Array, Array]:
        """Coordinates, velocities and accelerations, (dofs,), of y, ẏ and ÿ."""
        (t, rate, change), p = given.along, given.p
        z = (
            self.spread(y, t),
            self.spread(speed, t) + self.carried(y, rate),
            self.spread(second, t) + 2.0 * self.carried(speed, rate) + self.carried(y, change),
        )
        q, v, a = (self.basis @ x + known for x, known in zip(z, p, strict=True))
        return q, v, a

    def configuration(self, y: Array, given: Given) -> Array:
        """Coordinates of y as the kernels have them, (rows, nodes)."""
        return self.flat(self.basis @ self.spread(y, given.along[0]) + given.p[0])

    def flat(self, coordinates: Array) -> Array:
        """Coordinates, (dofs,), as the kernels have them, (rows, nodes)."""
        out = self._reference.copy()
        out.reshape(-1)[self.places] = coordinates
        return out

    def loads(self, coordinates: Array, values: Array) -> Array:
        """Varying loads, (dofs,), from their values, (loads, 2)."""
        loads = self.model.loads
        q, f = self.flat(coordinates).reshape(-1), np.zeros(self.model.size)
        for k, place in enumerate(loads.place):
            at = np.array([place, place + loads.nodes])
            x, y = q[at]
            moment = values[k, 0] / (x * x + y * y) if loads.torque[k] else 0.0
            f[at] += [-moment * y, moment * x] if loads.torque[k] else values[k]
        return f[self.places]

    def elastic(self, coordinates: Array) -> Array:
        """Elastic forces, (dofs,)."""
        b = self.model.bodies
        out = np.zeros((b.rows, b.nodes))
        elastic_forces(
            b.formulations, self.flat(coordinates), b.first, b.kinds, b.constants, self._buffer, out
        )
        return out.reshape(-1)[self.places]

    def forces(self, coordinates: Array, values: Array) -> Array:
        """All forces beside those of joints, (dofs,)."""
        dead = self.model.parts.dead[self.places]
        return dead + self.loads(coordinates, values) - self.elastic(coordinates)

    def residual(self, y: Array, speed: Array, second: Array, given: Given, values: Array) -> Array:
        """RᵀBᵀ(F − M q̈) at y, ẏ and ÿ."""
        q, _, a = self.motion(y, speed, second, given)
        return self.gather(self.basis.T @ (self.forces(q, values) - self.model.mass @ a), given.along[0])

    def accelerations(self, y: Array, speed: Array, given: Given, values: Array) -> Array:
        """ÿ."""
        left = self.residual(y, speed, np.zeros(len(y)), given, values)
        return splu(self.inertia(given)).solve(left)  # type: ignore[no-any-return]

    def inertia(self, given: Given) -> Matrix:
        """RᵀBᵀM B R."""
        return self.between(self.mass, given.along[0])

    def stiffness(self, y: Array, given: Given, values: Array) -> Matrix:
        """RᵀBᵀK B R, K the tangent of all forces."""
        model, system, along = self.model, self._system, given.along[0]
        q, rows = self.configuration(y, given), model.bodies.rows
        data, K = np.zeros(len(system.row) + 1), np.zeros((2 * rows, 2 * rows))
        assemble(system, 0.0, model.parts, model.loads, values, q, np.zeros(TANGENT_BUFFER), K, data)
        tangent = matrix_of(system, data)[: model.dofs, : model.dofs]
        return self.between(Matrix(self.basis.T @ tangent @ self.basis), along)


def _independent(phi: Array) -> tuple[int, NDArray[np.int64]]:
    """Rank of rows, and their columns, those first that it takes to solve them."""
    _, R, order = qr(phi, mode="economic", pivoting=True)
    pivots = np.abs(np.diag(R))
    return int((pivots > REDUNDANT * pivots[0]).sum()), order.astype(np.int64)


def _turning(vector: complex, drive: Array) -> list[tuple[float, float]]:
    """A vector turned by cos θ, sin θ, θ' and θ'', and its two derivatives."""
    cos, sin, rate, second = drive
    moved = complex(cos, sin) * vector
    return [((f * moved).real, (f * moved).imag) for f in (1.0, 1j * rate, 1j * second - rate * rate)]
