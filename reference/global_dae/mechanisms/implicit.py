"""Implicit generalized-α in index-3 form (Arnold & Brüls 2007) on M q̈ + Jᵀμ = f, Φ = 0.

The same scheme as that of `reference.global_dae.implicit`, with forces that depend on velocities, constraints that are
not linear, and a full Newton iteration.
"""

import numpy as np
from numpy.typing import NDArray

from reference.global_dae.mechanisms.independent import independent_rows
from reference.global_dae.mechanisms.march import Failure, Marcher, State
from reference.global_dae.mechanisms.system import System

Array = NDArray[np.float64]

#: Newton iterations a step may take; roundings of the largest terms that a residual may have.
ITERATIONS, ROUNDINGS, EPSILON = 40, 8.0, float(np.finfo(np.float64).eps)
#: Misfit of constraints left out as following from others, of the scene's length, above which they do not.
MISSED = 1e-9


class GeneralizedAlpha(Marcher):
    """The implicit solver of one system."""

    advice = "take a smaller dt, a coarser mesh, more damping (spectral_radius) or a larger newton_tolerance"

    def __init__(self, system: System) -> None:
        super().__init__(system)
        self.factorizations = 0
        h, rho = self.run.exact_dt, self.run.spectral_radius
        self.h, self.alpha_m, self.alpha_f = h, (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        self.gamma = 0.5 + self.alpha_f - self.alpha_m
        self.beta = 0.25 * (self.gamma + 0.5) ** 2
        self.by_a = (1.0 - self.alpha_m) / (self.beta * h * h * (1.0 - self.alpha_f))
        self.by_v = self.gamma / (self.beta * h)
        self.mass = system.elastic.mass.toarray()

    def begin(self) -> State:
        """The state at t = 0, from [M Jᵀ; J 0] [q̈; μ] = [f; γ]."""
        layout, c = self.system.layout, self.system.constraints
        q, v, p = layout.reference.copy(), layout.velocity.copy(), c.parameters(0.0)
        v = self.start(q, v, p)
        J = c.jacobian(q, p)
        self.rows = independent_rows(J, layout.unit)
        damping, _ = self.system.elastic.damping(q, v)
        f = self.system.force(q, v, 0.0) + damping
        self.damping = damping
        x = solved(self.mass, J[self.rows], f, c.right(q, v, p)[self.rows])
        mu = np.zeros(c.count)
        mu[self.rows] = x[self.system.size :]
        a = x[: self.system.size]
        self.auxiliary = a
        return State(q, v, a, mu, p)

    def step(self, state: State, n: int, t: float) -> State:
        """The step that leads to number n."""
        c, p = self.system.constraints, self.system.constraints.parameters(t)
        found = self._newton(state, t, p)
        missed = float(np.abs(c.value(found.q, p)).max(initial=0.0))
        if missed > MISSED * max(1.0, self.system.layout.scene.length):
            self.rows = independent_rows(c.jacobian(found.q, p), self.system.layout.unit)
            found = self._newton(state, t, p)
            if np.abs(c.value(found.q, p)).max() > MISSED * max(1.0, self.system.layout.scene.length):
                raise Failure("joints and drives leave the bodies no admissible position", None)
        mean = (1.0 - self.alpha_f) * found.a + self.alpha_f * state.a
        self.auxiliary = (mean - self.alpha_m * self.auxiliary) / (1.0 - self.alpha_m)
        damping, _ = self.system.elastic.damping(found.q, found.v)
        self.account.resist(float(0.5 * (damping + self.damping) @ (found.q - state.q)))
        self.damping = damping
        self.system.keep(found.q)
        return found

    def _newton(self, state: State, t: float, p: Array) -> State:
        """q_{n+1} and μ_{n+1} from q̈_{n+1} = q̈_n on."""
        system, c, h = self.system, self.system.constraints, self.h
        b = (state.a - self.alpha_m * self.auxiliary) / (1.0 - self.alpha_m)
        q = state.q + h * state.v + h * h * ((0.5 - self.beta) * self.auxiliary + self.beta * b)
        v = state.v + h * ((1.0 - self.gamma) * self.auxiliary + self.gamma * b)
        a, mu, size = state.a.copy(), state.mu.copy(), system.size
        unit, before, residuals, rows = system.layout.unit, np.inf, list[float](), self.rows
        change = a
        for _ in range(ITERATIONS):
            J = c.jacobian(q, p)
            damping, _power = system.elastic.damping(q, v)
            r = system.force(q, v, t) + damping - self.mass @ a - J.T @ mu
            gap = c.value(q, p)
            residuals.append(float(np.abs(r).max()))
            if not np.isfinite(residuals[-1]) or not np.isfinite(gap).all():
                raise Failure("Newton's iteration does not converge", change, tuple(residuals[:-1]))
            K, D = system.tangents(q, v, t, by_velocity=self.by_v)
            A = self.by_a * self.mass + K + self.by_v * D + c.hessian(q, p, mu)
            self.factorizations += 1
            self.newton_iterations += 1
            x = solved(A, J[rows], r, -gap[rows])
            change = x[:size]
            q, v, a = q + change, v + self.by_v * change, a + self.by_a * change
            mu[rows] += x[size:]
            largest = float((np.abs(change) / unit).max())
            if largest <= self.run.newton_tolerance:
                return State(q, v, a, mu, p)
            if largest > 0.5 * before and at_rounding(A, J[rows], q, mu[rows], r):
                return State(q, v, a, mu, p)
            before = largest
        raise Failure("Newton's iteration does not converge", change, tuple(residuals))


def solved(A: Array, J: Array, r: Array, gap: Array) -> Array:
    """Solution of [A Jᵀ; J 0] x = [r; gap]."""
    if not np.isfinite(A).all():
        raise Failure("the tangent is not finite", None)
    n, m = len(A), len(J)
    scale = float(np.abs(np.diagonal(A)).mean())
    full = np.zeros((n + m, n + m))
    full[:n, :n], full[:n, n:], full[n:, :n] = A, scale * J.T, scale * J
    right = np.concatenate([r, scale * gap])
    try:
        x = np.linalg.solve(full, right)
        x += np.linalg.solve(full, right - full @ x) if n + m < 60 else 0.0
    except np.linalg.LinAlgError:
        raise Failure("the tangent is singular", None) from None
    x[n:] *= scale
    return np.asarray(x)


def at_rounding(A: Array, J: Array, q: Array, mu: Array, r: Array) -> bool:
    """Whether the residual is as small as rounding of its terms lets it be."""
    terms = np.abs(A) @ np.abs(q) + np.abs(J).T @ np.abs(mu)
    return bool(np.abs(r).max() <= ROUNDINGS * EPSILON * terms.max())
