"""Generalized-α with a step driven by an estimate of its local error.

A step misses the displacement by h³ w' (1/6 − β + (αf − αm)/2) to leading order: the Taylor series of the exact motion
less that of the method, whose a lags w by (αf − αm) h (after Zienkiewicz & Xie 1991 and Hulbert & Jang 1995). The
difference of w over the step serves for h w'. High frequencies that the method damps anyway would dominate it, so it
is filtered by (c_w M + K)⁻¹ c_w M, which leaves slow motion as it is (Hairer & Wanner, IV.8).

What happens between the ends of a step is no part of this. So what a load does beside its straight line over the step
is added: its impulse ∫|f − f_line| dt, times h as if it came at the start; and what a drive does beside the cubic of
its angles and rates, times the length of the scene. Both vanish faster than the rest as steps fall.

Where there are constraints between rigid bodies or guides, a step of another length starts anew, too: their multipliers
would be wrong there.

Steps end where loads or drives break; where a load or the acceleration of a drive jumps, accelerations start anew.
The lag of a at such a start is found by a first try of the step.

Errors add up over a run: each step may make the share h/t_end of what the user allows. They are relative to the
largest displacement of each node, or a part of the largest of all where that is more: those until now, and where a
tight tolerance makes it pay, those of a pilot run of a loose one, which stops at no outputs. Where they turn out to be
less than was assumed, the first run is made again.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables, mass_product
from anctmm.discretise.chain import Chain
from anctmm.discretise.maps import push_alike
from anctmm.discretise.mesh import varying_loads
from anctmm.discretise.methods import Coefficients, GeneralizedAlpha
from anctmm.forces.actuation import Actuation, DrivenClamps, clamp_reactions, turn_clamps, work_done
from anctmm.forces.connectors import driven_connectors, has_clock, measure, slopes
from anctmm.forces.driving import drives_of
from anctmm.forces.loads import Loads, load_at
from anctmm.forces.timeline import Timeline, missed_impulse, missed_turn, set_actions, timeline
from anctmm.integrators.implicit_start import balance
from anctmm.integrators.implicit_step import State, begin_step, copy, finish, new_state
from anctmm.integrators.locking import locked, rows_in
from anctmm.integrators.newton import Newton, new_newton, solve_step
from anctmm.integrators.newton_failure import correction_size
from anctmm.integrators.output import (
    STEP,
    Output,
    Record,
    actuation_of,
    gradient_size,
    keep,
    too_large,
    worst_element,
)
from anctmm.jit.compiling import embedded, inlined, kernel
from anctmm.jit.pacing import paced
from anctmm.recursion.constrained import constrained, set_drives, work_of_drives
from anctmm.recursion.low_rank import correct
from anctmm.recursion.riccati import BlockFactors, Links, block_factors, links, sweep
from anctmm.recursion.rows import Rows
from anctmm.results.divergence_checks import STRETCH_LIMIT
from anctmm.results.finding import part
from anctmm.results.solution import Interrupted, Solution, Status, in_short, interruption

Array = NDArray[np.float64]

#: Share of the tolerance that the sum of local errors may take: errors cancel in part.
SHARE = 1.0
#: The same with constraints: at steps of other length their multipliers bring errors that the estimate does not see.
WITH_CONSTRAINTS = 0.2
#: First step and smallest step, of the interval of output and of the run.
FIRST, SMALLEST = 1.0 / 16.0, 1e-9
#: Relative change of the step beyond which the iteration matrix is renewed.
STALE = 0.15
#: More steps than a run can have.
UNLIMITED = 1 << 60
#: Displacement that the pilot run starts from, of the scene's length, and below which nothing moves.
FLOOR, STILL = 1e-3, 1e-11
#: Part of the largest displacement to which errors of nodes that move less are relative.
SMALL = 0.25
#: Largest value of the shape function of a gradient, of the element's length.
BULGE = 4.0 / 27.0
#: Tolerance of the pilot run, that below which it pays, and how often a first run is made where little moves, at most.
PILOT, PILOTED, ROUNDS = 0.05, 5e-3, 4


class Control(NamedTuple):
    """Step control: sum of local errors that is allowed, error coefficient, run length (s).

    reach: length that each drive moves by a unit, m. small: part of the largest displacement to which errors of nodes
    that move less are relative. method: αm, αf, β, γ. times: of the outputs, s. counts: accepted and rejected steps.
    scale: largest displacement, of a pilot run or until now, m, (1,). load and x: scratch, (rows, nodes). angles,
    values: of drives and loads at the start and at the end of the step, (2, drives, 3) and (2, loads, 2). missed:
    scratch, (2,). reference: coordinates at the start. bulge: largest displacement beside each node that a unit of its
    gradient makes, m, (nodes,). moved: that displacement of each node, m, (nodes,). progress: where the run stands,
    see `Progress`.
    """

    allowed: float
    coefficient: float
    t_end: float
    reach: Array
    small: float
    method: tuple[float, float, float, float]
    times: Array
    counts: Array
    scale: Array
    load: Array
    x: Array
    angles: Array
    values: Array
    missed: Array
    reference: Array
    bulge: Array
    moved: Array
    progress: Array


class Progress(NamedTuple):
    """Time reached, step aimed at, that of the matrix, the last one (0: none), s; what comes next.

    event: number of the next stop. start: whether the motion starts there. first: whether its first step comes next.
    kept: outputs.
    """

    t: float
    wanted: float
    factored: float
    last: float
    event: float
    start: float
    first: float
    kept: float


#: How a call of `advance` ended: at the end of the run, for good before it, or because it took all steps it may.
DONE, STUCK, UNFINISHED = 0, 1, 2


def integrate(chain: Chain) -> Solution:
    """Run a scene with error-controlled implicit steps.

    Returns
    -------
    Solution
        With a status that names time and element if no step was small enough.

    Raises
    ------
    PropertyError
        If a load or a drive cannot be followed, see `anctmm.forces.histories`.
    """
    run = chain.run
    actuation, record = actuation_of(chain), Record(chain)
    actions = timeline(
        drives_of(chain, actuation),
        varying_loads(chain.parts),
        driven_connectors(chain.parts),
        run.t_end,
        run.steps,
    )
    whole, ends = run.times(np.arange(run.steps + 1)), np.array([0.0, run.t_end])
    scratch, still = record.arrays(), np.zeros(chain.bodies.nodes)

    marched: list[Marched] = []

    def so_far(status: Status) -> Solution:
        steps, iterations, factorizations = np.sum([m.counts for m in marched], axis=0)
        return record.solution(marched[-1].kept, status, int(steps), int(iterations), int(factorizations))

    def march(out: Output, times: Array, tolerance: float, floor: float, moved: Array) -> Marched:
        found = _march(chain, actuation, actions, out, times, tolerance, floor, moved)
        if found.stopped:
            marched.append(found._replace(kept=min(found.kept, 1)) if times is ends else found)
            raise Interrupted(so_far(interruption(found.t)))
        return found

    march(scratch, np.zeros(1), 1.0, 1.0, still)  # compiles
    record.start()
    floor = FLOOR * chain.length
    tolerance = float(run.tolerance or 0.0)
    for _ in range(ROUNDS):
        if tolerance < PILOTED:
            marched.append(march(scratch, ends, PILOT, floor, still))
        else:
            marched.append(march(record.arrays(), whole, tolerance, floor, still))
        moved = marched[-1].moved
        if not marched[-1].whole or not STILL * chain.length < moved.max() < 0.5 * floor:
            break
        floor = float(moved.max())
    if tolerance < PILOTED:
        known = moved if marched[-1].whole else still
        marched.append(march(record.arrays(), whole, tolerance, floor, known))
    return so_far(Status() if marched[-1].whole else _stuck(chain, marched[-1]))


class Marched(NamedTuple):
    """One run: outputs kept, time reached (s), whether that is the end, or the user stopped it, what was at work.

    moved: largest displacement of each node, m, (nodes,). counts: steps, Newton corrections, factorizations.
    """

    kept: int
    t: float
    whole: bool
    stopped: bool
    moved: Array
    counts: tuple[int, int, int]
    state: State
    newton: Newton
    rows: Rows | None


def _march(
    chain: Chain,
    actuation: Actuation,
    actions: Timeline,
    out: Output,
    times: Array,
    tolerance: float,
    floor: float,
    moved: Array,
) -> Marched:
    """Run over `times` with a tolerance, relative to `floor` or `moved` at least."""
    bodies, state, newton = chain.bodies, new_state(chain), new_newton(chain)
    factors = block_factors(chain)
    method = GeneralizedAlpha(chain.run.spectral_radius)
    turns = [drive.turns for drive in drives_of(chain, actuation)]
    drives, histories = len(turns), len(actions.pieces.steady)
    control = Control(
        tolerance * (SHARE if rows_in(factors.loops) is None else WITH_CONSTRAINTS),
        abs(1.0 / 6.0 - method.beta + 0.5 * (method.alpha_f - method.alpha_m)),
        chain.run.t_end,
        np.where(turns, chain.length, 1.0),
        SMALL,
        (method.alpha_m, method.alpha_f, method.beta, method.gamma),
        times,
        np.zeros(2),
        np.array([max(floor, moved.max())]),
        np.zeros_like(state.q),
        np.zeros_like(state.q),
        np.zeros((2, drives, 3)),
        np.zeros((2, histories - drives + has_clock(chain.parts), 2)),
        np.zeros(2),
        chain.start_coordinates(),
        np.concatenate([np.full(m.nodes, BULGE * m.element_length or m.reach) for m in bodies.meshes]),
        moved.copy(),
        np.array(Progress(0.0, FIRST * chain.run.exact_dt, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)),
    )
    fixed = (
        control,
        state,
        bodies.tables(),
        links(chain),
        factors,
        actuation.clamps(),
        actuation.loads(),
        newton,
        out,
        actions,
    )
    code, stopped = UNFINISHED, False
    for begin, end in paced(UNLIMITED, STEP * bodies.nodes):
        try:
            code = int(advance(end - begin, len(times) - 1, *fixed))
        except KeyboardInterrupt:
            stopped = True
        if code != UNFINISHED or stopped:
            break
    counts = int(control.counts[0]), int(newton.counts[0]), int(newton.counts[1])
    reached = Progress(*control.progress)
    rows = rows_in(factors.loops)
    return Marched(
        int(reached.kept), reached.t, code == DONE, stopped, control.moved, counts, state, newton, rows
    )


def _stuck(chain: Chain, marched: Marched) -> Status:
    """What is known of a run that ended early."""
    t, state, newton = marched.t, marched.state, marched.newton
    if (found := locked(chain, state.q, marched.rows, t)) is not None:
        return found
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
        f"{what}, worst in {part(body, element)}: a finer mesh may do, or a load that does not jump",
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
    clamps: DrivenClamps,
    loads: Loads,
    newton: Newton,
    out: Output,
    actions: Timeline,
) -> int:
    """Run over the intervals of output with at most `budget` steps, from where `control.progress` stands."""
    q, v, w = state.q, state.v, state.w
    flat_q, flat_v, flat_a, flat_w, flat_q_before, flat_w_before = state.flat
    pieces, stops, anew = actions
    angles, values = control.angles, control.values
    progress = control.progress
    t, wanted, factored, last = progress[0], progress[1], progress[2], progress[3]
    event, start, first, kept = int(progress[4]), progress[5] != 0.0, progress[6] != 0.0, int(progress[7])
    code = DONE
    for number in range(max(kept - 1, 0), outputs + 1):
        end = control.times[min(number + 1, len(control.times) - 1)]
        while True:
            if start:  # the motion starts, or starts anew after a jump
                set_actions(pieces, t, True, angles[1], values[1])
                balance(state, tables, links, factors, clamps, loads, angles[1], values[1], None)
                clamp_reactions(q, w, state.f, tables, clamps)
                work_done(False, q, clamps, loads, values[1])
                work_of_drives(factors.loops, False, q)
                newton.counts[1] += 1
                newton.counts[2] = 1
                start, first, last = False, True, 0.0
            if number == kept:
                if too_large(q, STRETCH_LIMIT):
                    newton.history[:] = 0.0  # no step was refused
                    code = STUCK
                    break
                keep(number, 1, q, v, w, tables, loads.connectors, out)
                kept += 1
            if number == outputs or t >= end:
                break
            if budget == 0:
                code = UNFINISHED
                break
            budget -= 1
            stop = min(end, stops[event])
            h = (stop - t) / np.ceil((stop - t) / wanted * (1.0 - 1e-9))
            if h < SMALLEST * control.t_end and wanted < SMALLEST * control.t_end:
                code = STUCK
                break
            if last > 0.0 and h != last:
                if constrained(factors.loops):
                    balance(state, tables, links, factors, clamps, loads, angles[1], values[1], None)
                    newton.counts[1] += 1
                    newton.counts[2] = 1
                    first = True
                else:
                    _shift(state, control, 1.0 - h / last)
            last = 0.0
            c = _coefficients(h, control.method)
            begin_step(False, state.flat, c)
            _copy_actions(angles, values, 1, 0)
            final = t + h > stop - 0.5 * h
            set_actions(pieces, stop if final else t + h, False, angles[1], values[1])
            turn_clamps(clamps, angles[1])
            set_drives(factors.loops, angles[1], len(clamps.nodes))
            if abs(h - factored) > STALE * h:
                newton.counts[2] = 1
            if newton.counts[2] != 0:
                factored = h
            solved = solve_step(state, c, tables, links, factors, clamps, loads, values[1], newton, None)
            allowed = control.allowed * h / control.t_end
            error = np.inf
            if solved:
                error = _error(t, state, control, c, tables, factors, clamps, loads, pieces)
            again = solved and first  # the first step tells how a lags w
            if again or not error <= 2.0 * allowed:
                if not again:
                    factor = max(0.2, 0.8 * np.sqrt(allowed / error)) if solved else 0.25
                    if solved and not first:
                        _shift(state, control, 1.0 - factor)
                    wanted = h * factor
                    newton.counts[2] = 1
                    control.counts[1] += 1
                else:
                    _shift(state, control, -1.0)
                    wanted = h
                    first = False
                copy(flat_q_before, flat_q)
                copy(flat_w_before, flat_w)
                _copy_actions(angles, values, 0, 1)
                continue
            finish(flat_v, flat_a, flat_w, flat_w_before, c)
            t, last = stop if final else t + h, h
            control.counts[0] += 1
            clamp_reactions(q, w, state.f, tables, clamps)
            out.work[0] += work_done(True, q, clamps, loads, values[1])
            out.work[0] += work_of_drives(factors.loops, True, q)
            _measure(q, control)
            ratio = 0.9 * np.sqrt(allowed / max(error, 1e-300))
            if ratio < 0.9 or ratio > 1.25:  # small changes would only cost factorizations
                wanted = h * min(max(ratio, 0.3), 1.6)
            while stops[event] <= t:
                start = start or anew[event]
                event += 1
        if code != DONE:
            break
    progress[0], progress[1], progress[2], progress[3], progress[4] = t, wanted, factored, last, event
    progress[5], progress[6], progress[7] = start, first, kept
    return code


@inlined
def _coefficients(h, method):  # type: ignore[no-untyped-def]
    """Coefficients of a step of h, as `GeneralizedAlpha.of_step` gives them."""
    am, af, b, g = method
    return Coefficients(h, am, af, b, g, (1.0 - am) / (b * h * h * (1.0 - af)), 1.0)


@inlined
def _shift(state, control, part):  # type: ignore[no-untyped-def]
    """Move a, which lags w by αf − αm of a step, to the lag of the step to come, `part` of the last one shorter."""
    lag = part * (control.method[1] - control.method[0])
    for k in range(state.q.shape[0]):
        for i in range(state.q.shape[1]):
            state.a[k, i] += lag * (state.w[k, i] - state.w_before[k, i])


@inlined
def _copy_actions(angles, values, here, there):  # type: ignore[no-untyped-def]
    """Copy what acts at one end of the step to the other."""
    for h in range(angles.shape[1]):
        for k in range(3):
            angles[there, h, k] = angles[here, h, k]
    for n in range(values.shape[1]):
        for k in range(2):
            values[there, n, k] = values[here, n, k]


@inlined
def _error(t, state, control, c, tables, factors, clamps, loads, pieces):  # type: ignore[no-untyped-def]
    """Filtered estimate of the step's error in displacement, relative, the largest of the nodes."""
    q, load, x, angles, values, missed = (
        state.q,
        control.load,
        control.x,
        control.angles,
        control.values,
        control.missed,
    )
    factor = control.coefficient * c.h * c.h * c.to_w
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            x[k, i] = factor * (state.w[k, i] - state.w_before[k, i])
    mass_product(x, tables.first, tables.masses, tables.buffer, load)
    drives = angles.shape[1]
    for n in range(len(loads.kinds)):
        missed_impulse(pieces, drives + n, t, c.h, values[0, n], values[1, n], missed)
        fx, fy = load_at(loads, n, q, missed[0], missed[1])
        push_alike(loads.targets, n, c.to_w * c.h * fx, c.to_w * c.h * fy, load)
    _add_missed_lengths(loads.connectors, pieces, drives, t, c, q, values, missed, load)
    sweep(factors, load, x)
    correct(loads.border, x)
    turned = 0.0
    for h in range(drives):
        missing = control.reach[h] * missed_turn(pieces, h, t, c.h, angles[0, h], angles[1, h])
        turned = max(turned, missing)
    largest, least = 0.0, control.small * control.scale[0]
    for i in range(q.shape[1]):
        largest = max(largest, _size(x, i, control.bulge) / max(control.moved[i], least))
    return largest + turned / control.scale[0]


