"""Zhai's explicit integrator (Rong 2014, eq. 38) on the equations with multipliers.

[M Jᵀ; J 0] [q̈; μ] = [f; γ] at q_n, v_n; q_{n+1} = q_n + h v_n + (½ + ψ) h² a_n − ψ h² a_{n−1},
v_{n+1} = v_n + (1 + φ) h a_n − φ h a_{n−1}, a_{−1} := a_0. Then positions and velocities are put back on the
constraints: coordinates of beams' nodes that joints or drives prescribe are set, the rest changes least in the metric
of mass.
"""

import numpy as np
from numpy.typing import NDArray

from reference.global_dae.marching import Failure, Marcher, State
from reference.global_dae.saddle import Nearest, Saddle, independent_rows
from reference.global_dae.system import System

Array = NDArray[np.float64]

#: Newton's corrections of positions after a step at most; misfit that is rounding, and that which has failed, of the
#: scene's length.
CORRECTIONS, ROUNDING, KEPT = 12, 1e-14, 1e-8


class Zhai(Marcher):
    """The explicit solver of one system."""

    advice = "take a smaller dt, or a coarser mesh, or an implicit integrator"

    def __init__(self, system: System, projected: bool = True) -> None:
        super().__init__(system)
        self.projected = projected
        self.saddle: Saddle | None = None
        self.length = max(1.0, system.layout.scene.length)

    def begin(self) -> State:
        """The state at t = 0."""
        layout, c = self.system.layout, self.system.constraints
        q, v, p = layout.reference.copy(), layout.velocity.copy(), c.parameters(0.0)
        J = c.jacobian(q, p)
        self.rows = independent_rows(J, layout.unit)
        self.prescribe = Nearest(J[c.held])
        v = v - Nearest(J)(J @ v + c.rate(q, p))
        state = self._accelerated(q, v, 0.0, p)
        self.before = state.a
        return state

    def step(self, state: State, t: float) -> State:
        """The next step."""
        h, psi, phi, power = self.run.exact_dt, self.run.psi, self.run.phi, self.power
        a, b = state.a, self.before
        q = state.q + h * state.v + h * h * ((0.5 + psi) * a - psi * b)
        v = state.v + h * ((1.0 + phi) * a - phi * b)
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise Failure("accelerations are not finite", state.a)
        self.before, p = a, self.system.constraints.parameters(t)
        if self.projected and self.system.constraints.count:
            q, v = self._corrected(q, v, p)
        self.system.keep(q)
        found = self._accelerated(q, v, t, p)
        self.account.resist(0.5 * h * (power + self.power))
        return found

    def _accelerated(self, q: Array, v: Array, t: float, p: Array) -> State:
        c, damping = self.system.constraints, self.system.beams.damping(q, v)
        self.power = float(damping @ v)
        force, right = self.system.force(q, v, t) + damping, c.right(q, v, p)
        if not (np.isfinite(force).all() and np.isfinite(right).all()):
            raise Failure("accelerations are not finite", force)
        mu, saddle = np.zeros(c.count), self._saddle(q, p)
        a, mu[self.rows] = saddle.solve(force, right[self.rows])
        return State(q, v, a, mu, p)

    def _saddle(self, q: Array, p: Array) -> Saddle:
        """Factors of [M Jᵀ; J 0], found once where J is constant; other rows are chosen where these are dependent."""
        c = self.system.constraints
        if self.saddle is not None and c.constant:
            return self.saddle
        J = c.jacobian(q, p)
        try:
            self.saddle = Saddle(self.system.mass, J[self.rows])
        except Failure:
            self.rows = independent_rows(J, self.system.layout.unit)
            self.saddle = Saddle(self.system.mass, J[self.rows])
        self.factorizations += 1
        return self.saddle

    def _corrected(self, q: Array, v: Array, p: Array) -> tuple[Array, Array]:
        """Positions and velocities on the constraints."""
        c = self.system.constraints
        q = q - self.prescribe(c.value(q, p)[c.held])
        found = self._on_constraints(q, p)
        if found is None:  # rows that were left out do not follow from the others
            self.rows, self.saddle = independent_rows(c.jacobian(q, p), self.system.layout.unit), None
            found = self._on_constraints(q, p)
        if found is None:
            raise Failure("joints and drives leave the bodies no admissible position")
        J, rate = c.jacobian(found, p), c.rate(found, p)
        v = v - self.prescribe((J @ v + rate)[c.held])
        return found, v + self._saddle(found, p).solve(self.system.still, -(J @ v + rate)[self.rows])[0]

    def _on_constraints(self, q: Array, p: Array) -> Array | None:
        """Positions by Newton's corrections of least size; None where they do not fulfil all constraints."""
        c = self.system.constraints
        for _ in range(CORRECTIONS):
            gap = c.value(q, p)
            if not np.isfinite(gap).all():
                raise Failure("constraints are not finite")
            if np.abs(gap).max() <= ROUNDING * self.length:
                return q
            q = q + self._saddle(q, p).solve(self.system.still, -gap[self.rows])[0]
        return q if np.abs(c.value(q, p)).max() <= KEPT * self.length else None
