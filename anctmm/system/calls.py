"""Functions of the equations that are compiled once, and called by their address.

What is called in the usual way becomes part of the machine code of each of its callers, and is compiled with them.
Here each function has the name of the one that it calls, whose docstring describes it.
"""

from collections import namedtuple
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import typeof, types
from numpy.typing import NDArray

from anctmm.kernels.by_address import by_address
from anctmm.kernels.intrinsics import call, call_number
from anctmm.kernels.options import c_function, kernel, part
from anctmm.system import acting, elastic, matrix, rows
from anctmm.system.tables import Inputs

Array = NDArray[np.float64]
Zeros = tuple[int, ...]

_A, _V = types.Array(types.float64, 2, "C"), types.Array(types.float64, 1, "C")
_NUMBER, _NONE = types.float64, types.void
_GIVEN = ("inputs", types.int64)  # and which time of them

#: Inputs of no particular scene, for their type.
INPUTS = Inputs(np.zeros(1), np.zeros((1, 1, 3)), np.zeros((1, 0, 2)), np.zeros((1, 0, 2)))
#: The functions, their results, and the types of their arguments; names are those of what a scene has.
FUNCTIONS: list[tuple[Callable[..., Any], Any, tuple[Any, ...]]] = [
    (elastic.subtract_elastic, _NONE, ("space", "elements", _A, _A)),
    (elastic.subtract_damping, _NONE, ("space", "elements", _A, _A, _A)),
    (elastic.subtract_beside, _NONE, ("space", "elements", "driven", _A, _A, _A, _A)),
    (elastic.add_mass, _NONE, ("size", "space", "elements", _NUMBER, _V)),
    (elastic.add_tangent, _NONE, ("size", "space", "elements", _A, _NUMBER, _NUMBER, _V)),
    (elastic.kinetic_energy, _NUMBER, ("space", "elements", _A, _A)),
    (elastic.strain_energy, _NUMBER, ("elements", _A)),
    (acting.add_loads, _NONE, ("space", "acting", _A, _A, _A)),
    (acting.add_connectors, _NONE, ("space", "acting", _A, _A, _A, _NUMBER, _A)),
    (acting.add_acting_tangents, _NONE, ("size", "space", "acting", _A, _A, *_GIVEN, _NUMBER, _NUMBER, _V)),
    (acting.work_done, _NONE, ("space", "acting", types.boolean, _A, *_GIVEN, _V)),
    (acting.power, _NONE, ("space", "acting", _A, _A, *_GIVEN, _V)),
    (rows.set_rows, _NUMBER, ("rows", _A, _A)),
    (rows.set_jacobian, _NONE, ("rows", _A, _A)),
    (rows.set_rates, _NUMBER, ("rows", _A, _A, _A)),
    (rows.set_accelerations, _NONE, ("rows", _A, _A, _A, _A)),
    (rows.drive_power, _NUMBER, ("rows", _A, _A)),
    (rows.drive_work, _NUMBER, ("rows", _A, _A, types.boolean, _A)),
    (matrix.add_rows, _NONE, ("size", "rows", _V, _NUMBER, _NUMBER, _A)),
    (matrix.factorize_matrix, _NUMBER, ("size", "matrix")),
    (matrix.solve_for, _NONE, ("size", "space", "matrix", "rows", _A)),
]
#: Their addresses, by their names.
Calls: Any = by_address(namedtuple("Calls", [function.__name__ for function, _, _ in FUNCTIONS]))


def calls_of(size: Zeros, space: Zeros, parts: dict[str, Any]) -> Any:
    """Addresses of all functions for a scene; parts: what it has, by the names in `FUNCTIONS`."""
    given = {"size": size, "space": space, "inputs": INPUTS, **parts}
    return Calls(*_addresses(tuple((name, typeof(one)) for name, one in given.items())))


@cache
def _addresses(kinds: tuple[tuple[str, Any], ...]) -> list[int]:
    """The same by names and types of what a scene has."""
    known = dict(kinds)
    compiled = [
        c_function(result(*(known[one] if isinstance(one, str) else one for one in arguments)), function)
        for function, result, arguments in FUNCTIONS
    ]
    return [int(one.address) for one in compiled]


@part
def subtract_elastic(space, tables, q, f):  # type: ignore[no-untyped-def]
    """See `anctmm.system.elastic`."""
    call(tables.calls.subtract_elastic, space, tables.elements, q, f)


