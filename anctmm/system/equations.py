"""The equations of motion at one state: residual and matrix, for Newton's method, statics and modes."""

import numpy as np
from numpy.typing import NDArray

from anctmm.elimination.factor import factorize
from anctmm.kernels.options import kernel, thin
from anctmm.system.acting import add_acting_tangents
from anctmm.system.elastic import add_mass, add_tangent, subtract_inertia
from anctmm.system.matrix import add_rows, clear, gather
from anctmm.system.rows import add_row_forces, set_jacobian, set_rows
from anctmm.system.system import Tables, set_forces

Array = NDArray[np.float64]


@thin
def set_residual(
    space: tuple[int, ...],
    tables: Tables,
    q: Array,
    v: Array,
    w: Array,
    signals: Array,
    loads: Array,
    free: Array,
    t: float,
    f: Array,
) -> float:
    """Residual f(q, v, t) − M w − Jᵀλ, in f by nodes and in the unknowns, with the J and the values g of the rows.

    Returns
    -------
    float
        The largest value of a row.
    """
    set_forces(space, tables, q, v, loads, free, t, f)
    subtract_inertia(tables.elements, w, len(space), f)
    largest = 0.0
    if len(tables.rows.at) > 0:
        set_jacobian(tables.rows, q, signals)
        largest = set_rows(tables.rows, q, signals)
        add_row_forces(tables.rows, f)
    gather(tables.matrix.at, f, len(space), tables.matrix.unknowns)
    return largest


@kernel
def set_matrix(
    size: tuple[int, ...],
    space: tuple[int, ...],
    tables: Tables,
    q: Array,
    v: Array,
    signals: Array,
    loads: Array,
    free: Array,
    t: float,
    mass: float,
    stiffness: float,
    rate: float,
) -> None:
    """The matrix mass · M + stiffness · K, with the rows; `rate`: dv/dq of a step, 1/s, for dampers."""
    matrix, width = tables.matrix, len(size)
    clear(matrix.flat, width, matrix.padding)
    add_mass(tables.elements, len(space), mass, matrix.flat, width)
    if stiffness != 0.0:
        add_tangent(tables.elements, q, len(space), stiffness, matrix.flat, width)
        add_acting_tangents(space, tables.acting, q, v, loads, free, t, stiffness, rate, matrix.flat, width)
    add_rows(tables.rows, matrix.flat, width, max(mass, 1e-300), stiffness, signals)


@kernel
def factorize_matrix(size: tuple[int, ...], tables: Tables) -> int:
    """Factor the matrix in place; its number of negative pivots."""
    return factorize(size, tables.matrix.plan, tables.matrix.values)
