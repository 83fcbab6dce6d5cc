"""Steps of fourth order with a length driven by an estimate of their error: `esdirk` with a tolerance.

What is shared with other methods stands in `step_control`, the estimate in `stage_error`. Two things are other than
with steps of second order. A sum of errors ten times too small makes the run dearer by 10^(1/4) = 1.8 only, not by 3.2.
And outputs lie within steps, so that they do not bound their length: `stage_outputs`. Where a step does not resolve
what vibrates, the quintic from which these start is no motion: its error tells up to which length a step may have
outputs within, and where that is less than the way to the next output, steps end there. So a step is rarely refused for
its outputs: half of the work of some runs had gone into steps that were tried again and again.

The first correction of a stage starts from what the last step did there, see `prediction`: that saves up to a tenth of
the corrections.

All stages have one matrix, which is kept as long as the length is. One Newton correction may do for a stage, where
others have told what it leaves: see `contraction`. A matrix is renewed by its cost, as with fixed steps
(`implicit.renewal`), before any stage.

What the iteration leaves matters by where it is left: nothing in the first stage goes to the end of the step, and what
is stiff in the others, the next stage corrects. So these may leave more than the last one. And it has any sign, so that
it may be more in each of many steps. Both together take 0.93 times the corrections and factorizations, and of a
four-bar at 1e-3 … 1e-5 0.85 to 0.90 times the CPU time, for no larger errors. And it matters by the displacement that
it makes: a change of a gradient moves what is beside its node by a small part of the element's length, as in the
estimate of the error. Counted like that, and no coarser than COARSE, it takes 0.8 to 0.95 times at 1e-4 and 1e-5.

What it costs, in Newton corrections and factorizations, each for as many corrections as it takes of time (4.4, with
shear elements 6.6), over the best fixed step of the same error, the best of 12 steps and 6 bounds of Newton's
iteration, no error counted as smaller than with the tightest bound or with a step shorter by up to a half, in the mean
of three tolerances close to each: on seventeen moving scenes with 1e-2 … 1e-5 0.86 in the mean, and at most 1.21 of
the 68. What the best of so many runs costs has some chance in it: that of a gantry crane, whose error hardly falls with
the step, differed by a tenth with the way in which Newton's iteration begins in the first step alone; beside the
cheaper of the two it would be 1.35 at 1e-2 and 1.58 at 1e-4.

The rms error was 0.001 to 2.6 of the tolerance on these, and on chains of two and three steel beams drawn at random up
to 5.1 in 8 of 552 runs. Nearly all of the latter amplify errors: with Newton's iteration as tight as rounding lets it
4 missed by more than 3. No share brings both near to 1: the sum of the sizes of the errors is 1.3 times the error of
some motions and 64 times that of others, as they cancel or not.

Where bodies turn freely many times errors of their speed stay, which is no part of that: see `free_turns`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.methods import Coefficients, Stages, stages
from anctmm.forces.timeline import set_actions
from anctmm.integrators.adaptive.contraction import (
    expect_contraction,
    forget_contraction,
    leaps,
    learn_contraction,
    new_contraction,
    rate_of_motion,
)
from anctmm.integrators.adaptive.controlled_run import SHARE, Scheme, run_controlled
from anctmm.integrators.adaptive.free_turns import follow_turns, swing_error, turn_error
from anctmm.integrators.adaptive.law_kinks import (
    before_kink,
    crosses,
    grown,
    keep_forces,
    knows_kinks,
    missed_at_kinks,
    pass_kink,
    stop_at_kink,
)
from anctmm.integrators.adaptive.prediction import (
    learn_multipliers,
    predict,
    predict_multipliers,
    repeated,
)
from anctmm.integrators.adaptive.returning import follow_returning
from anctmm.integrators.adaptive.stage_error import stage_error
from anctmm.integrators.adaptive.stage_outputs import (
    balance_within,
    motion_within,
    put_actions,
    put_tensions,
    strained_by,
)
from anctmm.integrators.adaptive.step_control import (
    CAP,
    DONE,
    EVENT,
    FACTORED,
    KEPT,
    LARGEST,
    LOOKED,
    RATE,
    SMALLEST,
    SPENT,
    STARTS,
    STRAINED,
    STUCK,
    TIME,
    TURNED,
    UNFINISHED,
    WANTED,
    WITHIN,
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
from anctmm.integrators.adaptive.velocity_error import drives_rigid, measure_speed
from anctmm.integrators.esdirk import (
    Room,
    begin_stage,
    move_drives,
    new_room,
    pass_power,
    solve_stage,
    stage_power,
    work_of_stages,
)
from anctmm.integrators.implicit.renewal import PRICE
from anctmm.integrators.implicit.run import balance
from anctmm.integrators.implicit.step import copy
from anctmm.integrators.implicit.system import System
from anctmm.integrators.output import Output, keep, too_large
from anctmm.integrators.stage_constraints import end_step, look_ahead, of_stages
from anctmm.integrators.turn_count import count_turns
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import inlined, kernel, shared
from anctmm.results.checks.divergence import STRETCH_LIMIT
from anctmm.results.solution import Solution

Array = NDArray[np.float64]

#: Times the error allowed that a single step may make: with 2 up to a tenth of the steps were refused, for errors for
#: which a run whose next steps aim lower has room.
PEAK = 4.0
#: Times the mean error allowed that steps may aim at, at least and at most, as those before took more or less than
#: their part; and part of the run at whose end that is no longer asked.
LEAST, MOST, AT_LAST = 0.3, 2.0, 1e-3
#: Steps over which the mean of the errors is taken, where they are more; and part of the largest of the last errors
#: that counts after each further step, above which the mean is not.
LATEST, FADES = 20.0, 0.7
#: Part of the step aimed at, and of the error allowed, below which a step tells nothing: rounding over h⁵.
SHORT = 0.1
#: Part of the error allowed in a step that the iteration of a stage may leave: what it leaves is noise of w, and with
#: as much as all of it the estimate would answer that noise with ever smaller steps. Where stiff beams turn, it is of
#: their momenta, too: with 0.3 chains of steel beams missed 1e-4 and 1e-5 by up to 8.9 times, for 0.97 times the work.
#: The second is that where nothing is elastic. The last is that in structures which joints hold: with 3.5 to 6
#: reactions at 1e-2 and a portal's error at 1e-5 were up to six times as large.
NEWTON_PART, RIGID_PART, HELD_PART = 0.1, 0.3, 1.0
#: That of rigid bodies that move freely, over the part that the step is of what is left of the run: until its end they
#: go on with the speeds that the iteration leaves. Without it 10 of 320 runs of pendulums of one to three bodies, drawn
#: at random, missed their tolerances by 3 to 26 times; with it, for 1.1 times the work, none by more than 2.
SWINGING_PART = 3.0
#: Times that where drives move rigid bodies: what is left of their forces is in the work of the drives, and the balance
#: of energy was wrong by up to 8 times the tolerance, now by 2.3 times it, for 1 to 5 % more steps.
DRIVEN = 0.2
#: Times what the last stage may leave that each may: the end of a step has no part of the w of the first one, whose
#: weights are 0 in b and in b A, and what the others leave of stiff parts, the next ones correct; the fourth one has
#: the largest weight in b, 0.68, the others 0.19 and −0.28: with twice as much there, runs took 1.02 times the work.
#: But no more than LEFT of any gradient: with twice that, reactions of a steel linkage at 1e-2 were wrong by 0.4 of the
#: largest, not 0.17, and without a bound by 1.05. Nor in linkages of rigid bodies: the error of Andrews' squeezer was
#: up to 2.0 times the tolerance.
TIMES, LEFT = (0.0, 60.0, 10.0, 1.0, 5.0, 1.0), 1e-5
#: What may be left of a gradient, even if it moves next to nothing: it strains beams. With no limit a fall at 1e-2 took
#: three times the steps. Where drives move rigid bodies gradients count in full: the balance of energy was wrong by 4
#: times the tolerance.
COARSE = 1e-6
#: Steps in a run above which each may leave more than its part.
MANY = 100.0
#: Relative change of the step beyond which the matrix is renewed.
STALE = 0.02
#: Part of the length at which the quintic would just be good enough at outputs that a step with outputs within has at
#: most, and times the step before. With 0.8 a fifth of the work of Andrews' squeezer at 1e-2 was of refused steps.
FITS, LENGTHENED = 0.6, 3.0
#: Part of the length up to which steps may have outputs within, above which those of structures which joints hold stay
#: as long as that of the matrix: a little longer or shorter each, they took one more correction in each stage. Stiff
#: bars that turn need newer matrices: reactions of a steel linkage at 1e-2 were wrong by 7 times the largest.
ALIKE = 0.8
#: Error of a quintic at least, relative: against division by zero.
LEAST_ERROR = 1e-300
#: What a step costs, in Newton corrections, above which shorter ones are cheaper: see `_take_stages`.
HARD = 45
#: Part of a step by which its end and an output may differ and be one.
CLOSE = 1e-9
#: Part of its speed, over the fourth power of the angle of a step, that a stiff elastic bar loses which turns freely:
#: stages project its motion on the length that it keeps. Half of 0.0045, as displacements are of twice the radius.
LOST = 0.0025
#: Peano's kernel of the method's weights, at most: near an end of the step, times the way to it, and between.
EDGE, MIDDLE = 0.25, 0.041
#: The implicit Euler method in the form of the stages: a guess of how far nodes move is a step of it.
EULER = Stages(np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([0.0, 1.0]))


@by_address
class Track(NamedTuple):
    """What a controlled step keeps beside what one of fixed length does, which is `room`.

    start, end: q, v and w at its ends, (3, rows, nodes). found: those at an output, (3, rows, nodes). multipliers: of
    constraints at the end. rates: change of w from the stage before to each stage in the last step, over its length,
    (stages, rows × nodes). parts: those of it that the next step is expected to repeat, (stages,). multiplier_rates:
    change of the multipliers, as `rates`, (stages, constraints). before: those before the stage, (constraints,).
    contraction: see `contraction`. Row 0 of what stages keep is that of the start, also between two steps.
    """

    method: Stages
    euler: Stages
    room: Room
    start: Array
    end: Array
    found: Array
    multipliers: Array
    rates: Array
    parts: Array
    multiplier_rates: Array
    before: Array
    contraction: Array


def integrate(chain: Chain) -> Solution:
    """Run a scene with error-controlled steps of fourth order.

    Returns
    -------
    Solution
        With a status that names time and element if no step was small enough.

    Raises
    ------
    PropertyError
        If a load or a drive cannot be followed, see `anctmm.forces.histories`.
    """
    method, shape = stages(), (3, chain.bodies.rows, chain.bodies.nodes)
    constraints = len(chain.kept.constraints.names) if chain.plan.kept else 0
    start, end, found = (np.zeros(shape) for _ in range(3))
    room, multipliers = new_room(chain), np.zeros(constraints)
    rates, parts = np.zeros_like(room.w), np.zeros(len(method.c))
    multiplier_rates, before = np.zeros((len(method.c), constraints)), np.zeros(constraints)
    learned = rates, parts, multiplier_rates, before, new_contraction()
    track = Track(method, EULER, room, start, end, found, multipliers, *learned)

    return run_controlled(chain, Scheme(advance, track, 4, len(method.c), SHARE, SHARE, look=look_ahead))


@kernel
def advance(budget: int, outputs: int, system: System, control: Control, track: Track, out: Output) -> int:
    """Run to the end with at most `budget` steps, from where `control.progress` stands."""
    state, progress = system.state, control.progress
    while True:
        if progress[STARTS] != 0.0:
            _start_anew(system, control, track)
        if too_large(state.q, STRETCH_LIMIT):
            system.newton.history[:] = 0.0  # no step was refused
            return STUCK
        if progress[TIME] >= control.times[int(progress[KEPT])]:
            _copy_state(state, track.found)
            _keep(progress[TIME], 0.0, system, control, track, out)
        if progress[KEPT] > outputs:
            return DONE
        if control.turns.found[2]:
            return TURNED
        if budget == 0:
            return UNFINISHED
        budget -= 1
        stop = _next_stop(outputs, control)
        h = length_of(control, stop)
        if h < SMALLEST * control.t_end and progress[WANTED] < SMALLEST * control.t_end:
            return STUCK
        _copy_state(state, track.start)
        _step(h, stop, system, control, track, out)


@inlined
def _next_stop(outputs, control):  # type: ignore[no-untyped-def]
    """The time that a step must not pass: where it breaks, or else the quintic is no motion at an output within."""
    progress = control.progress
    stop = min(control.times[outputs], control.actions.stops[int(progress[EVENT])])
    stop = before_kink(control.kinks, progress[TIME], stop)
    if progress[WITHIN] < min(progress[WANTED], progress[CAP]):
        fits = progress[WITHIN]
        if control.restrained and ALIKE * fits < progress[FACTORED] < fits:
            fits = progress[FACTORED]
        stop = min(stop, max(progress[TIME] + fits, control.times[int(progress[KEPT])]))
    return stop


@inlined
def _start_anew(system, control, track):  # type: ignore[no-untyped-def]
    """Start the motion, or start it anew after a jump of what acts: accelerations and powers are those after it."""
    state, room, angles, values = system.state, track.room, control.angles[0], control.values[0]
    set_actions(control.actions.pieces, control.progress[TIME], True, angles, values)
    balance(system, angles, values)
    system.newton.counts[1] += 1
    system.newton.counts[2] = 1
    _, _, flat_a, flat_w, _, _ = state.flat
    flat_a[:] = 0.0  # stages have no acceleration beside w
    copy(flat_w, room.w[0])
    room.power[0, 0], room.power[0, 1] = stage_power(
        state, system.tables, system.factors, system.clamps, system.loads, values, system.damping
    )
    control.progress[STARTS] = 0.0
    track.rates[:], track.parts[:], track.multiplier_rates[:] = 0.0, 0.0, 0.0
    forget_contraction(track.contraction)


@inlined
def _stage_of(part):  # type: ignore[no-untyped-def]
    """Coefficients of a step of length `part` by the implicit Euler method, which a stage is."""
    return Coefficients(part, 0.0, 0.0, 1.0, 1.0, 1.0 / (part * part), 1.0, 0.0)


@inlined
def _step(h, stop, system, control, track, out):  # type: ignore[no-untyped-def]
    """Try a step, and accept it or go back; a guess is accepted."""
    progress, guess, fits = control.progress, control.allowed == np.inf, True
    allowed = control.allowed * h / control.t_end
    part = h if guess else track.method.A[1, 1] * h
    c = of_stages(_stage_of(part), track.room.projected)
    stiffen(system.damping, control, c)
    _set_actions(h, stop, control, track)
    effort, solved = _take_stages(guess, h, c, system, control, track)
    missed, crossing = 0.0, crosses(control.kinks)
    error, inside = np.inf, control.times[int(progress[KEPT])] < end_of(h, stop, progress) - CLOSE * h
    if solved:
        to_w = _stage_of(part * progress[FACTORED] / h).to_w
        error, between, rates = stage_error(progress[TIME], h, to_w, system, control, track)
        error = seen(error, system, control) * grown(control.kinks, progress[TIME], control.t_end)
        if not guess:
            before, q, end = track.start[0], system.state.q, progress[TIME] + h
            turned = turn_error(before, q, 4, LOST, end, allowed, control)
            error = max(error, turned, swing_error(h, before, q, end, control), allowed * rates)
        if inside:
            progress[STRAINED] = strained_by(
                system.loads.connectors, between, track.start[0], system, control
            )
        fits = between <= control.allowed
        longer = (control.allowed / max(between, LEAST_ERROR)) ** 0.2
        progress[WITHIN] = h * min(FITS * longer, LENGTHENED)
        places, q, v = track.method.c, track.start[0], track.start[1]
        missed = missed_at_kinks(
            control.kinks, EDGE, MIDDLE, h, to_w, places, q, v, system.state.v, system, control
        )
        solved = missed < np.inf
    if guess or (missed <= 1.0 and error <= PEAK * allowed and (fits or not inside)):
        _accept(h, stop, system, control, track, out)
        pass_kink(control.kinks, progress[TIME], h)
        if not crossing:
            progress[CAP] = min(progress[CAP] * 1.05, 0.7 * h if effort > HARD else np.inf)
        if not crossing and (h > SHORT * progress[WANTED] or error > SHORT * allowed):
            _forget(h, error, control)
            aim(h, error, 4, 0, _times_left(control), control)
        else:
            spend(error, progress)
    elif solved and missed > 1.0:
        _go_back(system, control, track)
        stop_at_kink(control.kinks, h, system, control)
    else:
        _refuse(solved, h, error, allowed, system, control, track)


@inlined
def _forget(h, error, control):  # type: ignore[no-untyped-def]
    """Let the last steps count, too, where they are many in the part of the run over which errors are averaged.

    As steps of what has died out, one two hundredth as long, had 200⁴ times this rate, which a mean keeps for ever. And
    no mean is above the largest of the last errors: by a part of 1/LATEST steps grow by 1.3 % each, and a crane, whose
    trolley jumps into motion, and an arm at rest after its motion took up to twice the steps. Not where errors of
    speeds stay or are in the work of drives: longer steps had a mass on a stiff spring miss 1e-4 by 3.4 times, and one
    that bounces 1e-2 by 5.3 times.
    """
    progress = control.progress
    rate = error / (h**4 * (progress[TIME] - progress[LOOKED]))
    progress[LARGEST] = max(rate, FADES * progress[LARGEST])
    if rate < progress[RATE]:
        progress[RATE] += (rate - progress[RATE]) / LATEST
    if not (goes_on(control) or drives_rigid(control) or knows_kinks(control.kinks)):
        progress[RATE] = min(progress[RATE], progress[LARGEST])


@inlined
def _times_left(control):  # type: ignore[no-untyped-def]
    """What is left of the error allowed, over what is left of the run, as parts of all."""
    spent, past = control.progress[SPENT] / control.allowed, control.progress[TIME] / control.t_end
    return min(max((1.0 - spent) / max(1.0 - past, AT_LAST), LEAST), MOST)


@inlined
def _take_stages(guess, h, c, system, control, track):  # type: ignore[no-untyped-def]
    """Find the stages of a step, or the last one alone by the implicit Euler method for a guess of how far nodes move.

    Returns what it costs, in Newton corrections, and whether all were found.
    """
    newton, progress, last = system.newton, control.progress, len(track.method.c) - 1
    _begin(system.state, track)
    if guess or abs(h - progress[FACTORED]) > STALE * h:
        newton.counts[2] = 1
    made, rate = newton.counts[1], rate_of_motion(h, system.state, newton.scale)
    method = track.euler if guess else track.method
    linkage = is_linkage(system, control)
    left = left_by_newton(_newton_part(h, linkage, control), h, c, system, control)
    row, solved, effort = last if guess else 1, True, 0.0
    newton.weight[0] = 1.0 if drives_rigid(control) else max(control.by_gradient, min(1.0, left / COARSE))
    while solved and row <= last:
        may = (
            left if linkage else min(TIMES[row] * left, max(left, LEFT * newton.weight[0]), newton.tolerance)
        )
        solved = _take_stage(1 if guess else row, row, h, may, rate, c, method, system, control, track)
        if solved:
            effort += effort_of(newton.history)
            row += 1
    effort += newton.wear[PRICE] * (newton.counts[1] - made)
    return effort, solved if guess else end_step(solved, track.room, system, control.angles[last])


@inlined
def _newton_part(h, linkage, control):  # type: ignore[no-untyped-def]
    """Part of the error allowed in a step that the iteration of a stage may leave."""
    part = HELD_PART if control.restrained else NEWTON_PART if control.turns.elastic else RIGID_PART
    if not (control.turns.elastic or control.held):
        part = min(part, SWINGING_PART * h / (control.t_end - control.progress[TIME]))
    return part * (DRIVEN if drives_rigid(control) else 1.0 if linkage else times_for_many(h, MANY, control))


@inlined
def _begin(state, track):  # type: ignore[no-untyped-def]
    """Keep q and v at the start of the stages."""
    flat_q, flat_v, _, _, _, _ = state.flat
    copy(flat_q, track.room.q)
    copy(flat_v, track.room.v)


@inlined
def _set_actions(h, stop, control, track):  # type: ignore[no-untyped-def]
    """Set what acts at the stages of a step."""
    progress, c = control.progress, track.method.c
    for i in range(1, len(c)):
        t = end_of(h, stop, progress) if i == len(c) - 1 else progress[TIME] + c[i] * h
        set_actions(control.actions.pieces, t, False, control.angles[i], control.values[i])


@inlined
def _take_stage(i, row, h, left, rate, c, method, system, control, track):  # type: ignore[no-untyped-def]
    """Find stage i of a method, and keep it in a row; bodies move at a rate."""
    state, room, angles, values = system.state, track.room, control.angles[row], control.values[row]
    _, flat_v, _, flat_w, _, _ = state.flat
    begin_stage(i, h, c.h, method, room, state.flat)
    predict(h * track.parts[row], track.rates[row], state.flat[5])
    predict_multipliers(h * track.parts[row], track.multiplier_rates[row], track.before, system.factors.loops)
    move_drives(system.factors, system.clamps, angles)
    newton, progress, known = system.newton, control.progress, track.contraction
    t = progress[TIME] + track.method.c[row] * h
    expect_contraction(t, h, rate, newton, progress, known)
    solved = solve_stage(1, system, c, values, left)
    solved = solved and not leaps(newton.history, h, rate, control)
    if solved:
        learn_contraction(t, h, control.rounding, newton, progress, known)
    learn_multipliers(solved, h, track.multiplier_rates[row], track.before, system.factors.loops)
    keep_forces(control.kinks, system.loads.connectors, row)
    for k in range(len(flat_v)):
        flat_v[k] += c.h * flat_w[k]
    copy(flat_w, room.w[row])
    if solved:  # it counts the turns of rotational springs
        room.power[row, 0], room.power[row, 1] = stage_power(
            state, system.tables, system.factors, system.clamps, system.loads, values, system.damping
        )
    return solved


@inlined
def _refuse(solved, h, error, allowed, system, control, track):  # type: ignore[no-untyped-def]
    """Go back to the start of the step, with a shorter one."""
    progress = control.progress
    _go_back(system, control, track)
    if not solved:
        progress[WANTED] = 0.5 * h
        system.newton.counts[2] = 1
    elif error > PEAK * allowed:
        progress[WANTED] = h * max(0.2, (allowed / error) ** 0.25)
        progress[RATE] = max(progress[RATE], error / (h**4 * (progress[TIME] + h - progress[LOOKED])))
        progress[LARGEST] = max(progress[LARGEST], progress[RATE])


@inlined
def _go_back(system, control, track):  # type: ignore[no-untyped-def]
    """Go back to the start of the step."""
    state, start = system.state, track.start
    for k in range(start.shape[1]):
        for i in range(start.shape[2]):
            state.q[k, i], state.v[k, i], state.w[k, i] = start[0, k, i], start[1, k, i], start[2, k, i]
    move_drives(system.factors, system.clamps, control.angles[0])
    control.counts[1] += 1


@inlined
def _accept(h, stop, system, control, track, out):  # type: ignore[no-untyped-def]
    """Go to the end of the step, and keep the outputs within."""
    progress, room, last = control.progress, track.room, len(track.method.c) - 1
    start, before, lost_before = progress[TIME], out.work[0], out.work[1]
    progress[TIME] = end_of(h, stop, progress)
    control.counts[0] += 1
    work, lost = work_of_stages(h, track.method, room.power)
    while control.times[int(progress[KEPT])] < progress[TIME] - CLOSE * h:
        t = control.times[int(progress[KEPT])]
        x = (t - start) / h
        motion_within(x, h, system.state, track.start, track.found)
        out.work[0] = before + _work_within(x, h, work, 0, room.power)
        out.work[1] = lost_before + _work_within(x, h, lost, 1, room.power)
        _keep(t, h, system, control, track, out)
    event = control.actions.stops[int(progress[EVENT])]
    if progress[TIME] != event and control.times[int(progress[KEPT])] < progress[TIME] + CLOSE * h:
        progress[TIME] = control.times[int(progress[KEPT])]
    out.work[0], out.work[1] = before + work, lost_before + lost
    if control.allowed < np.inf:  # a guess has no stages
        for i in range(1, last + 1):
            track.parts[i] = repeated(
                h, room.w[i - 1], room.w[i], track.rates[i], system.newton.scale, system.state.q.shape[1]
            )
    copy(room.w[last], room.w[0])
    pass_power(room.power)
    copy_actions(control.angles, control.values, last, 0)
    pass_stops(control)
    count_turns(system.state.q, out.turns)
    measure_motion(system.state.q, control)
    measure_speed(system.state.v, control)
    follow_turns(system.state.q, progress[TIME], control.t_end, control.turns)
    follow_returning(system.state.q, control)


@inlined
def _work_within(x, h, work, j, power):  # type: ignore[no-untyped-def]
    """Work until the part x of a step of h in which this work is done, by the powers j at both ends: a cubic."""
    y = 1.0 - x
    return x * x * (1.0 + 2.0 * y) * work + h * x * y * (y * power[0, j] - x * power[-1, j])


@inlined
def _copy_state(state, found):  # type: ignore[no-untyped-def]
    """q, v and w, as (3, rows, nodes)."""
    for k in range(found.shape[1]):
        for i in range(found.shape[2]):
            found[0, k, i], found[1, k, i], found[2, k, i] = state.q[k, i], state.v[k, i], state.w[k, i]


@shared
def _keep(t, h, system, control, track, out):  # type: ignore[no-untyped-def]
    """Keep an output that stands in `track.found`: one within a step of h, or, where h is 0, one at an end."""
    q, v, w = track.found[0], track.found[1], track.found[2]
    put_actions(t, 1, track.room.projected, system, control, track.found)
    if h > 0.0 and control.allowed < np.inf:
        balance_within(1, _stage_of(track.method.A[1, 1] * h), system, control, track)
    put_tensions(1, system, control, track.found)
    keep(int(control.progress[KEPT]), 1, q, v, w, system.tables, system.loads.connectors, out)
    control.progress[KEPT] += 1.0
