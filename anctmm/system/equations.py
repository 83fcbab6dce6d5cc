"""The equations of motion at one state: residual and matrix, for Newton's method, statics and modes."""

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.options import kernel
from anctmm.system.calls import add_acting_tangents, add_mass, add_rows, add_tangent, set_jacobian, set_rows
from anctmm.system.elastic import subtract_inertia
from anctmm.system.forces import set_forces
from anctmm.system.matrix import clear, gather
from anctmm.system.rows import add_row_forces
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]


@kernel
def set_residual(
    space: tuple[int, ...],
    tables: Tables,
    q: Array,
    v: Array,
    w: Array,
    inputs: Inputs,
    n: int,
    f: Array,
) -> float:
    """Residual f(q, v, t) − M w − Jᵀλ, in f by nodes and in the unknowns, with the J and the values g of the rows.

    Returns
    -------
    float
        The largest value of a row.
    """
    set_forces(space, tables, q, v, inputs, n, f)
    subtract_inertia(space, tables.elements, w, f)
    largest = 0.0
    if len(tables.rows.at) > 0:
        set_jacobian(tables, q, inputs.signals[n])
        largest = set_rows(tables, q, inputs.signals[n])
        add_row_forces(tables.rows, f)
    gather(space, tables.matrix.at, f, tables.matrix.unknowns)
    return largest


@kernel
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
    damping: float,
) -> None:
    """The matrix mass · M + stiffness · K + damping · D, with the rows and their J; D: of materials and dampers."""
    clear(tables.matrix.flat, len(size), tables.matrix.padding)
    add_mass(size, space, tables, mass)
    if stiffness != 0.0 or damping != 0.0:
        add_tangent(size, space, tables, q, stiffness, damping)
        if len(tables.acting.kind) + len(tables.acting.load_kind) > 0:
            add_acting_tangents(size, space, tables, q, v, inputs, n, stiffness, damping)
    add_rows(size, tables, max(mass, 1e-300), stiffness, inputs.signals[n])
