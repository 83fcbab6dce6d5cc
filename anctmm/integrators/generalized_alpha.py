"""Implicit ANC-TMM: generalized-α with Newton, its linear solves by the Riccati recursion.

Chung & Hulbert (1993) in the form of Arnold & Brüls (2007): M w_{n+1} = F(q_{n+1}) holds at the end of the step, and

    (1 − αm) a_{n+1} + αm a_n = (1 − αf) w_{n+1} + αf w_n,
    q_{n+1} = q_n + h v_n + h² ((½ − β) a_n + β a_{n+1}),    v_{n+1} = v_n + h ((1 − γ) a_n + γ a_{n+1}).

A Newton correction solves (c_w M + K_T) Δq = F − M w with c_w = (1 − αm)/(βh²(1 − αf)): block tridiagonal, so the same
recursion as for the mass. Damping forces are those of q_{n+1} and v_{n+1}; to the matrix they add τγ/(βh) times the
elastic tangent of their body, which leaves out what stress and velocity add to their exact derivative: Newton needs a
correction or two more, and its limit is the same.

Known coordinates are known as positions; their velocities and accelerations follow from the formulas above, as they do
in an index-3 solution of the equations with multipliers.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import (
    FIRST_BODY,
    Bodies,
    Tables,
    body_after,
    elastic_forces,
    mass_product,
    resist,
    window_forces,
    window_inertia,
)
from anctmm.discretise.chain import Chain, Joined
from anctmm.elements.shear_kernel import BLOCK
from anctmm.forces.actuation import (
    Actuation,
    Hubs,
    Loads,
    hub_reactions,
    place_hubs,
    set_loads,
    turn_hubs,
    work_done,
)
from anctmm.integrators.output import (
    Output,
    Record,
    gradient_size,
    keep,
    run_batches,
    too_large,
    worst_element,
)
from anctmm.integrators.stability import element_bound
from anctmm.jit.compiling import embedded, inlined, kernel
from anctmm.jit.prefetching import AHEAD, LINE, LONG, prefetch_columns, prefetch_row
from anctmm.recursion.accelerations import by_blocks
from anctmm.recursion.riccati import (
    BlockFactors,
    Links,
    block_factors,
    factorize,
    find_unknowns,
    links,
    meet_inboard,
    part_outboard,
    pass_outboard,
    solve,
    start_sweep,
    turn_back,
    widened,
)
from anctmm.results.divergence_checks import STRETCH_LIMIT
from anctmm.results.solution import Solution, Status, in_short

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Newton corrections in a step before it is given up.
ITERATIONS = 25
#: Newton stops when the error left is this part of the tolerance (κ of Hairer & Wanner, IV.8): errors of steps add up.
KAPPA = 0.01
#: Contraction above which the iteration matrix is renewed.
SLOW = 0.5
#: Size below which corrections that do not fall are rounding.
ROUNDING = 1e-8
#: What rounding the factors may leave of the error at each correction, at most; measured, 0.7 makes no difference yet.
ROUNDED = 0.1
#: Components that pass through the cache together between two steps.
PART = 1024
#: Corrections in a step above which the matrix is renewed before the next one.
MANY = 5


@dataclass(frozen=True)
class GeneralizedAlpha:
    """Coefficients of the method.

    Parameters
    ----------
    spectral_radius : float
        ρ∞ in [0, 1]: 1 keeps the energy of high frequencies, 0 annihilates them in one step.
    """

    spectral_radius: float

    @property
    def alpha_m(self) -> float:
        """Weight of the old acceleration a."""
        return (2.0 * self.spectral_radius - 1.0) / (self.spectral_radius + 1.0)

    @property
    def alpha_f(self) -> float:
        """Weight of the old w."""
        return self.spectral_radius / (self.spectral_radius + 1.0)

    @property
    def gamma(self) -> float:
        """Newmark's γ, for second order."""
        return 0.5 + self.alpha_f - self.alpha_m

    @property
    def beta(self) -> float:
        """Newmark's β, for the most dissipation of high frequencies at the least of low ones."""
        return 0.25 * (self.gamma + 0.5) ** 2

    def of_step(self, h: float) -> "Coefficients":
        """Coefficients of a step of h (s)."""
        am, af, b, g = self.alpha_m, self.alpha_f, self.beta, self.gamma
        return Coefficients(h, am, af, b, g, (1 - am) / (b * h * h * (1 - af)))


