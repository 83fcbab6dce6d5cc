"""The residual of the equations of motion at one state, for Newton's method, statics and modes."""

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.options import kernel
from anctmm.system.calls import set_forces, set_jacobian, set_rows
from anctmm.system.elastic import subtract_inertia
from anctmm.system.matrix import gather
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
