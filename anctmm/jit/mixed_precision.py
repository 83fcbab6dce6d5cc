"""Rows of a matrix in single precision, read in double, four numbers by one instruction.

Numba's own conversion takes one number at a time, which costs more than the memory that single precision saves.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from anctmm.jit.compiling import chosen_by_types

Array = NDArray[np.float64]

#: Numbers converted at once: rows in single precision must have a multiple of it.
WIDTH = 4


def in_double(array: NDArray[Any], row: int, wide: Array, place: int) -> tuple[Array, int]:
    """A C-ordered matrix in double precision, and its row with the numbers that `array` has in its row `row`.

    Parameters
    ----------
    array : ndarray of float64 or float32, shape (rows, n)
        n a multiple of WIDTH if of float32.
    row : int
    wide : ndarray, shape (places, ≥ n)
        Scratch, written if numbers must be converted.
    place : int
        Row of the scratch.
    """
    if array.dtype == np.float64:
        return array, row
    wide[place, : array.shape[1]] = array[row]
    return wide, place


@intrinsic
def _widen(typingctx: Any, array: Any, row: Any, wide: Any, place: Any, column: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        source, i, target, j, k = arguments
        single = ir.VectorType(ir.FloatType(), WIDTH)
        double = ir.VectorType(ir.DoubleType(), WIDTH)
        origin = _place(context, builder, signature.args[0], source, i, k, single)
        there = _place(context, builder, signature.args[2], target, j, k, double)
        builder.store(builder.fpext(builder.load(origin, align=4), double), there, align=8)
        return context.get_dummy_value()

    return types.void(array, types.int64, wide, types.int64, types.int64), codegen


def _place(context: Any, builder: Any, kind: Any, value: Any, row: Any, column: Any, vector: Any) -> Any:
    """Pointer to the vector that begins at a number of a C-ordered matrix."""
    matrix = context.make_array(kind)(context, builder, value)
    width = builder.extract_value(matrix.shape, 1)
    number = builder.gep(matrix.data, [builder.add(builder.mul(row, width), column)])
    return builder.bitcast(number, vector.as_pointer())


@chosen_by_types(in_double)
def _in_double(array, row, wide, place):  # type: ignore[no-untyped-def]
    if array.dtype == types.float64:
        return lambda array, row, wide, place: (array, row)

    def widened(array, row, wide, place):  # type: ignore[no-untyped-def]
        for k in range(0, array.shape[1], WIDTH):
            _widen(array, row, wide, place, k)  # type: ignore[call-arg]
        return wide, place

    return widened
