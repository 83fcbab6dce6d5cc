"""The equations of a model in independent coordinates: joints are solved for the others, and no multiplier is left.

Joints are Φ q = b(t) with a constant Φ. With q = B y + p(t), Φ B = 0 and Φ p = b, the equations M q̈ + Φᵀμ = F become
BᵀM B ÿ = Bᵀ(F − M p̈): ordinary differential equations, for methods that lose order with multipliers.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import qr
from scipy.sparse.linalg import splu

from anctmm.discretise.assembly import elastic_forces
from anctmm.elements.tangent_blocks import TANGENT_BUFFER
from reference.global_dae.assemble import System, assemble, matrix_of, system_of
from reference.global_dae.model import Matrix, Model

Array = NDArray[np.float64]
#: Part of the largest pivot of the joints' rows below which a row says nothing new.
REDUNDANT = 1e-12


@dataclass(frozen=True)
class Reduced:
    """A model in independent coordinates y, some of its coordinates.

    Parameters
    ----------
    model : Model
        Without damping: forces depend on coordinates and time.
    """

    model: Model

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
        _, R, order = qr(phi, mode="economic", pivoting=True)
        pivots = np.abs(np.diag(R))
        rank = int((pivots > REDUNDANT * pivots[0]).sum())
        dependent, independent = np.sort(order[:rank]), np.sort(order[rank:])
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
    def _mass_factors(self):  # type: ignore[no-untyped-def]
        return splu(self.mass)

    @cached_property
    def _system(self) -> System:
        return system_of(self.model, 1.0)

    def prescribed(self, drives: Array) -> Array:
        """p, ṗ and p̈, (3, dofs), from cos θ, sin θ, θ' and θ'' of the drives, (drives, 4)."""
        dependent, _, inverse, _ = self._split
        rows = self.model.rows(1.0)
        b = np.zeros((3, len(self.model.joints), 2))
        b[0] = rows.reference
        for j, d in zip(rows.driven, rows.drive, strict=True):
            cos, sin, rate, second = drives[d]
            moved = complex(cos, sin) * complex(*rows.reference[j])
            for k, factor in enumerate((1.0, 1j * rate, 1j * second - rate * rate)):
                b[k, j] = (factor * moved).real, (factor * moved).imag
        p = np.zeros((3, self.model.dofs))
        if len(dependent):
            p[:, dependent] = b.reshape(3, -1) @ inverse.T
        return p

    def independent(self, coordinates: Array) -> Array:
        """y of all coordinates, (dofs,)."""
        return coordinates[self._split[1]]

    def flat(self, coordinates: Array) -> Array:
        """Coordinates, (dofs,), as the kernels have them, (rows, nodes)."""
        out = self.model.bodies.reference()
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
        elastic_forces(b.formulations, self.flat(coordinates), b.first, b.kinds, b.constants, b.buffer(), out)
        return out.reshape(-1)[self.places]

    def forces(self, coordinates: Array, values: Array) -> Array:
        """All forces beside those of joints, (dofs,)."""
        dead = self.model.parts.dead[self.places]
        return dead + self.loads(coordinates, values) - self.elastic(coordinates)

    def residual(self, y: Array, p: Array, values: Array) -> Array:
        """Bᵀ(F − M p̈) at y, p of `prescribed`."""
        coordinates = self.basis @ y + p[0]
        return self.basis.T @ (self.forces(coordinates, values) - self.model.mass @ p[2])  # type: ignore[no-any-return]

    def accelerations(self, y: Array, p: Array, values: Array) -> Array:
        """ÿ."""
        return self._mass_factors.solve(self.residual(y, p, values))  # type: ignore[no-any-return]

    def stiffness(self, y: Array, p: Array, values: Array) -> Matrix:
        """BᵀK B, K the tangent of all forces."""
        model, system = self.model, self._system
        q, rows = self.flat(self.basis @ y + p[0]), model.bodies.rows
        data, K = np.zeros(len(system.row) + 1), np.zeros((2 * rows, 2 * rows))
        assemble(system, 0.0, model.parts, model.loads, values, q, np.zeros(TANGENT_BUFFER), K, data)
        tangent = matrix_of(system, data)[: model.dofs, : model.dofs]
        return Matrix(self.basis.T @ tangent @ self.basis)
