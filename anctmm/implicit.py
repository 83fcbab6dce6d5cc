"""Implicit ANC-TMM: generalized-α with Newton, its linear solves by the Riccati recursion.

Chung & Hulbert (1993) in the form of Arnold & Brüls (2007): M w_{n+1} = F(q_{n+1}) holds at the end of the step, and

    (1 − αm) a_{n+1} + αm a_n = (1 − αf) w_{n+1} + αf w_n,
    q_{n+1} = q_n + h v_n + h² ((½ − β) a_n + β a_{n+1}),    v_{n+1} = v_n + h ((1 − γ) a_n + γ a_{n+1}).

A Newton correction solves (c_w M + K_T) Δq = F − M w with c_w = (1 − αm)/(βh²(1 − αf)): block tridiagonal, so the same
recursion as for the mass. Known coordinates are known as positions; their velocities and accelerations follow from the
formulas above, as they do in an index-3 solution of the equations with multipliers.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.accelerations import by_blocks
from anctmm.actuation import (
    Actuation,
    Hubs,
    Loads,
    hub_reactions,
    place_hubs,
    set_loads,
    turn_hubs,
    work_done,
)
from anctmm.assembly import Tables, elastic_forces, mass_product
from anctmm.chain import Chain
from anctmm.compiling import announced, inlined, kernel
from anctmm.recording import STRETCH_LIMIT, Output, Record, keep, run_batches, too_large, worst_element
from anctmm.riccati import BlockFactors, Links, block_factors, factorize, links, sweep
from anctmm.solution import Solution, Status

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
        return Coefficients(h, am, b, g, 1 / (b * h * h), g / (b * h), (1 - am) / (b * h * h * (1 - af)))


class Coefficients(NamedTuple):
    """Step h (s), αm, β, γ, and what a correction of q adds to a, v and w."""

    h: float
    alpha_m: float
    beta: float
    gamma: float
    to_a: float
    to_v: float
    to_w: float


class State(NamedTuple):
    """q, v, a, w, external force and dead load at the end of a step, and scratch: each (rows, nodes)."""

    q: Array
    v: Array
    a: Array
    w: Array
    f: Array
    dead: Array
    load: Array
    inertia: Array
    x: Array
    total: Array


class Newton(NamedTuple):
    """Newton's iteration: scale of positions (m), bound of the error left, and what it reports.

    counts: corrections, factorizations, whether the matrix must be renewed. size: of the last correction at each
    node, (nodes,). history: of the corrections of the last step, (ITERATIONS,).
    """

    scale: float
    tolerance: float
    counts: Ints
    size: Array
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
        GeneralizedAlpha(run.spectral_radius).of_step(run.dt),
        state,
        bodies.tables(),
        links(chain),
        block_factors(bodies.nodes, bodies.rows),
        actuation.hubs(),
        actuation.loads(),
        newton,
        record.arrays(),
    )

    def one(begin: int, end: int) -> int:
        t = run.times(np.arange(begin, end + 1))
        return int(advance(begin, end, *fixed, actuation.hub_table(t), actuation.load_table(t)))

    with announced():
        one(0, 0)
        start(*fixed[3:10], actuation)
    record.start()
    start(*fixed[3:10], actuation)
    failed = run_batches(chain, one)
    done = run.steps if failed < 0 else failed
    status = Status() if failed < 0 else _stalled(chain, failed, newton)
    kept = len(run.output_steps) if failed < 0 else 1 + (failed - 1) // run.stride
    return record.solution(kept, status, done, int(newton.counts[0]), int(newton.counts[1]))


def new_state(chain: Chain) -> State:
    """State of a scene at t = 0, accelerations apart."""
    q, v, dead = chain.bodies.reference(), chain.initial_velocity(), chain.dead_load
    return State(q, v, np.zeros_like(q), np.zeros_like(q), dead.copy(), dead, *np.zeros((4, *q.shape)))


def new_newton(chain: Chain) -> Newton:
    """Newton's iteration for a scene; what may be left of its tolerance is no less than rounding allows."""
    furthest = float(np.abs(chain.bodies.reference()[:2]).max())
    rounding = 32.0 * float(np.finfo(float).eps) * (1.0 + furthest / chain.length)
    left = max(KAPPA * chain.run.newton_tolerance, rounding)
    return Newton(
        chain.length, left, np.zeros(3, np.int64), np.zeros(chain.bodies.nodes), np.zeros(ITERATIONS)
    )


