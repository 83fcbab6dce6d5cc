"""Forces, tangent and potential energy of a chain under a part of its load, for every search for equilibria."""

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables, elastic_forces, mass_product, strain_energy
from anctmm.discretise.chain import Chain
from anctmm.discretise.joined import Joined
from anctmm.discretise.maps import vector_at
from anctmm.discretise.turning import Turning
from anctmm.forces.actuation import actuation_of
from anctmm.forces.connectors import TURN, add_connectors_at_end, connectors_energy, connectors_work
from anctmm.forces.driving import drive_table
from anctmm.forces.loads import DEAD, FOLLOWER, set_loads
from anctmm.forces.potentials import potential_change
from anctmm.jit.compiling import uncompiled
from anctmm.recursion.constrained import ask_equilibrium, take_equilibrium
from anctmm.recursion.kept.rows import set_signals
from anctmm.recursion.low_rank import correct, factor_border, negative_of
from anctmm.recursion.riccati import block_factors, factorize, links, solve

Array = NDArray[np.float64]

#: Step of the load factor by which forces of connectors are differentiated: they are linear in it, except for laws.
RATE = 1e-3
#: Factor of the penalty of constraints: one of 1 would cancel −Ω² M of rigid bodies that spin, and the stiffness that
#: the weight of one gives a joint below it.
PENALTY = 7.3
#: Corrections that bring coordinates onto the constraints, at most, the error that counts as none, that which rounding
#: may leave, and the longest way.
PROJECTIONS, ROUNDED, CLOSED, NEAREST = 10, 1e-13, 1e-9, 0.3


class Turns(NamedTuple):
    """Turns at an equilibrium, which coordinates tell but for whole ones.

    Parameters
    ----------
    angles : ndarray, shape (nodes,)
        By which sections have turned since the undeformed scene, rad.
    connectors : ndarray or None
        What rotational springs count.
    """

    angles: Array
    connectors: Array | None