@part
def subtract_damping(space, tables, q, v, f):  # type: ignore[no-untyped-def]
    """See `anctmm.system.elastic`."""
    call(tables.calls.subtract_damping, space, tables.elements, q, v, f)


@part
def subtract_beside(space, tables, q, v, w, f):  # type: ignore[no-untyped-def]
    """See `anctmm.system.elastic`."""
    call(tables.calls.subtract_beside, space, tables.elements, tables.driven, q, v, w, f)


@part
def add_mass(size, space, tables, factor):  # type: ignore[no-untyped-def]
    """See `anctmm.system.elastic`."""
    call(tables.calls.add_mass, size, space, tables.elements, factor, tables.matrix.flat)


@part
def add_tangent(size, space, tables, q, stiffness, damping):  # type: ignore[no-untyped-def]
    """See `anctmm.system.elastic`."""
    flat, address = tables.matrix.flat, tables.calls.add_tangent
    call(address, size, space, tables.elements, q, stiffness, damping, flat)


@part
def kinetic_energy(space, tables, v, scratch):  # type: ignore[no-untyped-def]
    """See `anctmm.system.elastic`."""
    return call_number(tables.calls.kinetic_energy, space, tables.elements, v, scratch)


@kernel
def strain_energy(tables, q):  # type: ignore[no-untyped-def]
    """See `anctmm.system.elastic`."""
    return call_number(tables.calls.strain_energy, tables.elements, q)


@part
def add_loads(space, tables, q, values, f):  # type: ignore[no-untyped-def]
    """See `anctmm.system.acting`."""
    call(tables.calls.add_loads, space, tables.acting, q, values, f)


@part
def add_connectors(space, tables, q, v, free, t, f):  # type: ignore[no-untyped-def]
    """See `anctmm.system.acting`."""
    call(tables.calls.add_connectors, space, tables.acting, q, v, free, t, f)


@part
def add_acting_tangents(size, space, tables, q, v, inputs, n, stiffness, damping):  # type: ignore[no-untyped-def]
    """See `anctmm.system.acting`."""
    flat, address = tables.matrix.flat, tables.calls.add_acting_tangents
    call(address, size, space, tables.acting, q, v, inputs, n, stiffness, damping, flat)


@part
def work_done(space, tables, moving, q, inputs, n, out):  # type: ignore[no-untyped-def]
    """See `anctmm.system.acting`."""
    call(tables.calls.work_done, space, tables.acting, moving, q, inputs, n, out)


@part
def power(space, tables, q, v, inputs, n, out):  # type: ignore[no-untyped-def]
    """See `anctmm.system.acting`."""
    call(tables.calls.power, space, tables.acting, q, v, inputs, n, out)


@part
def set_rows(tables, q, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    return call_number(tables.calls.set_rows, tables.rows, q, signals)


@part
def set_jacobian(tables, q, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    call(tables.calls.set_jacobian, tables.rows, q, signals)


@part
def set_rates(tables, q, v, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    return call_number(tables.calls.set_rates, tables.rows, q, v, signals)


@part
def set_accelerations(tables, q, v, w, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    call(tables.calls.set_accelerations, tables.rows, q, v, w, signals)


@part
def drive_power(tables, q, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    return call_number(tables.calls.drive_power, tables.rows, q, signals)


@part
def drive_work(tables, q, signals, moving, memory):  # type: ignore[no-untyped-def]
    """See `anctmm.system.rows`."""
    return call_number(tables.calls.drive_work, tables.rows, q, signals, moving, memory)


@part
def add_rows(size, tables, mass, stiffness, signals):  # type: ignore[no-untyped-def]
    """See `anctmm.system.matrix`."""
    call(tables.calls.add_rows, size, tables.rows, tables.matrix.flat, mass, stiffness, signals)


@kernel
def factorize_matrix(size, tables):  # type: ignore[no-untyped-def]
    """See `anctmm.system.matrix`."""
    return int(call_number(tables.calls.factorize_matrix, size, tables.matrix))


@part
def solve_for(size, space, tables, x):  # type: ignore[no-untyped-def]
    """See `anctmm.system.matrix`."""
    call(tables.calls.solve_for, size, space, tables.matrix, tables.rows, x)
