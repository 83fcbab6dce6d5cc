"""Generalized-α with a step driven by an estimate of its local error: see `step_control`.

A step misses the displacement by h³ w' (1/6 − β + (αf − αm)/2) to leading order: the Taylor series of the exact motion
less that of the method, whose a lags w by (αf − αm) h (after Zienkiewicz & Xie 1991 and Hulbert & Jang 1995). The
difference of w over the step serves for h w'. High frequencies that the method damps anyway would dominate it, so it
is filtered by (c_w M + K)⁻¹ c_w M, which leaves slow motion as it is (Hairer & Wanner, IV.8).

A step of another length has another lag. At a start it is found by a first try of the step. Constraints between rigid
bodies or guides need no more than that, as long as steps do not become much shorter: accelerations that were found anew
at each change were five sixths of the work. What a long step leaves of velocities across the constraints, an error of
h², a far shorter one has to take by accelerations ~ 1/h, which alternate while they decay as n ρⁿ, and look like errors
of steps that are too long: a double pendulum took 236 steps for 103, and its error was 4 times the one asked for. So
the motion starts anew before a step of less than half the last one, with velocities that fit the constraints.

Driven coordinates have no error, but their velocities have, and with them the kinetic energy, forces and the work of
drives. So what the change of a drive's acceleration would do to a free coordinate counts, too: a mechanism that drives
move as a whole has no other error. Where nothing is elastic the velocities themselves are measured, also those across
constraints: see `velocity_error`.

Outputs are ends of steps; accelerations there that break constraints are found anew at the end (`implicit.balanced`).

The first correction of a step starts from what the last one did, see `prediction`, and one does in half of the steps.
What it leaves matters more than with stages: it is an error of w, and so of v, which stays in a mechanism that moves
freely until the end.

The matrix is renewed by its cost, as with fixed steps (`implicit.renewal`), and where corrections fall slowly: as it
gets older, steps take two in place of one. Those that only show what the first one left do not count. The contraction
expected of it grows with its age.

What it costs, in Newton corrections and factorizations, each for as many corrections as it takes of time (4.4, with
shear elements 6.6), over the best fixed step of the same error, the best of 17 steps and 6 bounds of Newton's
iteration, no error counted as smaller than with the tightest bound or with a step shorter by up to a half, in the mean
of three tolerances close to each: on seventeen moving scenes with 1e-2 … 1e-5 1.18 in the mean, and at most 1.3 in 50
of the 68. Most cost a portal frame, 1.65 and 2.0, Andrews' squeezer, 2.1 at 1e-2, and a gantry crane, 2.1 at 1e-4.
That is no chance of the fixed steps: their errors are 0.73 and 450 over n² on the portal and the squeezer, to 3 %, with
60 … 1,000 steps. On the crane 960 have a third of what 1,920 promise.

Why, and what was tried, stands in `step_control`. A bound of Newton's iteration five times as loose is no remedy: a
four-bar with a moment cost 1.8 times. What is left in free motion has one sign, and grows with the square of the number
of steps. In runs of more than 300 steps each may leave more (`step_control.times_for_many`): 0.96 times the work.

The rms error was at most 1.2 times the tolerance, the squeezer's 1.6 times it. On 610 runs of 250 scenes drawn at
random, with the steps before `alpha_error` took the slow part of w, the peak of the error was above 3 times the
tolerance in two, 4.2 and 3.6 times it at 1e-2, with tighter bounds of Newton's iteration, too.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.methods import Coefficients, GeneralizedAlpha
from anctmm.forces.actuation import clamp_reactions, turn_clamps, work_done
from anctmm.forces.connectors import end_velocities
from anctmm.forces.timeline import set_actions
from anctmm.integrators.adaptive.alpha_error import (
    ORDER,
    PLACES,
    ROUNDED,
    alpha_error,
    begin_anew,
    follow,
    looks,
    remember,
    share_of,
)
from anctmm.integrators.adaptive.contraction import contraction_or_bound, leaps, rate_of_motion
from anctmm.integrators.adaptive.controlled_run import Scheme, run_controlled
from anctmm.integrators.adaptive.free_turns import follow_turns, turn_error
from anctmm.integrators.adaptive.law_kinks import (
    before_kink,
    crosses,
    missed_at_kinks,
    near_kink,
    pass_kink,
    stop_at_kink,
)
from anctmm.integrators.adaptive.matrix_age import SAFE, expect_aged, expect_of_length
from anctmm.integrators.adaptive.prediction import predict, repeated
from anctmm.integrators.adaptive.returning import follow_returning
from anctmm.integrators.adaptive.step_control import (
    CAP,
    DONE,
    EVENT,
    FACTORED,
    FIRST_STEP,
    KEPT,
    LAST,
    LOOKED,
    RATE,
    REPEATED,
    SMALLEST,
    STARTS,
    STEADY_STEPS,
    STUCK,
    TIME,
    TURNED,
    UNFINISHED,
    WANTED,
    Control,
    aim,
    copy_actions,
    effort_of,
    end_of,
    goes_on,
    is_linkage,
    left_by_newton,
    length_of,
    pass_stops,
    seen,
    spend,
    stiffen,
    times_for_many,
)
from anctmm.integrators.adaptive.step_error import measure_motion
from anctmm.integrators.adaptive.velocity_error import drives_rigid, measure_speed, velocity_error
from anctmm.integrators.implicit.newton import solve_step
from anctmm.integrators.implicit.run import balance
from anctmm.integrators.implicit.step import begin_step, copy, dissipated, finish
from anctmm.integrators.implicit.system import System
from anctmm.integrators.output import Output, add_work, keep, too_large
from anctmm.integrators.turn_count import count_turns
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined, kernel
from anctmm.recursion.constrained import set_drives, work_of_drives
from anctmm.results.checks.divergence import STRETCH_LIMIT
from anctmm.results.solution import Solution

Array = NDArray[np.float64]

#: Share of the tolerance that the sum of the errors of the steps may take, with constraints between rigid bodies or
#: guides: Andrews' squeezer amplifies errors of its steps 6 times.
CONSTRAINED = 0.2
#: The same where these are known to turn freely or to go to and fro for long: their errors add up.
GOES_ON = 0.08
#: Part of the error allowed in a step that Newton's iteration may leave, and that in structures which joints hold. With
#: 0.3 there the estimate answered what is left by up to twice as many steps. The last is that of rigid bodies with
#: constraints: with 0.01 the error of Andrews' squeezer, at 16 tolerances from 1e-5 to 1e-2, was up to 3.5 times the
#: one asked for, now 2.1 times it, with a tenth more corrections.
NEWTON_PART, HELD_PART, RIGID_PART = 0.01, 0.15, 0.003
#: Steps in a run above which each may leave more than its part. With 100 a portal's error at 1e-5 was 3 times as large,
#: and with constraints between rigid bodies that of Andrews' squeezer at 1e-4.
MANY = 300.0
#: Relative change of the step beyond which the iteration matrix is renewed.
STALE = 0.15
#: Contraction of Newton's corrections in a step above which the matrix is renewed before the next one, and that where
#: errors of the speed stay. With 0.02 for all a gantry crane renewed it in each third step, which saved nothing.
SLOW, STAYS = 0.05, 0.02
#: Part of its bound up to which a further correction of Newton's iteration does no more than show what the first one
#: has left: no reason to renew the matrix, as a new one has to be shown, too. What the next step expects is SAFE times
#: that.
SHOWS = 1.0 / SAFE
#: Power of the contraction in a step that is expected of the next one.
FORGETS = 0.85
#: Contraction that is expected at least of a matrix that was renewed in the step before, where drives move rigid
#: bodies: in its own step it has 1e-6 and less. With that, one correction was taken to do, which left 1e-9 of a length:
#: 1e-3 of accelerations in short steps, and of the balance of energy 60 times the tolerance at 1e-5, now 4 times.
AGED = 0.01
#: Times what rounding leaves of a correction, at least, of which the next one shows a contraction.
CLEAR = 100.0
#: Times the error allowed that a single step may make.
PEAK = 4.0
#: Steps between two changes of the length.
STEADY = 30
#: Newton corrections of a step, and twice the renewals of its matrix, above which shorter ones are cheaper.
HARD = 12
#: Part of the last step below which the motion starts anew, where there are constraints.
MUCH_SHORTER = 0.5
#: Part of the step aimed at, below which one that ends before a bend tells nothing.
SHORT = 0.1
#: Peano's kernel of the trapezoidal rule, at most: near an end of the step, times the way to it, and between.
EDGE, MIDDLE = 0.5, 0.125


@by_address
class Lag(NamedTuple):
    """What generalized-α adds to step control.

    coefficient: of the error. method: αm, αf, β, γ. w: its slow part at the last estimate, (rows, nodes). slow: means
    of w, the last of which is that part, (ORDER, rows, nodes), see `alpha_error`. rate: that of w over
    the last step, (rows × nodes,). taken: length of the last step since the motion started, (1,), s; 0 before. radian:
    a length of steps, and what `alpha_error` has found for it, (2,), s.
    """

    coefficient: float
    method: tuple[float, float, float, float]
    w: Array
    slow: Array
    rate: Array
    taken: Array
    radian: Array


def integrate(chain: Chain) -> Solution:
    """Run a scene with error-controlled steps of generalized-α.

    Returns
    -------
    Solution
        With a status that names time and element if no step was small enough.

    Raises
    ------
    PropertyError
        If a load or a drive cannot be followed, see `anctmm.forces.histories`.
    """
    method, shape = GeneralizedAlpha(chain.run.spectral_radius), (chain.bodies.rows, chain.bodies.nodes)
    lag = Lag(
        abs(1.0 / 6.0 - method.beta + 0.5 * (method.alpha_f - method.alpha_m)),
        (method.alpha_m, method.alpha_f, method.beta, method.gamma),
        np.zeros(shape),
        np.zeros((ORDER, *shape)),
        np.zeros(shape[0] * shape[1]),
        np.zeros(1),
        np.zeros(2),
    )

    return run_controlled(chain, Scheme(advance, lag, 2, len(PLACES), CONSTRAINED, GOES_ON, SHOWS))


@kernel
def advance(budget: int, outputs: int, system: System, control: Control, lag: Lag, out: Output) -> int:
    """Run over the intervals of output with at most `budget` steps, from where `control.progress` stands."""
    state, progress = system.state, control.progress
    code = DONE
    for number in range(max(int(progress[KEPT]) - 1, 0), outputs + 1):
        end = control.times[min(number + 1, len(control.times) - 1)]
        while True:
            if progress[STARTS] != 0.0:
                _start_anew(system, control, lag)
            if number == int(progress[KEPT]):
                if too_large(state.q, STRETCH_LIMIT):
                    system.newton.history[:] = 0.0  # no step was refused
                    code = STUCK
                    break
                keep(number, 1, state.q, state.v, state.w, system.tables, system.loads.connectors, out)
                progress[KEPT] += 1.0
            if number == outputs or progress[TIME] >= end:
                break
            if control.turns.found[2]:
                code = TURNED
                break
            if budget == 0:
                code = UNFINISHED
                break
            budget -= 1
            stop = min(end, control.actions.stops[int(progress[EVENT])])
            stop = before_kink(control.kinks, progress[TIME], stop)
            h = length_of(control, stop)
            if h < SMALLEST * control.t_end and progress[WANTED] < SMALLEST * control.t_end:
                code = STUCK
                break
            if system.factors.loops is not None and h < MUCH_SHORTER * lag.taken[0]:
                progress[STARTS] = 1.0
                continue
            _step(h, stop, system, control, lag, out)
        if code != DONE:
            break
    return code


@inlined
def _start_anew(system, control, lag):  # type: ignore[no-untyped-def]
    """Start the motion, or start it anew after a jump of what acts."""
    q, progress, values = system.state.q, control.progress, control.values
    set_actions(control.actions.pieces, progress[TIME], True, control.angles[1], values[1])
    balance(system, control.angles[1], values[1])
    system.newton.counts[1] += 1
    system.newton.counts[2] = 1
    clamp_reactions(q, system.state.w, system.state.f, system.tables, system.clamps)
    work_done(False, q, system.clamps, system.loads, values[1])
    work_of_drives(system.factors.loops, False, q)
    progress[STARTS], progress[LAST], progress[REPEATED] = 0.0, 0.0, 0.0
    progress[FIRST_STEP] = 1.0
    lag.rate[:], lag.taken[0] = 0.0, 0.0
    begin_anew(system.state, lag)


@inlined
def _step(h, stop, system, control, lag, out):  # type: ignore[no-untyped-def]
    """Try a step, and accept it or go back."""
    state, newton, progress = system.state, system.newton, control.progress
    if abs(h - progress[LAST]) > ROUNDED * progress[LAST] > 0.0:
        _shift(state, lag, 1.0 - h / progress[LAST])
    progress[LAST] = 0.0
    c, share = _coefficients(h, lag.method), share_of(h, control, lag)
    solved = _find_end(h, stop, c, system, control, lag)
    guess, error, missed, crossing = control.allowed == np.inf, np.inf, 0.0, crosses(control.kinks)
    allowed = control.allowed * (progress[TIME] + h - progress[LOOKED]) / control.t_end
    # an iteration that wandered may have found another motion
    look = looks(h, control, lag) or effort_of(newton.history) > HARD
    if solved:
        kept = _coefficients(progress[FACTORED], lag.method)
        if look:
            error = alpha_error(progress[TIME], c.h, kept.to_w, share, system, control, lag)
            if not guess:
                turned = turn_error(state.q_before, state.q, 2, 0.0, progress[TIME] + h, allowed, control)
                speeds = allowed * velocity_error(c, system, control)
                error = seen(max(error, turned, speeds), system, control)
        missed = _missed(control.kinks, c, kept.to_w, system, control)
    aside = crossing or (near_kink(control.kinks) and h < SHORT * progress[WANTED])
    good = not look or guess or (progress[FIRST_STEP] == 0.0 and error <= PEAK * allowed)
    if solved and missed <= 1.0 and good:
        progress[REPEATED] = repeated(
            h, state.flat[5], state.flat[3], lag.rate, newton.scale, state.q.shape[1]
        )
        _accept(h, stop, c, system, control, out)
        follow(share, state, lag)
        lag.taken[0] = h
        if not crossing:
            progress[CAP] = min(progress[CAP] * 1.05, 0.7 * h if effort_of(newton.history) > HARD else np.inf)
        progress[STEADY_STEPS] += 1.0
        if look:
            _look_back(h, error, aside, state, control, lag)
        if pass_kink(control.kinks, progress[TIME], h):
            progress[STARTS] = 1.0
    elif solved and missed > 1.0:
        _go_back_to_kink(missed, h, system, control, lag)
    else:
        _refuse(solved, h, error, allowed, system, control, lag)


@inlined
def _find_end(h, stop, c, system, control, lag):  # type: ignore[no-untyped-def]
    """Find the end of a step, and what to expect of its matrix in the next one; whether it was found."""
    newton, progress = system.newton, control.progress
    _begin(h, stop, c, system, control, lag)
    stiffen(system.damping, control, c)
    left = left_by_newton(_newton_part(h, system, control), h, c, system, control)
    factored, slow = newton.counts[1], STAYS if goes_on(control) else SLOW
    rate = rate_of_motion(h, system.state, newton.scale)
    solved = solve_step(system, c, control.values[1], left)
    solved = solved and not leaps(newton.history, h, rate, control)
    renewed = newton.counts[1] != factored
    found = contraction_or_bound(newton.history, CLEAR * control.rounding, control.rounding, slow)
    expect_aged(found, FORGETS, slow, renewed, newton, progress)
    if renewed:
        progress[FACTORED] = h
        if drives_rigid(control):
            newton.expected[0] = max(newton.expected[0], AGED)
    return solved


@inlined
def _look_back(h, error, aside, state, control, lag):  # type: ignore[no-untyped-def]
    """After steps whose error was estimated: measure the motion, and choose the next step, but `aside` of a bend."""
    progress = control.progress
    measure_motion(state.q, control)
    measure_speed(state.v, control)
    follow_turns(state.q, progress[TIME], control.t_end, control.turns)
    follow_returning(state.q, control)
    remember(lag)
    if aside:
        spend(error, progress)
    else:
        aim(h, error, 2, STEADY, 1.0, control)


@embedded
def _newton_part(h, system, control):  # type: ignore[no-untyped-def]
    """Part of the error allowed in a step that Newton's iteration may leave."""
    if is_linkage(system, control):
        return RIGID_PART
    return (HELD_PART if control.restrained else NEWTON_PART) * times_for_many(h, MANY, control)


