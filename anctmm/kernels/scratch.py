"""Small arrays on the stack, and calls of C functions: the only module that uses numba's and llvmlite's insides.

A loop of constant length over such an array is unrolled, and its numbers stay in registers.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array


def _on_stack(context: Any, builder: Any, kind: Any, shape: tuple[int, ...]) -> Any:
    """An array of doubles in the frame of the function that is compiled."""
    count = shape[0] * (shape[1] if len(shape) == 2 else 1)
    memory = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), count))
    strides = (8,) if len(shape) == 1 else (8 * shape[1], 8)
    array = make_array(kind)(context, builder)
    populate_array(
        array,
        data=builder.bitcast(memory, ir.DoubleType().as_pointer()),
        shape=[context.get_constant(types.intp, n) for n in shape],
        strides=[context.get_constant(types.intp, n) for n in strides],
        itemsize=context.get_constant(types.intp, 8),
        meminfo=None,
    )
    return array._getvalue()


def _vector(typingctx: Any, size: Any) -> Any:
    """An array on the stack with as many numbers as the tuple `size` has, not set to zero."""
    kind = types.Array(types.float64, 1, "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _on_stack(context, builder, kind, (size.count,))

    return kind(size), generate


def _matrix(typingctx: Any, size: Any, width: Any) -> Any:
    """The same with as many rows as `size` has entries, and as many columns as `width` has."""
    kind = types.Array(types.float64, 2, "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _on_stack(context, builder, kind, (size.count, width.count))

    return kind(size, width), generate


def _call_element(
    typingctx: Any,
    address: Any,
    q: Any,
    v: Any,
    first: Any,
    count: Any,
    constants: Any,
    factor: Any,
    out: Any,
) -> Any:
    """Call a compiled element kernel at an address: see `anctmm.elements.compiled`."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = {k: make_array(signature.args[k])(context, builder, arguments[k]) for k in (1, 2, 5, 7)}
        nodes = cgutils.unpack_tuple(builder, arrays[1].shape)[1]
        number, whole = ir.DoubleType(), nodes.type
        pointer = number.as_pointer()
        kinds = [pointer, pointer, whole, whole, whole, pointer, number, pointer]
        function = builder.inttoptr(arguments[0], ir.FunctionType(ir.VoidType(), kinds).as_pointer())
        given = [
            arrays[1].data,
            arrays[2].data,
            nodes,
            arguments[3],
            arguments[4],
            arrays[5].data,
            arguments[6],
        ]
        builder.call(function, [*given, arrays[7].data])
        return context.get_dummy_value()

    return types.void(address, q, v, types.intp, types.intp, constants, types.float64, out), generate


def _call_address(typingctx: Any, address: Any, elongation: Any, rate: Any, t: Any) -> Any:
    """Value of a compiled function of three numbers at an address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = ir.DoubleType()
        function = ir.FunctionType(number, [number, number, number])
        return builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])

    return types.float64(types.int64, types.float64, types.float64, types.float64), generate


#: To type checkers they are functions of their first argument, the context of the compiler, too.
vector: Any = intrinsic(_vector)
matrix: Any = intrinsic(_matrix)
call_element: Any = intrinsic(_call_element)
call_address: Any = intrinsic(_call_address)
