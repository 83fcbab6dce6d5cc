"""The equations M q̈ + Jᵀμ = f(q, q̇, t), Φ(q, t) = 0 of a scene as discretised, with its energies and work."""

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from reference.global_dae.beams import Beams, Matrix
from reference.global_dae.connectors import ConnectorForce, Effort
from reference.global_dae.constraints import Constraints
from reference.global_dae.joints import constraints_of
from reference.global_dae.layout import Layout
from reference.global_dae.loads import LoadForce, loads_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class ForceElement(Protocol):
    """What connectors and loads have in common."""

    at: Ints

    def evaluate(self, q: Array, v: Array, t: float, factor: float = 1.0) -> tuple[Array, Array, Array]:
        """Force (k,) and its derivatives −∂f/∂q and −∂f/∂v, (k, k)."""
        ...

    def effort(self, q: Array, v: Array, t: float) -> Effort:
        """What its work is summed up from."""
        ...

    def keep(self, q: Array) -> None:
        """Accept a state."""
        ...


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
        self.connectors = [ConnectorForce(self.layout, c) for c in self.layout.scene.connectors]
        loads = loads_of(self.layout)
        self.dead = self.weight.copy()
        for load in loads:
            if load.dead:
                np.add.at(self.dead, load.at, load.evaluate(self.layout.reference, self.still, 0.0)[0])
        self.loads: list[LoadForce] = [load for load in loads if not load.dead]
        self.elements: Sequence[ForceElement] = [*self.connectors, *self.loads]

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

    def force(self, q: Array, v: Array, t: float, factor: float = 1.0) -> Array:
        """All forces but those of the constraints and of damping of materials."""
        f = factor * self.dead - self.beams.force(q)
        for element in self.elements:
            np.add.at(f, element.at, element.evaluate(q, v, t, factor)[0])
        return f

    def sizes(self, q: Array, v: Array, t: float, factor: float = 1.0) -> Array:
        """Sizes of the terms of `force`, (size,)."""
        f = np.abs(factor * self.dead) + np.abs(self.beams.force(q))
        for element in self.elements:
            np.add.at(f, element.at, np.abs(element.evaluate(q, v, t, factor)[0]))
        return f

    def tangents(self, q: Array, v: Array, t: float, factor: float = 1.0, by_velocity: float = 0.0) -> Matrix:
        """−∂f/∂q − `by_velocity` (1/s) ∂f/∂v."""
        K = self.beams.tangent(q, by_velocity)
        entries = []
        for element in self.elements:
            _, by_q, by_v = element.evaluate(q, v, t, factor)
            entries.append(
                ((by_q + by_velocity * by_v).ravel(), *np.broadcast_arrays(element.at[:, None], element.at))
            )
        if not entries:
            return K
        values, rows, columns = (
            np.concatenate([part.ravel() for part in parts]) for parts in zip(*entries, strict=True)
        )
        return Matrix(K + Matrix((values, (rows, columns)), shape=K.shape))

    def energies(self, q: Array, v: Array, t: float, account: "Account", factor: float = 1.0) -> Array:
        """Kinetic, strain (with that of connectors), potential, work and what damping has taken of it, J."""
        strain = self.beams.energy(q) + sum(c.energy(q, t, factor) for c in self.connectors)
        potential = -float(self.dead @ (q - self.layout.reference))
        kinetic = 0.5 * v @ (self.mass @ v)
        return np.array([kinetic, strain, potential, account.work, 0.0 - account.lost])

    def keep(self, q: Array) -> None:
        """Accept a state: whole turns are counted from here."""
        for element in self.elements:
            element.keep(q)


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
        system = self.system
        c = system.constraints
        efforts = [element.effort(q, v, t) for element in system.elements]
        if c.driven:
            forces = (mu * c.by_parameter(q, p))[c.driven]
            efforts.append(Effort(forces, p[c.driven, 0], p[c.driven, 1]))
        return _joined(efforts), _joined([x.resistance(q, v, t) for x in system.connectors])


def _joined(efforts: list[Effort]) -> Effort:
    none = np.zeros(0)
    return (
        Effort(*(np.concatenate([none, *parts]) for parts in zip(*efforts, strict=True)))
        if efforts
        else Effort(none, none, none)
    )
