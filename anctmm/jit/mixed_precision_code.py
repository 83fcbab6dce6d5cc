"""Implementations that kernels call in place of functions of `mixed_precision`."""

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from anctmm.jit.compiling import chosen_by_types
from anctmm.jit.mixed_precision import WIDTH, in_double


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
