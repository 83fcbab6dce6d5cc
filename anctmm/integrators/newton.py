"""Newton's iteration of an implicit step: q and v at its end are linear in the accelerations w there,

    q = base + w / to_w,    v = rate + to_v w,

and M w = f(q, v, t) − Jᵀλ with g(q, t) = 0, or its second derivative, are solved for a correction x of q, with w
corrected by to_w x. The matrix to_w M + K is used as long as corrections fall quickly (Hairer & Wanner, Solving ODEs
II, IV.8); forces and rows are exact at each correction.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.integrators.accelerations import VIOLATED
from anctmm.integrators.state import State
from anctmm.kernels.options import inlined, part
from anctmm.system.calls import factorize_matrix, set_accelerations, solve_for
from anctmm.system.equations import set_matrix, set_residual
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]

#: Contraction above which the matrix is renewed before the next step, and above which in the step.
SLOW, TOO_SLOW = 0.1, 0.5
#: Part of the tolerance that the error left may have where it is estimated by the contraction.
SAFE = 0.1
#: Corrections below which one that does not fall is rounding.
ROUNDING = 1e-8


class Coefficients(NamedTuple):
    """Of an implicit step: h (s), to_w, to_v, and the derivative of rows that is kept: 0 positions, 2 accelerations."""

    h: float
    to_w: float
    to_v: float
    level: int


@inlined
def set_end(state, c):  # type: ignore[no-untyped-def]
    """q and v at the end of the step from w there."""
    q, v, w, base, rate = state.q, state.v, state.w, state.base, state.rate
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            q[k, i] = base[k, i] + w[k, i] / c.to_w
            v[k, i] = rate[k, i] + c.to_v * w[k, i]


@part
def iterate(
    size: tuple[int, ...],
    space: tuple[int, ...],
    tables: Tables,
    state: State,
    c: Coefficients,
    full: bool,
    inputs: Inputs,
    n: int,
) -> bool:
    """Newton's iteration from q, v and w; whether it converged. With `full` the matrix is renewed at each correction.

    It ends where a correction, times `State.unit`, is at most the tolerance, or where the geometric series of the
    corrections leaves an error far below it.
    """
    rows, matrix = tables.rows, tables.matrix
    length, tolerance = state.scale[0], state.scale[1]
    last, stalls, growths = 0.0, 0, 0
    state.sizes[:] = 0.0
    for iteration in range(state.limits[0]):
        off = set_residual(space, tables, state.q, state.v, state.w, inputs, n, state.f)
        if full or state.counts[2] != 0:
            renew(size, space, tables, state, c, inputs, n)
        if len(rows.at) > 0:
            off = set_row_sides(tables, state, c, inputs.signals[n], off)
        solve_for(size, space, tables, state.scratch)
        for r in range(len(rows.at)):
            rows.multiplier[r] += matrix.unknowns[rows.at[r]]
        change = correct(state, c)
        state.counts[0] += 1
        state.sizes[iteration] = change
        if not change < np.inf:
            break
        contraction = change / last if iteration > 0 else 1.0
        small = change <= tolerance or (
            contraction < 1.0 and change * contraction / (1.0 - contraction) <= SAFE * tolerance
        )
        if small and off <= VIOLATED * length:
            state.counts[2] = (
                1 if iteration > 0 and contraction > SLOW and change > ROUNDING * tolerance else 0
            )
            return True
        if iteration > 0 and contraction > TOO_SLOW:
            state.counts[2] = 1
            if change < ROUNDING:
                stalls += 1
            elif change > last:
                growths += 1
            if growths > state.limits[2]:
                break
            if stalls == 3:  # corrections with a new matrix that no longer fall are rounding
                return off <= VIOLATED * length
        last = change
    state.counts[2] = 1
    return False


@part
def renew(size, space, tables, state, c, inputs, n):  # type: ignore[no-untyped-def]
    """Form and factor the matrix; the residual in the unknowns is left as it is."""
    set_matrix(size, space, tables, state.q, state.v, inputs, n, c.to_w, 1.0, c.to_v * c.to_w)
    factorize_matrix(size, tables)
    state.counts[1] += 1
    state.counts[2] = 0


@part
def set_row_sides(tables, state, c, signals, off):  # type: ignore[no-untyped-def]
    """Right-hand sides of the rows: −g, or what their second derivative lacks; the largest value that counts."""
    rows = tables.rows
    if c.level == 2:
        set_accelerations(tables, state.q, state.v, state.w, signals)
        off = 0.0
        for r in range(len(rows.at)):
            rows.g[r] /= c.to_w
            off = max(off, abs(rows.g[r]))
    for r in range(len(rows.at)):
        tables.matrix.unknowns[rows.at[r]] = -rows.g[r]
    return off


@part
def correct(state, c):  # type: ignore[no-untyped-def]
    """Add the correction to q, v and w; its largest component, times its unit, or infinity."""
    largest, odd, by_v = 0.0, 0.0, c.to_v * c.to_w
    q, v, w, change, unit = state.q, state.v, state.w, state.scratch, state.unit
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            x = change[k, i]
            q[k, i] += x
            v[k, i] += by_v * x
            w[k, i] += c.to_w * x
            largest = max(largest, abs(x) * unit[k, i])
            odd += x - x  # 0 unless infinite or not a number
    return largest if odd == 0.0 else np.inf
