"""Implicit generalized-α in index-3 form (Arnold & Brüls 2007, Multibody Syst. Dyn. 18) on eq. 14 of Rong 2014.

M q̈_{n+1} + Φᵀμ = F(q_{n+1}, t_{n+1}), Φ q_{n+1} = b(t_{n+1}), with the auxiliary accelerations a:
(1 − αm) a_{n+1} + αm a_n = (1 − αf) q̈_{n+1} + αf q̈_n, and Newmark's formulae with a for q and v; a_0 := q̈_0.
Damping forces in F are those of q_{n+1} and v_{n+1}; to Newton's matrix they add ∂v/∂q τ times the elastic tangent of
their body, which leaves out what stress and velocity add to their exact derivative.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from anctmm.discretise.assembly import damping_forces, elastic_forces, mass_product
from anctmm.elements.tangent_blocks import TANGENT_BUFFER
from anctmm.integrators.implicit.renewal import new_wear, worn
from anctmm.jit.compiling import embedded, inlined, kernel
from reference.global_dae.assemble import System, assemble, fill_dense, matrix_of, solve_dense, system_of
from reference.global_dae.constraints import Rows, add_transposed, misfit, prescribe, project
from reference.global_dae.history import HUGE, Acting, Marcher, Motion, Outputs, Reached, keep, motion_of
from reference.global_dae.loads import Loads, add_loads, work_since
from reference.global_dae.lu import Factors, Pattern, choose, no_factors, refactor, solve_factored
from reference.global_dae.model import Model, Parts, kkt, typical
from reference.global_dae.turning import turn

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Newton iterations a step may take; ratio of successive corrections above which the tangent is renewed.
ITERATIONS, SLOW = 30, 0.5
#: Cost of new factors, in corrections: measured, 3 to 5.
PRICE = 4.5
#: Residuals below this many roundings of their largest terms are zero within double precision.
ROUNDINGS, EPSILON = 8.0, float(np.finfo(np.float64).eps)
#: How a Newton iteration ended.
CONVERGED, FAILED, SINGULAR = 0, 1, 2


class Scheme(NamedTuple):
    """Coefficients of the method, and of Newton's iteration.

    h (s); alpha_m, alpha_f, beta, gamma; by_acceleration = ∂q̈/∂q = (1 − αm)/(β h² (1 − αf)), by_velocity = ∂v/∂q;
    tolerance of corrections, length (m) that makes positions dimensionless.
    """

    h: float
    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    by_acceleration: float
    by_velocity: float
    tolerance: float
    length: float


class State(NamedTuple):
    """Where the motion stands, and scratch.

    motion: q_n, v_n; acceleration q̈_n and auxiliary a_n, flat; multiplier μ/s (2 m,). new, flat new_q: q_{n+1};
    new_v, new_acceleration, flat. right, left: of the linear system, flat, with the unknowns at `places`; force
    (rows, nodes) is the head of right. product, data, small, K, scratch, column, dense: of the kernels used.
    residuals: largest component before each correction of the last step, (ITERATIONS,).
    counts: Newton iterations, factorisations, node of the largest correction, whether the factors can be used, step
    reached, outputs kept. wear: of the factors.
    """

    motion: Motion
    acceleration: Array
    auxiliary: Array
    multiplier: Array
    new: Array
    new_q: Array
    new_v: Array
    new_acceleration: Array
    force: Array
    right: Array
    left: Array
    product: Array
    data: Array
    small: Array
    K: Array
    scratch: Array
    column: Array
    dense: Array
    places: Ints
    residuals: Array
    counts: Ints
    wear: Array


class Damping(NamedTuple):
    """Kelvin-Voigt damping of each body, s; its forces now and at the end of the step before, (2, rows, nodes), N."""

    of: Array
    force: Array


class Equations(NamedTuple):
    """What the steps take: the method, bodies, joints, loads, Newton's matrix, and the state.

    stiff: the bodies with the stiffness of Newton's matrix, that of damping included. pattern, factors: of that matrix.
    damping: None unless a material has some: then nothing of it is compiled.
    """

    scheme: Scheme
    parts: Parts
    stiff: Parts
    rows: Rows
    loads: Loads
    matrix: System
    pattern: Pattern
    factors: Factors
    state: State
    damping: Damping | None


def damping_of(model: Model) -> Damping | None:
    """Damping of a model that has some; None where it has none: then nothing of it is compiled."""
    bodies = model.bodies
    return (
        None if bodies.damping is None else Damping(bodies.damping, np.zeros((2, bodies.rows, bodies.nodes)))
    )


def stiffened(model: Model, c: Scheme) -> Parts:
    """The bodies with the stiffness that Newton's matrix has of them."""
    if model.bodies.damping is None:
        return model.parts
    factors = 1.0 + c.by_velocity * model.bodies.damping
    return model.parts._replace(constants=model.bodies.stiffened(factors, stresses=False).constants)


