"""Zhai's explicit integrator (Rong 2014, eq. 38) on the equations with multipliers.

[M Jᵀ; J 0] [q̈; μ] = [f; γ] at q_n, v_n; q_{n+1} = q_n + h v_n + (½ + ψ) h² a_n − ψ h² a_{n−1},
v_{n+1} = v_n + (1 + φ) h a_n − φ h a_{n−1}, a_{−1} := a_0. Then positions and velocities are put back on the
constraints: coordinates of beams' nodes that joints or drives prescribe are set, the rest changes least in the metric
of mass.
"""

import numpy as np
from numpy.typing import NDArray

from reference.global_dae.marching import Failure, Marcher, State
from reference.global_dae.saddle import Nearest, Saddle
from reference.global_dae.system import System

Array = NDArray[np.float64]

#: Newton's corrections of positions after a step at most; misfit that is rounding, and that which has failed, of the
#: scene's length.
CORRECTIONS, ROUNDING, KEPT = 12, 1e-14, 1e-8


class Zhai(Marcher):
    """The explicit solver of one system."""

    advice = "take a smaller dt, or a coarser mesh, or an implicit integrator"

    def __init__(self, system: System) -> None:
        super().__init__(system)
        self.saddle: Saddle | None = None

    def begin(self) -> State:
        """The state at t = 0."""
        layout, c = self.system.layout, self.system.constraints
        q, v, p = layout.reference.copy(), layout.velocity.copy(), c.parameters(0.0)
        J = c.jacobian(q, p)
        self.prescribe = Nearest(J[c.held])
        state = self._accelerated(q, v - Nearest(J)(J @ v + c.rate(q, p)), 0.0, p)
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
        if self.system.constraints.count:
            q, v = self._projected(q, v, p)
        self.system.accept(q)
        found = self._accelerated(q, v, t, p)
        self.account.resist(0.5 * h * (power + self.power))
        return found

    def _accelerated(self, q: Array, v: Array, t: float, p: Array) -> State:
        c, damping = self.system.constraints, self.system.beams.damping(q, v)
        self.power = float(damping @ v)
        force, right = self.system.force(q, v, t) + damping, c.right(q, v, p)
        if not (np.isfinite(force).all() and np.isfinite(right).all()):
            raise Failure("accelerations are not finite", force)
        return State(q, v, *self._factored(q, p).solve(force, right), p)

    def _factored(self, q: Array, p: Array) -> Saddle:
        """Factors of [M Jᵀ; J 0], found once where J is constant."""
        c = self.system.constraints
        if self.saddle is None or not c.constant:
            self.saddle = Saddle(self.system.mass, c.jacobian(q, p))
            self.factorizations += 1
        return self.saddle

    def _projected(self, q: Array, v: Array, p: Array) -> tuple[Array, Array]:
        """Positions, by Newton's corrections of least size, and velocities on the constraints."""
        c, still = self.system.constraints, self.system.still
        q = q - self.prescribe(c.value(q, p)[c.held])
        for _ in range(CORRECTIONS):
            gap = c.value(q, p)
            if not np.isfinite(gap).all():
                raise Failure("constraints are not finite")
            if np.abs(gap).max() <= ROUNDING * self.length:
                break
            q = q + self._factored(q, p).solve(still, -gap)[0]
        else:
            if not np.abs(c.value(q, p)).max() <= KEPT * self.length:
                raise Failure("joints and drives leave the bodies no admissible position")
        J, rate = c.jacobian(q, p), c.rate(q, p)
        v = v - self.prescribe((J @ v + rate)[c.held])
        return q, v + self._factored(q, p).solve(still, -(J @ v + rate))[0]
