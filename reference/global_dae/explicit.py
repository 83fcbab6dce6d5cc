"""Zhai's explicit integrator (Rong 2014, eq. 38) on the equations with multipliers.

[M Φᵀ; Φ 0] [q̈; μ] = [F; b̈] at each step;
q_{n+1} = q_n + h v_n + (½ + ψ) h² a_n − ψ h² a_{n−1},  v_{n+1} = v_n + (1 + φ) h a_n − φ h a_{n−1},  a_{−1} := a_0.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import damping_forces, elastic_forces
from anctmm.jit.compiling import embedded, inlined, kernel
from reference.global_dae.assemble import fill_dense, solve_dense
from reference.global_dae.constraints import Rows, prescribe, project, scale_driven
from reference.global_dae.history import HUGE, Acting, Marcher, Motion, Outputs, Reached, keep, motion_of
from reference.global_dae.loads import Loads, add_loads, work_since
from reference.global_dae.lu import Factors, Index, factorise, no_factors, solve_factored
from reference.global_dae.model import Model, Parts, kkt, typical
from reference.global_dae.turning import turn

Array = NDArray[np.float64]


class Scheme(NamedTuple):
    """Step h (s), ψ, φ; whether positions and velocities are projected."""

    h: float
    psi: float
    phi: float
    project: bool


class Constant(NamedTuple):
    """[M, sΦᵀ; sΦ, 0] by columns, from which the dense solve assembles its matrix in each step."""

    column: Index
    row: Index
    data: Array


class State(NamedTuple):
    """Where the motion stands, and scratch.

    `right` and `left` are [F; s b̈] and [q̈; μ/s]; `force` (rows, nodes) is the head of `right`; `before` is the
    acceleration one step back.
    """

    motion: Motion
    force: Array
    right: Array
    left: Array
    before: Array
    scratch: Array
    dense: Array


@inlined
def solve(
    factors: Factors, constant: Constant, right: Array, left: Array, scratch: Array, dense: Array
) -> bool:
    """Accelerations and multipliers from forces; False if they are not finite."""
    bad = False
    if len(factors.width) == 0:
        for i in range(right.size):
            bad |= not abs(right[i]) < HUGE
        if bad:  # LAPACK's wrapper would raise
            return False
        fill_dense(constant.column, constant.row, constant.data, dense)
        solve_dense(dense, factors.source, right, left)
    else:
        solve_factored(factors, right, left, scratch)
    for i in range(left.size):
        bad |= not abs(left[i]) < HUGE
    return not bad


@inlined
def advance(scheme: Scheme, q: Array, v: Array, left: Array, before: Array) -> None:
    """One step of positions and velocities, flat."""
    h, c = scheme.h, scheme.h * scheme.h
    now, back = (0.5 + scheme.psi) * c, scheme.psi * c
    faster, slower = (1.0 + scheme.phi) * h, scheme.phi * h
    for i in range(q.size):
        a, b = left[i], before[i]
        q[i] += h * v[i] + now * a - back * b
        v[i] += faster * a - slower * b
        before[i] = a


class Damping(NamedTuple):
    """Kelvin-Voigt damping of each body, s, and the power lost at the step before, (1,), W."""

    of: Array
    power: Array


class Equations(NamedTuple):
    """What the steps take: the method, bodies, joints, loads, the factored matrix or its entries, the state.

    `damping` is None unless a material has some: then nothing of it is compiled.
    """

    scheme: Scheme
    parts: Parts
    rows: Rows
    loads: Loads
    factors: Factors
    constant: Constant
    state: State
    damping: Damping | None


@embedded
def resist(damping, parts, motion, force):  # type: ignore[no-untyped-def]
    """Take damping forces from the force; power lost now and at the step before, W."""
    if damping is None:
        return 0.0
    before = damping.power[0]
    damping.power[0] = damping_forces(
        parts.formulations, motion.q, motion.v, parts.first, parts.kinds, parts.constants, damping.of, motion.buffer,
        force,
    )  # fmt: skip
    return before + damping.power[0]


@kernel
def march(equations: Equations, span: tuple[int, int, int], acting: Acting, out: Outputs) -> tuple[int, int]:
    """Steps span[0] … span[1] − 1: acceleration, output where wanted, and advance unless it is the last, span[2].

    Returns
    -------
    int, int
        Step reached (below span[1] if the acceleration there is not finite), outputs kept.
    """
    scheme, parts, rows, loads, factors, constant, s, damping = equations
    values, angles = acting
    wanted, kept, energies, turned = out
    count, m, size = 0, s.motion, s.before.size
    flat_q, flat_v, b, rate, acceleration, trail = (
        m.flat_q, m.flat_v, m.b, m.rate, m.acceleration, m.trail
    )  # fmt: skip
    right, left, before, dead = s.right, s.left, s.before, parts.dead
    for n in range(span[0], span[1]):
        at = n - span[0]
        if n == 0:
            prescribe(rows, angles, 0, b, rate, acceleration)
            project(rows, flat_v, rate)
        elastic_forces(parts.formulations, m.q, parts.first, parts.kinds, parts.constants, m.buffer, s.force)
        for i in range(size):
            right[i] = dead[i] - right[i]
        lost = 0.5 * scheme.h * resist(damping, parts, m, s.force)
        if n > 0:
            m.work[0] -= lost
            m.work[1] -= lost
        add_loads(loads, values, at, flat_q, right)
        scale_driven(rows, acceleration, right, size)
        if not solve(factors, constant, right, left, s.scratch, s.dense):
            return n, count
        if n == 0:
            for i in range(size):
                before[i] = left[i]
        if len(trail):
            work = work_since(loads, values, at, rows, left, size, flat_q, trail)
            m.work[0] += work if n > 0 else 0.0
        turn(flat_q, m.turned)
        if n == wanted[count]:
            keep(parts, m, left, count, kept, energies, turned)
            count += 1
        if n == span[2]:
            break
        advance(scheme, flat_q, flat_v, left, before)
        prescribe(rows, angles, at + 1, b, rate, acceleration)
        if scheme.project:
            project(rows, flat_q, b)
            project(rows, flat_v, rate)
    return span[1], count


class Zhai(Marcher):
    """The explicit solver of one model."""

    advice = "take a smaller dt, or a coarser mesh, or an implicit integrator"

    def __init__(self, model: Model, dense: bool, stabilise: bool) -> None:
        super().__init__(model)
        run = model.run
        self.scheme = Scheme(float(run.times(np.array([1]))[0]), run.psi, run.phi, stabilise)
        self.dense = dense

    def prepare(self) -> None:
        """Factor the constant matrix, and set the state to t = 0."""
        model = self.model
        scale = typical(model.scalar_mass)
        self.rows = model.rows(scale)
        full = kkt(model.mass, model.constraints, scale)
        self.constant = Constant(full.indptr.astype(np.uint32), full.indices.astype(np.uint32), full.data)
        if self.dense:
            self.factors = no_factors(model.places(1))
        elif model.separable:
            matrix = kkt(model.scalar_mass, model.complex_constraints.real, scale)
            self.factors = factorise(matrix, model.places(2))
        else:
            self.factors = factorise(full, model.places(1))
        self.begin()

    def begin(self) -> None:
        """Set the state to t = 0."""
        model, damping = self.model, self.model.bodies.damping
        self.state = self._start()
        self.equations = Equations(
            self.scheme, model.parts, self.rows, model.loads, self.factors, self.constant, self.state,
            None if damping is None else Damping(damping, np.zeros(1)),
        )  # fmt: skip

    def _start(self) -> State:
        model, unknowns = self.model, self.model.dofs + 2 * len(self.model.joints)
        right = np.zeros(model.size + 2 * len(model.joints))
        return State(
            motion=motion_of(model, self.rows.reference),
            force=right[: model.size].reshape(model.bodies.rows, -1),
            right=right,
            left=np.zeros_like(right),
            before=np.zeros(model.size),
            scratch=np.zeros(unknowns),
            dense=np.zeros((unknowns, unknowns) if self.dense else (0, 0)),
        )

    def batch(self, first: int, last: int, acting: Acting, out: Outputs) -> Reached:
        """Do steps first … last − 1; see `march`."""
        step, outputs = march(self.equations, (first, last, self.model.run.steps), acting, out)
        self.factorizations = step if self.dense else 1
        if step == last:
            return Reached(step, outputs)
        size = np.where(np.isfinite(self.state.force), np.abs(self.state.force), np.inf).max(axis=0)
        return Reached(step, outputs, int(size.argmax()), "accelerations are not finite")