def scheme_of(model: Model) -> Scheme:
    """Coefficients for the spectral radius ρ of the run (Chung & Hulbert 1993)."""
    run = model.run
    h, rho = float(run.times(np.array([1]))[0]), run.spectral_radius
    alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    gamma = 0.5 + alpha_f - alpha_m
    beta = 0.25 * (gamma + 0.5) ** 2
    by_acceleration = (1.0 - alpha_m) / (beta * h * h * (1.0 - alpha_f))
    tolerance, length = run.newton_tolerance, model.length
    return Scheme(h, alpha_m, alpha_f, beta, gamma, by_acceleration, gamma / (beta * h), tolerance, length)


@kernel
def predict(c: Scheme, s: State) -> None:
    """Start of Newton's iteration: q̈_{n+1} = q̈_n."""
    m, h = s.motion, c.h
    for i in range(s.new_q.size):
        a = s.auxiliary[i]
        b = (s.acceleration[i] - c.alpha_m * a) / (1.0 - c.alpha_m)
        s.new_q[i] = m.flat_q[i] + h * m.flat_v[i] + h * h * ((0.5 - c.beta) * a + c.beta * b)
        s.new_v[i] = m.flat_v[i] + h * ((1.0 - c.gamma) * a + c.gamma * b)
        s.new_acceleration[i] = s.acceleration[i]


@inlined
def resisting(damping: Damping, parts: Parts, q: Array, v: Array, buffer: Array, f: Array) -> None:
    """Find the damping forces at q and v, (rows, nodes), and add them to f."""
    force = damping.force[0]
    for k in range(f.shape[0]):
        for i in range(f.shape[1]):
            force[k, i] = 0.0
    damping_forces(
        parts.formulations, q, v, parts.first, parts.kinds, parts.constants, damping.of, buffer, force
    )
    for k in range(f.shape[0]):
        for i in range(f.shape[1]):
            f[k, i] += force[k, i]


@embedded
def dissipated(damping: Damping | None, q: Array, before: Array) -> float:
    """Work of the damping forces over a step, J: their mean times the displacement; q of shape (rows, nodes)."""
    work = 0.0
    if damping is None:
        return work
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            now = damping.force[0, k, i]
            work += 0.5 * (now + damping.force[1, k, i]) * (q[k, i] - before[k, i])
            damping.force[1, k, i] = now
    return work


@kernel
def residual(
    parts: Parts, rows: Rows, loads: Loads, damping: Damping | None, table: Array, n: int, s: State
) -> float:
    """[F − M q̈ − Φᵀμ; s (b − Φ q)] into `right`; its largest component, infinite if one is not a number."""
    size = s.new_q.size
    elastic_forces(
        parts.formulations, s.new, parts.first, parts.kinds, parts.constants, s.motion.buffer, s.force
    )
    acceleration = s.new_acceleration.reshape(s.new.shape)
    mass_product(acceleration, parts.first, parts.masses, s.motion.buffer, s.product)
    inertia = s.product.reshape(size)
    for i in range(size):
        s.right[i] = parts.dead[i] - s.right[i] - inertia[i]
    if damping is not None:
        resisting(damping, parts, s.new, s.new_v.reshape(s.new.shape), s.motion.buffer, s.force)
    add_loads(loads, table, n, s.new_q, s.right)
    for j in range(len(rows.reference)):
        x, y = misfit(rows, j, s.new_q, s.motion.b)
        s.right[size + 2 * j], s.right[size + 2 * j + 1] = -rows.scale * x, -rows.scale * y
        add_transposed(
            rows, j, -rows.scale * s.multiplier[2 * j], -rows.scale * s.multiplier[2 * j + 1], s.right
        )
    largest = 0.0
    for i in range(s.right.size):
        here = abs(s.right[i])
        largest = max(largest, here if here < HUGE else np.inf)
    return largest


