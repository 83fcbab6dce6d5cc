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

Newton's iteration stops where what it leaves is a small part of the error that the step may make: what it leaves is
noise of w, which the estimate would answer with ever smaller steps. No choice of a step depends on how the iteration
went below that: the filter has the c_w of the matrix that is kept, which may be that of other steps, and corrections of
the size of rounding are no effort.

Errors add up over a run: on the average over a part of it, each step may make the share h/t_end of what the user
allows. A smooth motion so has equal steps, although the error of a step swings with it. Errors are relative to the
largest displacement of each node, or a part of the largest of all where that is more. How far the nodes will move is
first guessed by a few long steps of one Newton correction each, and where these find a scene at rest, or next to
nothing of what acts, by steps over the whole run and what acts beside them. Where a run finds that they move much less
than was assumed, it is made again.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.fitting import fitting_velocity
from anctmm.discretise.junctions.constraints import Drive
from anctmm.discretise.mesh import varying_loads
from anctmm.discretise.methods import Coefficients, GeneralizedAlpha
from anctmm.forces.actuation import clamp_reactions, turn_clamps, work_done
from anctmm.forces.connectors import driven_connectors, has_clock
from anctmm.forces.driving import drives_of
from anctmm.forces.timeline import Timeline, set_actions, timeline
from anctmm.integrators.implicit_run import balance
from anctmm.integrators.implicit_step import begin_step, copy, dissipated, finish
from anctmm.integrators.implicit_system import System, least_left, new_system
from anctmm.integrators.locking import locked, rows_in
from anctmm.integrators.newton import ROUNDING, SLOW, solve_step
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
from anctmm.integrators.step_error import measure_motion, step_error
from anctmm.jit.compiling import embedded, inlined, kernel
from anctmm.jit.pacing import paced
from anctmm.recursion.constrained import constrained, set_drives, work_of_drives
from anctmm.results.divergence_checks import STRETCH_LIMIT
from anctmm.results.finding import part
from anctmm.results.solution import Interrupted, Solution, Status, in_short, interruption

Array = NDArray[np.float64]

#: Share of the tolerance that the sum of local errors may take: they cancel in part, and motions take some back.
SHARE = 1.2
#: The same with constraints: at steps of other length their multipliers bring errors that the estimate does not see.
WITH_CONSTRAINTS = 0.2
#: Part of the error allowed in a step that Newton's iteration may leave.
NEWTON_PART = 0.03
#: First step, of the interval of output, at a tolerance of LOOSE and at smaller ones in proportion to their root; and
#: smallest step, of the run.
FIRST, LOOSE, SMALLEST = 0.5, 1e-2, 1e-9
#: Relative change of the step beyond which the iteration matrix is renewed.
STALE = 0.15
#: Changes of the step below which it stays, and steps between two changes: each costs a factorization.
SHORTER, LONGER, STEADY = 0.87, 1.15, 8
#: Times the error allowed that a single step may make, and part of the run over which the mean of the errors is taken,
#: and steps at most: what is over, as a start that dies out fast, would hold back the steps of all that part.
PEAK, MEMORY, RECENT = 4.0, 0.05, 100
#: Steps of equal length after which the error is estimated over several of them, where no load varies.
ALIKE = 4
#: Newton corrections of a step, and twice the renewals of its matrix, above which shorter ones are cheaper.
HARD = 12
#: More steps than a run can have.
UNLIMITED = 1 << 60
#: Length to which steps are fitted between two stops, of the one aimed at, at most.
FITTED = 1.15
#: Steps, as parts of the run, that guess how far nodes move; what they find counts up to FAR of the scene's length.
GUESS, FAR = (0.5, 0.125), 0.5
#: Times what a guess finds, that it may miss of what acts: beyond, it has seen none of it.
BLIND = 1e3
#: Displacement assumed at least of a scene that is found at rest, and that below which nothing moves, of the scene's
#: length.
AT_REST = 1e-6
STILL = 1e-11
#: Part of the largest displacement to which errors of nodes that move less are relative.
SMALL = 0.25
#: Largest value of the shape function of a gradient, of the element's length.
BULGE = 4.0 / 27.0
#: Times the error allowed that may be found at the end, relative to what has moved; and rounds of a run, at most.
FOUND, ROUNDS = 2.0, 4
#: How a call of `advance` ended: at the end of the run, for good before it, or because it took all steps it may.
DONE, STUCK, UNFINISHED = 0, 1, 2
#: Places in `Control.progress`.
TIME, WANTED, FACTORED, LAST, EVENT, STARTS, FIRST_STEP, KEPT, STEADY_STEPS, RATE, SPENT, LOOKED, CAP = range(
    13
)


