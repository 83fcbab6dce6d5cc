"""Where Newton's iteration of a stage starts from, if an error drives the steps: w goes on as it has changed before.

The change of w from one stage to the next is predicted as a sum of the last ones, over the times that they took, each
with the part that would have been best for this stage in the steps before: linear prediction by least squares (Makhoul
1975, Proc. IEEE 63), older steps with less weight. So a smooth motion goes on as a polynomial would, and vibrations
that steps do not resolve as they are damped. Sums run over all nodes, in the sizes that corrections have; products of
changes are kept, so that a stage needs those of the new one alone, and a solution of DEPTH equations.

Multipliers of constraints go on with the same parts. What they lack is no part of w, but a correction with a matrix of
another place makes it one: second corrections of Andrews' squeezer were as large as the first ones, and a run took
twice as many.

What no correction reaches must not go on. Ends at a joint have the same unknowns, each of its own; predicted from what
they differ by, rounding grew by a hundredth in a stage, and a welded triangle came apart after 2,000 stages. So their
changes are made alike.

A prediction with more than twice the largest of the last changes is none: a load that begins makes much of what was
rounding before.

First corrections are a tenth as large as with a part of the change in the last step, as `repetition` has it (medians of
seventeen scenes, 1e-2 … 1e-5: 0.6 … 0.003). With 5, 8, 10 and 15 changes they are 0.12, 0.10, 0.095 and 0.094 of these,
with weights of 0.5 … 0.85 the same.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.joined import Doubles, doubles_of, repeat_at_joints
from anctmm.discretise.kept_chains import once
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, inlined, shared, summed

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Changes of which a prediction is made: those of a step.
DEPTH = 5
#: Weight of a step in the least squares, over that of the next one.
FORGETS = 0.7
#: Part of each square, relative, that is added to it. Without it noise was predicted: largest first corrections of a
#: run were 1.1 times as large.
LEAST = 1e-6
#: Times the largest change before that a predicted one may be.
LARGEST = 2.0


@by_address
class Prediction(NamedTuple):
    """What is known of the last changes.

    rates, forces: changes of w and of multipliers over the length of their step, of one stage after the other and
    around, (slots, size), (slots, multipliers). products: of each change of w with itself and those before it, (slots,
    DEPTH + 1). squares: of the least squares of each stage, right side last, (stages, DEPTH, DEPTH + 1). factors: the
    same, scaled and factorized, (DEPTH, DEPTH + 1). parts: of the last changes, in the next one, (DEPTH,).
    multipliers: those found last, and at the start of the step, (2, multipliers). known: number of changes, and that at
    the start of the step, (2,). doubles: unknowns at joints.
    """

    rates: Array
    forces: Array
    products: Array
    squares: Array
    factors: Array
    parts: Array
    multipliers: Array
    known: Ints
    doubles: Doubles


def new_prediction(chain: Chain, stages: int) -> Prediction:
    """Nothing known, for a method with so many stages."""
    slots, size = DEPTH + stages, chain.bodies.rows * chain.bodies.nodes
    multipliers = len(chain.kept.constraints.names) if chain.plan.kept else 0
    return Prediction(
        np.zeros((slots, size)),
        np.zeros((slots, multipliers)),
        np.zeros((slots, DEPTH + 1)),
        np.zeros((stages, DEPTH, DEPTH + 1)),
        np.zeros((DEPTH, DEPTH + 1)),
        np.zeros(DEPTH),
        np.zeros((2, multipliers)),
        np.zeros(2, np.int64),
        once(chain, doubles_of),
    )


@inlined
def forget_changes(loops, prediction):  # type: ignore[no-untyped-def]
    """Forget all, as a motion starts anew."""
    prediction.known[:] = 0
    prediction.squares[:] = 0.0
    _copy_multipliers(loops, prediction.multipliers[0])


@inlined
def begin_prediction(prediction):  # type: ignore[no-untyped-def]
    """A step begins."""
    prediction.known[1] = prediction.known[0]
    for k in range(prediction.multipliers.shape[1]):
        prediction.multipliers[1, k] = prediction.multipliers[0, k]


@inlined
def take_back(loops, prediction):  # type: ignore[no-untyped-def]
    """Go back to the start of a step; what was learned from its stages holds."""
    prediction.known[0] = prediction.known[1]
    for k in range(prediction.multipliers.shape[1]):
        prediction.multipliers[0, k] = prediction.multipliers[1, k]
    _set_multipliers(loops, prediction.multipliers[0])


@embedded
def _copy_multipliers(loops, kept):  # type: ignore[no-untyped-def]
    """Keep the multipliers found last."""
    if loops is not None:
        for k in range(len(kept)):
            kept[k] = loops.rows.trusted[k]


@embedded
def _set_multipliers(loops, kept):  # type: ignore[no-untyped-def]
    """Let the next solution start from these multipliers."""
    if loops is not None:
        for k in range(len(kept)):
            loops.rows.trusted[k] = kept[k]


@shared
def predict(stage, h, w, loops, prediction):  # type: ignore[no-untyped-def]
    """Let w, flat, and the multipliers change over a step of h as is expected of this stage."""
    rates, parts, last = prediction.rates, prediction.parts, prediction.known[0] - 1
    _find_parts(stage, prediction)
    if parts[0] != 0.0:
        for j in range(min(DEPTH, last + 1)):
            slot = (last - j) % len(rates)
            _add(h * parts[j], rates[slot], w)
            _add_multipliers(h * parts[j], slot, loops, prediction)


@inlined
def _add(part, rates, w):  # type: ignore[no-untyped-def]
    """Add so much of these rates."""
    for k in range(len(w)):
        w[k] += part * rates[k]


@embedded
def _add_multipliers(part, slot, loops, prediction):  # type: ignore[no-untyped-def]
    """Add so much of the rates of multipliers to those from which the next solution starts."""
    if loops is not None:
        _add(part, prediction.forces[slot], loops.rows.trusted)


@inlined
def _find_parts(stage, prediction):  # type: ignore[no-untyped-def]
    """The parts that would have been best for this stage until now; 0 if they make too much of the last changes."""
    squares, a, parts = prediction.squares[stage], prediction.factors, prediction.parts
    for i in range(DEPTH):
        parts[i] = 1.0 / np.sqrt(squares[i, i]) if squares[i, i] > 0.0 else 0.0
    for i in range(DEPTH):
        for j in range(i):
            a[i, j] = squares[i, j] * parts[i] * parts[j]
        a[i, i], a[i, DEPTH] = 1.0 + LEAST, squares[i, DEPTH] * parts[i]
    _solve(a)
    for i in range(DEPTH):
        parts[i] *= a[i, DEPTH]
    if _too_large(prediction):
        for i in range(DEPTH):
            parts[i] = 0.0


@inlined
def _solve(a):  # type: ignore[no-untyped-def]
    """Solve symmetric equations with right sides in the last column, where the solution stands then, by Cholesky.

    The diagonal has the inverses of the factor's.
    """
    for i in range(DEPTH):
        for j in range(i):
            x = a[i, j]
            for k in range(j):
                x -= a[i, k] * a[j, k]
            a[i, j] = x * a[j, j]
        x, y = a[i, i], a[i, DEPTH]
        for k in range(i):
            x -= a[i, k] * a[i, k]
            y -= a[i, k] * a[k, DEPTH]
        a[i, i] = 1.0 / np.sqrt(max(x, LEAST))
        a[i, DEPTH] = y * a[i, i]
    for n in range(DEPTH):
        i = DEPTH - 1 - n
        x = a[i, DEPTH]
        for k in range(i + 1, DEPTH):
            x -= a[k, i] * a[k, DEPTH]
        a[i, DEPTH] = x * a[i, i]


@inlined
def _too_large(prediction):  # type: ignore[no-untyped-def]
    """Whether the predicted change is larger than those before allow."""
    products, parts, last = prediction.products, prediction.parts, prediction.known[0] - 1
    most, square, count, slots = 0.0, 0.0, min(DEPTH, last + 1), len(products)
    for i in range(count):
        at = (last - i) % slots
        most = max(most, products[at, 0])
        square += parts[i] * parts[i] * products[at, 0]
        for j in range(i + 1, count):
            square += 2.0 * parts[i] * parts[j] * products[at, j - i]
    return not square <= LARGEST * LARGEST * most


@shared
def learn(stage, h, before, now, scale, nodes, loops, prediction):  # type: ignore[no-untyped-def]
    """Learn from the change of w over h, in the sizes that corrections have: positions, first in w, over `scale`."""
    rates, products, squares = prediction.rates, prediction.products, prediction.squares[stage]
    count, slots = prediction.known[0], len(prediction.rates)
    new, places = count % slots, 2 * nodes
    for k in range(len(now)):
        rates[new, k] = (now[k] - before[k]) / h
    repeat_at_joints(prediction.doubles, rates[new])
    _learn_multipliers(h, new, loops, prediction)
    for lag in range(min(DEPTH, count) + 1):
        old = rates[(count - lag) % slots]
        product = _product(rates[new, :places], old[:places]) / (scale * scale)
        products[new, lag] = product + _product(rates[new, places:], old[places:])
    for j in range(min(DEPTH, count)):
        squares[j, DEPTH] = FORGETS * squares[j, DEPTH] + products[new, j + 1]
        at = (count - 1 - j) % slots
        for i in range(j, min(DEPTH, count)):
            squares[i, j] = FORGETS * squares[i, j] + products[at, i - j]
    prediction.known[0] += 1


@embedded
def _learn_multipliers(h, slot, loops, prediction):  # type: ignore[no-untyped-def]
    """Keep the rates at which multipliers have changed."""
    if loops is not None:
        known = prediction.multipliers[0]
        for k in range(len(known)):
            prediction.forces[slot, k] = (loops.rows.trusted[k] - known[k]) / h
            known[k] = loops.rows.trusted[k]


@summed
def _product(x, y):  # type: ignore[no-untyped-def]
    """Scalar product."""
    total = 0.0
    for k in range(len(x)):
        total += x[k] * y[k]
    return total
