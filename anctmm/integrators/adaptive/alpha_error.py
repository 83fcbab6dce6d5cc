"""Estimate of the error of a step of generalized-α: see `alpha_control`.

Where joints and drives hold all bodies and no load varies, errors are those of the slow part of w. A vibration whose
phase is lost over the run, as c ω³ h² t_end is above 1, is wrong by its amplitude, and not by more, while the sum of
the sizes of its errors c ω³ h³ goes on: vibrations no larger than the error allowed were resolved. A clamped rod that
is loaded suddenly took 109 steps at 3e-3, and 1,477 at 1e-3 with an error of 1e-5, where 100 fixed ones have 1.2e-4;
now 82 and 295. On 23 random structures steps are 0.72 times as many in the mean, 0.16 to 1.07, and the promise is kept
as before. On 37 whose clamps and guides are driven it is 0.79, 0.34 to 1.8: once more where what was assumed of
displacements is found to be too large. A scissor lift of steel that a guide drives took 17,229 steps at 1e-3, and 3,058
now.

Means of w, each the exponential one of that before, leave (ω τ)⁻ᴼᴿᴰᴱᴿ of a frequency ω, but lag by ORDER τ. So where
loads change w a portal under a pulse had 2.5 times the error with as many steps, and in free motion, where errors do
not come back, a thrown triangle 2.3 times: means for all made 15 of 68 runs cost more than 1.3.
"""

from anctmm.integrators.adaptive.step_control import LOOKED, STEADY_STEPS
from anctmm.integrators.adaptive.step_error import filtered_error, largest_error
from anctmm.integrators.adaptive.velocity_error import drives_rigid
from anctmm.integrators.implicit.step import copy
from anctmm.jit.compiling import inlined

#: Means in a row, and the time of each, in that of a radian of the slowest vibration whose phase is lost. Twice the
#: time: 162 steps of the rod, but twice the cost of falling beams at 1e-2, as errors that grow are seen too late.
ORDER, SHARP = 3, 0.25
#: Steps of equal length after which the error is estimated over several of them, where no load varies.
ALIKE = 4
#: Part of the error of a free coordinate that counts of a driven one: its velocity alone has it. With 1 a straight line
#: took up to 1.7 times as many steps; with nothing velocities of a driven arm were wrong by 0.06 at 1e-2 and at 1e-3.
DRIVEN = 0.25
#: Relative difference of equal steps, at most: they divide what is left of the way to an output.
ROUNDED = 1e-9
#: Places at which a step sees what acts, parts of its length, and the rows of `Control.values` that stand for them.
PLACES, ROWS = (0.0, 1.0), (0, 1)


@inlined
def alpha_error(t, h, to_w, share, system, control, lag):  # type: ignore[no-untyped-def]
    """Filtered estimate of the error in displacement since the last one, relative, the largest of the nodes."""
    w, x, factor = system.state.w, control.x, lag.coefficient * h * h * to_w
    for k in range(w.shape[0]):
        new, before = x[k], lag.w[k]
        copy(w[k], new)
        for n in range(ORDER):
            mean = lag.slow[n, k]
            for i in range(len(new)):
                new[i] = mean[i] + share * (new[i] - mean[i])
        for i in range(len(new)):
            new[i] = factor * (new[i] - before[i])
    turned = filtered_error(t, h, to_w, PLACES, ROWS, False, system, control)
    return largest_error(x, max(turned, _of_drives(t, h, control, lag)), False, control)


@inlined
def looks(h, control, lag):  # type: ignore[no-untyped-def]
    """Whether the error is estimated: over several steps where they stay as they are and no load varies.

    Over a time of 1/ω of the frequency whose phase is lost over the run, errors of faster ones cancel.
    """
    steady = int(control.progress[STEADY_STEPS])
    look = steady < ALIKE or control.values.shape[1] > 0
    if not look:
        look = steady % max(1, int(_turned_by_one(h, control, lag) / h)) == 0
    return look


@inlined
def follow(share, state, lag):  # type: ignore[no-untyped-def]
    """After a step: bring the slow part of w up to date."""
    for k in range(state.w.shape[0]):
        new = state.w[k]
        for n in range(ORDER):
            mean = lag.slow[n, k]
            for i in range(len(mean)):
                mean[i] += share * (new[i] - mean[i])
            new = mean


@inlined
def begin_anew(state, lag):  # type: ignore[no-untyped-def]
    """At a start, all of w is slow."""
    for k in range(state.w.shape[0]):
        for n in range(ORDER):
            copy(state.w[k], lag.slow[n, k])
    remember(lag)


@inlined
def remember(lag):  # type: ignore[no-untyped-def]
    """Keep the slow part of w, from which the next estimate starts."""
    for k in range(len(lag.w)):
        copy(lag.slow[ORDER - 1, k], lag.w[k])


@inlined
def share_of(h, control, lag):  # type: ignore[no-untyped-def]
    """Part of a new value in an exponential mean after a step of h; all where the slow part is w itself."""
    slow = 0.0
    if control.held and control.values.shape[1] == 0:
        slow = SHARP * max(_turned_by_one(h, control, lag) - h, 0.0)
    return h / (h + slow)


@inlined
def _turned_by_one(h, control, lag):  # type: ignore[no-untyped-def]
    """Time of about a radian of a vibration whose phase is wrong by as much at the end, s, by steps of h."""
    if abs(lag.radian[0] - h) > ROUNDED * h:
        lag.radian[0], lag.radian[1] = h, (0.5 * lag.coefficient * control.t_end * h * h) ** (1.0 / 3.0)
    return lag.radian[1]


@inlined
def _of_drives(t, h, control, lag):  # type: ignore[no-untyped-def]
    """Part of the error that driven angles and positions would have since the last estimate if they were free, m."""
    angles, change = control.angles, 0.0
    if not drives_rigid(control):
        for n in range(angles.shape[1]):
            change = max(change, control.reach[n] * abs(angles[1, n, 2] - angles[0, n, 2]))
    return DRIVEN * lag.coefficient * h * change * (t + h - control.progress[LOOKED])
