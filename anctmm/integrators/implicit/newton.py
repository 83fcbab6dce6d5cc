"""Newton's iteration of an implicit step, its linear solves by the Riccati recursion.

The matrix is kept as long as the corrections decrease (modified Newton); otherwise it is computed in each iteration.
When it is renewed before a solution, see `renewal`.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import (
    FIRST_BODY,
    body_after,
    window_end,
    window_forces,
    window_inertia,
)
from anctmm.discretise.methods import Coefficients
from anctmm.elements.force_blocks import BLOCK
from anctmm.forces.connectors import add_connectors_at_end, end_velocities
from anctmm.forces.loads import set_loads
from anctmm.integrators.implicit.renewal import worn
from anctmm.integrators.implicit.step import damp_at_end, predict
from anctmm.integrators.implicit.system import ITERATIONS, System
from anctmm.jit.compiling import embedded, inlined, separate
from anctmm.jit.prefetching import AHEAD, LINE, LONG, prefetch_columns, prefetch_row
from anctmm.recursion.constrained import ask_correction, begin_newton, end_newton, take_correction
from anctmm.recursion.kept.rows import KEPT
from anctmm.recursion.lines import hold_on_lines
from anctmm.recursion.low_rank import correct_step, factor_border
from anctmm.recursion.riccati import (
    factorize,
    find_unknowns,
    meet_inboard,
    part_outboard,
    pass_outboard,
    start_sweep,
    turn_back,
)
from anctmm.recursion.scratch import vectors

Array = NDArray[np.float64]

#: Contraction above which the iteration matrix is renewed.
SLOW = 0.5
#: Size below which corrections that do not fall are rounding.
ROUNDING = 1e-8
#: Growth of corrections over the smallest, and over what is no rounding, at which accelerations cannot be kept.
GROWN, LEAST = 10.0, 1e-10


@inlined
def solve_step(system, coefficients, load_values, tolerance):  # type: ignore[no-untyped-def]
    """Find the end of a step from its predictor: by modified Newton, and where that fails by Newton."""
    q, w = system.state.q, system.state.w
    flat_q, flat_v, flat_a, flat_w, was, had = system.state.flat
    solved = False
    for full in range(2):
        if not solved:
            if full == 1:
                predict(flat_q, flat_v, flat_a, flat_w, was, had, coefficients)
            _drag(q, w, system.clamps, coefficients)
            hold_on_lines(system.links.turned, q, w, coefficients)
            solved = iterate(full == 1, system, coefficients, load_values, tolerance)
    return solved


@inlined
def _drag(q, w, clamps, c):  # type: ignore[no-untyped-def]
    """Give the driven clamps' nodes their known positions; w follows, and with it a and v."""
    for h in range(len(clamps.nodes)):
        i = clamps.nodes[h]
        for k in range(clamps.held[h]):
            w[k, i] += c.to_w * (clamps.motion[0, h, k] - q[k, i])
            q[k, i] = clamps.motion[0, h, k]


@separate
def iterate(
    full: bool, system: System, coefficients: Coefficients, load_values: Array, tolerance: float
) -> bool:
    """Newton's iteration, the matrix renewed at each correction if `full`, else when the corrections fall slowly.

    It ends where the error left, positions relative to Newton's scale and gradients by their weight, is at most
    `tolerance`. An infinite one asks for one correction, which tells nothing of what solutions cost with the matrix.
    """
    state, tables, links, factors, _, loads, newton, damping = system
    q, v, a, w, _, w_before, f, dead, arrived, _ = state
    scale, _, counts, history, wear, weight, expected, shows = newton
    new, renewed = full or counts[2] != 0, counts[1]
    last, stalls, least = 0.0, 0, np.inf
    by_rates = coefficients.level * coefficients.to_q != 0.0
    history[:] = 0.0
    begin_newton(factors.loops)
    for iteration in range(ITERATIONS):
        set_loads(q, f, dead, loads, load_values)
        end_velocities(loads.connectors, v, a, w, w_before, coefficients)
        if full or counts[2] != 0:
            _factorize(damping, q, tables, links, coefficients, loads, load_values, factors)
            factor_border(loads.border, q, coefficients.to_q, loads, load_values, factors)
            counts[1] += 1
            counts[2] = 0
            _forget(expected)
        damp_at_end(damping, state, coefficients, tables, loads, load_values)
        add_connectors_at_end(loads.connectors, q, load_values, f)
        off = ask_correction(factors.loops, coefficients, q, v, w)
        _forward(q, w, f, tables, factors, factors.loops, arrived)
        take_correction(factors.loops)
        size = _backward(q, w, coefficients, scale, weight[0], factors, factors.loops, arrived)
        size = correct_step(loads.border, arrived, q, w, coefficients, scale, weight[0], size, factors)
        history[iteration] = size
        counts[0] += 1
        if size == np.inf or (by_rates and size > GROWN * max(least, LEAST)):
            break
        least = min(least, size)
        # the corrections fall by `rate` each: what is left is at most their geometric series
        rate = size / last if iteration > 0 else _expected(new, size, expected)
        small = size <= tolerance or (rate < 1.0 and size * rate / (1.0 - rate) <= tolerance)
        if small and off <= KEPT:  # constraints that nothing can keep bring no correction
            counts[2] = 0
            if tolerance < np.inf:
                cost = _needed(iteration + 1, history, shows * tolerance)
                counts[2] = 1 if worn(new, cost, counts[1] - renewed, wear) else 0
            end_newton(factors.loops)
            return True
        if iteration > 0 and rate > SLOW:
            counts[2] = 1
            stalls += 1 if size < ROUNDING else 0
            if stalls == 3:  # corrections with a new matrix that no longer fall are rounding
                end_newton(factors.loops)
                return off <= KEPT
        last = size
    counts[2] = 1
    return False


