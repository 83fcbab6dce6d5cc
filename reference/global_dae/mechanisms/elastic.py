"""Flexible beams: mass, elastic and damping forces, tangents and energies, on the coordinates of a layout."""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from anctmm.discretise.assembly import damping_forces, elastic_forces, strain_energy
from anctmm.elements.tangent_blocks import TANGENT_BUFFER
from reference.global_dae.assemble import assemble, matrix_of, system_of
from reference.global_dae.mechanisms.layout import Layout
from reference.global_dae.model import Matrix, Model

Array = NDArray[np.float64]


class Elastic:
    """Forces of the beams of a layout, and the masses of all its bodies."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.model: Model | None = layout.beams
        if self.model is not None:
            self.parts, self.buffer = self.model.parts, self.model.bodies.buffer()
            self.flat = np.zeros(self.model.size)
            self.spread = self.flat.reshape(self.model.bodies.rows, -1)
            self.found = np.zeros_like(self.spread)
            self.rates = np.zeros_like(self.spread)

    @cached_property
    def mass(self) -> Matrix:
        """Mass matrix."""
        layout = self.layout
        blocks: list[Any] = [] if self.model is None else [self.model.mass]
        diagonal: list[float] = []
        for body in layout.rigid.values():
            inertia = getattr(body, "inertia", None)
            diagonal += [body.mass, body.mass] + ([] if inertia is None else [inertia, inertia])
        if diagonal:
            blocks.append(sparse.diags_array(diagonal))
        return Matrix(sparse.block_diag(blocks, "csc"))

    @cached_property
    def weight(self) -> Array:
        """Forces of gravity."""
        f = np.zeros(self.layout.size)
        if self.model is not None:
            f[: self.layout.bending] = self.model.bodies.weight().reshape(-1)[self.layout.numbers]
        for name, body in self.layout.rigid.items():
            at = self.layout.first[name]
            f[at : at + 2] = body.mass * np.asarray(self.layout.scene.gravity)
        return f

    def force(self, q: Array) -> Array:
        """Elastic forces, the gradient of the strain energy."""
        f = np.zeros(len(q))
        if self.model is not None:
            p = self.parts
            elastic_forces(
                p.formulations, self._nodal(q), p.first, p.kinds, p.constants, self.buffer, self.found
            )
            f[: self.layout.bending] = self.found.reshape(-1)[self.layout.numbers]
        return f

    def energy(self, q: Array) -> float:
        """Strain energy, J."""
        if self.model is None:
            return 0.0
        p = self.parts
        return float(strain_energy(p.formulations, self._nodal(q), p.first, p.kinds, p.constants))

    @property
    def damped(self) -> bool:
        """Whether a material damps."""
        return self.model is not None and self.model.bodies.damping is not None

    def damping(self, q: Array, v: Array) -> tuple[Array, float]:
        """Damping forces, that work against v, and the power that they take, W."""
        f, power = np.zeros(len(q)), 0.0
        if self.model is not None and self.model.bodies.damping is not None:
            p = self.parts
            self.rates.reshape(-1)[self.layout.numbers] = v[: self.layout.bending]
            self.found[:] = 0.0
            power = damping_forces(
                p.formulations, self._nodal(q), self.rates, p.first, p.kinds, p.constants,
                self.model.bodies.damping, self.buffer, self.found,
            )  # fmt: skip
            f[: self.layout.bending] = self.found.reshape(-1)[self.layout.numbers]
        return f, float(power)

    def tangent(self, q: Array, by_velocity: float = 0.0) -> Matrix:
        """Tangent of the elastic forces, and `by_velocity` times that of damping (stiffness times its time)."""
        size = self.layout.size
        if self.model is None:
            return Matrix((size, size))
        model, parts = self.model, self.parts
        if by_velocity and model.bodies.damping is not None:
            parts = parts._replace(
                constants=model.bodies.stiffened(
                    1.0 + by_velocity * model.bodies.damping, stresses=False
                ).constants
            )
        system, data, small, K = self._pattern
        assemble(system, 0.0, parts, model.loads, np.zeros((0, 2)), self._nodal(q), small, K, data)
        found = sparse.coo_array(matrix_of(system, data))
        return Matrix((found.data, (found.row, found.col)), shape=(size, size))

    def viscous(self) -> Matrix:
        """Tangent of the damping forces by velocities in the reference."""
        none = self.tangent(self.layout.reference)
        return Matrix(self.tangent(self.layout.reference, 1.0) - none) if self.damped else Matrix(none.shape)

    @cached_property
    def _pattern(self):  # type: ignore[no-untyped-def]
        assert self.model is not None
        system, rows = system_of(self.model, 1.0), 2 * self.model.bodies.rows
        return system, np.zeros(len(system.row) + 1), np.zeros(TANGENT_BUFFER), np.zeros((rows, rows))

    def _nodal(self, q: Array) -> Array:
        self.flat[self.layout.numbers] = q[: self.layout.bending]
        return self.spread