@embedded
def _missed(kinks, c, to_w, system, control):  # type: ignore[no-untyped-def]
    """What a step misses where laws bend: see `law_kinks`."""
    state, missed = system.state, 0.0
    if kinks is not None:
        connectors = system.loads.connectors
        end_velocities(connectors, state.v, state.a, state.w, state.w_before, c)
        missed = missed_at_kinks(
            kinks, EDGE, MIDDLE, c.h, to_w, PLACES, state.q_before, state.v, connectors.v, system, control
        )
    return missed


@inlined
def _begin(h, stop, c, system, control, lag):  # type: ignore[no-untyped-def]
    """Predict the end of a step, and set what acts there."""
    newton, progress, state = system.newton, control.progress, system.state
    angles, values, loops = control.angles, control.values, system.factors.loops
    flat_q, _, _, flat_w, _, _ = state.flat
    begin_step(False, state.flat, c)
    predict(progress[REPEATED] * h, lag.rate, flat_w)
    predict(progress[REPEATED] * h / c.to_w, lag.rate, flat_q)
    copy_actions(angles, values, 1, 0)
    set_actions(control.actions.pieces, end_of(h, stop, progress), False, angles[1], values[1])
    turn_clamps(system.clamps, angles[1])
    set_drives(loops, angles[1], len(system.clamps.nodes))
    expect_of_length(h, STALE, newton, progress)


