"""Implicit steps by a full Newton iteration: generalized-α in index-3 form, and a Runge-Kutta method of fourth order.

Generalized-α (Arnold & Brüls 2007, Multibody Syst. Dyn. 18): M q̈_{n+1} + Jᵀμ = f, Φ(q_{n+1}) = 0 with auxiliary
accelerations a, (1 − αm) a_{n+1} + αm a_n = (1 − αf) q̈_{n+1} + αf q̈_n, and Newmark's formulae with a; a_0 := q̈_0.

ESDIRK (Kennedy & Carpenter 2003, ESDIRK4(3)6L[2]SA): with w_j the accelerations of the stages,

    Q_i = q_n + c_i h v_n + h² Σ (A²)_ij w_j,   V_i = v_n + h Σ A_ij w_j,   M w_i + Jᵀμ_i = f(Q_i, V_i),  J w_i = γ_i.

Coordinates of beams' nodes that joints or drives prescribe have their values, rates and accelerations of the stage's
time. Other constraints are projected at the end of a step in the metric of Newton's matrix (Eich 1993).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.methods import GeneralizedAlpha as AlphaMethod
from anctmm.discretise.methods import stages
from reference.global_dae.elements import Matrix
from reference.global_dae.marching import Failure, Marcher, State
from reference.global_dae.saddle import Nearest, Saddle
from reference.global_dae.system import System

Array = NDArray[np.float64]

#: Newton iterations of a step at most; roundings of the largest terms that a residual may have.
ITERATIONS, ROUNDINGS, EPSILON = 40, 8.0, float(np.finfo(np.float64).eps)
#: Misfit of constraints, of the scene's length, that has failed, and that which is rounding.
MISSED, ROUNDING = 1e-9, 1e-14


class Slopes(NamedTuple):
    """∂v/∂q and ∂q̈/∂q of a step, 1/s and 1/s²; whether constraints are kept as accelerations."""

    by_v: float
    by_a: float
    accelerations: bool = False


class Implicit(Marcher):
    """What both methods share: the start, and Newton's iteration."""

    advice = "take a smaller dt, a coarser mesh, more damping (spectral_radius) or a larger newton_tolerance"

    def __init__(self, system: System) -> None:
        super().__init__(system)
        self.h, self.unit = self.run.exact_dt, system.layout.unit

    def begin(self) -> State:
        """The state at t = 0: velocities that fit joints and drives, and [M Jᵀ; J 0] [q̈; μ] = [f; γ]."""
        system, layout, c = self.system, self.system.layout, self.system.constraints
        q, v, p = layout.reference.copy(), layout.velocity.copy(), c.parameters(0.0)
        J = c.jacobian(q, p)
        v = v - Nearest(J)(J @ v + c.rate(q, p))
        self.damping = system.beams.damping(q, v)
        self.factorizations += 1
        force = system.force(q, v, 0.0) + self.damping
        return State(q, v, *Saddle(system.mass, J).solve(force, c.right(q, v, p)), p)

    def newton(self, guess: State, t: float, slopes: Slopes) -> State:
        """The state that fulfils the equations at t, from a guess on.

        Raises
        ------
        Failure
            If the iteration does not converge.
        """
        system, c = self.system, self.system.constraints
        q, v, a, mu, p = guess.q, guess.v, guess.a, guess.mu, guess.p
        change, before, residuals = a, np.inf, list[float]()
        for _ in range(ITERATIONS):
            J = c.jacobian(q, p)
            r = system.force(q, v, t) + system.beams.damping(q, v) - system.mass @ a - J.T @ mu
            gap = (J @ a - c.right(q, v, p)) / slopes.by_a if slopes.accelerations else c.value(q, p)
            if not (np.isfinite(r).all() and np.isfinite(gap).all()):
                break
            residuals.append(float(np.abs(r).max()))
            A = self.matrix(State(q, v, a, mu, p), t, slopes)
            change, multiplier = Saddle(A, J).solve(r, -gap)
            self.factorizations += 1
            self.newton_iterations += 1
            q, v, a = q + change, v + slopes.by_v * change, a + slopes.by_a * change
            mu = mu + multiplier
            largest = float((np.abs(change) / self.unit).max())
            if largest <= self.run.newton_tolerance:
                return State(q, v, a, mu, p)
            if largest > 0.5 * before:
                sizes = system.sizes(q, v, t) + abs(A) @ np.abs(q) + abs(J).T @ np.abs(mu)
                if residuals[-1] <= ROUNDINGS * EPSILON * sizes.max():
                    return State(q, v, a, mu, p)
            before = largest
        raise Failure("Newton's iteration does not converge", change, residuals)

    def matrix(self, s: State, t: float, slopes: Slopes) -> Matrix:
        """Newton's matrix of the coordinates."""
        K = self.system.tangents(s.q, s.v, t, by_velocity=slopes.by_v)
        return Matrix(slopes.by_a * self.system.mass + K + self.system.constraints.hessian(s.q, s.p, s.mu))

    def check_position(self, q: Array, p: Array) -> None:
        """Raise Failure where positions do not fit the constraints: some contradict each other."""
        allowed = max(MISSED, self.run.newton_tolerance) * self.length
        if not np.abs(self.system.constraints.value(q, p)).max(initial=0.0) <= allowed:
            raise Failure("joints and drives leave the bodies no admissible position")


