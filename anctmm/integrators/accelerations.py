"""Accelerations from the equations of motion, and projections of positions and velocities onto the rows.

    M w + Jᵀλ = f,    J w = γ

are solved by one factorization of [M Jᵀ; J −δ], with δ λ on the right-hand side as of the last solution, so that δ
changes nothing once multipliers do not.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.integrators.state import State
from anctmm.kernels.options import part
from anctmm.system.calls import (
    factorize_matrix,
    set_accelerations,
    set_jacobian,
    set_rates,
    set_rows,
    solve_for,
)
from anctmm.system.elastic import subtract_driven_inertia
from anctmm.system.equations import set_matrix
from anctmm.system.matrix import gather
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]

#: Projections of positions at most; values of rows, of the size of the scene, that are none; and how far one must fall.
PROJECTIONS, KEPT, FALLS = 12, 1e-14, 0.1
#: Value of a row, of the size of the scene, that is not kept.
VIOLATED = 1e-8


@part
def factorize_mass(
    size: tuple[int, ...], space: tuple[int, ...], tables: Tables, state: State, inputs: Inputs, n: int
) -> None:
    """Factor [M Jᵀ; J −δ] with the J at hand."""
    set_matrix(size, space, tables, state.q, state.v, inputs, n, 1.0, 0.0, 0.0)
    factorize_matrix(size, tables)


@part
def solve_accelerations(
    size: tuple[int, ...], space: tuple[int, ...], tables: Tables, state: State, signals: Array
) -> None:
    """Accelerations w of all vectors, and multipliers, from the forces f by the factored matrix.

    On entry w holds the accelerations of driven vectors, and zero elsewhere; f is used up.
    """
    rows, matrix = tables.rows, tables.matrix
    if len(tables.driven.node) > 0:
        subtract_driven_inertia(space, tables.elements, tables.driven, state.w, state.f)
    gather(space, matrix.at, state.f, matrix.unknowns)
    if len(rows.at) > 0:
        set_accelerations(tables, state.q, state.v, state.w, signals)
    set_row_sides(tables, -1.0)
    solve_for(size, space, tables, state.scratch)
    take_multipliers(tables)
    w, found = state.w, state.scratch
    for k in range(w.shape[0]):
        for i in range(w.shape[1]):
            w[k, i] += found[k, i]


@part
def set_row_sides(tables: Tables, factor: float) -> None:
    """Right-hand sides of the rows: factor g − δ λ, λ as known."""
    rows = tables.rows
    for r in range(len(rows.at)):
        tables.matrix.unknowns[rows.at[r]] = factor * rows.g[r] - rows.compliance[r] * rows.multiplier[r]


@part
def take_multipliers(tables: Tables) -> None:
    """Multipliers of a solution."""
    rows = tables.rows
    for r in range(len(rows.at)):
        rows.multiplier[r] = tables.matrix.unknowns[rows.at[r]]


@part
def take_off(size: tuple[int, ...], space: tuple[int, ...], tables: Tables, state: State, x: Array) -> None:
    """Add to x the least change, in the metric of the matrix, that takes the values g off; known vectors stay."""
    unknowns, rows, change = tables.matrix.unknowns, tables.rows, state.scratch
    for k in range(len(unknowns)):
        unknowns[k] = 0.0
    for r in range(len(rows.at)):
        unknowns[rows.at[r]] = -rows.g[r]
    solve_for(size, space, tables, change)
    for k in range(x.shape[0]):
        for i in range(x.shape[1]):
            x[k, i] += change[k, i]


@part
def project(
    size: tuple[int, ...], space: tuple[int, ...], tables: Tables, state: State, inputs: Inputs, n: int
) -> bool:
    """Put positions and velocities where rows that change have them; False where they are not kept.

    The matrix of the last call serves as long as values fall by ten times; it ends factored at the positions found.
    """
    last, bound, signals = np.inf, KEPT * state.scale[0], inputs.signals[n]
    for _ in range(PROJECTIONS):
        size_of = set_rows(tables, state.q, signals)
        if not size_of > bound:
            break
        if size_of > FALLS * last:
            if size_of <= 1e3 * bound:  # rounding
                break
            set_jacobian(tables, state.q, signals)
            factorize_mass(size, space, tables, state, inputs, n)
            state.counts[1] += 1
        take_off(size, space, tables, state, state.q)
        last = size_of
    set_jacobian(tables, state.q, signals)
    factorize_mass(size, space, tables, state, inputs, n)
    state.counts[1] += 1
    set_rates(tables, state.q, state.v, signals)
    take_off(size, space, tables, state, state.v)
    return set_rows(tables, state.q, signals) <= VIOLATED * state.scale[0]