@kernel
def correct(c: Scheme, s: State) -> float:
    """Add the correction in `left`; its size: positions relative to the length, gradients absolute."""
    size, nodes = s.new_q.size, s.new.shape[1]
    largest, place = 0.0, 0
    for i in range(size):
        d = s.left[i]
        s.new_q[i] += d
        s.new_v[i] += c.by_velocity * d
        s.new_acceleration[i] += c.by_acceleration * d
        d = abs(d) / c.length if i < 2 * nodes else abs(d)
        if not d <= largest:
            largest, place = d, i
    for j in range(s.multiplier.size):
        s.multiplier[j] += s.left[size + j]
    s.counts[2] = place % nodes
    return largest


@kernel
def at_rounding(system: System, s: State) -> bool:
    """Whether the residual is as small as rounding of its terms, |A| |q|, lets it be."""
    size = s.new_q.size
    largest, found = 0.0, 0.0
    s.left[:] = 0.0
    for j in range(len(system.column) - 1):
        value = abs(s.new_q[s.places[j]]) if s.places[j] < size else 0.0
        for t in range(system.column[j], system.column[j + 1]):
            s.left[s.places[system.row[t]]] += abs(s.data[t]) * value
    for i in range(size):
        largest, found = max(largest, s.left[i]), max(found, abs(s.right[i]))
    return found <= ROUNDINGS * EPSILON * largest


@kernel
def newton(full: bool, equations: Equations, table: Array, n: int) -> int:
    """Solve for q_{n+1} and μ_{n+1}: with a new tangent each time if `full`, else while it contracts with an old one.

    Factors are renewed before a step by the rule of ANC-TMM.
    """
    c, parts, stiff, rows, loads, system, pattern, factors, s, damping = equations
    dense = len(factors.width) == 0
    before, new, renewed = np.inf, full or s.counts[3] == 0, s.counts[1]
    renew = new
    s.residuals[:] = 0.0
    for iteration in range(ITERATIONS):
        s.residuals[iteration] = residual(parts, rows, loads, damping, table, n, s)
        if s.residuals[iteration] == np.inf:
            return FAILED
        fresh = renew
        if renew:
            assemble(system, c.by_acceleration, stiff, loads, table[n], s.new, s.small, s.K, s.data)
            s.counts[1] += 1
            if not dense and not refactor(pattern, s.data, factors, s.column):
                s.counts[3] = 0
                return SINGULAR
            s.counts[3] = 1
        if dense:
            fill_dense(system.column, system.row, s.data, s.dense)
            solve_dense(s.dense, factors.source, s.right, s.left)
        else:
            solve_factored(factors, s.right, s.left, s.scratch)
        size = correct(c, s)
        s.counts[0] += 1
        if size <= c.tolerance:
            if worn(new, iteration + 1, s.counts[1] - renewed, s.wear):
                s.counts[3] = 0
            return CONVERGED
        if fresh and size > 0.5 * before and at_rounding(system, s):
            return CONVERGED
        renew = full or size > SLOW * before
        before = size
    return FAILED


@inlined
def solve(equations, values, at):  # type: ignore[no-untyped-def]
    """Find the end of a step from its predictor: by modified Newton, and where that fails by Newton, as ANC-TMM."""
    s, dense = equations.state, len(equations.factors.width) == 0
    predict(equations.scheme, s)
    code = newton(dense, equations, values, at)
    if code != CONVERGED and not dense:
        predict(equations.scheme, s)
        s.multiplier[:] = 0.0  # those of an iteration that failed may be no numbers
        code = newton(True, equations, values, at)
    return code


