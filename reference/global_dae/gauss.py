"""Implicit steps of high order: collocation at Gauss's three points, order 6, on independent coordinates.

The global solver uses this method for integrator "esdirk", implicit steps of high order. It shares neither method nor
linear algebra with the integrator of that name, so that references are confirmed by an independent method. With a, b
and c of Gauss,

    M w_i = F(Y_i, t + c_i h),   Y_i = y + c_i h v + h² Σ_j (a²)_ij w_j,   y' = y + h v + h² Σ_i (bᵀa)_i w_i,
    v' = v + h Σ b_i w_i

(Hairer, Lubich & Wanner 2006, II.1.3): symmetric and symplectic. The stages are solved together by modified Newton with
the sparse matrix I ⊗ M + h² a² ⊗ K. The work of drives and loads is integrated by the same points.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from anctmm.discretise.assembly import kinetic_energy, strain_energy
from anctmm.model.topology import turning_bodies
from reference.global_dae.history import HUGE, Acting, Marcher, Outputs, Reached
from reference.global_dae.loads import drive_table, load_table
from reference.global_dae.model import Matrix, Model
from reference.global_dae.reduced import Given, Reduced
from reference.global_dae.turning import at_starts, not_turned, turn

Array = NDArray[np.float64]

#: Points of a step.
STAGES = 3
#: Newton's corrections in a step at most; ratio of two above which the matrix is renewed; what an end that corrections
#: no longer approach may be from it.
CORRECTIONS, SLOW, ROUNDING = 30, 0.2, 1e-9
#: What Newton's iteration may leave of its tolerance: errors of steps add up.
LEFT = 0.01


class Points(NamedTuple):
    """Coefficients a (s, s), b and c (s,) of collocation."""

    a: Array
    b: Array
    c: Array


def gauss_points(stages: int) -> Points:
    """Gauss's points on [0, 1]: a_ij and b_j are the integrals of Lagrange's polynomials to c_i and to 1."""
    c = 0.5 * (np.polynomial.legendre.leggauss(stages)[0] + 1.0)
    integrals = [lagrange(c, j).integ() for j in range(stages)]
    a = np.array([[p(x) - p(0.0) for p in integrals] for x in c])
    return Points(a, np.array([p(1.0) - p(0.0) for p in integrals]), c)


def lagrange(c: Array, j: int) -> Polynomial:
    """The polynomial that is 1 at c_j and 0 at the others."""
    others = np.delete(c, j)
    return Polynomial.fromroots(others) / float(np.prod(c[j] - others))


class Gauss(Marcher):
    """The solver of high order of one model."""

    advice = "take a smaller dt, a coarser mesh or a larger newton_tolerance"

    def __init__(self, model: Model, dense: bool) -> None:
        super().__init__(model)
        self.factors: Callable[[Array], Array] | None = None
        self.dense, self.reduced, self.points = dense, Reduced(model), gauss_points(STAGES)
        self.h = float(model.run.times(np.array([1]))[0])
        #: Takes accelerations at the points of the last step to those of the next one.
        self.further = np.array(
            [[lagrange(self.points.c, j)(1.0 + x) for j in range(STAGES)] for x in self.points.c]
        )

    def _tables(self, first: int, last: int) -> Acting:
        """Values of loads and drives at the points and at the end of each step, (steps, STAGES + 1, …)."""
        run = self.model.run
        n = np.arange(first, last + 1)
        starts = run.times(np.maximum(n - 1, 0))
        t = np.hstack(
            [starts[:, None] + np.minimum(n, 1)[:, None] * self.h * self.points.c, run.times(n)[:, None]]
        )
        tables = load_table(self.model.scene, t.ravel()), drive_table(self.model.scene, t.ravel())
        return Acting(*(x.reshape(*t.shape, *x.shape[1:]) for x in tables))

    def prepare(self) -> None:
        """What stays the same is found where it is first needed: set the state to t = 0."""
        self.begin()

    def begin(self) -> None:
        """Set the state to t = 0."""
        model, reduced = self.model, self.reduced
        values, drives = self._tables(0, 0)
        given = reduced.given(drives[0, -1])
        self.y = reduced.independent(model.bodies.reference().reshape(-1)[reduced.places], given)
        v = model.bodies.initial_velocity().reshape(-1)[reduced.places]
        # the velocities nearest to those given that joints and drives allow, as where multipliers project them
        self.v = reduced.speeds(v, self.y, given)
        self.stages = np.tile(reduced.accelerations(self.y, self.v, given, values[0, -1]), (STAGES, 1))
        q = model.bodies.reference().reshape(-1)
        self.turned = not_turned(at_starts(model.bodies, turning_bodies(model.scene)), q)
        self.work, self.factors = 0.0, None
        self.newton_iterations = self.factorizations = 0

    def batch(self, first: int, last: int, acting: Acting, out: Outputs) -> Reached:
        """Do steps first … last − 1."""
        outputs, (values, drives) = 0, acting
        for n in range(first, last):
            at = n - first
            if n > 0 and not self._step(values[at], drives[at]):
                return Reached(n, outputs, self._worst(), "Newton's iteration does not converge")
            given = self.reduced.given(drives[at, -1])
            turn(self.reduced.configuration(self.y, given).reshape(-1), self.turned)
            if n == out.wanted[outputs]:
                out.angles[outputs] = self.turned.angles
                self._keep(values[at, -1], given, out.states[outputs], out.energies[outputs])
                outputs += 1
        return Reached(last, outputs)

    def _step(self, values: Array, drives: Array) -> bool:
        """Find the accelerations at the points of a step, and its end; whether that could be done."""
        (a, _, c), h, reduced = self.points, self.h, self.reduced
        given = [reduced.given(d) for d in drives[:STAGES]]
        w, ahead = self.further @ self.stages, self.y + h * np.outer(c, self.v)
        square, last = h * h * (a @ a), np.nan
        bound = max(LEFT * self.model.run.newton_tolerance, 1e2 * np.finfo(float).eps) * self.model.length
        for k in range(CORRECTIONS):
            if self.dense or self.factors is None:
                self._factor(ahead[STAGES // 2], given[STAGES // 2], values[STAGES // 2], square)
            y, speed = ahead + square @ w, self.v + h * (a @ w)
            left = [reduced.residual(y[i], speed[i], w[i], given[i], values[i]) for i in range(STAGES)]
            assert self.factors is not None  # just made, where there were none
            change = self.factors(np.ravel(left)).reshape(w.shape)
            w += change
            size = float(np.abs(square @ change).max())
            self.newton_iterations += 1
            if not size < HUGE:
                return False
            rate = size / last  # of the first correction nothing is known: neither converged nor slow
            if size <= bound or (rate < 1.0 and size * rate / (1.0 - rate) <= bound):
                self._accept(w, ahead + square @ w, given, values)
                return True
            if rate > SLOW:
                if k > 2 and rate > 0.5 and size < ROUNDING * self.model.length:
                    self._accept(w, ahead + square @ w, given, values)
                    return True
                self.factors = None
            last = size
        return False

    def _factor(self, y: Array, given: Given, values: Array, square: Array) -> None:
        A = sparse.kron(np.eye(STAGES), self.reduced.inertia(given)) + sparse.kron(
            square, self.reduced.stiffness(y, given, values)
        )
        if self.dense:
            full = A.toarray()
            self.factors = lambda right: np.linalg.solve(full, right)
        else:
            self.factors = splu(Matrix(A)).solve
        self.factorizations += 1

    def _accept(self, w: Array, y: Array, given: list[Given], values: Array) -> None:
        (a, b, _), h = self.points, self.h
        speed = self.v + h * (a @ w)
        for i in range(STAGES):
            place, rate, second = self.reduced.motion(y[i], speed[i], w[i], given[i])
            loads = self.reduced.loads(place, values[i])
            held = self.model.mass @ second - self.reduced.forces(place, values[i])
            self.work += h * b[i] * float((loads + held) @ rate)
        self.y = self.y + h * self.v + h * h * ((b @ a) @ w)
        self.v = self.v + h * (b @ w)
        self.stages = w

    def _keep(self, values: Array, given: Given, kept: Array, energies: Array) -> None:
        """Store coordinates, velocities, accelerations and energies."""
        reduced, parts = self.reduced, self.model.parts
        w = reduced.accelerations(self.y, self.v, given, values)
        for k, moved in enumerate(reduced.motion(self.y, self.v, w, given)):
            kept[k] = 0.0
            kept[k].reshape(-1)[reduced.places] = moved
        q, v = np.ascontiguousarray(kept[0]), np.ascontiguousarray(kept[1])
        energies[0] = kinetic_energy(v, parts.first, parts.masses)
        energies[1] = strain_energy(parts.formulations, q, parts.first, parts.kinds, parts.constants)
        energies[2] = -float(parts.dead @ (q.reshape(-1) - parts.reference))
        energies[3] = self.work

    def _worst(self) -> int:
        """Node that moves fastest."""
        still = np.ones((len(self.reduced.directions), 2))
        v = self.reduced.flat(self.reduced.basis @ self.reduced.spread(self.v, still))
        v -= self.model.bodies.reference()
        return int(np.nan_to_num(np.abs(v), nan=np.inf).max(axis=0).argmax())