class Control(NamedTuple):
    """Step control: sum of local errors that is allowed, error coefficient, run length (s).

    reach: length that each drive moves by a unit, m. small: part of the largest displacement to which errors of nodes
    that move less are relative. method: αm, αf, β, γ. rounding: what Newton's iteration leaves at least. times: of the
    outputs, s. counts: accepted and rejected steps. scale: largest displacement, assumed or until now, m, (1,). load
    and x: scratch, (rows, nodes). w: that at the last estimate. angles, values: of drives and loads at the start and
    at the end of the step, (2, drives, 3) and (2, loads, 2). missed: scratch, (2,). reference: coordinates at the
    start. bulge: largest displacement beside each node that a unit of its gradient makes, m, (nodes,). moved:
    displacement of each node until now, and the one assumed, m, (2, nodes). elastic: constants of the elements, and
    what damping times rate adds to them, (2, bodies, ...). progress: where the run stands. actions: what acts in time.

    The progress is the time reached, the step aimed at, that of the matrix, the last one (0: none), s; the number of
    the next stop; whether the motion starts there; whether its first step comes next; outputs kept; steps since the
    length changed; the mean of the errors over the cube of the step, 1/s³; their sum; the time of the last estimate, s;
    the step above which Newton's iteration is expensive, s.
    """

    allowed: float
    coefficient: float
    t_end: float
    reach: Array
    small: float
    method: tuple[float, float, float, float]
    rounding: float
    times: Array
    counts: Array
    scale: Array
    load: Array
    x: Array
    w: Array
    angles: Array
    values: Array
    missed: Array
    reference: Array
    bulge: Array
    moved: Array
    elastic: Array
    progress: Array
    actions: Timeline


class March(NamedTuple):
    """One run: outputs kept, time reached (s), whether that is the end, or the user stopped it.

    moved: largest displacement of each node, m, (nodes,). error: sum of the local errors, relative.
    """

    kept: int
    t: float
    whole: bool
    stopped: bool
    moved: Array
    error: float


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
    run, record = chain.run, Record(chain)
    system, control, out = _system(chain), _control(chain), record.arrays()
    outputs, ends = run.times(np.arange(run.steps + 1)), np.array([0.0, run.t_end])
    still, counts = np.zeros(chain.bodies.nodes), control.counts

    def so_far(kept: int, status: Status) -> Solution:
        corrections, factorizations, _ = system.newton.counts
        return record.solution(kept, status, int(counts[0]), int(corrections), int(factorizations))

    def march(times: Array, assumed: Array, scale: float = 0.0, guess: int = 0) -> March:
        found = _march(chain, system, control, out, times, assumed, scale, guess)
        if found.stopped:
            raise Interrupted(so_far(min(found.kept, 1) if guess else found.kept, interruption(found.t)))
        return found

    march(np.zeros(1), still)  # compiles
    record.start()
    counts[:] = 0.0
    system.newton.counts[:] = 0
    guesses = [march(part * ends, still, chain.length, guess=1) for part in GUESS]
    assumed, scale = _assumed(chain, [guess.moved for guess in guesses])
    if scale < max(STILL * chain.length, *(_missed(chain, guess) / BLIND for guess in guesses)):
        scale = _acted(chain, march(ends, still, chain.length, guess=len(control.actions.stops)))
    for _ in range(ROUNDS):
        done = march(outputs, assumed, scale)
        if not done.whole or done.moved.max() < STILL * chain.length:
            break
        used = np.maximum(np.maximum(assumed, done.moved), SMALL * max(scale, done.moved.max()))
        most = (used / np.maximum(done.moved, SMALL * done.moved.max())).max()
        if done.error * most <= FOUND * _allowed(chain, system):
            break
        assumed, scale = done.moved, float(done.moved.max())
    return so_far(done.kept, Status() if done.whole else _stuck(chain, system, done.t))