class Coefficients(NamedTuple):
    """Step h (s), αm, αf, β, γ, and what a correction of q adds to w."""

    h: float
    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float
    to_w: float


class State(NamedTuple):
    """q, v, a and w, q and w at the start of the step, external force and dead load: each (rows, nodes).

    loads: those that arrive at each node in a solution, and then the unknowns, (nodes, rows). flat: the first six
    again, as vectors.
    """

    q: Array
    v: Array
    a: Array
    w: Array
    q_before: Array
    w_before: Array
    f: Array
    dead: Array
    loads: Array
    flat: tuple[Array, ...]


class Damping(NamedTuple):
    """Kelvin-Voigt damping of each body, s, and velocities at the end of the step, (rows, nodes).

    force: damping forces at the last evaluation and at the end of the step before, (2, rows, nodes). stiff: tables
    whose stiffness is that of the iteration matrix. flat: the velocities again, as a vector.
    """

    of: Array
    v: Array
    force: Array
    stiff: Tables
    flat: Array


class Newton(NamedTuple):
    """Newton's iteration: scale of positions (m), bound of the error left, and what it reports.

    counts: corrections, factorizations, whether the matrix must be renewed. history: of the sizes of the corrections
    of the last step, (ITERATIONS,).
    """

    scale: float
    tolerance: float
    counts: Ints
    history: Array


