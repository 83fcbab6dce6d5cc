"""The equations M q̈ + Jᵀμ = f(q, q̇, t), Φ(q, t) = 0 of a scene as discretised, with its energies and work."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from reference.global_dae.constraints import Constraints
from reference.global_dae.elements import Beams, Matrix
from reference.global_dae.forces import ConnectorForce, Effort, ForceElement, LoadForce, Parts, loads_of
from reference.global_dae.joints import constraints_of
from reference.global_dae.layout import Layout
from reference.global_dae.vectors import Stack

Array = NDArray[np.float64]


class System:
    """The equations of a layout."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.size = layout, layout.size
        self.beams = Beams(layout)
        self.constraints = Constraints(constraints_of(layout), layout.size)
        self.still = np.zeros(self.size)
        self.restart()

    def restart(self) -> None:
        """Back to the reference, from which whole turns of angles are counted."""
        layout, loads = self.layout, loads_of(self.layout)
        self.connectors = [ConnectorForce(layout, c) for c in layout.scene.connectors]
        self.dead = self.weight.copy()
        for load in loads:
            if load.dead:
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

    @cached_property
    def weight(self) -> Array:
        """Forces of gravity."""
        f = self.beams.weight(self.layout.scene.gravity)
        for name, body in self.layout.rigid.items():
            at = self.layout.first[name]
            f[at : at + 2] = body.mass * np.asarray(self.layout.scene.gravity)
        return f

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

    def sizes(self, q: Array, v: Array, t: float, factor: float = 1.0) -> Array:
        """Sizes of the terms of `force`, (size,)."""
        f = np.abs(factor * self.dead) + np.abs(self.beams.force(q))
        if parts := self._parts(q, v, t, factor):
            f += abs(self.acted_on.V).T @ np.abs(np.concatenate([part[0] for part in parts]))
        return f

    def tangents(self, q: Array, v: Array, t: float, factor: float = 1.0, by_velocity: float = 0.0) -> Matrix:
        """−∂f/∂q − `by_velocity` (1/s) ∂f/∂v."""
        K = self.beams.tangent(q, by_velocity)
        if parts := self._parts(q, v, t, factor):
            blocks: Any = sparse.block_diag([by_x + by_velocity * by_y for _, by_x, by_y in parts])
            K = Matrix(K + self.acted_on.V.T @ blocks @ self.acted_on.V)
        return K

    def energies(self, q: Array, v: Array, t: float, account: "Account", factor: float = 1.0) -> Array:
        """Kinetic, strain (with that of connectors), potential, work and what damping has taken of it, J."""
        strain = float(self.beams.energy(q[None])[0])
        strain += sum(
            c.energy(x, t, factor) for c, x, _ in self.states(q, v) if isinstance(c, ConnectorForce)
        )
        potential = -float(self.dead @ (q - self.layout.reference))
        kinetic = 0.5 * v @ (self.mass @ v)
        return np.array([kinetic, strain, potential, account.work, 0.0 - account.lost])

    def accept(self, q: Array) -> None:
        """Accept a state: whole turns are counted from here."""
        for element, x, _ in self.states(q, self.still):
            element.accept(x)


class Account:
    """Work of drives, connectors, loads and damping, J, and the part of damping."""

    def __init__(self, system: System) -> None:
        self.system, self.work, self.lost = system, 0.0, 0.0
        self.before: tuple[Effort, Effort] | None = None

    def add(self, q: Array, v: Array, t: float, p: Array, mu: Array) -> None:
        """Add the work of the step that leads here, by the trapezoidal rule."""
        now = self._efforts(q, v, t, p, mu)
        if self.before is not None:
            work, lost = (
                float(0.5 * (new.forces + old.forces) @ (new.values - old.values))
                for new, old in zip(now, self.before, strict=True)
            )
            self.work, self.lost = self.work + work, self.lost + lost
        self.before = now

    def power(self, q: Array, v: Array, t: float, p: Array, mu: Array) -> Array:
        """Power of all of these without the damping of materials, and of damping, W, (2,)."""
        return np.array([effort.forces @ effort.rates for effort in self._efforts(q, v, t, p, mu)])

    def resist(self, work: float) -> None:
        """Add the work of damping of materials."""
        self.work += work
        self.lost += work

    def _efforts(self, q: Array, v: Array, t: float, p: Array, mu: Array) -> tuple[Effort, Effort]:
        states, c = self.system.states(q, v), self.system.constraints
        efforts = [element.effort(x, y, t) for element, x, y in states]
        if c.driven:
            forces = (mu * c.by_parameter(q, p))[c.driven]
            efforts.append(Effort(forces, p[c.driven, 0], p[c.driven, 1]))
        resistances = [e.resistance(x, y, t) for e, x, y in states if isinstance(e, ConnectorForce)]
        return _joined(efforts), _joined(resistances)


def _joined(efforts: list[Effort]) -> Effort:
    none = Effort(*np.zeros((3, 0)))
    return Effort(*(np.concatenate(parts) for parts in zip(none, *efforts, strict=True)))
