"""Lengths of steps that an error drives, and what Newton's iteration may leave in them: what all methods share.

Errors add up over a run: on the average over a part of it, each step may make the share h/t_end of what the user
allows. A smooth motion so has equal steps, although the error of a step swings with it. Errors are relative to the
largest displacement of each node, or a part of the largest of all where that is more.

If that share were the same all the time, the run would not be the cheapest. Errors C hᵖ in a unit of time, by steps of
h, are least for as many steps where those of the steps are alike, C hᵖ⁺¹, so that the share goes as C to the power
1/(p + 1). Its mean over the run is not known before; that over what has been stands for it, within CALM and ACTIVE.
Where errors of the speed stay the share is the same: a pendulum's error was four times as large otherwise.

Newton's iteration stops where what it leaves is a small part of the error that the step may make: what it leaves is
noise of w, which an estimate would answer with ever smaller steps. No choice of a step depends on how the iteration
went below that: a filter has the c_w of the matrix that is kept, which may be that of other steps, and corrections of
the size of rounding are no effort.

One correction may do, where others have told what it leaves: see `contraction` and `matrix_age`.

Can steps be chosen better? Some scenes cost up to twice the best equal steps of second order, see `alpha_control`.
Steps that were chosen for a portal frame at 1e-5 were taken again, with changes; error over that of as many equal ones:

    as they were; with a bound of Newton's iteration of 1e-9; without the shift of a    2.4  2.4  2.4
    equal ones in each interval of output                                               2.1
    lengths averaged over ± 5, 15 and 30 % of the run                                   1.4  0.9  0.8
    lengths that come 2.5 and 10 % of the run earlier; 5 % later                        1.2  0.9  1.1

So neither the iteration nor changes of the length matter, but which steps are longer: errors of steps have both signs,
the sum of their sizes is eight times the error, and equal steps make them cancel. Andrews' squeezer amplifies errors
of its steps six times, those of a crane's early steps die out by damping: neither is seen when they are made. If the
rate C of errors is known over all of the run, errors by lengths as C^(-1/3) are 0.8 times those of equal steps on the
portal, and 0.6 … 1.2 times on ten other scenes. But C is known after a run only. One for a hundred times the tolerance
would take a tenth of the steps, which costs the other scenes more than these gain.

Of what knows nothing of the rest of the run nothing was better. Runs of 68 that cost more than 1.3 times the fixed
steps of then, which were dearer than those of now, 5, and 6 when the first four were tried: 9 with a share that active
parts do not exceed, or with a mean that takes the rest to be as active as now; 8 and 9 with lengths as C^(-1/6); 9 and
11 with changes by 1.35 and 1.6 at least; 8 with none as long as the sum expected at the end is 0.6 … 1.3 of the one
allowed. Before, when 7 did: 13 with means over 0.15 of the run, 14 with an aim by what is left.

The steps themselves stand in `alpha_control` and `stage_control`, the runs that they make in `controlled_run`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.forces.timeline import Timeline
from anctmm.integrators.adaptive.free_turns import Turns
from anctmm.integrators.adaptive.law_kinks import Kinks, knows_kinks
from anctmm.integrators.adaptive.returning import Returning
from anctmm.integrators.implicit.newton import ROUNDING, SLOW
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined

Array = NDArray[np.float64]

#: Smallest step, of the run. With 1e-9 no first step of a steel arm in a run of 5,000 s was small enough, with 1e-12
#: none of a fine frame at whose end a force begins.
SMALLEST = 1e-14
#: Rounding of positions, of what it leaves in Newton's iteration; and how many times it the sum of errors that is
#: allowed must be for errors of steps to be told from it.
POSITIONS, TOLD_APART = 1.0 / 8.0, 3e4
#: Part of the error allowed that may be what Newton's iteration leaves of speeds, where errors of these stay; and where
#: anything is elastic: what is left of a stiff length does not alternate. A smaller part costs next to nothing there.
#: The last one is where what drives and loads move is joined to nothing that stands still.
SPEED_PART, ELASTIC_PART, AFLOAT_PART = 0.2, 0.002, 0.05
#: Changes of the step below which it stays: each costs a factorization.
SHORTER, LONGER = 0.87, 1.15
#: Part of the run over which the mean of the errors is taken, and steps at most: what is over, as a start that dies out
#: fast, would hold back the steps of all that part.
MEMORY, RECENT = 0.05, 100
#: Error aimed at in calm and in active parts of a run, over that of its mean, at least and at most. With 0.3 and 3 the
#: squeezer's error was 5 times the one asked for, and runs whose errors grow were repeated.
CALM, ACTIVE = 0.5, 1.5
#: Length to which steps are fitted between two stops, of the one aimed at, at most.
FITTED = 1.15
#: How a call of `advance` ended: at the end of the run, for good before it, because it took all steps it may, or as
#: a body was found to turn freely, see `free_turns`.
DONE, STUCK, UNFINISHED, TURNED = 0, 1, 2, 3
#: Places in `Control.progress`.
(
    TIME,
    WANTED,
    FACTORED,
    LAST,
    EVENT,
    STARTS,
    FIRST_STEP,
    KEPT,
    STEADY_STEPS,
    RATE,
    SPENT,
    LOOKED,
    CAP,
    WITHIN,
    REPEATED,
    AGE,
    SEEN,
    SEEN_AT,
    ROOTS,
    LARGEST,
    STRAINED,
) = PROGRESS = range(21)


@by_address
class Control(NamedTuple):
    """Step control: sum of local errors that is allowed, tolerance, and run length (s).

    reach: length that each drive moves by a unit, m. small: part of the largest displacement to which errors of nodes
    that move less are relative. rounding: what Newton's iteration leaves at least. times: of the outputs, s. counts:
    accepted and rejected steps. scale: largest displacement, assumed or until now, m, (1,). fastest: largest velocity
    until now, m/s, (1,). load and x: scratch, (rows, nodes). angles, values: of drives and loads at the places where a
    step sees them, from its start to its end, (places, drives, 3) and (places, loads, 2). missed: scratch, (2,).
    reference: coordinates at the start. bulge: largest displacement beside each node that a unit of its gradient makes,
    m, (nodes,); by_gradient: the largest of these, relative to Newton's scale. moved: displacement of each node until
    now, and the one assumed, m, (2, nodes). elastic: constants of the elements, and what damping times rate adds to
    them, (2, bodies, ...). damping: the largest one of a body, s. progress: where the run stands. actions: what acts in
    time. restrained, held, afloat, returning: see `returning`. turns: see `free_turns`. kinks: see `law_kinks`.

    The progress is the time reached, the step aimed at, that of the matrix, the last one (0: none), s; the number of
    the next stop; whether the motion starts there; whether its first step comes next; outputs kept; steps since the
    length changed; the mean of the errors over the (order + 1)th power of the step; their sum; the time of the last
    estimate, s; the step above which Newton's iteration is expensive, s; the one above which outputs within it are not
    good enough, s; part of the last change of the accelerations that the next step is expected to repeat. Of the matrix
    its age, in steps; the last contraction seen with it, and the age then, 0 if none was: see `matrix_age`. The
    integral over time of the activity, the (order + 1)th root of the mean of the errors; the largest of the last errors
    over the same power of the step as their mean, which fades; how far the motion at outputs within the last step may
    strain beams, see `stage_outputs`.
    """

    allowed: float
    tolerance: float
    t_end: float
    reach: Array
    small: float
    rounding: float
    times: Array
    counts: Array
    scale: Array
    fastest: Array
    load: Array
    x: Array
    angles: Array
    values: Array
    missed: Array
    reference: Array
    bulge: Array
    by_gradient: float
    moved: Array
    elastic: Array
    damping: float
    restrained: bool
    held: bool
    afloat: bool
    progress: Array
    actions: Timeline
    turns: Turns
    returning: Returning
    kinks: Kinks | None


@inlined
def length_of(control, stop):  # type: ignore[no-untyped-def]
    """A step about as long as the one aimed at that divides the way to the next stop."""
    progress = control.progress
    left, wanted = stop - progress[TIME], min(progress[WANTED], progress[CAP])
    return left / np.ceil(left / (FITTED * wanted))


@inlined
def end_of(h, stop, progress):  # type: ignore[no-untyped-def]
    """The end of a step, which is the next stop if that is close."""
    end = progress[TIME] + h
    return stop if end > stop - 0.5 * h else end


@embedded
def stiffen(damping, control, c):  # type: ignore[no-untyped-def]
    """Give the iteration matrix the stiffness of damping at steps of this length."""
    if damping is not None:
        constants, rate = damping.stiff.constants, c.gamma / (c.beta * c.h)
        for i in range(constants.shape[0]):
            for k in range(constants.shape[1]):
                constants[i, k] = control.elastic[0, i, k] + rate * control.elastic[1, i, k]


@inlined
def copy_actions(angles, values, here, there):  # type: ignore[no-untyped-def]
    """Copy what acts at one end of the step to the other."""
    for h in range(angles.shape[1]):
        for k in range(3):
            angles[there, h, k] = angles[here, h, k]
    for n in range(values.shape[1]):
        for k in range(2):
            values[there, n, k] = values[here, n, k]


@inlined
def pass_stops(control):  # type: ignore[no-untyped-def]
    """Go beyond the stops that the time has reached, and see whether the motion starts anew there."""
    progress, stops, anew = control.progress, control.actions.stops, control.actions.anew
    while stops[int(progress[EVENT])] <= progress[TIME]:
        if anew[int(progress[EVENT])]:
            progress[STARTS] = 1.0
        progress[EVENT] += 1.0


@inlined
def left_by_newton(part, h, c, system, control):  # type: ignore[no-untyped-def]
    """What Newton's iteration may leave in a step of h: a part of the error that it may make; no less than rounding.

    Damping resists what is left of a gradient by τ γ/(β h) times as much as elasticity. Without this factor, squared,
    beams of steel with τ of 1 ms and more missed 1e-2 … 1e-5 by up to 150 times, for no less work.

    Where errors of the speed stay, what it leaves, over h, is one until the end: see `free_turns` and `returning`.
    """
    resists = 1.0 + control.damping * c.gamma / (c.beta * c.h)
    may = part * control.allowed * h / control.t_end / (resists * resists)
    returning = control.returning
    stays = goes_on(control) or h > returning.resolved or knows_kinks(control.kinks)
    if stays or control.afloat:
        speed = AFLOAT_PART if not stays else ELASTIC_PART if returning.elastic else SPEED_PART
        over = control.t_end * (control.t_end - control.progress[TIME])
        may = min(may, speed * control.allowed * h * h / over)
    left = max(control.rounding, may * control.scale[0] / system.newton.scale)
    return min(system.newton.tolerance, left)


@embedded
def is_linkage(system, control):  # type: ignore[no-untyped-def]
    """Whether constraints hold rigid bodies and nothing is elastic: what the iteration leaves is of forces there."""
    return system.factors.loops is not None and not control.turns.elastic


@inlined
def seen(error, system, control):  # type: ignore[no-untyped-def]
    """Return the error of a step, or 0 where it may be rounding of positions, of which shorter steps have no less.

    Where rounding is more of what is allowed than can be told apart, it counts, and no step is small enough.
    """
    rounded, scale = POSITIONS * control.rounding * system.newton.scale, control.scale[0]
    return 0.0 if error * scale <= rounded and TOLD_APART * rounded <= control.allowed * scale else error


@inlined
def times_for_many(h, many, control):  # type: ignore[no-untyped-def]
    """Times its part of the error allowed that a step may leave, where there are more than so many steps of h in a run.

    What the iteration leaves has any sign, so that a sum of N such grows as √N, not as N.
    """
    return max(1.0, (control.t_end / (many * h)) ** 0.5)


@inlined
def spend(error, progress):  # type: ignore[no-untyped-def]
    """Add the error since the last estimate to those of the run."""
    progress[SPENT] += error
    progress[LOOKED] = progress[TIME]


@inlined
def aim(h, error, order, steady, times, control):  # type: ignore[no-untyped-def]
    """Choose the next step by the mean error of the last ones: that of a single one swings with the motion.

    The error is that since the last estimate, by steps of h; after a change a length stays for `steady` steps. The mean
    error aimed at is so many `times` the one allowed. A guess may have an infinite error, of which no mean is taken.
    """
    progress = control.progress
    if not error < np.inf:
        spend(error, progress)
        return
    since = progress[TIME] - progress[LOOKED]
    rate = error / (h**order * since)
    part = min(1.0, since / min(MEMORY * control.t_end, RECENT * h))
    progress[RATE] += (rate - progress[RATE]) * (part if progress[LOOKED] > 0.0 else 1.0)
    spend(error, progress)
    active = _times_active(since, order, progress)
    if not goes_on(control):
        times *= active
    wanted = (times * control.allowed / (control.t_end * max(progress[RATE], 1e-300))) ** (1.0 / order)
    ratio = wanted / h
    if (ratio < SHORTER or ratio > LONGER) and (progress[STEADY_STEPS] >= steady or ratio > 2.0):
        progress[WANTED] = h * min(max(ratio, 0.3), 3.0)
        progress[STEADY_STEPS] = 0.0


@inlined
def _times_active(since, order, progress):  # type: ignore[no-untyped-def]
    """Error that the motion may make now for its part of the run, over that of its mean until now."""
    root = progress[RATE] ** (1.0 / (order + 1.0))
    progress[ROOTS] += since * root
    mean = progress[ROOTS] / progress[TIME]
    return min(max(root / mean, CALM), ACTIVE) if mean > 0.0 else 1.0


@inlined
def goes_on(control):  # type: ignore[no-untyped-def]
    """Whether bodies are known to turn freely, or to go to and fro for long: errors of their speed stay."""
    return control.turns.found[0] or control.returning.known[0]


@inlined
def effort_of(history):  # type: ignore[no-untyped-def]
    """Newton corrections of a solution, and twice the times that they fell slowly; those of rounding do not count."""
    effort = 0
    for k in range(len(history)):
        if history[k] > ROUNDING:
            effort += 1 if k == 0 or history[k] <= SLOW * history[k - 1] else 3
    return effort