class GeneralizedAlpha(Implicit):
    """Implicit steps of second order."""

    def __init__(self, system: System) -> None:
        super().__init__(system)
        self.c = AlphaMethod(self.run.spectral_radius).of_step(self.h)
        self.slopes = Slopes(self.c.gamma / (self.c.beta * self.h), self.c.to_w)

    def begin(self) -> State:
        """The state at t = 0; a_0 := q̈_0."""
        found = super().begin()
        self.auxiliary = found.a
        return found

    def step(self, state: State, t: float) -> State:
        """The next step, from q̈_{n+1} = q̈_n on."""
        c, h, a = self.c, self.h, self.auxiliary
        b = (state.a - c.alpha_m * a) / (1.0 - c.alpha_m)
        guess = State(
            state.q + h * state.v + h * h * ((0.5 - c.beta) * a + c.beta * b),
            state.v + h * ((1.0 - c.gamma) * a + c.gamma * b),
            state.a, state.mu, self.system.constraints.parameters(t),
        )  # fmt: skip
        found = self.newton(guess, t, self.slopes)
        self.check_position(found.q, found.p)
        mean = (1.0 - c.alpha_f) * found.a + c.alpha_f * state.a
        self.auxiliary = (mean - c.alpha_m * a) / (1.0 - c.alpha_m)
        damping = self.system.beams.damping(found.q, found.v)
        self.account.resist(float(0.5 * (damping + self.damping) @ (found.q - state.q)))
        self.damping = damping
        self.system.accept(found.q)
        return found


class Esdirk(Implicit):
    """Implicit steps of fourth order."""

    advice = "take a smaller dt, a coarser mesh or a larger newton_tolerance"

    def __init__(self, system: System) -> None:
        super().__init__(system)
        self.stages = stages()
        part = float(self.stages.A[-1, -1]) * self.h
        self.part, self.slopes = part, Slopes(1.0 / part, 1.0 / part**2, accelerations=True)

    def begin(self) -> State:
        """The state at t = 0."""
        found, c = super().begin(), self.system.constraints
        self.prescribe = Nearest(c.jacobian(found.q, found.p)[c.held])
        self.power = self._power(found, 0.0)
        return found

    def step(self, state: State, t: float) -> State:
        """The next step: five implicit stages, the last of which is its end."""
        A, square, c = self.stages
        found, w, power = state, [state.a], [self.power]
        for i in range(1, len(c)):
            when = t if i == len(c) - 1 else t - (1.0 - float(c[i])) * self.h
            known = (
                self.h * c[i] * state.v + self.h**2 * sum(square[i, j] * w[j] for j in range(i)),
                self.h * sum(A[i, j] * w[j] for j in range(i)),
            )
            p = self.system.constraints.parameters(when)
            q, v = self._prescribed(state.q + known[0], state.v + known[1], p)
            guess = State(q + self.part**2 * w[-1], v + self.part * w[-1], w[-1], found.mu, p)
            found = self.newton(guess, when, self.slopes)
            w.append(found.a)
            power.append(self._power(found, when))
        found = self._projected(found, t)
        work, lost = self.h * (A[-1] @ np.array(power))
        self.account.work += float(work)
        self.account.lost += float(lost)
        self.account.before, self.power = None, power[-1]
        self.system.accept(found.q)
        return found

    def _prescribed(self, q: Array, v: Array, p: Array) -> tuple[Array, Array]:
        """q and v before the stage's own acceleration, from which prescribed coordinates reach their values."""
        c = self.system.constraints
        if not c.held.any():
            return q, v
        J, gamma = c.jacobian(q, p), c.right(q, v, p)
        gap = c.value(q, p) + self.part**2 * gamma
        rate = J @ v + c.rate(q, p) + self.part * gamma
        return q - self.prescribe(gap[c.held]), v - self.prescribe(rate[c.held])

    def _projected(self, s: State, t: float) -> State:
        """Positions and velocities on the constraints, the nearest in the metric of Newton's matrix."""
        c, still = self.system.constraints, self.system.still
        if c.constant and not c.driven:
            return s
        A, q = self.matrix(s, t, self.slopes), s.q
        for _ in range(ITERATIONS):
            gap = c.value(q, s.p)
            if np.abs(gap).max() <= ROUNDING * self.length:
                break
            q = q + Saddle(A, c.jacobian(q, s.p)).solve(still, -gap)[0]
        self.check_position(q, s.p)
        J = c.jacobian(q, s.p)
        v = s.v + Saddle(A, J).solve(still, -(J @ s.v + c.rate(q, s.p)))[0]
        return State(q, v, s.a, s.mu, s.p)

    def _power(self, s: State, t: float) -> Array:
        """Power of all that does work beside energies, and of damping, W, (2,)."""
        resisting = float(self.system.beams.damping(s.q, s.v) @ s.v)
        return self.account.power(s.q, s.v, t, s.p, s.mu) + resisting