@inlined
def _accept(h, stop, c, system, control, out):  # type: ignore[no-untyped-def]
    """Go to the end of the step."""
    state, progress = system.state, control.progress
    q, loops = state.q, system.factors.loops
    _, flat_v, flat_a, flat_w, _, flat_w_before = state.flat
    finish(flat_v, flat_a, flat_w, flat_w_before, c)
    progress[TIME] = end_of(h, stop, progress)
    progress[LAST], progress[FIRST_STEP] = h, 0.0
    control.counts[0] += 1
    clamp_reactions(q, state.w, state.f, system.tables, system.clamps)
    add_work(out, work_done(True, q, system.clamps, system.loads, control.values[1]))
    out.work[0] += work_of_drives(loops, True, q)
    lost = dissipated(system.damping, q, state.q_before)
    add_work(out, (lost, lost))
    count_turns(q, out.turns)
    pass_stops(control)


@inlined
def _refuse(solved, h, error, allowed, system, control, lag):  # type: ignore[no-untyped-def]
    """Go back to the start of the step, with a shorter one; a first one was a try that told how a lags w."""
    state, progress = system.state, control.progress
    flat_q, _, _, flat_w, flat_q_before, flat_w_before = state.flat
    if solved and progress[FIRST_STEP] != 0.0:
        _shift(state, lag, -1.0)
        progress[FIRST_STEP] = 0.0
        if not near_kink(control.kinks):
            progress[WANTED] = h
    else:
        factor = max(0.2, np.sqrt(allowed / error)) if solved else 0.5
        if solved:
            _shift(state, lag, 1.0 - factor)
        progress[WANTED] = h * factor
        progress[STEADY_STEPS] = 0.0
        if solved:
            progress[RATE] = max(progress[RATE], error / (h * h * (progress[TIME] + h - progress[LOOKED])))
        system.newton.counts[2] = 1
        control.counts[1] += 1
        if progress[TIME] > progress[LOOKED] and control.angles.shape[1] > 0:
            # a drive may have begun since the last estimate: its velocity is wrong until the motion starts anew
            progress[STARTS] = 1.0
    copy(flat_q_before, flat_q)
    copy(flat_w_before, flat_w)
    copy_actions(control.angles, control.values, 0, 1)


