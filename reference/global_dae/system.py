"""The equations M q̈ + Jᵀμ = f(q, q̇, t), Φ(q, t) = 0 of a scene as discretised, with its energies and what does work."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from reference.global_dae.constraints import Constraints
from reference.global_dae.elements import Beams, Matrix
from reference.global_dae.forces import ConnectorForce, Effort, ForceElement, LoadForce, Parts
from reference.global_dae.joints import constraints_of
from reference.global_dae.layout import Layout
from reference.global_dae.vectors import Stack

Array = NDArray[np.float64]


class System:
    """The equations of a layout."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.size, self.run = layout, layout.size, layout.run
        self.beams = Beams(layout)
        self.constraints = Constraints(constraints_of(layout), layout.size)
        self.still = np.zeros(self.size)
        loads = [LoadForce(layout, load) for load in layout.scene.loads]
        self.connectors = [ConnectorForce(layout, c) for c in layout.scene.connectors]
        # weight: the mass under one acceleration
        self.dead = self.mass @ (layout.places * np.resize(layout.scene.gravity, self.size))
        for load in (load for load in loads if load.dead):
            np.add.at(self.dead, load.vectors[0].at, load.value(0.0) @ load.vectors[0].A)
        self.loads: list[LoadForce] = [load for load in loads if not load.dead]
        self.elements: Sequence[ForceElement] = [*self.connectors, *self.loads]
        self.acted_on = Stack([vector for element in self.elements for vector in element.vectors], self.size)
        self.ends = np.cumsum([len(element.vectors) for element in self.elements])[:-1]

    @cached_property
    def mass(self) -> Matrix:
        """Mass matrix."""
        diagonal = np.zeros(self.size)
        for name, body in self.layout.rigid.items():
            at = self.layout.first[name]
            diagonal[at : at + 2] = body.mass
            if (inertia := getattr(body, "inertia", None)) is not None:
                diagonal[at + 2 : at + 4] = inertia
        return Matrix(self.beams.mass() + sparse.diags_array(diagonal))

    def states(self, q: Array, v: Array) -> list[tuple[ForceElement, Array, Array]]:
        """Connectors and loads, each with the values and the rates of its vectors."""
        if not self.elements:
            return []
        x, y = (np.split(z, self.ends) for z in (self.acted_on(q), self.acted_on.rate(v)))
        return list(zip(self.elements, x, y, strict=True))

    def _parts(self, q: Array, v: Array, t: float, factor: float) -> list[Parts]:
        return [element.evaluate(x, y, t, factor) for element, x, y in self.states(q, v)]

    def force(self, q: Array, v: Array, t: float, factor: float = 1.0) -> Array:
        """All forces but those of the constraints and of damping of materials."""
        f = factor * self.dead - self.beams.force(q)
        if parts := self._parts(q, v, t, factor):
            f += self.acted_on.V.T @ np.concatenate([part[0] for part in parts])
        return f

    def tangents(self, q: Array, v: Array, t: float, factor: float = 1.0, by_velocity: float = 0.0) -> Matrix:
        """−∂f/∂q − `by_velocity` (1/s) ∂f/∂v."""
        K = self.beams.tangent(q, by_velocity)
        if parts := self._parts(q, v, t, factor):
            blocks: Any = sparse.block_diag([by_x + by_velocity * by_y for _, by_x, by_y in parts])
            K = Matrix(K + self.acted_on.V.T @ blocks @ self.acted_on.V)
        return K

    def energies(self, q: Array, v: Array, t: float, work: Array, factor: float = 1.0) -> Array:
        """Kinetic, strain (with that of connectors), potential, work and what damping has taken of it, J.

        `work` is all work, and that of damping, (2,).
        """
        strain = float(self.beams.energy(q[None])[0])
        strain += sum(
            c.energy(x, t, factor) for c, x, _ in self.states(q, v) if isinstance(c, ConnectorForce)
        )
        potential = -float(self.dead @ (q - self.layout.reference))
        return np.array([0.5 * v @ (self.mass @ v), strain, potential, work[0], 0.0 - work[1]])

    def efforts(self, q: Array, v: Array, t: float, p: Array, mu: Array) -> tuple[Effort, Effort]:
        """What does work beside energies, without the damping of materials, and the part of damping in it."""
        pairs = [element.effort(x, y, t) for element, x, y in self.states(q, v)]
        c = self.constraints
        drives = Effort(mu * c.by_parameter(q, p), p[:, 0], p[:, 1])
        all_of = [drives, *(work for work, _ in pairs)], [Effort(*np.zeros((3, 0))), *(d for _, d in pairs)]
        work, damping = (
            Effort(*(np.concatenate(part) for part in zip(*efforts, strict=True))) for efforts in all_of
        )
        return work, damping

    def accept(self, q: Array) -> None:
        """Accept a state: whole turns are counted from here."""
        for element, x, _ in self.states(q, self.still):
            element.accept(x)
