"""Forces of a scene, all but inertia and those of the rows, and what drives do."""

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.options import inlined, part
from anctmm.system.calls import add_connectors, add_loads, subtract_beside, subtract_damping, subtract_elastic
from anctmm.system.elastic import subtract_rigid_inertia
from anctmm.system.rows import add_row_forces
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]


@inlined
def place_driven(driven, signals, q, v, w):  # type: ignore[no-untyped-def]
    """Give driven vectors their positions, velocities and accelerations."""
    for n in range(len(driven.node)):
        i, a = driven.node[n], driven.component[n]
        for k in range(driven.b.shape[1]):
            x, rate, acceleration = 0.0, 0.0, 0.0
            for t in range(driven.start[n], driven.start[n + 1]):
                b = driven.b[t, k]
                x += signals[driven.signal[t], 0] * b
                rate += signals[driven.signal[t], 1] * b
                acceleration += signals[driven.signal[t], 2] * b
            q[a + k, i], v[a + k, i], w[a + k, i] = x, rate, acceleration


@part
def set_given(
    space: tuple[int, ...], tables: Tables, q: Array, v: Array, inputs: Inputs, n: int, f: Array
) -> None:
    """Gravity and the forces of loads and connectors at q and v, (rows, nodes)."""
    dead = tables.dead
    for k in range(f.shape[0]):
        for i in range(f.shape[1]):
            f[k, i] = dead[k, i]
    if len(tables.acting.load_kind) > 0:
        add_loads(space, tables, q, inputs.loads[n], f)
    if len(tables.acting.kind) > 0:
        add_connectors(space, tables, q, v, inputs.free[n], inputs.t[n], f)


@part
def set_forces(
    space: tuple[int, ...], tables: Tables, q: Array, v: Array, inputs: Inputs, n: int, f: Array
) -> None:
    """All forces at q and v but inertia and those of the rows, (rows, nodes)."""
    set_given(space, tables, q, v, inputs, n, f)
    if tables.damped[1] != 0:
        subtract_damping(space, tables, q, v, f)
    subtract_elastic(space, tables, q, f)


@part
def set_reactions(
    space: tuple[int, ...],
    tables: Tables,
    q: Array,
    v: Array,
    w: Array,
    inputs: Inputs,
    n: int,
    f: Array,
) -> None:
    """Make f the forces that drives exert on driven vectors; elsewhere it means nothing."""
    set_given(space, tables, q, v, inputs, n, f)
    subtract_beside(space, tables, q, v, w, f)
    subtract_rigid_inertia(tables.elements, w, f)
    add_row_forces(tables.rows, f)
    for k in range(f.shape[0]):
        for i in range(f.shape[1]):
            f[k, i] = -f[k, i]