@inlined
def _go_back_to_kink(missed, h, system, control, lag):  # type: ignore[no-untyped-def]
    """Go back to the start of a step that has missed a bend: the next one ends before it, or, blind, is half as long.

    The lag of that one is found by the rate of w before the step, whose own is none; where there is none, or the next
    one is no part of this, the motion starts anew.
    """
    state, progress = system.state, control.progress
    flat_q, _, _, flat_w, flat_q_before, flat_w_before = state.flat
    if missed < np.inf:
        shift = (h - stop_at_kink(control.kinks, h, system, control)) * (lag.method[1] - lag.method[0])
        predict(shift, lag.rate, state.flat[2])
    else:
        progress[WANTED] = 0.5 * h
        system.newton.counts[2] = 1
    if missed == np.inf or lag.taken[0] == 0.0:
        progress[STARTS] = 1.0
    control.counts[1] += 1
    copy(flat_q_before, flat_q)
    copy(flat_w_before, flat_w)
    copy_actions(control.angles, control.values, 0, 1)


@inlined
def _coefficients(h, method):  # type: ignore[no-untyped-def]
    """Coefficients of a step of h, as `GeneralizedAlpha.of_step` gives them."""
    am, af, b, g = method
    return Coefficients(h, am, af, b, g, (1.0 - am) / (b * h * h * (1.0 - af)), 1.0, 0.0)


@inlined
def _shift(state, lag, part):  # type: ignore[no-untyped-def]
    """Move a, which lags w by αf − αm of a step, to the lag of the step to come, `part` of the last one shorter."""
    _, _, a, w, _, w_before = state.flat
    shift = part * (lag.method[1] - lag.method[0])
    for k in range(len(a)):
        a[k] += shift * (w[k] - w_before[k])
