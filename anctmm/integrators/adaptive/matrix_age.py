"""What the first Newton correction of a step of generalized-α leaves, by the age of the matrix.

The contraction that steps have shown with the same matrix tells that of the next ones (Hairer & Wanner, IV.8). It is
expected to get worse with each step that shows none, as the matrix gets older, and to be no better than steps of
another length than the matrix allow: that does not fit the inertia.

By the angle that bodies turn, as with stages (`contraction`), runs of seventeen scenes took 1.04 times the corrections
and factorizations, and Andrews' squeezer missed 1e-5 by 19 times: what a step leaves of accelerations stays in them.
"""

from anctmm.integrators.adaptive.contraction import contraction_of_length
from anctmm.integrators.adaptive.step_control import AGE, FACTORED, SEEN, SEEN_AT
from anctmm.jit.compiling import inlined

#: Times the contraction in proportion to the age of the matrix that is expected, and the age, over that at which it was
#: seen, up to which it is.
SAFE, AGAIN = 2.0, 2.0


@inlined
def expect_of_length(h, stale, newton, progress):  # type: ignore[no-untyped-def]
    """Expect no better contraction than a step of h allows with the matrix that is kept; a `stale` one is renewed."""
    if abs(h - progress[FACTORED]) > stale * h:
        newton.counts[2] = 1
    else:
        newton.expected[0] = max(newton.expected[0], contraction_of_length(h, progress))


@inlined
def expect_aged(found, forgets, slow, renewed, newton, progress):  # type: ignore[no-untyped-def]
    """As `_expect_next`, but no more than in proportion to the age of the matrix, where steps with it have shown one.

    What it had in its own step tells nothing: that is the square of a correction. Above `slow` it is renewed.
    """
    _expect_next(found, forgets, newton)
    if found > slow:
        newton.counts[2] = 1
    if renewed:
        progress[AGE], progress[SEEN_AT] = 0.0, 0.0
    else:
        progress[AGE] += 1.0
        if found > 0.0:
            progress[SEEN], progress[SEEN_AT] = found, progress[AGE]
    known = progress[SEEN_AT]
    if known > 0.0 and progress[AGE] < AGAIN * known:
        newton.expected[0] = min(newton.expected[0], SAFE * progress[SEEN] * (progress[AGE] + 1.0) / known)


@inlined
def _expect_next(found, forgets, newton):  # type: ignore[no-untyped-def]
    """Expect of the next step the contraction found in this one, 0 if none was."""
    newton.expected[0] = (found if found > 0.0 else newton.expected[0]) ** forgets
