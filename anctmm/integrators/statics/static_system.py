"""Forces, tangent and potential of a chain under a part of its load: what every search for an equilibrium needs."""

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import elastic_forces, mass_product, strain_energy
from anctmm.discretise.chain import Chain
from anctmm.forces.actuation import Actuation, set_loads
from anctmm.recursion.riccati import block_factors, factorize, links, solve

Array = NDArray[np.float64]


class StaticSystem:
    """Equilibrium equations of a chain, K_T solved by the Riccati recursion.

    Coordinates and forces have the shape (rows, nodes); a load factor multiplies gravity and the loads of t = 0.

    Parameters
    ----------
    chain : Chain
    """

    def __init__(self, chain: Chain) -> None:
        bodies, actuation = chain.bodies, Actuation(chain.scene, chain.bodies)
        self.chain = chain
        self.reference = bodies.reference()
        self.values = actuation.load_table(np.zeros(1))[0]
        self.loads = actuation.loads()
        self.factors, self.tables = block_factors(chain), bodies.tables()
        self.links = links(chain)
        self.elastic = np.empty((bodies.rows, bodies.nodes))

    def applied(self, q: Array, factor: float) -> Array:
        """Loads and gravity, N; a torque's generalized force depends on q."""
        dead = factor * self.chain.dead_load
        total = dead.copy()
        set_loads(q, total, dead, self.loads, factor * self.values)
        return total

    def residual(self, q: Array, factor: float) -> Array:
        """Loads less elastic forces, minus the gradient of the potential energy; N."""
        return self.applied(q, factor) - self.elastic_forces(q)

    def elastic_forces(self, q: Array) -> Array:
        """Gradient of the strain energy, N; overwritten by the next call."""
        t = self.tables
        elastic_forces(t.blend, q, t.first, t.kinds, t.constants, t.buffer, self.elastic)
        return self.elastic

    def factorize(self, q: Array, factor: float, shift: float = 0.0) -> int:
        """Factor K_T + shift · M (shift in 1/s²); the number of its negative pivots, that of its negative eigenvalues
        (Sylvester's law of inertia).
        """
        values = factor * self.values
        return int(factorize(q, self.tables, self.links, shift, 1.0, self.loads, values, self.factors))

    def solve(self, force: Array) -> Array:
        """Displacements under forces, with the matrix factored last; 0 for known components."""
        with np.errstate(all="ignore"):
            return solve(self.factors, force)

    def inertia(self, x: Array) -> Array:
        """Product of the mass matrix with x."""
        out = np.empty_like(x)
        mass_product(x, self.tables.first, self.tables.masses, self.tables.buffer, out)
        return out

    def potential_change(self, q: Array, new: Array, factor: float) -> float:
        """Strain energy and potential of the loads at coordinates `new`, less those at q, J.

        A torque M has the potential −M θ, θ the angle of the vector it turns: by less than half a turn at once.
        """
        moved = new - q
        change = self.strain_energy(new) - self.strain_energy(q)
        change -= factor * float((self.chain.dead_load * moved).sum())
        for node, row, value in zip(self.loads.nodes, self.loads.rows, factor * self.values, strict=True):
            if row == 0:
                change -= float(value @ moved[:2, node])
            else:
                a, b = q[row : row + 2, node], new[row : row + 2, node]
                change -= value[0] * float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
        return change

    def sizes(self, x: Array) -> Array:
        """Largest component at each node, (nodes,): positions relative to the scene's length, gradients as they are."""
        return np.maximum(np.abs(x[:2]).max(axis=0) / self.chain.length, np.abs(x[2:]).max(axis=0))

    def size(self, x: Array) -> float:
        """Largest of the sizes of all nodes."""
        return float(self.sizes(x).max())

    def strain_energy(self, q: Array) -> float:
        """Strain energy of all bodies, J."""
        t = self.tables
        return float(strain_energy(t.blend, q, t.first, t.kinds, t.constants))