def start(
    state: State,
    tables: Tables,
    links: Links,
    factors: BlockFactors,
    hubs: Hubs,
    loads: Loads,
    newton: "Newton",
    actuation: Actuation,
) -> None:
    """True accelerations at t = 0, M w = F, from which a starts too; the hubs' are those of their drives."""
    now = np.zeros(1)
    values = actuation.load_table(now)[0]
    turn_hubs(hubs, actuation.hub_table(now)[0])
    place_hubs(state.q, state.v, hubs)
    set_loads(state.q, state.f, state.dead, loads, values)
    factorize(state.q, tables, links, 1.0, 0.0, loads, values, factors)
    by_blocks(state.q, state.f, tables, hubs, factors, state.load, state.w)
    state.a[:] = state.w
    newton.counts[:] = 0, 1, 1


def _stalled(chain: Chain, step: int, newton: Newton) -> Status:
    body, element = worst_element(chain, newton.size)
    t = float(chain.run.times(np.array([step]))[0])
    history = ", ".join(f"{x:.1e}" for x in newton.history if x > 0.0)
    return Status(
        "diverged",
        f"Newton's iteration failed at t = {t:.6g} s (step {step}), worst in element {element} of body {body!r}, "
        f"with corrections {history or 'none'}; a smaller dt than {chain.run.dt:g} s or a finer mesh may do",
        time=t,
        step=step,
        body=body,
        element=element,
    )


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
    hub_table: Array,
    load_table: Array,
) -> int:
    """From step `begin` to step `end`; the step whose Newton iteration failed, or −1.

    The two tables hold the values of hubs, (steps + 1, hubs, 3), and loads, (steps + 1, loads, 2), from `begin` on.
    """
    q, v, w = state.q, state.v, state.w
    driven = len(hubs.nodes) + len(loads.nodes) > 0
    for step in range(begin, end):
        values = load_table[step - begin]
        if driven:
            hub_reactions(q, w, state.f, tables, hubs)
            out.work[0] += work_done(step > 0, q, hubs, loads, values)
        if step % stride == 0 or step == steps:
            if too_large(q, STRETCH_LIMIT):
                return step
            keep(step, stride, q, v, tables, out)
        if step == steps:
            break
        predict(state, coefficients)
        if driven:
            turn_hubs(hubs, hub_table[step + 1 - begin])
            drag_hubs(state, hubs, coefficients)
        if not solve_step(
            state, coefficients, tables, links, factors, loads, load_table[step + 1 - begin], newton
        ):
            return step + 1
    return -1


@inlined
def predict(state, c):  # type: ignore[no-untyped-def]
    """State at the end of the step if w stayed as it is."""
    q, v, a, w = state.q, state.v, state.a, state.w
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            new = (w[k, i] - c.alpha_m * a[k, i]) / (1.0 - c.alpha_m)
            q[k, i] += c.h * v[k, i] + c.h * c.h * ((0.5 - c.beta) * a[k, i] + c.beta * new)
            v[k, i] += c.h * ((1.0 - c.gamma) * a[k, i] + c.gamma * new)
            a[k, i] = new


@inlined
def drag_hubs(state, hubs, c):  # type: ignore[no-untyped-def]
    """Give the hubs' nodes their known positions; velocities and accelerations follow."""
    for h in range(len(hubs.nodes)):
        i = hubs.nodes[h]
        for k in range(state.q.shape[0]):
            x = hubs.motion[0, h, k] - state.q[k, i]
            state.q[k, i] += x
            state.a[k, i] += c.to_a * x
            state.v[k, i] += c.to_v * x
            state.w[k, i] += c.to_w * x


