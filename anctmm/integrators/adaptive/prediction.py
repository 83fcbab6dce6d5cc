"""What a step repeats of the last one, from which its first Newton correction starts, where an error drives steps.

The predictor of a fixed step keeps accelerations, w. Here they go on as in the last step, by the part of their change
then that would have been best: near 1 in smooth motion, and near −1 where vibrations that steps do not resolve change
its sign. So a first correction is smaller by an order. With stages each has a change and a part of its own, those from
the stage before it: a line through the stages of the same step saves nothing, as what is not resolved is no line.

Multipliers of a stage change with its w: by their last change there, times the same part. Kept as they were, each
correction with an older matrix turned what they lacked into accelerations: Andrews' squeezer took 1.3 to 1.9 times as
many factorizations.

The change of the change beside it, with a part of its own, saved up to 15 % of the corrections of some runs and cost
others as much.

Linear prediction of stages, from their last changes with parts by least squares over all nodes and steps before
(Makhoul 1975, Proc. IEEE 63), makes first corrections a tenth as large. With it, and with what the last new matrix
tells of the next one, runs of seventeen scenes took 0.86 of the corrections and factorizations, from ten changes. From
five they took 1.00 times the time: 0.72 to 0.85 of Andrews' squeezer, up to 1.3 of a falling beam; from ten the beam
took up to 1.7. What is left after a correction is stiff, so that the next one falls slowly, and matrices were renewed
more often; and the sums took as long as half a correction in short chains. Who tries again: ends at a joint must be
made alike, as no correction reaches what they differ by, which grew by a hundredth in a stage.
"""

from anctmm.jit.compiling import embedded, inlined, summed


@inlined
def predict(part, rates, w):  # type: ignore[no-untyped-def]
    """Let w, flat, change by its last rate in so much of time."""
    if part != 0.0:
        for k in range(len(w)):
            w[k] += part * rates[k]


@inlined
def repeated(h, before, now, rates, scale, nodes):  # type: ignore[no-untyped-def]
    """Part of the last change of w that this one, over h, has repeated, in the sizes that corrections have.

    All are flat, positions of the nodes first, which count over Newton's `scale`. The rates become those of this one.
    """
    weight, places = 1.0 / (scale * scale), 2 * nodes
    both, last = _products(1.0 / h, before[:places], now[:places], rates[:places])
    beside, last_beside = _products(1.0 / h, before[places:], now[places:], rates[places:])
    both, last = weight * both + beside, weight * last + last_beside
    return min(max(both / last, -1.0), 1.0) if last > 0.0 else 0.0


@embedded
def predict_multipliers(part, rates, before, loops):  # type: ignore[no-untyped-def]
    """Let multipliers, the start of a solution, change by their last rates in so much of time; keep the old ones."""
    if loops is not None:
        trusted = loops.rows.trusted
        for k in range(len(before)):
            before[k] = trusted[k]
            trusted[k] += part * rates[k]


@embedded
def learn_multipliers(solved, h, rates, before, loops):  # type: ignore[no-untyped-def]
    """Find the rates of multipliers in a solution; where there is none, take the old ones again."""
    if loops is not None:
        trusted = loops.rows.trusted
        for k in range(len(before)):
            if solved:
                rates[k] = (trusted[k] - before[k]) / h
            else:
                trusted[k] = before[k]


@summed
def _products(per_second, before, now, rates):  # type: ignore[no-untyped-def]
    """Products of the new rates and the old ones, and of the old ones with themselves; they become the new ones."""
    both, last = 0.0, 0.0
    for k in range(len(now)):
        rate, old = per_second * (now[k] - before[k]), rates[k]
        both += rate * old
        last += old * old
        rates[k] = rate
    return both, last