def _assumed(chain: Chain, guesses: list[Array]) -> tuple[Array, float]:
    """Displacements assumed of each node, m, (nodes,), and of the scene: those of a guess, none of them far.

    A guess is that of equations made linear at the start: right for small motions, and too large for large ones.
    """
    moved = np.nan_to_num(np.max(guesses, axis=0), posinf=0.0)
    scale = min(float(moved.max()), FAR * chain.length)
    return moved * (scale / max(float(moved.max()), STILL)), scale


def _missed(chain: Chain, guess: March) -> float:
    """Displacement that the steps of a guess miss, m."""
    return float(np.nan_to_num(SMALL * chain.length * guess.error))


def _acted(chain: Chain, guess: March) -> float:
    """Displacement of a scene that is at rest until something acts, or that acts too fast for long steps, m.

    The guess is by a step between all breaks of what acts. It counts what these steps find, and what they miss. Without
    it errors would be relative to what rounding has moved until then. Less than AT_REST is found in a second round.
    """
    found = max(_missed(chain, guess), float(np.nan_to_num(guess.moved.max())))
    return min(max(found, AT_REST * chain.length), FAR * chain.length)


def _allowed(chain: Chain, system: System) -> float:
    """Sum of local errors that is allowed."""
    share = SHARE if rows_in(system.factors.loops) is None else WITH_CONSTRAINTS
    return float(chain.run.tolerance or 0.0) * share


def _system(chain: Chain) -> System:
    """What the steps take: without a tolerance of the user's, Newton's is a part of the error of a step alone."""
    system = new_system(chain)
    if chain.run.newton_given:
        return system
    return system._replace(newton=system.newton._replace(tolerance=np.inf))


def _actions(chain: Chain, drives: Sequence[Drive]) -> Timeline:
    """What acts on a scene in time."""
    parts, run = chain.parts, chain.run
    return timeline(drives, varying_loads(parts), driven_connectors(parts), run.t_end, run.steps)


def _control(chain: Chain) -> Control:
    """Step control before the first march."""
    bodies, run, method = chain.bodies, chain.run, GeneralizedAlpha(chain.run.spectral_radius)
    driven, start = drives_of(chain, actuation_of(chain)), chain.start_coordinates()
    turns, actions = [drive.turns for drive in driven], _actions(chain, driven)
    drives, histories = len(turns), len(actions.pieces.steady)
    return Control(
        allowed=np.inf,
        coefficient=abs(1.0 / 6.0 - method.beta + 0.5 * (method.alpha_f - method.alpha_m)),
        t_end=run.t_end,
        reach=np.where(turns, chain.length, 1.0),
        small=SMALL,
        method=(method.alpha_m, method.alpha_f, method.beta, method.gamma),
        rounding=least_left(chain),
        times=np.zeros(1),
        counts=np.zeros(2),
        scale=np.zeros(1),
        load=np.zeros_like(start),
        x=np.zeros_like(start),
        w=np.zeros_like(start),
        angles=np.zeros((2, drives, 3)),
        values=np.zeros((2, histories - drives + has_clock(chain.parts), 2)),
        missed=np.zeros(2),
        reference=start,
        bulge=np.concatenate([np.full(m.nodes, BULGE * m.element_length or m.reach) for m in bodies.meshes]),
        moved=np.zeros((2, bodies.nodes)),
        elastic=_elastic(chain),
        progress=np.zeros(13),
        actions=actions,
    )


