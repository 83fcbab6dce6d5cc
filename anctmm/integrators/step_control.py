"""Generalized-α with a step driven by an estimate of its local error.

A step misses the displacement by h³ w' (1/6 − β + (αf − αm)/2) to leading order: the Taylor series of the exact motion
less that of the method, whose a lags w by (αf − αm) h (after Zienkiewicz & Xie 1991 and Hulbert & Jang 1995). The
difference of w over the step serves for h w'. High frequencies that the method damps anyway would dominate it, so it
is filtered by (c_w M + K)⁻¹ c_w M, which leaves slow motion as it is (Hairer & Wanner, IV.8).

Errors add up over a run: each step may make the share h/t_end of what the user allows. Drives and loads are tabulated
once on a fine grid; angles between its points by their quintic Hermite interpolant, loads by a cubic.
"""

from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables, mass_product
from anctmm.discretise.chain import Chain
from anctmm.discretise.methods import Coefficients, GeneralizedAlpha
from anctmm.forces.actuation import Actuation, Hubs, Loads, hub_reactions, turn_hubs, work_done
from anctmm.integrators.generalized_alpha import start
from anctmm.integrators.implicit_step import State, begin_step, copy, finish, new_state
from anctmm.integrators.newton import Newton, new_newton, solve_step
from anctmm.integrators.newton_failure import correction_size
from anctmm.integrators.output import STEP, Output, Record, gradient_size, keep, too_large, worst_element
from anctmm.jit.compiling import inlined, kernel
from anctmm.jit.pacing import paced
from anctmm.recursion.riccati import BlockFactors, Links, block_factors, links, sweep
from anctmm.results.divergence_checks import STRETCH_LIMIT
from anctmm.results.solution import Interrupted, Solution, Status, in_short, interruption

Array = NDArray[np.float64]

#: Share of the tolerance that the sum of local errors may take: errors cancel in part. Measured on the base scenes,
#: whose errors in time are then at most 1.4 times what is asked.
SHARE = 2.0
#: First step and smallest step, of the interval of output and of the run.
FIRST, SMALLEST = 1.0 / 16.0, 1e-9
#: Relative change of the step beyond which the iteration matrix is renewed.
STALE = 0.15
#: Points of the tables of drives and loads in an interval of output, and in all at least.
DENSITY, POINTS = 8, 4096
#: More steps than a run can have.
UNLIMITED = 1 << 60


class Control(NamedTuple):
    """Step control: tolerance, error coefficient, run length (s), outputs, grid spacing (s), least scale (m).

    method: αm, αf, β, γ. counts: accepted and rejected steps. load and x: scratch, (rows, nodes). values and angles: of
    loads and driven clamps now, a row of their tables. reference: coordinates of the undeformed scene. progress: where
    the run stands, see `Progress`.
    """

    tolerance: float
    coefficient: float
    t_end: float
    outputs: int
    spacing: float
    floor: float
    method: tuple[float, float, float, float]
    counts: Array
    load: Array
    x: Array
    values: Array
    angles: Array
    reference: Array
    progress: Array


class Progress(NamedTuple):
    """Time reached, scale of displacements (m), step aimed at, that of the matrix, the last one (0: none), s."""

    t: float
    scale: float
    wanted: float
    factored: float
    last: float


#: How a call of `advance` ended: at the end of the run, for good before it, or because it took all steps it may.
DONE, STUCK, UNFINISHED = 0, 1, 2


