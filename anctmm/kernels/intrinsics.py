"""What numba does not offer by itself: the only module that uses its and llvmlite's insides.

- Small arrays on the stack: a loop of constant length over one is unrolled, and its numbers stay in registers.
- Tables by their address: a call passes one number in the place of all arrays of a named tuple.
- Calls of C functions by their address.
"""

from typing import Any

from llvmlite import ir
from numba import extending, types
from numba.core import cgutils, errors
from numba.core.typing.templates import AttributeTemplate
from numba.np.arrayobj import make_array, populate_array


def _on_stack(context: Any, builder: Any, kind: Any, shape: tuple[int, ...]) -> Any:
    """An array of doubles in the frame of the function that is compiled, not set to zero."""
    array, length = make_array(kind)(context, builder), shape[0] * (shape[1] if len(shape) == 2 else 1)
    memory = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), length))
    data, strides = builder.bitcast(memory, ir.DoubleType().as_pointer()), (8 * shape[-1], 8)[-len(shape) :]
    sizes, steps, (item,) = (
        [context.get_constant(types.intp, n) for n in each] for each in (shape, strides, (8,))
    )
    populate_array(array, data, sizes, steps, item, None)
    return array._getvalue()


def _vector(typingctx: Any, size: Any) -> Any:
    """An array on the stack with as many numbers as the tuple `size` has."""
    kind = types.Array(types.float64, 1, "C")
    return kind(size), lambda context, builder, *_: _on_stack(context, builder, kind, (size.count,))


def _matrix(typingctx: Any, size: Any, width: Any) -> Any:
    """The same with as many rows as `size` has entries, and as many columns as `width` has."""
    kind, shape = types.Array(types.float64, 2, "C"), (size.count, width.count)
    return kind(size, width), lambda context, builder, *_: _on_stack(context, builder, kind, shape)


class Reference(types.Type):
    """The address of a named tuple, whose type is `dtype`."""

    def __init__(self, dtype: Any) -> None:
        self.dtype = dtype
        super().__init__(f"Reference({dtype})")


extending.register_model(Reference)(extending.models.PointerModel)


@extending.infer_getattr
class _Fields(AttributeTemplate):
    """Types of its entries."""

    key = Reference

    def generic_resolve(self, reference: Any, name: str) -> Any:  # type: ignore[override]
        fields = reference.dtype.fields
        return reference.dtype.types[fields.index(name)] if name in fields else None


@extending.lower_getattr_generic(Reference)
def _entry(context: Any, builder: Any, kind: Any, address: Any, name: str) -> Any:
    return builder.load(cgutils.gep_inbounds(builder, address, 0, kind.dtype.fields.index(name)))


@extending.unbox(Reference)
def _unbox(kind: Any, value: Any, c: Any) -> Any:
    number, form = c.pyapi.object_getattr_string(value, "address"), c.context.get_value_type(kind)
    read = cgutils.is_not_null(c.builder, number)
    found = cgutils.alloca_once_value(c.builder, ir.Constant(form, None))
    with cgutils.if_likely(c.builder, read):  # not where Ctrl-C is pressed while Python evaluates the address
        c.builder.store(c.builder.bitcast(c.pyapi.long_as_voidptr(number), form), found)
        c.pyapi.decref(number)
    return extending.NativeValue(c.builder.load(found), is_error=c.builder.not_(read))


def _called(result: Any, address: Any, given: tuple[Any, ...]) -> Any:
    """A call of a C function; arrays, which it gets whole, must be contiguous as its signature says."""
    kinds = tuple(types.unliteral(kind) for kind in given)
    if any(isinstance(kind, types.Array) and kind.layout != "C" for kind in kinds):
        raise errors.TypingError(f"a C function gets {kinds}; arrays must be contiguous")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        passed = cgutils.unpack_tuple(builder, arguments[1], len(kinds))
        function = ir.FunctionType(context.get_value_type(result), [x.type for x in passed])
        found = builder.call(builder.inttoptr(arguments[0], function.as_pointer()), passed)
        return found if result is types.float64 else context.get_dummy_value()

    return result(address, types.StarArgTuple.from_types(kinds)), generate


def _call(typing: Any, address: Any, *given: Any) -> Any:
    """Call a C function without a result at an address."""
    return _called(types.void, address, given)


def _call_number(typing: Any, address: Any, *given: Any) -> Any:
    """Call a C function of a number at an address."""
    return _called(types.float64, address, given)


#: To type checkers they are functions of their first argument, the context of the compiler, too.
vector: Any = extending.intrinsic(_vector)
matrix: Any = extending.intrinsic(_matrix)
call: Any = extending.intrinsic(_call)
call_number: Any = extending.intrinsic(_call_number)