def _elastic(chain: Chain) -> Array:
    """Constants of the elements, and what a factor τ of each body adds: they are linear in the stiffness."""
    bodies = chain.bodies
    if bodies.damping is None:
        return np.zeros((2, 0, 0))
    plain = bodies.tables().constants
    return np.array(
        [plain, bodies.stiffened([1.0 + tau for tau in bodies.damping]).tables().constants - plain]
    )


def _march(
    chain: Chain,
    system: System,
    control: Control,
    out: Output,
    times: Array,
    assumed: Array,
    scale: float,
    guess: int,
) -> March:
    """Run from the start over `times`, with displacements that are assumed, or a `guess` of them by so many steps."""
    run, state, newton = chain.run, system.state, system.newton
    tolerance = float(run.tolerance or 0.0)
    state.q[:], state.v[:] = control.reference, fitting_velocity(chain)
    control.moved[0], control.moved[1] = 0.0, assumed
    control.scale[0] = scale
    out.work[0] = 0.0
    first = FIRST * min(1.0, np.sqrt(tolerance / LOOSE)) * run.exact_dt
    control.progress[:] = 0.0
    control.progress[WANTED], control.progress[STARTS] = times[-1] if guess else first, 1.0
    control.progress[CAP] = np.inf
    control = control._replace(allowed=np.inf if guess else _allowed(chain, system), times=times)
    system = system._replace(newton=newton._replace(tolerance=np.inf)) if guess else system
    code, stopped = UNFINISHED, False
    for begin, end in paced(UNLIMITED, STEP * chain.bodies.nodes):
        try:
            code = int(advance(guess or end - begin, len(times) - 1, system, control, out))
        except KeyboardInterrupt:
            stopped = True
        if code != UNFINISHED or stopped or guess:
            break
    progress = control.progress
    return March(
        int(progress[KEPT]), float(progress[TIME]), code == DONE, stopped, control.moved[0].copy(),
        float(progress[SPENT]),
    )  # fmt: skip


