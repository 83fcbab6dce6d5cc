"""Accelerations from the equations of motion, and projections of positions and velocities onto the rows.

    M w + Jᵀλ = f,    J w = γ

are solved by one factorization of [M Jᵀ; J −δ], with δ λ on the right-hand side as of the last solution, so that δ
changes nothing once multipliers do not.
"""

import numpy as np
from numpy.typing import NDArray

from anctmm.elimination.factor import factorize
from anctmm.integrators.state import State
from anctmm.kernels.options import part, thin
from anctmm.system.elastic import add_mass, subtract_inertia
from anctmm.system.matrix import add_rows, clear, gather, scatter, solve_augmented
from anctmm.system.rows import add_time_parts, multiply, set_jacobian, set_rates, set_rows
from anctmm.system.system import Tables

Array = NDArray[np.float64]

#: Projections of positions at most; values of rows, of the size of the scene, that are none; and how far one must fall.
PROJECTIONS, KEPT, FALLS = 12, 1e-14, 0.1
#: Value of a row, of the size of the scene, that is not kept.
VIOLATED = 1e-8


@thin
def factorize_mass(size: tuple[int, ...], space: tuple[int, ...], tables: Tables, signals: Array) -> int:
    """Factor [M Jᵀ; J −δ] with the J at hand; its number of negative pivots."""
    matrix, width = tables.matrix, len(size)
    clear(matrix.flat, width, matrix.padding)
    add_mass(tables.elements, len(space), 1.0, matrix.flat, width)
    add_rows(tables.rows, matrix.flat, width, 1.0, 0.0, signals)
    return factorize(size, matrix.plan, matrix.values)


@thin
def solve_accelerations(
    size: tuple[int, ...], space: tuple[int, ...], tables: Tables, state: State, signals: Array
) -> None:
    """Accelerations w of all vectors, and multipliers, from the forces f by the factored matrix.

    On entry w holds the accelerations of driven vectors, and zero elsewhere; f is used up.
    """
    rows, matrix, dim = tables.rows, tables.matrix, len(space)
    if len(tables.driven.node) > 0:
        subtract_inertia(tables.elements, state.w, dim, state.f)
    gather(matrix.at, state.f, dim, matrix.unknowns)
    multiply(rows, state.w)
    add_time_parts(rows, state.q, state.v, signals, 2)
    set_row_sides(tables, -1.0)
    solve_augmented(size, tables)
    take_multipliers(tables)
    scatter(matrix.at, matrix.unknowns, dim, state.scratch)
    for k in range(state.w.shape[0]):
        for i in range(state.w.shape[1]):
            state.w[k, i] += state.scratch[k, i]


@thin
def set_row_sides(tables: Tables, factor: float) -> None:
    """Right-hand sides of the rows: factor g − δ λ, λ as known."""
    rows = tables.rows
    for r in range(len(rows.at)):
        tables.matrix.unknowns[rows.at[r]] = factor * rows.g[r] - rows.compliance[r] * rows.multiplier[r]


@thin
def take_multipliers(tables: Tables) -> None:
    """Multipliers of a solution."""
    rows = tables.rows
    for r in range(len(rows.at)):
        rows.multiplier[r] = tables.matrix.unknowns[rows.at[r]]


@thin
def take_off(size: tuple[int, ...], space: tuple[int, ...], tables: Tables, state: State, x: Array) -> None:
    """Add to x the least change, in the metric of the matrix, that takes the values g off; known vectors stay."""
    matrix, rows = tables.matrix, tables.rows
    for k in range(len(matrix.unknowns)):
        matrix.unknowns[k] = 0.0
    for r in range(len(rows.at)):
        matrix.unknowns[rows.at[r]] = -rows.g[r]
    solve_augmented(size, tables)
    scatter(matrix.at, matrix.unknowns, len(space), state.scratch)
    for k in range(x.shape[0]):
        for i in range(x.shape[1]):
            x[k, i] += state.scratch[k, i]


@part
def project(
    size: tuple[int, ...], space: tuple[int, ...], tables: Tables, state: State, signals: Array
) -> bool:
    """Put positions and velocities where rows that change have them; False where they are not kept.

    The matrix of the last call serves as long as values fall by ten times; it ends factored at the positions found.
    """
    rows, last, bound = tables.rows, np.inf, KEPT * state.scale[0]
    for _ in range(PROJECTIONS):
        size_of = set_rows(rows, state.q, signals)
        if not size_of > bound:
            break
        if size_of > FALLS * last:
            if size_of <= 1e3 * bound:  # rounding
                break
            set_jacobian(rows, state.q, signals)
            factorize_mass(size, space, tables, signals)
            state.counts[1] += 1
        take_off(size, space, tables, state, state.q)
        last = size_of
    set_jacobian(rows, state.q, signals)
    factorize_mass(size, space, tables, signals)
    state.counts[1] += 1
    set_rates(rows, state.q, state.v, signals)
    take_off(size, space, tables, state, state.v)
    return set_rows(rows, state.q, signals) <= VIOLATED * state.scale[0]