@kernel
def accept(c: Scheme, s: State) -> None:
    """Make the new state the present one."""
    m = s.motion
    for i in range(s.new_q.size):
        old, new = s.acceleration[i], s.new_acceleration[i]
        mean = (1.0 - c.alpha_f) * new + c.alpha_f * old
        s.auxiliary[i] = (mean - c.alpha_m * s.auxiliary[i]) / (1.0 - c.alpha_m)
        s.acceleration[i] = new
        m.flat_q[i], m.flat_v[i] = s.new_q[i], s.new_v[i]


@kernel
def march(equations: Equations, span: tuple[int, int], acting: Acting, out: Outputs) -> int:
    """Steps span[0] … span[1] − 1, step n leading to t_n; step 0 only keeps the start.

    Returns
    -------
    int
        CONVERGED, or why Newton's iteration ended; step reached and outputs kept are in `s.counts`.
    """
    c, parts, _, rows, loads, _, _, _, s, damping = equations
    values, angles = acting
    wanted, kept, energies, turned = out
    m = s.motion
    s.counts[5] = 0
    for n in range(span[0], span[1]):
        at = n - span[0]
        s.counts[4] = n
        if n > 0:
            prescribe(rows, angles, at, m.b, m.rate, m.acceleration)
            code = solve(equations, values, at)
            if code != CONVERGED:
                return code
            lost = dissipated(damping, s.new, m.q)
            m.work[0] += lost
            m.work[1] += lost
            accept(c, s)
        if len(m.trail):
            work = work_since(loads, values, at, rows, s.multiplier, 0, m.flat_q, m.trail)
            if n > 0:
                m.work[0] += work
        turn(m.flat_q, m.turned)
        if n == wanted[s.counts[5]]:
            keep(parts, m, s.acceleration, s.counts[5], kept, energies, turned)
            s.counts[5] += 1
    s.counts[4] = span[1]
    return CONVERGED


class GeneralizedAlpha(Marcher):
    """The implicit solver of one model."""

    advice = "take a smaller dt, a coarser mesh, more damping (spectral_radius) or a larger newton_tolerance"

    def __init__(self, model: Model, dense: bool) -> None:
        super().__init__(model)
        self.scheme = scheme_of(model)
        self.stiff, self.damping = stiffened(model, self.scheme), damping_of(model)
        self.dense = dense

    def prepare(self) -> None:
        """Factor the mass, choose order and pivots, and set the state to t = 0."""
        model = self.model
        q, values = model.bodies.reference(), self._tables(0, 0).loads
        bare, size = system_of(model, 1.0), 2 * model.bodies.rows
        data, small, K = np.zeros(len(bare.row) + 1), np.zeros(TANGENT_BUFFER), np.zeros((size, size))
        assemble(bare, self.scheme.by_acceleration, self.stiff, model.loads, values[0], q, small, K, data)
        scale = typical(matrix_of(bare, data)[: model.dofs, : model.dofs])
        self.rows, self.system = model.rows(scale), bare._replace(joints=scale * bare.joints)
        self.mass = splu(kkt(model.mass, model.constraints, typical(model.scalar_mass)))
        self.begin()
        self._choose_pivots(values[0], q)

    def begin(self) -> None:
        """Set the state to t = 0, with accelerations and multipliers."""
        self.state = _start(self.model, self.system, self.dense)
        _accelerate(self.model, self.rows, self.damping, self._tables(0, 0), self.mass, self.state)

    def _choose_pivots(self, value: Array, q: Array) -> None:
        places, data = self.model.places(1), self.state.data
        assemble_into(data, self.system, self.scheme, self.model, self.stiff, value, q, self.state)
        if self.dense:
            nothing = np.zeros(0, dtype=np.uint32)
            self.pattern, self.factors = Pattern(nothing, nothing, nothing), no_factors(places)
        else:
            self.pattern, self.factors = choose(matrix_of(self.system, data), places)
        self.state.counts[3] = 0

    def batch(self, first: int, last: int, acting: Acting, out: Outputs) -> Reached:
        """Do steps first … last − 1; see `march`. Where the pivots turn bad, choose new ones and go on."""
        outputs, start, repivoted = 0, first, -1
        while True:
            try:
                rest = Acting(*(table[start - first :] for table in acting))
                code = march(self._equations(), (start, last), rest, out.after(outputs))
            except np.linalg.LinAlgError:
                code = FAILED
            counts = self.state.counts
            self.newton_iterations, self.factorizations = int(counts[0]), int(counts[1])
            start, outputs = int(counts[4]) if first < last else last, outputs + int(counts[5])
            if code == CONVERGED:
                return Reached(start, outputs)
            if code == FAILED or start == repivoted:
                why = "Newton's iteration does not converge" if code == FAILED else "the tangent is singular"
                found = self.state.residuals
                return Reached(start, outputs, int(counts[2]), why, tuple(map(float, found[found > 0.0])))
            repivoted = start
            try:
                self._choose_pivots(acting.loads[start - first], self.state.motion.q)
            except np.linalg.LinAlgError:
                return Reached(start, outputs, int(counts[2]), "the tangent is singular")

    def _equations(self) -> Equations:
        model = self.model
        return Equations(
            self.scheme, model.parts, self.stiff, self.rows, model.loads, self.system, self.pattern, self.factors,
            self.state, self.damping,
        )  # fmt: skip