class StaticSystem:
    """Equilibrium equations of a chain, K_T solved by the Riccati recursion.

    Coordinates and forces have the shape (rows, nodes); a load factor multiplies gravity and the loads.

    Parameters
    ----------
    chain : Chain
    time : float
        s, at which loads and drives act.
    """

    def __init__(self, chain: Chain, time: float = 0.0) -> None:
        bodies = chain.bodies
        actuation = actuation_of(chain)
        self.chain = chain
        self.reference = bodies.reference()
        #: Turns of sections until the configuration followed last.
        self.turning = Turning(bodies)
        self.values = actuation.load_table(np.full(1, time))[0]
        self.loads = actuation.loads()
        if self.loads.connectors is not None:
            self.loads.connectors.part[2] = 1.0
        #: Rows of the values that are loads: the others stay as they are.
        self.scaled = len(self.loads.kinds)
        self.factors, self.tables = block_factors(chain), bodies.tables()
        self.links = links(chain)
        self.elastic = np.empty((bodies.rows, bodies.nodes))
        loops = self.factors.loops
        self.loops = loops if loops is not None and chain.kept.constraints.names else None
        if self.loops is not None:
            self.loops.rows.penalty[0] = PENALTY
            drives = drive_table(chain, actuation, np.full(1, time))[0]
            uncompiled(set_signals)(self.loops.rows, drives, len(actuation.driven))

    @cached_property
    def joined(self) -> Joined:
        """The independent unknowns."""
        return Joined(self.chain)

    def mass(self, x: Array) -> Array:
        """M x of the independent unknowns x, (size,)."""
        return self.joined.gather(self.inertia(self.joined.spread(x)))

    @property
    def conservative(self) -> bool:
        """Whether all forces have a potential: those that turn with their place have none."""
        return not (self.loads.kinds == FOLLOWER).any()

    def applied(self, q: Array, factor: float) -> Array:
        """Loads and gravity, N; a torque's generalized force depends on q."""
        dead = factor * self.chain.dead_load
        total = dead.copy()
        set_loads(q, total, dead, self.loads, self.values_at(factor))
        return total

    def values_at(self, factor: float) -> Array:
        """Values of the loads at a load factor; connectors take theirs by parts."""
        values = self.values.copy()
        values[: self.scaled] *= factor
        if self.loads.connectors is not None:
            self.loads.connectors.part[0] = factor
        return values

    def residual(self, q: Array, factor: float) -> Array:
        """Loads and forces of connectors less elastic forces, minus the gradient of the potential energy; N."""
        return self._acting(q, factor) - self.elastic_forces(q)

    def _acting(self, q: Array, factor: float) -> Array:
        total = self.applied(q, factor)
        add_connectors_at_end(self.loads.connectors, q, self.values_at(factor), total)
        return total

    def load_rate(self, q: Array, factor: float) -> Array:
        """Derivative of the residual by the load factor, N."""
        if self.loads.connectors is None:
            return self.applied(q, 1.0)
        return (self._acting(q, factor + RATE) - self._acting(q, factor - RATE)) / (2.0 * RATE)

    def restart(self) -> None:
        """Forget all turns: back to the undeformed scene."""
        self.turning.angles = np.zeros_like(self.turning.angles)
        c = self.loads.connectors
        if c is not None:
            c.memory[:, 1] = np.where(c.kinds == TURN, 0.0, c.placed)

    def accept(self, q: Array, factor: float) -> None:
        """Count the turns of sections and of rotational springs from here on."""
        self.turning.follow(q)
        self._acting(q, factor)
        connectors_work(self.loads.connectors, False, self.values_at(factor))

    def turns(self) -> Turns:
        """What is counted until now, for `accept_again`."""
        c = self.loads.connectors
        return Turns(self.turning.angles, None if c is None else c.memory.copy())

    def accept_again(self, turns: Turns) -> None:
        """Back to turns counted before."""
        self.turning.angles = turns.angles
        if self.loads.connectors is not None and turns.connectors is not None:
            self.loads.connectors.memory[:] = turns.connectors

    def turned(self, q: Array, factor: float) -> float:
        """Largest turn of a rotational spring since the equilibrium accepted last, rad."""
        c = self.loads.connectors
        if c is None:
            return 0.0
        self._acting(q, factor)
        return float(np.abs(np.where(c.kinds == TURN, c.now[:, 1] - c.memory[:, 1], 0.0)).max())

    def elastic_forces(self, q: Array) -> Array:
        """Gradient of the strain energy, N; overwritten by the next call."""
        t = self.tables
        elastic_forces(t.formulations, q, t.first, t.kinds, t.constants, t.buffer, self.elastic)
        return self.elastic

    def factorize(self, q: Array, factor: float, shift: float = 0.0, tables: Tables | None = None) -> int:
        """Factor K_T + shift · M (shift in 1/s²), with the stiffness of other `tables` of the bodies if given.

        The number of its negative pivots is returned, that of its negative eigenvalues (Sylvester's law of inertia).
        """
        values = self.values_at(factor)
        with np.errstate(all="ignore"):  # singular where the scene is a mechanism
            negative = int(
                factorize(q, tables or self.tables, self.links, shift, 1.0, self.loads, values, self.factors)
            )
            factor_border(self.loads.border, q, 1.0, self.loads, values, self.factors)
            return negative + negative_of(self.loads.border)

    def solve(self, force: Array) -> Array:
        """Displacements under forces, with the matrix factored last; 0 for known components."""
        with np.errstate(all="ignore"):
            x = solve(self.factors, force)
            if self.loads.border is not None:
                self._correct(x)
            return x

    def _correct(self, x: Array) -> None:
        """Make x the solution with the whole matrix; what is asked of constraints, and their unknowns, stay."""
        kept = () if self.loops is None else (self.loops.load, self.loops.x)
        before = [array.copy() for array in kept]
        for array in kept:
            array[:] = 0.0
        correct(self.loads.border, x, self.factors)
        for array, was in zip(kept, before, strict=True):
            array[:] = was

    def correction(self, q: Array, factor: float) -> Array:
        """Newton's correction of coordinates q with the matrix factored last, constraints included."""
        if self.loops is None:
            return self.solve(self.residual(q, factor))
        ask_equilibrium(self.loops, q)
        found = self.solve(self.residual(q, factor))
        take_equilibrium(self.loops, bool(not np.isfinite(found).all()))
        return found

    def projected(self, q: Array, factor: float, shift: float) -> Array | None:
        """Coordinates near q that keep the constraints; the matrix is factored again as they change.

        None where they are not found, as with a matrix that is nearly singular: a larger shift is needed.
        """
        if self.loops is None:
            return q
        start, nothing = q, np.zeros_like(q)
        off = self._missed(q)
        for _ in range(PROJECTIONS):
            if not off > ROUNDED:
                break
            self.factorize(q, factor, shift)
            ask_equilibrium(self.loops, q)
            q = q + self.solve(nothing)
            off = self._missed(q)
        return q if off <= CLOSED and self.size(q - start) <= NEAREST else None

    def _missed(self, q: Array) -> float:
        """Largest error of a constraint at coordinates q; nothing is asked of the next solution."""
        off = float(ask_equilibrium(self.loops, q))
        take_equilibrium(self.loops, True)
        return off

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
        change = self._elastic_energy(new) - self._elastic_energy(q)
        change -= factor * float((self.chain.dead_load * moved).sum())
        for n in range(self.scaled):
            value = factor * self.values[n]
            a, b = (np.array(uncompiled(vector_at)(self.loads.targets, n, at)) for at in (q, new))
            if self.loads.kinds[n] == DEAD:
                change -= float(value @ (b - a))
            else:
                change -= value[0] * float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
        return change + potential_change(self.loads.connectors, q, new, self.values_at(factor))

    def sizes(self, x: Array) -> Array:
        """Largest component at each node, (nodes,): positions relative to the scene's length, gradients as they are."""
        return np.maximum(np.abs(x[:2]).max(axis=0) / self.chain.length, np.abs(x[2:]).max(axis=0))

    def size(self, x: Array) -> float:
        """Largest of the sizes of all nodes."""
        return float(self.sizes(x).max())

    def strain_energy(self, q: Array, factor: float) -> float:
        """Strain energy of all bodies and connectors, J."""
        self._acting(q, factor)
        return self._elastic_energy(q) + float(connectors_energy(self.loads.connectors))

    def _elastic_energy(self, q: Array) -> float:
        t = self.tables
        return float(strain_energy(t.formulations, q, t.first, t.kinds, t.constants))
