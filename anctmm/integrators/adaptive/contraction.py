"""What the first Newton correction of a stage leaves, from what the stages before have shown.

One correction may do where it is known what it leaves (Hairer & Wanner, IV.8). That has three causes, which are told
apart here. Rules for the contraction of a whole step mixed them, and had to differ between mechanisms that move freely
and structures that joints hold: `esdirk` took 1.09 times the corrections and factorizations with them.

A matrix that is kept is that of another place. Its contraction is in proportion to the way that bodies may have gone
since it was made, their velocity times the time: by angles, or over Newton's scale of positions. Over this way it was
0.5 to 0.9 in all stages of a beam on three supports, whose contractions were 1e-4 to 1e-3; over the number of solutions
it followed no rule.

It is that of steps of another length, too: of what inertia resists it leaves |1 − (h/h_kept)²|. Two lengths that differ
by 3 % leave a hundred times as much as what that beam moves in a step.

A matrix that is new leaves what goes as the square of the correction.

Nothing is expected that has not been seen: as long as no stage has shown a contraction, a first correction does not end
one, nor beyond TRUST times the largest way, or with a new matrix the largest correction, at which one has been shown
lately. Without that, a four-bar that a torque moves from rest, told by contractions at ways a thousandth as long,
missed 1e-3 by 2.7 times. And a chain of steel beams, told by what new matrices had left of corrections a tenth as large
while it moved slowly, got a kick of half of its energy where it moved fast.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.integrators.adaptive.step_control import FACTORED
from anctmm.integrators.implicit.newton import ROUNDING
from anctmm.jit.compiling import inlined

Array = NDArray[np.float64]

#: Places in what is known. Contraction over the way; largest way at which it was seen lately; what a new matrix leaves,
#: over the square of a correction; largest correction at which that was seen lately: 0 where none was seen yet. Time at
#: which the matrix was made, s. Of the present solution the way since then; the contraction of another length; whether
#: the matrix is new; and matrices before.
OF_WAY, SEEN, OF_NEW, SEEN_NEW, MADE, WAY, OF_LENGTH, NEW, BEFORE = PLACES = range(9)
#: Times the contraction in proportion to the way that is expected.
SAFE = 2.0
#: Times the way or the correction at which a contraction was seen, up to which it tells others; and the way below which
#: it tells nothing.
TRUST, LEAST = 1.5, 1e-6
#: Time since the matrix was made that counts at least, of the step: it was made before the solution was corrected.
NEAR = 0.1
#: Part of what was seen that counts at least after a smaller one; times what was seen that counts after each solution
#: that has shown none.
FADES, GROWS = 0.5, 1.05
#: Times what another length of step leaves that it may have left.
LEFT = 1.5
#: Contraction from which on corrections near rounding show none.
CLEAR = 0.05
#: Correction that is a leap to another motion which solves the equations, too, if bodies go less far in the step. A
#: damped steel pendulum at 1e-2 had ten times its speed after one.
LEAP = 0.1
#: Times what a new matrix has left of the square of a correction that is expected, and what is taken for rounding.
SAFE_NEW, LEAST_LEFT = 4.0, 1e-12


def new_contraction() -> Array:
    """Nothing is known yet."""
    return np.zeros(len(PLACES))


@inlined
def forget_contraction(known):  # type: ignore[no-untyped-def]
    """Know nothing, as where a motion starts."""
    known[OF_WAY], known[SEEN], known[OF_NEW], known[SEEN_NEW] = 0.0, 0.0, 0.0, 0.0


@inlined
def rate_of_motion(h, state, scale):  # type: ignore[no-untyped-def]
    """Largest rate at which gradients, and positions over a length, change in the middle of a step of h, 1/s."""
    v, w, rate, change = state.v, state.w, 0.0, 0.0
    for k in range(4):
        part = 1.0 / scale if k < 2 else 1.0
        for i in range(v.shape[1]):
            rate = max(rate, part * abs(v[k, i]))
            change = max(change, part * abs(w[k, i]))
    return rate + 0.5 * h * change


@inlined
def leaps(history, h, rate, control):  # type: ignore[no-untyped-def]
    """Whether a correction goes further than bodies do at this rate in a step of h, which then is too long.

    Not in a guess, which is one step for all of the run, nor where laws may bend: `law_kinks` looks for impacts, which
    change velocities within a step.
    """
    found = False
    if control.kinks is None and control.allowed < np.inf:
        for k in range(len(history)):
            found = found or history[k] > max(LEAP, rate * h)
    return found


@inlined
def expect_contraction(t, h, rate, newton, progress, known):  # type: ignore[no-untyped-def]
    """Expect of the stage at time t, in a step of h through which bodies move at a rate, what others have shown."""
    known[NEW], known[BEFORE] = newton.counts[2], newton.counts[1]
    known[WAY] = rate * max(abs(t - known[MADE]), NEAR * h)
    known[OF_LENGTH] = 0.0 if known[NEW] != 0.0 else contraction_of_length(h, progress)
    told = known[OF_WAY] > 0.0 and known[WAY] < TRUST * known[SEEN]
    newton.expected[0] = known[OF_LENGTH] + SAFE * known[OF_WAY] * known[WAY] if told else 1.0
    newton.expected[1], newton.expected[2] = SAFE_NEW * known[OF_NEW], TRUST * known[SEEN_NEW]


@inlined
def learn_contraction(t, h, rounding, newton, progress, known):  # type: ignore[no-untyped-def]
    """Learn from the corrections of the stage at time t, which leave at least `rounding`."""
    made, history = newton.counts[1] - known[BEFORE], newton.history
    if made > 0.0:
        progress[FACTORED], known[MADE] = h, t
    if made == 0.0:
        _learn_of_kept(history, rounding, known)
    elif made == 1.0 and known[NEW] != 0.0:
        _learn_of_new(history, known)


@inlined
def _learn_of_kept(history, rounding, known):  # type: ignore[no-untyped-def]
    """Learn from corrections with a matrix that was kept."""
    if history[1] == 0.0:
        known[OF_WAY] *= GROWS
    elif known[WAY] > LEAST:
        shown = contraction_or_bound(history, ROUNDING, rounding, CLEAR)
        if shown > 0.0:
            of_way = max(shown - LEFT * known[OF_LENGTH], 0.0) / known[WAY]
            known[OF_WAY] = max(of_way, FADES * known[OF_WAY])
            known[SEEN] = max(known[WAY], FADES * known[SEEN])


@inlined
def _learn_of_new(history, known):  # type: ignore[no-untyped-def]
    """Learn from corrections with a matrix that was new at the first, and kept."""
    if history[1] > 0.0:
        known[OF_NEW] = max(history[1], LEAST_LEFT) / (history[0] * history[0])
        known[SEEN_NEW] = max(history[0], FADES * known[SEEN_NEW])
    else:
        known[OF_NEW] *= GROWS


@inlined
def contraction(history, least):  # type: ignore[no-untyped-def]
    """Largest contraction of the corrections of a solution that are more than `least`; 0 where there was none."""
    largest = 0.0
    for k in range(1, len(history)):
        if history[k - 1] > least:
            largest = max(largest, history[k] / history[k - 1])
    return largest


@inlined
def contraction_or_bound(history, least, rounding, slow):  # type: ignore[no-untyped-def]
    """As `contraction`, but where all corrections are near rounding what it is at most, if that is below `slow`.

    Without that nothing would be known of the matrix, and each step would take a second correction.
    """
    found = contraction(history, least)
    if found == 0.0 and history[1] > 0.0:
        most = max(history[1], rounding) / history[0]
        if most < slow:
            found = most
    return found


@inlined
def contraction_of_length(h, progress):  # type: ignore[no-untyped-def]
    """What a matrix for steps of another length leaves of what inertia resists, in a step of h."""
    return abs(1.0 - (h / progress[FACTORED]) ** 2)