def assemble_into(
    data: Array, system: System, c: Scheme, model: Model, stiff: Parts, value: Array, q: Array, s: State
) -> None:
    """Numbers of Newton's matrix at q."""
    assemble(system, c.by_acceleration, stiff, model.loads, value, q, s.small, s.K, data)


def _start(model: Model, system: System, dense: bool) -> State:
    size, count = model.size, 2 * len(model.joints)
    reference = model.rows(1.0).reference
    unknowns, rows = model.dofs + count, model.bodies.rows
    right, new = np.zeros(size + count), model.bodies.reference()
    return State(
        motion=motion_of(model, reference),
        acceleration=np.zeros(size),
        auxiliary=np.zeros(size),
        multiplier=np.zeros(count),
        new=new,
        new_q=new.reshape(-1),
        new_v=np.zeros(size),
        new_acceleration=np.zeros(size),
        force=right[:size].reshape(rows, -1),
        right=right,
        left=np.zeros_like(right),
        product=np.zeros_like(new),
        data=np.zeros(len(system.row) + 1),
        small=np.zeros(TANGENT_BUFFER),
        K=np.zeros((2 * rows, 2 * rows)),
        scratch=np.zeros(unknowns),
        column=np.zeros(unknowns),
        dense=np.zeros((unknowns, unknowns) if dense else (0, 0)),
        places=model.places(1).reshape(-1),
        residuals=np.zeros(ITERATIONS),
        counts=np.zeros(6, dtype=np.int64),
        wear=new_wear(PRICE),
    )


def _accelerate(
    model: Model, rows: Rows, damping: Damping | None, acting: Acting, mass: SuperLU, s: State
) -> None:
    """Velocities that fit the drives at t = 0, and q̈_0 and μ_0 from [M Φᵀ; Φ 0] [q̈; μ] = [F; b̈]; a_0 := q̈_0.

    `mass`: factors of that matrix, its Φ scaled by the typical mass.
    """
    m, size = s.motion, model.size
    prescribe(rows, acting.drives, 0, m.b, m.rate, m.acceleration)
    project(rows, m.flat_v, m.rate)
    s.right[:size] = model.parts.dead
    if damping is not None:
        p = model.parts
        damping.force[:] = 0.0
        damping_forces(
            p.formulations, m.q, m.v, p.first, p.kinds, p.constants, damping.of, m.buffer, damping.force[0]
        )
        s.force[:] += damping.force[0]
        damping.force[1] = damping.force[0]
    add_loads(model.loads, acting.loads, 0, m.flat_q, s.right)
    scale = typical(model.scalar_mass)
    s.right[size:] = scale * m.acceleration.reshape(-1)
    s.left[s.places] = mass.solve(s.right[s.places])
    s.acceleration[:] = s.left[:size]
    s.auxiliary[:] = s.left[:size]
    s.multiplier[:] = s.left[size:] * (scale / rows.scale)
