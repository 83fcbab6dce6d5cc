"""The matrix of Newton's method and of accelerations: formed, factored, and solutions by it."""

import numpy as np
from numpy.typing import NDArray

from anctmm.elimination.factor import factorize, solve
from anctmm.system.acting import add_acting_tangents
from anctmm.system.elastic import add_mass, add_tangent
from anctmm.system.matrix import add_rows, augment, clear, scatter
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]


def set_matrix(
    size: tuple[int, ...],
    space: tuple[int, ...],
    tables: Tables,
    q: Array,
    v: Array,
    inputs: Inputs,
    n: int,
    mass: float,
    stiffness: float,
    rate: float,
) -> None:
    """The matrix mass · M + stiffness · K, with the rows and their J; `rate`: dv/dq of a step, 1/s, for dampers."""
    matrix, width = tables.matrix, len(size)
    clear(matrix.flat, width, matrix.padding)
    add_mass(size, space, tables.elements, mass, matrix.flat)
    if stiffness != 0.0:
        add_tangent(size, space, tables.elements, q, stiffness, matrix.flat)
        add_acting_tangents(space, tables.acting, q, v, inputs, n, stiffness, rate, matrix.flat, width)
    add_rows(tables.rows, matrix.flat, width, max(mass, 1e-300), stiffness, inputs.signals[n])


def factorize_matrix(size: tuple[int, ...], tables: Tables) -> float:
    """Factor the matrix in place; its number of negative pivots."""
    return float(factorize(size, tables.matrix.plan, tables.matrix.values))


def solve_for(size: tuple[int, ...], space: tuple[int, ...], tables: Tables, x: Array) -> None:
    """Solve for the right-hand side in the unknowns, in its place; x, (rows, nodes): the solution by nodes."""
    matrix = tables.matrix
    if len(tables.rows.squares) > 0:
        augment(tables.rows, matrix.at, matrix.unknowns)
    solve(size, matrix.plan, matrix.values, matrix.x)
    scatter(space, matrix.at, matrix.unknowns, x)
