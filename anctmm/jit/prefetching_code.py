"""Implementations that kernels call in place of functions of `prefetching`."""

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from anctmm.jit.compiling import chosen_by_types
from anctmm.jit.prefetching import LINE, prefetch_columns, prefetch_row

#: Length of a line of the cache, bytes.
_LINE = 8 * LINE


@intrinsic
def _prefetch(typingctx: Any, array: Any, row: Any, byte: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        matrix = context.make_array(signature.args[0])(context, builder, arguments[0])
        integer, pointer = ir.IntType(32), ir.IntType(8).as_pointer()
        stride = cgutils.unpack_tuple(builder, matrix.strides)[0]
        offset = builder.add(builder.mul(stride, arguments[1]), arguments[2])
        place = builder.gep(builder.bitcast(matrix.data, pointer), [offset])
        kind = ir.FunctionType(ir.VoidType(), [pointer, integer, integer, integer])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
        builder.call(function, [place, integer(0), integer(3), integer(1)])  # to read, keep near, data
        return context.get_dummy_value()

    return types.void(array, types.int64, types.int64), codegen


@chosen_by_types(prefetch_row)
def _prefetch_row(array, row):  # type: ignore[no-untyped-def]
    def every_line(array, row):  # type: ignore[no-untyped-def]
        for line in range((array.itemsize * array.shape[1] + _LINE - 1) // _LINE):
            _prefetch(array, row, _LINE * line)  # type: ignore[call-arg]

    return every_line


@chosen_by_types(prefetch_columns)
def _prefetch_columns(array, column):  # type: ignore[no-untyped-def]
    def every_row(array, column):  # type: ignore[no-untyped-def]
        for row in range(array.shape[0]):
            _prefetch(array, row, 8 * column)  # type: ignore[call-arg]

    return every_row
