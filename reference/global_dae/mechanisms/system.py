"""The equations of a scene as discretised: mass, forces with derivatives, constraints, energies and work."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from reference.global_dae.mechanisms.connectors import ConnectorForce
from reference.global_dae.mechanisms.constraints import Constraints
from reference.global_dae.mechanisms.elastic import Elastic
from reference.global_dae.mechanisms.joints import constraints_of
from reference.global_dae.mechanisms.layout import Layout
from reference.global_dae.mechanisms.loads import LoadForce, loads_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class ForceElement(Protocol):
    """What connectors and loads have in common."""

    at: Ints

    def evaluate(self, q: Array, v: Array, t: float, factor: float = 1.0) -> tuple[Array, Array, Array]:
        """Force (k,) and its derivatives −∂f/∂q and −∂f/∂v, (k, k)."""
        ...

    def effort(self, q: Array, v: Array, t: float) -> tuple[Array, Array]:
        """What its work is summed up from: forces, and the values that they work along."""
        ...

    def keep(self, q: Array) -> None:
        """Accept a state."""
        ...


class System:
    """M q̈ + Jᵀμ = f, Φ = 0 of a layout."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.size = layout, layout.size
        self.elastic = Elastic(layout)
        self.constraints = Constraints(constraints_of(layout), layout.size)
        self.restart()

    def restart(self) -> None:
        """Forget the turns of angles: back to the reference."""
        self.connectors = [ConnectorForce(self.layout, c) for c in self.layout.scene.connectors]
        loads = loads_of(self.layout)
        self.dead = self.elastic.weight.copy()
        for load in loads:
            if load.dead:
                np.add.at(self.dead, load.at, load.evaluate(self.layout.reference, self.still, 0.0)[0])
        self.loads: list[LoadForce] = [load for load in loads if not load.dead]

    @property
    def still(self) -> Array:
        """Velocities of rest."""
        return np.zeros(self.size)

    @property
    def elements(self) -> list[ForceElement]:
        """Force elements."""
        return [*self.connectors, *self.loads]

    def force(self, q: Array, v: Array, t: float, factor: float = 1.0) -> Array:
        """All forces but those of the constraints and of damping of materials."""
        f = factor * self.dead - self.elastic.force(q)
        for element in self.elements:
            np.add.at(f, element.at, element.evaluate(q, v, t, factor)[0])
        return f

    def tangents(
        self, q: Array, v: Array, t: float, factor: float = 1.0, by_velocity: float = 0.0
    ) -> tuple[Array, Array]:
        """−∂f/∂q and −∂f/∂v, (size, size); damping of materials counts as stiffness by `by_velocity`."""
        K, D = self.elastic.tangent(q, by_velocity).toarray(), np.zeros((self.size, self.size))
        for element in self.elements:
            _, by_q, by_v = element.evaluate(q, v, t, factor)
            K[np.ix_(element.at, element.at)] += by_q
            D[np.ix_(element.at, element.at)] += by_v
        return K, D

    def energies(self, q: Array, v: Array, t: float, account: "Account") -> Array:
        """Kinetic, strain (with that of connectors), potential, work and what damping has taken of it, J."""
        strain = self.elastic.energy(q) + sum(c.energy(q, t) for c in self.connectors)
        potential = -float(self.dead @ (q - self.layout.reference))
        kinetic = 0.5 * v @ (self.elastic.mass @ v)
        return np.array([kinetic, strain, potential, account.work, 0.0 - account.lost])

    def keep(self, q: Array) -> None:
        """Accept a state: turns are counted from here."""
        for element in self.elements:
            element.keep(q)


class Account:
    """Work of drives, connectors and loads, summed up from step to step by the trapezoidal rule, J; that of damping."""

    def __init__(self, system: System) -> None:
        self.system, self.work, self.lost = system, 0.0, 0.0
        self.before: tuple[Array, Array] | None = None
        self.resisting: Array | None = None

    def add(self, q: Array, v: Array, t: float, p: Array, mu: Array) -> None:
        """Account for the step that leads here."""
        pairs = [element.effort(q, v, t) for element in self.system.elements]
        pairs.append(self.system.constraints.effort(q, p, mu))
        forces, places = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        if self.before is not None:
            self.work += float(0.5 * (forces + self.before[0]) @ (places - self.before[1]))
        self.before = forces, places
        resisting = np.array([c.resistance(q, v, t) for c in self.system.connectors]).reshape(-1, 2)
        if self.resisting is not None:
            change = resisting - self.resisting
            self.lost += float((resisting[:, 0] - 0.5 * change[:, 0]) @ change[:, 1])
        self.resisting = resisting

    def resist(self, work: float) -> None:
        """Account for the work of damping of materials."""
        self.work += work
        self.lost += work