@embedded
def _add_missed_lengths(connectors, pieces, drives, t, c, q, values, missed, load):  # type: ignore[no-untyped-def]
    """What free lengths and angles do beside their straight lines, as impulses of the forces that they make."""
    if connectors is not None:
        for n in range(len(connectors.kinds)):
            row = connectors.driven[n]
            if row >= 0:
                missed_impulse(pieces, drives + row, t, c.h, values[0, row], values[1, row], missed)
                m, ax, ay, bx, by = measure(connectors, n, q)
                k, d = slopes(connectors, n, m - values[1, row, 0], 0.0, t)
                s = c.to_w * c.h * (abs(k) * missed[0] + abs(d) * missed[1])
                push_alike(connectors.first, n, s * ax, s * ay, load)
                push_alike(connectors.second, n, s * bx, s * by, load)


@inlined
def _measure(q, control):  # type: ignore[no-untyped-def]
    """Bring the largest displacements up to date."""
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            control.x[k, i] = q[k, i] - control.reference[k, i]
    for i in range(q.shape[1]):
        control.moved[i] = max(control.moved[i], _size(control.x, i, control.bulge))
        control.scale[0] = max(control.scale[0], control.moved[i])


@inlined
def _size(x, i, bulge):  # type: ignore[no-untyped-def]
    """Displacement that changes of coordinates make at a node, or by its gradient beside it, m."""
    here = x[0, i] * x[0, i] + x[1, i] * x[1, i]
    beside = (x[2, i] * x[2, i] + x[3, i] * x[3, i]) * bulge[i] * bulge[i]
    return np.sqrt(max(here, beside))