def integrate(chain: Chain) -> Solution:
    """Run a scene with error-controlled implicit steps.

    Returns
    -------
    Solution
        With a status that names time and element if no step was small enough.
    """
    run, bodies = chain.run, chain.bodies
    actuation, record = Actuation(chain.scene, bodies), Record(chain)
    state, newton = new_state(chain), new_newton(chain)
    points = ceil(max(POINTS, DENSITY * run.steps) / run.steps) * run.steps
    grid = np.asarray(np.arange(points + 1) * (run.t_end / points), dtype=np.float64)
    method = GeneralizedAlpha(run.spectral_radius)
    control = Control(
        float(run.tolerance or 0.0),
        abs(1.0 / 6.0 - method.beta + 0.5 * (method.alpha_f - method.alpha_m)),
        run.t_end,
        run.steps,
        run.t_end / points,
        1e-3 * chain.length,
        (method.alpha_m, method.alpha_f, method.beta, method.gamma),
        np.zeros(2),
        np.zeros_like(state.q),
        np.zeros_like(state.q),
        actuation.load_table(grid[:1])[0],
        actuation.hub_table(grid[:1])[0],
        bodies.reference(),
        np.zeros(len(Progress._fields) + 1),
    )
    system = (bodies.tables(), links(chain), block_factors(chain))
    acting = (actuation.hubs(), actuation.loads())
    fixed = (control, state, *system, *acting, newton, record.arrays())
    advance(0, 0, *fixed, actuation.hub_table(grid[:1]), actuation.load_table(grid[:1]))
    start(state, *system, *acting, newton, actuation)
    record.start()
    start(state, *system, *acting, newton, actuation)
    control.progress[:] = *Progress(0.0, control.floor, FIRST * run.t_end / run.steps, 0.0, 0.0), 0.0
    tables = actuation.hub_table(grid), actuation.load_table(grid)

    def so_far(status: Status) -> Solution:
        kept, steps = int(control.progress[-1]), int(control.counts[0])
        return record.solution(kept, status, steps, int(newton.counts[0]), int(newton.counts[1]))

    code = UNFINISHED
    for begin, end in paced(UNLIMITED, STEP * bodies.nodes):
        try:
            code = int(advance(end - begin, run.steps, *fixed, *tables))
        except KeyboardInterrupt:
            raise Interrupted(so_far(interruption(float(control.progress[0])))) from None
        if code != UNFINISHED:
            break
    return so_far(Status() if code == DONE else _stuck(chain, float(control.progress[0]), state, newton))


def _stuck(chain: Chain, t: float, state: State, newton: Newton) -> Status:
    """What is known of a run that ended early."""
    if newton.history.any():
        body, element = worst_element(chain, correction_size(chain, state))
        what = (
            f"no step was small enough at t = {t:.6g} s, with corrections {in_short(newton.history)} in the last one "
            f"tried; the motion may blow up there"
        )
    else:
        body, element = worst_element(chain, gradient_size(state.q))
        what = f"gradients grew beyond {STRETCH_LIMIT:g} by t = {t:.6g} s"
    return Status(
        "diverged",
        f"{what}, worst in element {element} of body {body!r}: a finer mesh may do, or a load that does not jump",
        time=t,
        body=body,
        element=element,
    )


