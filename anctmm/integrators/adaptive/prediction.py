"""What a step repeats of the last one, from which its first Newton correction starts, where an error drives steps.

The predictor of a fixed step keeps accelerations, w. Here they go on as in the last step, by the part of their change
then that would have been best: near 1 in smooth motion, and near −1 where vibrations that steps do not resolve change
its sign. So a first correction is smaller by an order. With stages each has a change and a part of its own, those from
the stage before it: a line through the stages of the same step saves nothing, as what is not resolved is no line.

The change of the change beside it, with a part of its own, saved up to 15 % of the corrections of some runs and cost
others as much.
"""

from anctmm.jit.compiling import inlined, summed


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