@inlined
def _needed(corrections, history, least):  # type: ignore[no-untyped-def]
    """So many corrections, without those after the first that are no larger than `least`."""
    count = corrections
    for k in range(1, corrections):
        if history[k] <= least:
            count -= 1
    return count


@embedded
def _expected(new, size, expected):  # type: ignore[no-untyped-def]
    """Contraction to expect of a first correction of this size: 1 where nothing is known of the matrix."""
    found = 1.0
    if expected is not None:
        if not new:
            found = expected[0]
        elif size <= expected[2]:
            found = expected[1] * size
    return found


@embedded
def _forget(expected):  # type: ignore[no-untyped-def]
    """Nothing is known of a matrix that is new."""
    if expected is not None:
        expected[0] = 1.0


@embedded
def _factorize(damping, q, tables, links, c, loads, load_values, factors):  # type: ignore[no-untyped-def]
    """Renew the iteration matrix, with the stiffness of damping if there is some."""
    if damping is None:
        factorize(q, tables, links, c.to_w, c.to_q, loads, load_values, factors)
    else:
        factorize(q, damping.stiff, links, c.to_w, c.to_q, loads, load_values, factors)


@embedded
def _forward(q, w, f, tables, factors, loops, arrived):  # type: ignore[no-untyped-def]
    """Forward sweep of the residual f − F_elastic − M w, window by window: what has arrived at each node."""
    first, formulations, kinds, constants, masses, buffer = tables
    size, L, _, wide, work, _, places, _ = factors
    d, body, nodes, place = len(size), FIRST_BODY, q.shape[1], 0
    load, _, _, _ = vectors(size)
    last = 12 * BLOCK
    buffer[last:] = 0.0
    start_sweep(size, loops, work)
    start = 0
    while start < nodes:
        end = window_end(start, nodes, body, first)
        window_forces(formulations, q, start, end, body, first, kinds, constants, buffer)
        window_inertia(w, 1.0, start, end, body, first, masses, buffer)
        body = body_after(end, body, first)
        begin = start
        while begin < end:
            stop = min(end, places.at[place])
            for i in range(begin, stop):
                if nodes > LONG:
                    prefetch_row(L, min(i + AHEAD, nodes - 1))
                    if i % LINE == 0:
                        prefetch_columns(q, min(i + BLOCK, nodes - 1))
                        prefetch_columns(w, min(i + BLOCK, nodes - 1))
                        prefetch_columns(f, min(i + BLOCK, nodes - 1))
                for k in range(d):
                    at = k * BLOCK + i - start
                    work[load + k] = f[k, i] - buffer[at] - buffer[last + k]
                    buffer[last + k] = buffer[at + 6 * BLOCK]
                pass_outboard(size, L, wide, loops, i, work)
                for k in range(d):
                    arrived[i, k] = work[load + k]
            begin = stop
            if stop == places.at[place]:
                part_outboard(size, places, loops, place, work)
                place += 1
        start = end
    turn_back(size, loops, work)


@embedded
def _backward(q, w, c, scale, weight, factors, loops, arrived):  # type: ignore[no-untyped-def]
    """Backward sweep: the corrections, put in place of what arrived, are added to q and w as `c` says.

    Returns the largest component, positions relative to `scale`, gradients times `weight`; infinity if one is not
    finite.
    """
    size, L, G, wide, work, _, places, _ = factors
    d, largest, odd = len(size), 0.0, 0.0
    load, _, found, _ = vectors(size)
    nodes = q.shape[1]
    for place in range(len(places.at) - 1, -1, -1):
        meet_inboard(size, places, loops, place, arrived, work)
        begin = places.at[place - 1] if place > 0 else 0
        for i in range(places.at[place] - 1, begin - 1, -1):
            if nodes > LONG:
                prefetch_row(L, max(i - AHEAD, 0))
                prefetch_row(G, max(i - AHEAD, 0))
                if i % LINE == 0:
                    prefetch_columns(q, max(i - 2 * AHEAD, 0))
                    prefetch_columns(w, max(i - 2 * AHEAD, 0))
            for k in range(d):
                work[load + k] = arrived[i, k]
            find_unknowns(size, L, G, wide, loops, i, work)
            for k in range(d):
                x = work[found + k]
                arrived[i, k] = x
                q[k, i] += c.to_q * x
                w[k, i] += c.to_w * x
                largest = max(largest, abs(x) * (1.0 / scale if k < 2 else weight))
                odd += x - x  # 0 unless infinite or not a number
    return largest if odd == 0.0 else np.inf
