"""The plain integrators: Zhai's explicit one, and by a full Newton iteration generalized-α and a Runge-Kutta method.

Zhai (Rong 2014, eq. 38): [M Jᵀ; J 0] [q̈; μ] = [f; γ] at q_n, v_n;

    q_{n+1} = q_n + h v_n + (½ + ψ) h² a_n − ψ h² a_{n−1},  v_{n+1} = v_n + (1 + φ) h a_n − φ h a_{n−1},  a_{−1} := a_0.

Then positions and velocities are put back on the constraints: coordinates of beams' nodes that joints or drives
prescribe are set, the rest changes least in the metric of mass.

Generalized-α in index-3 form (Arnold & Brüls 2007, Multibody Syst. Dyn. 18): M q̈_{n+1} + Jᵀμ = f, Φ(q_{n+1}) = 0 with
auxiliary accelerations a, (1 − αm) a_{n+1} + αm a_n = (1 − αf) q̈_{n+1} + αf q̈_n, and Newmark's formulae with a;
a_0 := q̈_0.

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
from reference.global_dae.marching import ITERATIONS, MISSED, Marcher, State
from reference.global_dae.saddle import Failure, Nearest, Saddle
from reference.global_dae.system import System

Array = NDArray[np.float64]

#: A correction that is rounding where it no longer falls.
STALLED = 1e-8


class Zhai(Marcher):
    """The explicit solver of one system."""

    advice = "take a smaller dt, or a coarser mesh, or an implicit integrator"

    def __init__(self, system: System) -> None:
        super().__init__(system)
        self.saddle: Saddle | None = None

    def begin(self) -> State:
        state, c = super().begin(), self.system.constraints
        self.prescribe = Nearest(c.jacobian(state.q, state.p)[c.held])
        self.earlier = state.a
        return state

    def step(self, state: State, t: float) -> State:
        h, psi, phi = self.run.exact_dt, self.run.psi, self.run.phi
        a, b = state.a, self.earlier
        q = state.q + h * state.v + h * h * ((0.5 + psi) * a - psi * b)
        v = state.v + h * ((1.0 + phi) * a - phi * b)
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise Failure("accelerations are not finite", state.a)
        self.earlier, p = a, self.system.constraints.parameters(t)
        if (c := self.system.constraints).count:
            q = q - self.prescribe(c.value(q, p)[c.held])
            v = v - self.prescribe((c.jacobian(q, p) @ v + c.rate(q, p))[c.held])
            q, v = self.projected(q, v, p, lambda q: self._factored(q, p))
        self.system.accept(q)
        return self._accelerated(q, v, t, p)

    def _accelerated(self, q: Array, v: Array, t: float, p: Array) -> State:
        force = self.system.force(q, v, t) + self.system.beams.damping(q, v)
        right = self.system.constraints.right(q, v, p)
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


class Slopes(NamedTuple):
    """∂v/∂q and ∂q̈/∂q of a step, 1/s and 1/s²; whether constraints are kept as accelerations."""

    by_v: float
    by_a: float
    accelerations: bool = False


class Implicit(Marcher):
    """What both methods share: Newton's iteration."""

    advice = "take a smaller dt, a coarser mesh, more damping (spectral_radius) or a larger newton_tolerance"

    def __init__(self, system: System) -> None:
        super().__init__(system)
        self.h = self.run.exact_dt

    def newton(self, s: State, t: float, slopes: Slopes) -> State:
        """The state that fulfils the equations at t, from a guess on.

        Raises
        ------
        Failure
            If the iteration does not converge.
        """
        system, c, p = self.system, self.system.constraints, s.p
        change, before = s.a, np.inf
        for _ in range(ITERATIONS):
            J = c.jacobian(s.q, p)
            r = system.force(s.q, s.v, t) + system.beams.damping(s.q, s.v) - system.mass @ s.a - J.T @ s.mu
            gap = (J @ s.a - c.right(s.q, s.v, p)) / slopes.by_a if slopes.accelerations else c.value(s.q, p)
            if not (np.isfinite(r).all() and np.isfinite(gap).all()):
                break
            change, multiplier = Saddle(self.matrix(s, t, slopes), J).solve(r, -gap)
            self.factorizations += 1
            self.newton_iterations += 1
            s = State(
                s.q + change, s.v + slopes.by_v * change, s.a + slopes.by_a * change, s.mu + multiplier, p
            )
            largest = float((np.abs(change) / system.layout.unit).max())
            if largest <= self.run.newton_tolerance or 0.5 * before < largest <= STALLED:
                return s
            before = largest
        raise Failure("Newton's iteration does not converge", change)

    def matrix(self, s: State, t: float, slopes: Slopes) -> Matrix:
        """Newton's matrix of the coordinates."""
        K = self.system.tangents(s.q, s.v, t, by_velocity=slopes.by_v)
        return Matrix(slopes.by_a * self.system.mass + K + self.system.constraints.hessian(s.q, s.p, s.mu))


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
        self.check_position(found.q, found.p, max(MISSED, self.run.newton_tolerance))
        mean = (1.0 - c.alpha_f) * found.a + c.alpha_f * state.a
        self.auxiliary = (mean - c.alpha_m * a) / (1.0 - c.alpha_m)
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
        found, c = super().begin(), self.system.constraints
        self.prescribe = Nearest(c.jacobian(found.q, found.p)[c.held])
        self.power = [self._power(found, 0.0)]
        return found

    def step(self, state: State, t: float) -> State:
        """The next step: five implicit stages, the last of which is its end."""
        A, square, c = self.stages
        found, w, self.power = state, [state.a], self.power[-1:]
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
            self.power.append(self._power(found, when))
        found = self._projected(found, t)
        self.system.accept(found.q)
        return found

    def add_work(self, s: State, t: float) -> None:
        if len(self.power) > 1:  # by the quadrature of the method
            self.work += self.h * (self.stages.A[-1] @ np.array(self.power))

    def _power(self, s: State, t: float) -> Array:
        """Power of all that does work beside energies, and of damping, W, (2,)."""
        efforts, damping = self.system.efforts(s.q, s.v, t, s.p, s.mu), self.system.beams.damping(s.q, s.v)
        return np.array([effort.forces @ effort.rates + damping @ s.v for effort in efforts])

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
        c = self.system.constraints
        if c.constant and not c.drives:
            return s
        A, missed = self.matrix(s, t, self.slopes), max(MISSED, self.run.newton_tolerance)
        q, v = self.projected(s.q, s.v, s.p, lambda q: Saddle(A, c.jacobian(q, s.p)), missed)
        return State(q, v, s.a, s.mu, s.p)