@kernel
def advance(
    budget: int,
    outputs: int,
    control: Control,
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
    """Run over the intervals of output with at most `budget` steps, from where `control.progress` stands."""
    q, v, w = state.q, state.v, state.w
    flat_q, flat_v, flat_a, flat_w, flat_q_before, flat_w_before = state.flat
    values, angles, progress = control.values, control.angles, control.progress
    interval, kept = control.t_end / control.outputs, int(progress[5])
    t, scale, wanted, factored, last = progress[0], progress[1], progress[2], progress[3], progress[4]
    if kept == 0:
        hub_reactions(q, w, state.f, tables, hubs)
        work_done(False, q, hubs, loads, values)
    code = DONE
    for number in range(max(kept - 1, 0), outputs + 1):
        if number == kept:
            if too_large(q, STRETCH_LIMIT):
                newton.history[:] = 0.0  # no step was refused
                code = STUCK
                break
            keep(number, 1, q, v, tables, out)
            kept += 1
        if number == outputs:
            break
        end = (number + 1) * interval
        while t < end - 1e-12 * interval:
            if budget == 0:
                code = UNFINISHED
                break
            budget -= 1
            h = (end - t) / np.ceil((end - t) / wanted * (1.0 - 1e-9))
            if h < SMALLEST * control.t_end:
                code = STUCK
                break
            if last > 0.0 and h != last:
                _shift(state, control, 1.0 - h / last)
            last = 0.0
            c = _coefficients(h, control.method)
            begin_step(False, state.flat, c)
            _interpolate(t + h, control.spacing, hub_table, load_table, angles, values)
            turn_hubs(hubs, angles)
            if abs(h - factored) > STALE * h:
                newton.counts[2] = 1
            if newton.counts[2] != 0:
                factored = h
            solved = solve_step(state, c, tables, links, factors, hubs, loads, values, newton, None)
            allowed = SHARE * control.tolerance * h / control.t_end
            error = np.inf
            if solved:
                error = _error(state, control, c, tables, factors) / scale
            if not error <= 2.0 * allowed:
                copy(flat_q_before, flat_q)
                copy(flat_w_before, flat_w)
                wanted = h * max(0.2, 0.8 * np.sqrt(allowed / error)) if solved else 0.25 * h
                newton.counts[2] = 1
                control.counts[1] += 1
                continue
            finish(flat_v, flat_a, flat_w, flat_w_before, c)
            t, last = t + h, h
            control.counts[0] += 1
            hub_reactions(q, w, state.f, tables, hubs)
            out.work[0] += work_done(True, q, hubs, loads, values)
            scale = max(scale, _size(q, control.reference))
            ratio = 0.9 * np.sqrt(allowed / max(error, 1e-300))
            if ratio < 0.9 or ratio > 1.25:  # small changes would only cost factorizations
                wanted = h * min(max(ratio, 0.3), 1.6)
        if code != DONE:
            break
        t = end
    progress[0], progress[1], progress[2], progress[3], progress[4] = t, scale, wanted, factored, last
    progress[5] = kept
    return code


@inlined
def _coefficients(h, method):  # type: ignore[no-untyped-def]
    """Coefficients of a step of h, as `GeneralizedAlpha.of_step` gives them."""
    am, af, b, g = method
    return Coefficients(h, am, af, b, g, (1.0 - am) / (b * h * h * (1.0 - af)))


@inlined
def _shift(state, control, part):  # type: ignore[no-untyped-def]
    """Move a, which lags w by αf − αm of a step, to the lag of the step to come, `part` of the last one shorter."""
    lag = part * (control.method[1] - control.method[0])
    for k in range(state.q.shape[0]):
        for i in range(state.q.shape[1]):
            state.a[k, i] += lag * (state.w[k, i] - state.w_before[k, i])


@inlined
def _error(state, control, c, tables, factors):  # type: ignore[no-untyped-def]
    """Filtered estimate of the step's error in displacement, RMS over the nodes, m."""
    factor = control.coefficient * c.h * c.h * c.to_w
    for k in range(state.q.shape[0]):
        for i in range(state.q.shape[1]):
            control.x[k, i] = factor * (state.w[k, i] - state.w_before[k, i])
    mass_product(control.x, tables.first, tables.masses, tables.buffer, control.load)
    sweep(factors, control.load, control.x)
    total = 0.0
    for k in range(2):
        for i in range(state.q.shape[1]):
            total += control.x[k, i] * control.x[k, i]
    return np.sqrt(total / state.q.shape[1])


@inlined
def _size(q, reference):  # type: ignore[no-untyped-def]
    """RMS of the nodes' displacements, m."""
    total = 0.0
    for k in range(2):
        for i in range(q.shape[1]):
            total += (q[k, i] - reference[k, i]) ** 2
    return np.sqrt(total / q.shape[1])


@inlined
def _interpolate(t, spacing, hub_table, load_table, angles, values):  # type: ignore[no-untyped-def]
    """Driven clamps' angles and loads' values at t: quintic Hermite of θ, θ', θ''; cubic of four neighbours."""
    last = len(hub_table) - 1
    i = min(int(t / spacing), max(last - 1, 0))
    x = t / spacing - i
    y = 1.0 - x
    for h in range(hub_table.shape[1]):
        a, b = hub_table[i, h], hub_table[i + 1, h]
        angles[h, 0] = (
            y**3 * (1.0 + 3.0 * x + 6.0 * x * x) * a[0]
            + x**3 * (1.0 + 3.0 * y + 6.0 * y * y) * b[0]
            + spacing * x * y * (y * y * (1.0 + 3.0 * x) * a[1] - x * x * (1.0 + 3.0 * y) * b[1])
            + 0.5 * (spacing * x * y) ** 2 * (y * a[2] + x * b[2])
        )
    j = min(max(i - 1, 0), max(last - 3, 0))
    z = t / spacing - j
    for n in range(load_table.shape[1]):
        for c in range(2):
            values[n, c] = (
                -(z - 1.0) * (z - 2.0) * (z - 3.0) / 6.0 * load_table[j, n, c]
                + z * (z - 2.0) * (z - 3.0) / 2.0 * load_table[j + 1, n, c]
                - z * (z - 1.0) * (z - 3.0) / 2.0 * load_table[j + 2, n, c]
                + z * (z - 1.0) * (z - 2.0) / 6.0 * load_table[j + 3, n, c]
            )