def _stuck(chain: Chain, system: System, t: float) -> Status:
    """What is known of a run that ended early."""
    state, history = system.state, system.newton.history
    if (found := locked(chain, state.q, rows_in(system.factors.loops), t)) is not None:
        return found
    if history.any():
        body, element = worst_element(chain, correction_size(chain, state))
        what = (
            f"no step was small enough at t = {t:.6g} s, with corrections {in_short(history)} in the last one "
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
def advance(budget: int, outputs: int, system: System, control: Control, out: Output) -> int:
    """Run over the intervals of output with at most `budget` steps, from where `control.progress` stands."""
    state, progress = system.state, control.progress
    code = DONE
    for number in range(max(int(progress[KEPT]) - 1, 0), outputs + 1):
        end = control.times[min(number + 1, len(control.times) - 1)]
        while True:
            if progress[STARTS] != 0.0:
                _start_anew(system, control)
            if number == int(progress[KEPT]):
                if too_large(state.q, STRETCH_LIMIT):
                    system.newton.history[:] = 0.0  # no step was refused
                    code = STUCK
                    break
                keep(number, 1, state.q, state.v, state.w, system.tables, system.loads.connectors, out)
                progress[KEPT] += 1.0
            if number == outputs or progress[TIME] >= end:
                break
            if budget == 0:
                code = UNFINISHED
                break
            budget -= 1
            stop = min(end, control.actions.stops[int(progress[EVENT])])
            h = _length(control, stop)
            if h < SMALLEST * control.t_end and progress[WANTED] < SMALLEST * control.t_end:
                code = STUCK
                break
            _step(h, stop, system, control, out)
        if code != DONE:
            break
    return code


@inlined
def _length(control, stop):  # type: ignore[no-untyped-def]
    """A step about as long as the one aimed at that divides the way to the next stop."""
    progress = control.progress
    left, wanted = stop - progress[TIME], min(progress[WANTED], progress[CAP])
    return left / np.ceil(left / (FITTED * wanted))


@inlined
def _start_anew(system, control):  # type: ignore[no-untyped-def]
    """Start the motion, or start it anew after a jump of what acts."""
    q, progress, values = system.state.q, control.progress, control.values
    set_actions(control.actions.pieces, progress[TIME], True, control.angles[1], values[1])
    _accelerations(system, control)
    clamp_reactions(q, system.state.w, system.state.f, system.tables, system.clamps)
    work_done(False, q, system.clamps, system.loads, values[1])
    work_of_drives(system.factors.loops, False, q)
    progress[STARTS], progress[LAST] = 0.0, 0.0
    _remember(control, system.state)


@inlined
def _accelerations(system, control):  # type: ignore[no-untyped-def]
    """Find the true accelerations of the present state, from which the next step starts as a first one."""
    newton = system.newton
    balance(system, control.angles[1], control.values[1])
    newton.counts[1] += 1
    newton.counts[2] = 1
    control.progress[FIRST_STEP] = 1.0


@inlined
def _step(h, stop, system, control, out):  # type: ignore[no-untyped-def]
    """Try a step, and accept it or go back."""
    state, newton, progress = system.state, system.newton, control.progress
    if progress[LAST] > 0.0 and h != progress[LAST]:
        if constrained(system.factors.loops):
            _accelerations(system, control)
        else:
            _shift(state, control, 1.0 - h / progress[LAST])
    progress[LAST] = 0.0
    c = _coefficients(h, control.method)
    _begin(h, stop, c, system, control)
    _stiffen(system.damping, control, c)
    part = NEWTON_PART * control.allowed * h / control.t_end
    left = max(control.rounding, part * control.scale[0] / newton.scale)
    allowed = control.allowed * (progress[TIME] + h - progress[LOOKED]) / control.t_end
    factored = newton.counts[1]
    solved = solve_step(system, c, control.values[1], min(newton.tolerance, left))
    if newton.counts[1] != factored:
        progress[FACTORED] = h
    look, error = _looks(h, control), np.inf
    if solved and look:
        kept = _coefficients(progress[FACTORED], control.method)
        error = step_error(progress[TIME], c.h, kept.to_w, system, control)
    guess = control.allowed == np.inf
    if solved and (not look or guess or (progress[FIRST_STEP] == 0.0 and error <= PEAK * allowed)):
        _accept(h, stop, c, system, control, out)
        progress[CAP] = min(progress[CAP] * 1.05, 0.7 * h if _effort(newton.history) > HARD else np.inf)
        progress[STEADY_STEPS] += 1.0
        if look:
            measure_motion(state.q, control)
            _remember(control, state)
            _aim(h, error, control)
    else:
        _refuse(solved, h, error, allowed, system, control)


@inlined
def _effort(history):  # type: ignore[no-untyped-def]
    """Newton corrections of a step, and twice the times that they fell slowly; those of rounding are left to chance."""
    effort = 0
    for k in range(len(history)):
        if history[k] > ROUNDING:
            effort += 1 if k == 0 or history[k] <= SLOW * history[k - 1] else 3
    return effort


@inlined
def _looks(h, control):  # type: ignore[no-untyped-def]
    """Whether the error is estimated: over several steps where they stay as they are and no load varies.

    A vibration whose phase is lost over the run, c ω³ h² t_end of about 1, is wrong by its amplitude and not by more.
    Over a time of 1/ω of that frequency, errors of faster ones cancel.
    """
    steady = int(control.progress[STEADY_STEPS])
    span = max(1, int((0.5 * control.coefficient * control.t_end / h) ** (1.0 / 3.0)))
    return steady < ALIKE or steady % span == 0 or control.values.shape[1] > 0


@inlined
def _remember(control, state):  # type: ignore[no-untyped-def]
    """Keep w, from which the next estimate starts."""
    for k in range(state.w.shape[0]):
        for i in range(state.w.shape[1]):
            control.w[k, i] = state.w[k, i]


@inlined
def _begin(h, stop, c, system, control):  # type: ignore[no-untyped-def]
    """Predict the end of a step, and set what acts there."""
    newton, progress = system.newton, control.progress
    angles, values, loops = control.angles, control.values, system.factors.loops
    begin_step(False, system.state.flat, c)
    _copy_actions(angles, values, 1, 0)
    set_actions(control.actions.pieces, _end_of(h, stop, progress), False, angles[1], values[1])
    turn_clamps(system.clamps, angles[1])
    set_drives(loops, angles[1], len(system.clamps.nodes))
    if abs(h - progress[FACTORED]) > STALE * h:
        newton.counts[2] = 1


@inlined
def _end_of(h, stop, progress):  # type: ignore[no-untyped-def]
    """The end of a step, which is the next stop if that is close."""
    end = progress[TIME] + h
    return stop if end > stop - 0.5 * h else end


@embedded
def _stiffen(damping, control, c):  # type: ignore[no-untyped-def]
    """Give the iteration matrix the stiffness of damping at steps of this length."""
    if damping is not None:
        constants, rate = damping.stiff.constants, c.gamma / (c.beta * c.h)
        for i in range(constants.shape[0]):
            for k in range(constants.shape[1]):
                constants[i, k] = control.elastic[0, i, k] + rate * control.elastic[1, i, k]


@inlined
def _accept(h, stop, c, system, control, out):  # type: ignore[no-untyped-def]
    """Go to the end of the step."""
    state, progress = system.state, control.progress
    q, loops = state.q, system.factors.loops
    _, flat_v, flat_a, flat_w, _, flat_w_before = state.flat
    finish(flat_v, flat_a, flat_w, flat_w_before, c)
    progress[TIME] = _end_of(h, stop, progress)
    progress[LAST], progress[FIRST_STEP] = h, 0.0
    control.counts[0] += 1
    clamp_reactions(q, state.w, state.f, system.tables, system.clamps)
    out.work[0] += work_done(True, q, system.clamps, system.loads, control.values[1])
    out.work[0] += work_of_drives(loops, True, q)
    out.work[0] += dissipated(system.damping, q, state.q_before)
    stops, anew = control.actions.stops, control.actions.anew
    while stops[int(progress[EVENT])] <= progress[TIME]:
        if anew[int(progress[EVENT])]:
            progress[STARTS] = 1.0
        progress[EVENT] += 1.0


@inlined
def _aim(h, error, control):  # type: ignore[no-untyped-def]
    """Choose the next step by the mean error of the last ones: that of a single one swings with the motion."""
    progress = control.progress
    since = progress[TIME] - progress[LOOKED]
    rate = error / (h * h * since)
    part = min(1.0, since / min(MEMORY * control.t_end, RECENT * h))
    progress[RATE] += (rate - progress[RATE]) * (part if progress[LOOKED] > 0.0 else 1.0)
    progress[SPENT] += rate * h * h * since
    progress[LOOKED] = progress[TIME]
    ratio = np.sqrt(control.allowed / (control.t_end * max(progress[RATE], 1e-300))) / h
    if (ratio < SHORTER or ratio > LONGER) and (progress[STEADY_STEPS] >= STEADY or ratio > 2.0):
        progress[WANTED] = h * min(max(ratio, 0.3), 3.0)
        progress[STEADY_STEPS] = 0.0


@inlined
def _refuse(solved, h, error, allowed, system, control):  # type: ignore[no-untyped-def]
    """Go back to the start of the step, with a shorter one; a first one was a try that told how a lags w."""
    state, progress = system.state, control.progress
    flat_q, _, _, flat_w, flat_q_before, flat_w_before = state.flat
    if solved and progress[FIRST_STEP] != 0.0:
        _shift(state, control, -1.0)
        progress[WANTED], progress[FIRST_STEP] = h, 0.0
    else:
        factor = max(0.2, np.sqrt(allowed / error)) if solved else 0.5
        if solved:
            _shift(state, control, 1.0 - factor)
        progress[WANTED] = h * factor
        progress[STEADY_STEPS] = 0.0
        if solved:
            progress[RATE] = max(progress[RATE], error / (h * h * (progress[TIME] + h - progress[LOOKED])))
        system.newton.counts[2] = 1
        control.counts[1] += 1
    copy(flat_q_before, flat_q)
    copy(flat_w_before, flat_w)
    _copy_actions(control.angles, control.values, 0, 1)


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