def integrate(chain: Chain) -> Solution:
    """Run a scene with the implicit integrator.

    Returns
    -------
    Solution
        With a status that names step, time and element if Newton's iteration failed.
    """
    run, bodies = chain.run, chain.bodies
    actuation, record = Actuation(chain.scene, bodies), Record(chain)
    state, newton = new_state(chain), new_newton(chain)
    fixed = (
        run.steps,
        run.stride,
        GeneralizedAlpha(run.spectral_radius).of_step(run.exact_dt),
        state,
        bodies.tables(),
        links(chain),
        block_factors(chain, single_will_do(chain)),
        actuation.hubs(),
        actuation.loads(),
        newton,
        record.arrays(),
        new_damping(chain),
    )

    def one(begin: int, end: int) -> int:
        t = run.times(np.arange(begin, min(end, run.steps) + 1))
        return int(advance(begin, end, *fixed, actuation.hub_table(t), actuation.load_table(t)))

    one(0, 0)
    start(*fixed[3:10], actuation, fixed[-1])
    record.start()
    start(*fixed[3:10], actuation, fixed[-1])

    def so_far(kept: int, status: Status, steps: int) -> Solution:
        return record.solution(kept, status, steps, int(newton.counts[0]), int(newton.counts[1]))

    failed = run_batches(chain, actuation.width, one, so_far)
    if failed < 0:
        return so_far(len(run.output_steps), Status(), run.steps)
    return so_far(1 + (failed - 1) // run.stride, _stalled(chain, failed, state, newton), failed)


def new_state(chain: Chain) -> State:
    """State of a scene at t = 0, accelerations apart."""
    q, v, dead = chain.bodies.reference(), chain.initial_velocity(), chain.dead_load
    a, w, q_before, w_before = np.zeros((4, *q.shape))
    flat = tuple(x.ravel() for x in (q, v, a, w, q_before, w_before))
    return State(q, v, a, w, q_before, w_before, dead.copy(), dead, np.zeros(q.shape[::-1]), flat)


def new_damping(chain: Chain) -> Damping | None:
    """Damping of a scene that has some, for steps of the discretisation's length."""
    bodies, c = chain.bodies, GeneralizedAlpha(chain.run.spectral_radius).of_step(chain.run.exact_dt)
    if bodies.damping is None:
        return None
    v = bodies.initial_velocity()
    return Damping(bodies.damping, v, np.zeros((2, *v.shape)), _stiff(bodies, c).tables(), v.ravel())


def _stiff(bodies: Bodies, c: Coefficients) -> Bodies:
    """The bodies with the stiffness that the iteration matrix has of them."""
    if bodies.damping is None:
        return bodies
    return bodies.stiffened([1.0 + c.gamma / (c.beta * c.h) * tau for tau in bodies.damping])


def single_will_do(chain: Chain) -> bool:
    """Whether the iteration matrix's factors may be kept in single precision, which moves half as much memory.

    It pays where the factors do not stay in the cache. Residuals are in double precision and so is what Newton's
    iteration tends to; a correction is wrong by ε (c_w + ω²)/c_w of itself or less, the condition of c_w M + K_T times
    the rounding, with ω the highest frequency of a free element. (Kelley 2022, Newton's method in mixed precision.)
    """
    if chain.bodies.nodes <= LONG or chain.plan.kept:
        return False
    c = GeneralizedAlpha(chain.run.spectral_radius).of_step(chain.run.exact_dt)
    condition = 1.0 + element_bound(chain, _stiff(chain.bodies, c)) ** 2 / c.to_w
    return float(np.finfo(np.float32).eps) * condition <= ROUNDED


def new_newton(chain: Chain) -> Newton:
    """Newton's iteration for a scene; what may be left of its tolerance is no less than rounding allows."""
    furthest = float(np.abs(chain.bodies.reference()[:2]).max())
    rounding = 32.0 * float(np.finfo(float).eps) * (1.0 + furthest / chain.length)
    left = max(KAPPA * chain.run.newton_tolerance, rounding)
    return Newton(chain.length, left, np.zeros(3, np.int64), np.zeros(ITERATIONS))


def start(
    state: State,
    tables: Tables,
    links: Links,
    factors: BlockFactors,
    hubs: Hubs,
    loads: Loads,
    newton: Newton,
    actuation: Actuation,
    damping: Damping | None = None,
) -> None:
    """True accelerations at t = 0, M w = F, from which a starts too; the hubs' are those of their drives."""
    now = np.zeros(1)
    drives, values = actuation.hub_table(now)[0], actuation.load_table(now)[0]
    if factors.L.dtype != np.float64:  # here nothing would mend what is rounded
        factors = widened(factors)
    _balance(state, tables, links, factors, hubs, loads, drives, values, damping)
    newton.counts[:] = 0, 1, 1


@kernel
def _balance(
    state: State,
    tables: Tables,
    links: Links,
    factors: BlockFactors,
    hubs: Hubs,
    loads: Loads,
    drives: Array,
    values: Array,
    damping: Damping | None,
) -> None:
    """w and a from the forces at t = 0; one call, since handing over so many arrays takes longer than the work."""
    turn_hubs(hubs, drives)
    place_hubs(state.q, state.v, hubs)
    set_loads(state.q, state.f, state.dead, loads, values)
    if damping is not None:
        _, flat_v, _, _, _, _ = state.flat
        copy(flat_v, damping.flat)
        _resist(state.q, state.f, state.dead, tables, loads, values, damping)
        _dissipated(state.q, state.q, damping)
    factorize(state.q, tables, links, 1.0, 0.0, loads, values, factors)
    by_blocks(state.q, state.f, tables, hubs, factors, state.w_before, state.w)
    _, _, flat_a, flat_w, _, _ = state.flat
    copy(flat_w, flat_a)


def correction_size(chain: Chain, state: State) -> Array:
    """Largest component of the last correction at each node, positions relative to the chain's length, (nodes,)."""
    x = np.abs(state.loads)
    return np.maximum(x[:, :2].max(axis=1) / chain.length, x[:, 2:].max(axis=1))


def _stalled(chain: Chain, step: int, state: State, newton: Newton) -> Status:
    """What is known of the step that ended a run."""
    residuals: tuple[float, ...] = ()
    t = float(chain.run.times(np.array([step]))[0])
    if not newton.history.any():  # the step was found, and is none that can be
        body, element = worst_element(chain, gradient_size(state.q))
        what = f"gradients grew beyond {STRETCH_LIMIT:g} by t = {t:.6g} s (step {step})"
    else:
        body, element = worst_element(chain, correction_size(chain, state))
        residuals = residual_history(chain, state, t)
        what = (
            f"Newton's iteration failed at t = {t:.6g} s (step {step}), with corrections {in_short(newton.history)} "
            f"and residuals {in_short(residuals)} N"
        )
    return Status(
        "diverged",
        f"{what}, worst in element {element} of body {body!r}; a smaller dt than {chain.run.dt:g} s or a finer mesh "
        f"may do",
        time=t,
        step=step,
        body=body,
        element=element,
        residuals=residuals,
    )


def residual_history(chain: Chain, state: State, t: float) -> tuple[float, ...]:
    """Norms of the residual, N, of Newton's iteration in the step to t that failed, gone through once more.

    The kernel does not form them: a step that succeeds has no use for them.
    """
    bodies, joined, actuation = chain.bodies, Joined(chain), Actuation(chain.scene, chain.bodies)
    c = GeneralizedAlpha(chain.run.spectral_radius).of_step(chain.run.exact_dt)
    now, hubs, loads = np.array([t]), actuation.hubs(), actuation.loads()
    values, tables, dead = actuation.load_table(now)[0], bodies.tables(), chain.dead_load
    force, (elastic, inertia) = dead.copy(), np.zeros((2, *dead.shape))
    factors, damping = block_factors(chain), new_damping(chain)
    matrix = tables if damping is None else damping.stiff
    turn_hubs(hubs, actuation.hub_table(now)[0])
    a, w = state.a, state.w_before.copy()
    new = (w - c.alpha_m * a) / (1.0 - c.alpha_m)
    q = state.q_before + c.h * state.v + c.h**2 * ((0.5 - c.beta) * a + c.beta * new)
    for h, i in enumerate(hubs.nodes):
        w[:, i] += c.to_w * (hubs.motion[0, h] - q[:, i])
        q[:, i] = hubs.motion[0, h]
    found: list[float] = []
    with np.errstate(all="ignore"):
        while len(found) < ITERATIONS and np.isfinite(found[-1:]).all() and np.isfinite(q).all():
            np.copyto(force, dead)
            set_loads(q, force, dead, loads, values)
            if damping is not None:
                new = ((1.0 - c.alpha_f) * w + c.alpha_f * state.w_before - c.alpha_m * a) / (1.0 - c.alpha_m)
                v = state.v + c.h * ((1.0 - c.gamma) * a + c.gamma * new)
                resist(
                    tables.blend,
                    q,
                    v,
                    tables.first,
                    tables.kinds,
                    tables.constants,
                    damping.of,
                    tables.buffer,
                    force,
                )
            elastic_forces(
                tables.blend, q, tables.first, tables.kinds, tables.constants, tables.buffer, elastic
            )
            mass_product(w, tables.first, tables.masses, tables.buffer, inertia)
            residual = force - elastic - inertia
            found.append(float(np.linalg.norm(joined.gather(residual))))
            factorize(q, matrix, links(chain), c.to_w, 1.0, loads, values, factors)
            x = solve(factors, residual)
            q += x
            w += c.to_w * x
    return tuple(found)


@kernel
def advance(
    begin: int,
    end: int,
    steps: int,
    stride: int,
    coefficients: Coefficients,
    state: State,
    tables: Tables,
    links: Links,
    factors: BlockFactors,
    hubs: Hubs,
    loads: Loads,
    newton: Newton,
    out: Output,
    damping: Damping | None,
    hub_table: Array,
    load_table: Array,
) -> int:
    """From step `begin` to step `end`; the step whose Newton iteration failed, or −1.

    The two tables hold the values of hubs, (steps + 1, hubs, 3), and loads, (steps + 1, loads, 2), from `begin` on.
    """
    q, v, _, w, _, _, f, _, _, flat = state
    _, flat_v, flat_a, flat_w, _, flat_before = flat
    driven = len(hubs.nodes) + len(loads.nodes) > 0
    unfinished = False
    for step in range(begin, end):
        values = load_table[step - begin]
        if driven:
            hub_reactions(q, w, f, tables, hubs)
            out.work[0] += work_done(step > 0, q, hubs, loads, values)
        if step % stride == 0 or step == steps:
            if too_large(q, STRETCH_LIMIT):
                newton.history[:] = 0.0  # no iteration failed
                return step
            if unfinished:
                finish(flat_v, flat_a, flat_w, flat_before, coefficients)
            unfinished = False
            keep(step, stride, q, v, tables, out)
        if step == steps:
            break
        begin_step(unfinished, flat, coefficients)
        if driven:
            turn_hubs(hubs, hub_table[step + 1 - begin])
        if not solve_step(
            state,
            coefficients,
            tables,
            links,
            factors,
            hubs,
            loads,
            load_table[step + 1 - begin],
            newton,
            damping,
        ):
            return step + 1
        unfinished = True
        if damping is not None:
            out.work[0] += _dissipated(q, state.q_before, damping)
    if unfinished:
        finish(flat_v, flat_a, flat_w, flat_before, coefficients)
    return -1


@embedded
def begin_step(unfinished, flat, c):  # type: ignore[no-untyped-def]
    """Finish the step before if need be, keep q and w, and predict: part by part, as long as they are in the cache."""
    q, v, a, w, q_before, w_before = flat
    for start in range(0, len(q), PART):
        end = min(start + PART, len(q))
        was, had = q_before[start:end], w_before[start:end]
        if unfinished:
            finish(v[start:end], a[start:end], w[start:end], had, c)
        copy(q[start:end], was)
        copy(w[start:end], had)
        predict(q[start:end], v[start:end], a[start:end], w[start:end], was, had, c)


@inlined
def _shares(c):  # type: ignore[no-untyped-def]
    """Of w, the old w and the old a, the last taken off, in a at the end of the step."""
    r = 1.0 / (1.0 - c.alpha_m)
    return (1.0 - c.alpha_f) * r, c.alpha_f * r, c.alpha_m * r


@inlined
def finish(v, a, w, w_before, c):  # type: ignore[no-untyped-def]
    """v and a at the end of the step, from w there."""
    now, then, old = _shares(c)
    for i in range(len(v)):
        new = now * w[i] + then * w_before[i] - old * a[i]
        v[i] += c.h * ((1.0 - c.gamma) * a[i] + c.gamma * new)
        a[i] = new


@inlined
def copy(x, y):  # type: ignore[no-untyped-def]
    """Copy x to y."""
    for i in range(len(x)):
        y[i] = x[i]


@inlined
def predict(q, v, a, w, q_before, w_before, c):  # type: ignore[no-untyped-def]
    """q and w at the end of the step if w stayed as it was."""
    r = 1.0 / (1.0 - c.alpha_m)
    for i in range(len(q)):
        new = r * (w_before[i] - c.alpha_m * a[i])
        q[i] = q_before[i] + (c.h * v[i] + c.h * c.h * ((0.5 - c.beta) * a[i] + c.beta * new))
        w[i] = w_before[i]


@inlined
def _drag(q, w, nodes, motion, c):  # type: ignore[no-untyped-def]
    """Give the hubs' nodes their known positions; w follows, and with it a and v."""
    for h in range(len(nodes)):
        i = nodes[h]
        for k in range(q.shape[0]):
            w[k, i] += c.to_w * (motion[0, h, k] - q[k, i])
            q[k, i] = motion[0, h, k]


@inlined
def solve_step(state, coefficients, tables, links, factors, hubs, loads, load_values, newton, damping):  # type: ignore[no-untyped-def]
    """Find the end of a step from its predictor: by modified Newton, and where that fails by Newton."""
    q, w = state.q, state.w
    flat_q, flat_v, flat_a, flat_w, was, had = state.flat
    solved = False
    for full in range(2):
        if not solved:
            if full == 1:
                predict(flat_q, flat_v, flat_a, flat_w, was, had, coefficients)
            _drag(q, w, hubs.nodes, hubs.motion, coefficients)
            solved = _newton(
                full == 1, state, coefficients, tables, links, factors, loads, load_values, newton, damping
            )
    return solved


@inlined
def _newton(full, state, coefficients, tables, links, factors, loads, load_values, newton, damping):  # type: ignore[no-untyped-def]
    """Newton's iteration, the matrix renewed at each correction if `full`, else when the corrections fall slowly."""
    q, _, _, w, _, _, f, dead, arrived, flat = state
    _, flat_v, flat_a, flat_w, _, had = flat
    _, _, counts, history = newton
    last, stalls = 0.0, 0
    history[:] = 0.0
    for iteration in range(ITERATIONS):
        set_loads(q, f, dead, loads, load_values)
        if full or counts[2] != 0:
            if damping is None:
                factorize(q, tables, links, coefficients.to_w, 1.0, loads, load_values, factors)
            else:
                factorize(q, damping.stiff, links, coefficients.to_w, 1.0, loads, load_values, factors)
            counts[1] += 1
            counts[2] = 0
        if damping is not None:
            _velocities(flat_v, flat_a, flat_w, had, coefficients, damping.flat)
            _resist(q, f, dead, tables, loads, load_values, damping)
        _forward(q, w, f, tables, factors, factors.loops, arrived)
        size = _backward(q, w, coefficients.to_w, newton.scale, factors, factors.loops, arrived)
        history[iteration] = size
        counts[0] += 1
        if size == np.inf:
            break
        # the corrections fall by `rate` each: what is left is at most their geometric series
        rate = size / last if iteration > 0 else 1.0
        if size <= newton.tolerance or (rate < 1.0 and size * rate / (1.0 - rate) <= newton.tolerance):
            counts[2] = 1 if iteration >= MANY else 0
            return True
        if iteration > 0 and rate > SLOW:
            counts[2] = 1
            stalls += 1 if size < ROUNDING else 0
            if stalls == 3:  # corrections with a new matrix that no longer fall are rounding
                return True
        last = size
    counts[2] = 1
    return False


@inlined
def _velocities(v, a, w, w_before, c, out):  # type: ignore[no-untyped-def]
    """Velocities that `finish` would give."""
    now, then, old = _shares(c)
    for i in range(len(v)):
        new = now * w[i] + then * w_before[i] - old * a[i]
        out[i] = v[i] + c.h * ((1.0 - c.gamma) * a[i] + c.gamma * new)


@inlined
def _resist(q, f, dead, tables, loads, load_values, damping):  # type: ignore[no-untyped-def]
    """External forces at the velocities of `damping`, which resist them."""
    first, blend, kinds, constants, _, buffer = tables
    force = damping.force[0]
    for k in range(f.shape[0]):
        for i in range(f.shape[1]):
            f[k, i] = dead[k, i]
            force[k, i] = 0.0
    set_loads(q, f, dead, loads, load_values)
    resist(blend, q, damping.v, first, kinds, constants, damping.of, buffer, force)
    for k in range(f.shape[0]):
        for i in range(f.shape[1]):
            f[k, i] += force[k, i]


@inlined
def _dissipated(q, q_before, damping):  # type: ignore[no-untyped-def]
    """Work of the damping forces over the step, J: their mean times the displacement, as the integrator has it.

    The power lost, integrated in time, would count a motion that dies out within a step many times over.
    """
    work = 0.0
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            now = damping.force[0, k, i]
            work += 0.5 * (now + damping.force[1, k, i]) * (q[k, i] - q_before[k, i])
            damping.force[1, k, i] = now
    return work


@embedded
def _forward(q, w, f, tables, factors, loops, arrived):  # type: ignore[no-untyped-def]
    """Forward sweep of the residual f − F_elastic − M w, window by window: what has arrived at each node."""
    first, blend, kinds, constants, masses, buffer = tables
    unit, L, _, wide, work, _, places, _ = factors
    d, body, nodes, place = len(unit), FIRST_BODY, q.shape[1], 0
    last = 12 * BLOCK
    buffer[last:] = 0.0
    start_sweep(unit, loops, work)
    for start in range(0, nodes, BLOCK):
        end = min(start + BLOCK, nodes)
        window_forces(blend, q, start, end, body, first, kinds, constants, buffer)
        window_inertia(w, 1.0, start, end, body, first, masses, buffer)
        body = body_after(end, body, first)
        begin = start
        while begin < end:
            stop = min(end, places.at[place])
            for i in range(begin, stop):
                if nodes > LONG:
                    prefetch_row(L, min(i + AHEAD, nodes - 1))
                    if i % LINE == 0:
                        prefetch_columns(q, min(i + BLOCK, nodes - 1))
                        prefetch_columns(w, min(i + BLOCK, nodes - 1))
                        prefetch_columns(f, min(i + BLOCK, nodes - 1))
                for k in range(d):
                    at = k * BLOCK + i - start
                    work[4 * d * d + k] = f[k, i] - buffer[at] - buffer[last + k]
                    buffer[last + k] = buffer[at + 6 * BLOCK]
                pass_outboard(unit, L, wide, loops, i, work)
                for k in range(d):
                    arrived[i, k] = work[4 * d * d + k]
            begin = stop
            if stop == places.at[place]:
                part_outboard(unit, places, loops, place, work)
                place += 1
    turn_back(unit, loops, work)


@embedded
def _backward(q, w, to_w, scale, factors, loops, arrived):  # type: ignore[no-untyped-def]
    """Backward sweep: the corrections, put in place of what arrived, are added to q, and what follows to w.

    Returns the largest component, positions relative to `scale`; infinity if one is not finite.
    """
    unit, L, G, wide, work, _, places, _ = factors
    d, largest, odd = len(unit), 0.0, 0.0
    nodes = q.shape[1]
    for place in range(len(places.at) - 1, -1, -1):
        meet_inboard(unit, places, loops, place, arrived, work)
        begin = places.at[place - 1] if place > 0 else 0
        for i in range(places.at[place] - 1, begin - 1, -1):
            if nodes > LONG:
                prefetch_row(L, max(i - AHEAD, 0))
                prefetch_row(G, max(i - AHEAD, 0))
                if i % LINE == 0:
                    prefetch_columns(q, max(i - 2 * AHEAD, 0))
                    prefetch_columns(w, max(i - 2 * AHEAD, 0))
            for k in range(d):
                work[4 * d * d + k] = arrived[i, k]
            find_unknowns(unit, L, G, wide, loops, i, work)
            for k in range(d):
                x = work[4 * d * d + 2 * d + k]
                arrived[i, k] = x
                q[k, i] += x
                w[k, i] += to_w * x
                largest = max(largest, abs(x) * (1.0 / scale if k < 2 else 1.0))
                odd += x - x  # 0 unless infinite or not a number
    return largest if odd == 0.0 else np.inf
