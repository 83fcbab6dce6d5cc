"""Functions of the equations that are compiled once, and called by their address.

What is called in the usual way becomes part of the machine code of each of its callers, and is compiled with them.
Here each function has the name of the one that it calls, whose docstring describes it.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import typeof, types
from numpy.typing import NDArray

from anctmm.kernels.intrinsics import call, call_number
from anctmm.kernels.options import c_function, kernel, part
from anctmm.system import acting, elastic, forces, rows, tangents
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]
Zeros = tuple[int, ...]

_A, _V = types.Array(types.float64, 2, "C"), types.Array(types.float64, 1, "C")
_NUMBER, _NONE = types.float64, types.void
_GIVEN = ("inputs", types.int64)  # and which time of them

#: Inputs of no particular scene, for their type.
INPUTS = Inputs(np.zeros(1), np.zeros((1, 1, 3)), np.zeros((1, 0, 2)), np.zeros((1, 0, 2)))
#: The functions, their results, and the types of their arguments; names are those of what `System` has.
FUNCTIONS: list[tuple[Callable[..., Any], Any, tuple[Any, ...]]] = [
    (forces.set_forces, _NONE, ("space", "tables", _A, _A, *_GIVEN, _A)),
    (forces.set_reactions, _NONE, ("space", "tables", _A, _A, _A, *_GIVEN, _A)),
    (tangents.set_matrix, _NONE, ("size", "space", "tables", _A, _A, *_GIVEN, *3 * (_NUMBER,))),
    (tangents.factorize_matrix, _NUMBER, ("size", "tables")),
    (tangents.solve_for, _NONE, ("size", "space", "tables", _A)),
    (rows.set_rows, _NUMBER, ("rows", _A, _A)),
    (rows.set_jacobian, _NONE, ("rows", _A, _A)),
    (rows.set_rates, _NUMBER, ("rows", _A, _A, _A)),
    (rows.set_accelerations, _NONE, ("rows", _A, _A, _A, _A)),
    (rows.drive_power, _NUMBER, ("rows", _A, _A)),
    (rows.drive_work, _NUMBER, ("rows", _A, _A, types.boolean, _A)),
    (acting.work_done, _NONE, ("space", "acting", types.boolean, _A, *_GIVEN, _V)),
    (acting.power, _NONE, ("space", "acting", _A, _A, *_GIVEN, _V)),
    (elastic.kinetic_energy, _NUMBER, ("space", "elements", _A, _A)),
    (elastic.strain_energy, _NUMBER, ("elements", _A)),
]
#: Their places.
(
    FORCES, REACTIONS, MATRIX, FACTORIZE, SOLVE, ROWS, JACOBIAN, RATES, ACCELERATIONS, DRIVE_POWER, DRIVE_WORK,
    WORK, POWER, KINETIC, STRAIN,
) = range(len(FUNCTIONS))  # fmt: skip


def addresses_of(size: Zeros, space: Zeros, tables: Tables) -> NDArray[np.int64]:
    """Addresses of all functions for a scene."""
    groups = (tables.elements, tables.rows, tables.acting)
    return _addresses(*map(typeof, (size, space, tables, INPUTS, *groups)))


@cache
def _addresses(
    size: Any, space: Any, tables: Any, inputs: Any, elements: Any, rows: Any, acting: Any
) -> NDArray[np.int64]:
    """The same by the types of what `FUNCTIONS` names."""
    known = locals()
    compiled = [
        c_function(result(*(known[one] if isinstance(one, str) else one for one in arguments)), function)
        for function, result, arguments in FUNCTIONS
    ]
    return np.array([one.address for one in compiled], dtype=np.int64)


@part
def set_forces(space, tables, q, v, inputs, n, f):  # type: ignore[no-untyped-def]
    """See `anctmm.system.forces`."""
    call(tables.calls[FORCES], space, tables, q, v, inputs, n, f)


@part
def set_reactions(space, tables, q, v, w, inputs, n, f):  # type: ignore[no-untyped-def]
    """See `anctmm.system.forces`."""
    call(tables.calls[REACTIONS], space, tables, q, v, w, inputs, n, f)


@kernel
def set_matrix(size, space, tables, q, v, inputs, n, mass, stiffness, rate):  # type: ignore[no-untyped-def]
    """See `anctmm.system.tangents`."""
    address = tables.calls[MATRIX]
    call(address, size, space, tables, q, v, inputs, n, mass, stiffness, rate)


@kernel
def factorize_matrix(size, tables):  # type: ignore[no-untyped-def]
    """See `anctmm.system.tangents`."""
    return int(call_number(tables.calls[FACTORIZE], size, tables))


@part
def solve_for(size, space, tables, x):  # type: ignore[no-untyped-def]
    """See `anctmm.system.tangents`."""
    call(tables.calls[SOLVE], size, space, tables, x)


@part
def set_rows(tables, q, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    return call_number(tables.calls[ROWS], tables.rows, q, signals)


@part
def set_jacobian(tables, q, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    call(tables.calls[JACOBIAN], tables.rows, q, signals)


@part
def set_rates(tables, q, v, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    return call_number(tables.calls[RATES], tables.rows, q, v, signals)


@part
def set_accelerations(tables, q, v, w, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    call(tables.calls[ACCELERATIONS], tables.rows, q, v, w, signals)


@part
def drive_power(tables, q, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    return call_number(tables.calls[DRIVE_POWER], tables.rows, q, signals)


@part
def drive_work(tables, q, signals, moving, memory):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    return call_number(tables.calls[DRIVE_WORK], tables.rows, q, signals, moving, memory)


@part
def work_done(space, tables, moving, q, inputs, n, out):  # type: ignore[no-untyped-def]
    """See `anctmm.system.acting`."""
    call(tables.calls[WORK], space, tables.acting, moving, q, inputs, n, out)


@part
def power(space, tables, q, v, inputs, n, out):  # type: ignore[no-untyped-def]
    """See `anctmm.system.acting`."""
    call(tables.calls[POWER], space, tables.acting, q, v, inputs, n, out)


@part
def kinetic_energy(space, tables, v, scratch):  # type: ignore[no-untyped-def]
    """See `anctmm.system.elastic`."""
    return call_number(tables.calls[KINETIC], space, tables.elements, v, scratch)


@kernel
def strain_energy(tables, q):  # type: ignore[no-untyped-def]
    """See `anctmm.system.elastic`."""
    return call_number(tables.calls[STRAIN], tables.elements, q)