@inlined
def solve_step(state, coefficients, tables, links, factors, loads, load_values, newton):  # type: ignore[no-untyped-def]
    """Find the end of a step: by modified Newton, and where that fails by Newton from the predictor again."""
    solved = False
    for full in range(2):
        if not solved:
            solved = _newton(
                full == 1, state, coefficients, tables, links, factors, loads, load_values, newton
            )
    return solved


@kernel
def _newton(
    full: bool,
    state: State,
    coefficients: Coefficients,
    tables: Tables,
    links: Links,
    factors: BlockFactors,
    loads: Loads,
    load_values: Array,
    newton: Newton,
) -> bool:
    """Newton's iteration, the matrix renewed at each correction if `full`, else when the corrections fall slowly.

    False if it does not converge; the state is then what it was before.
    """
    # arrays leave their tuples once: taken out inside the loop, their references would be counted each time
    q, v, a, w, f, dead, load, inertia, x, total = state
    first, elements, kinds, constants, masses, buffer = tables
    unit, L, G, _, _, _ = factors
    scale, tolerance, counts, sizes, history = newton
    last, stalls = 0.0, 0
    history[:] = 0.0
    total[:] = 0.0
    for iteration in range(ITERATIONS):
        set_loads(q, f, dead, loads, load_values)
        elastic_forces(q, first, elements, kinds, constants, buffer, load)
        mass_product(w, first, elements, masses, inertia)
        for k in range(q.shape[0]):
            for i in range(q.shape[1]):
                load[k, i] = f[k, i] - load[k, i] - inertia[k, i]
        if full or counts[2] != 0:
            factorize(q, tables, links, coefficients.to_w, 1.0, loads, load_values, factors)
            counts[1] += 1
            counts[2] = 0
        sweep(unit, L, G, load, x)
        size = _size(x, scale, sizes)
        history[iteration] = size
        counts[0] += 1
        if size == np.inf:
            break
        _correct(q, v, a, w, x, 1.0, coefficients, total)
        # the corrections fall by `rate` each: what is left is at most their geometric series
        rate = size / last if iteration > 0 else 1.0
        if size <= tolerance or (rate < 1.0 and size * rate / (1.0 - rate) <= tolerance):
            counts[2] = 1 if iteration >= MANY else 0
            return True
        if iteration > 0 and rate > SLOW:
            counts[2] = 1
            stalls += 1 if size < ROUNDING else 0
            if stalls == 3:  # corrections with a new matrix that no longer fall are rounding
                return True
        last = size
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            x[k, i] = total[k, i]
    _correct(q, v, a, w, x, -1.0, coefficients, total)
    counts[2] = 1
    return False


@inlined
def _size(x, scale, sizes):  # type: ignore[no-untyped-def]
    """Largest component of a correction, positions relative to `scale`; infinite if it is not a number."""
    largest = 0.0
    sizes[:] = 0.0
    for k in range(x.shape[0]):
        unit = 1.0 / scale if k < 2 else 1.0
        for i in range(x.shape[1]):
            here = abs(x[k, i]) * unit
            sizes[i] = max(sizes[i], here if here - here == 0.0 else np.inf)
    for i in range(x.shape[1]):
        largest = max(largest, sizes[i])
    return largest


@inlined
def _correct(q, v, a, w, x, sign, c, total):  # type: ignore[no-untyped-def]
    """Add sign · x, and what follows from it, to the state, and to the total of the corrections."""
    for k in range(x.shape[0]):
        for i in range(x.shape[1]):
            step = sign * x[k, i]
            q[k, i] += step
            a[k, i] += c.to_a * step
            v[k, i] += c.to_v * step
            w[k, i] += c.to_w * step
            total[k, i] += step
