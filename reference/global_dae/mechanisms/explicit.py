"""Zhai's explicit integrator (Rong 2014, eq. 38) on the equations with multipliers.

[M Jᵀ; J 0] [q̈; μ] = [f; γ] at q_n, v_n; after each step positions and velocities are put back on the constraints:
first the beams' nodes that the ground prescribes, directly, then the rest with the least change in the metric of mass.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from reference.global_dae.mechanisms.independent import independent_rows
from reference.global_dae.mechanisms.march import Failure, Marcher, State
from reference.global_dae.mechanisms.system import System

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Newton's corrections of positions after a step at most; misfit that is rounding, of the size of a vector of 1.
CORRECTIONS, ROUNDING = 12, 1e-14
#: Misfit above which a correction has failed.
KEPT = 1e-8


class Zhai(Marcher):
    """The explicit solver of one system."""

    advice = "take a smaller dt, or a coarser mesh, or an implicit integrator"

    def __init__(self, system: System) -> None:
        super().__init__(system)
        self.mass = cho_factor(system.elastic.mass.toarray())
        self.unit = system.layout.unit

    def begin(self) -> State:
        """The state at t = 0."""
        layout, c = self.system.layout, self.system.constraints
        q, v, p = layout.reference.copy(), layout.velocity.copy(), c.parameters(0.0)
        self.rows = independent_rows(c.jacobian(q, p), self.unit)
        v = self.start(q, v, p)
        a, mu, power = self._accelerate(q, v, 0.0, p)
        self.before, self.power = a, power
        return State(q, v, a, mu, p)

    def step(self, state: State, n: int, t: float) -> State:
        """The step that leads to number n."""
        h, psi, phi = self.run.exact_dt, self.run.psi, self.run.phi
        a, b, c = state.a, self.before, self.system.constraints
        q = state.q + h * state.v + h * h * ((0.5 + psi) * a - psi * b)
        v = state.v + h * ((1.0 + phi) * a - phi * b)
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise Failure("accelerations are not finite", state.a)
        self.before = a
        p = c.parameters(t)
        q, v = self._corrected(q, v, p)
        self.system.keep(q)
        a, mu, power = self._accelerate(q, v, t, p)
        self.account.resist(-0.5 * h * (self.power + power))
        self.power = power
        return State(q, v, a, mu, p)

    def _accelerate(self, q: Array, v: Array, t: float, p: Array) -> tuple[Array, Array, float]:
        """Accelerations, multipliers and the power that damping of materials takes."""
        c = self.system.constraints
        f = self.system.force(q, v, t)
        damping, power = self.system.elastic.damping(q, v)
        free = cho_solve(self.mass, f + damping)
        mu = np.zeros(c.count)
        if c.count:
            J = c.jacobian(q, p)
            mu[self.rows], change = self._least(J, J @ free - c.right(q, v, p))
            free = free + change
        return free, -mu, power

    def _least(self, J: Array, misfit: Array) -> tuple[Array, Array]:
        """Multipliers and the change M⁻¹Jᵀλ that takes a misfit from J x, with the least x M x."""
        for attempt in (0, 1):
            rows = J[self.rows]
            answers = cho_solve(self.mass, rows.T)
            S = rows @ answers
            scale = 1.0 / np.sqrt(np.maximum(np.diagonal(S), 1e-300))
            try:
                factor = cho_factor(scale[:, None] * S * scale)
                if attempt or np.diagonal(factor[0]).min() > 1e-6:
                    break
            except LinAlgError:
                pass
            self.rows = independent_rows(J, self.unit)
        else:
            raise Failure("constraints depend on each other", None)
        right = scale * -misfit[self.rows]
        x = cho_solve(factor, right)
        x += cho_solve(factor, right - (scale[:, None] * S * scale) @ x)
        x *= scale
        return x, answers @ x

    def _corrected(self, q: Array, v: Array, p: Array) -> tuple[Array, Array]:
        c = self.system.constraints
        if not c.count:
            return q, v
        J = c.jacobian(q, p)
        if c.held.any():
            q = q - self._directly(J, c.value(q, p))
        for _ in range(CORRECTIONS):
            misfit = c.value(q, p)
            size = float(np.abs(misfit).max())
            if not np.isfinite(size):
                raise Failure("constraints are not finite", None)
            if size <= ROUNDING * max(1.0, self.system.layout.scene.length):
                break
            q = q + self._least(c.jacobian(q, p), misfit)[1]
        misfit = c.value(q, p)
        if np.abs(misfit).max() > KEPT * max(1.0, self.system.layout.scene.length):
            raise Failure("joints and drives leave the bodies no admissible position", None)
        J, rate = c.jacobian(q, p), c.rate(q, p)
        if c.held.any():
            v = v - self._directly(J, J @ v + rate)
        return q, v + self._least(J, J @ v + rate)[1]

    def _directly(self, J: Array, misfit: Array) -> Array:
        """The least change of coordinates that takes a misfit from what the ground prescribes of beams' nodes."""
        held = self.system.constraints.held
        if not misfit[held].any():
            return np.zeros(J.shape[1])
        return np.asarray(np.linalg.lstsq(J[held], misfit[held], rcond=1e-12)[0])
