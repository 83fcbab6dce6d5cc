"""Types of named tuples that kernels receive by their address (`by_address`), as numba needs them."""

import hashlib
from collections.abc import Callable
from functools import cache
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import register_default
from numba.core.datamodel.models import PrimitiveModel
from numba.core.imputils import impl_ret_borrowed
from numba.core.pythonapi import NativeValue, unbox
from numba.core.registry import cpu_target
from numba.core.typing.typeof import Purpose, typeof_impl
from numba.extending import lower_builtin, lower_getattr_generic

#: Alignment of what is kept, bytes, and its type.
_WORD = 8
_BYTE = ir.IntType(8)


class ByAddress(types.NamedTuple):  # type: ignore[misc]
    """The type of a named tuple of which kernels are handed the address."""

    def __init__(self, members: list[Any], kind: type) -> None:
        super().__init__(members, kind)
        self._digest = hashlib.blake2s(self.name.encode(), digest_size=8).hexdigest()

    @property
    def mangling_args(self) -> tuple[str, tuple[()]]:
        """What names of functions say of it."""
        return f"{self.instance_class.__name__}_{self._digest}", ()

    def __eq__(self, other: object) -> bool:
        return self is other or bool(super().__eq__(other))

    def __hash__(self) -> int:
        return int(self._digest[:15], 16)


def told(kind: type) -> None:
    """Tell numba that kernels are handed the address of such tuples."""

    def typed(value: Any, asked: Any) -> Any:
        members = [typeof_impl(one, asked) for one in value]
        if any(one is None for one in members):
            return None
        if asked.purpose is Purpose.constant:
            return types.BaseTuple.from_types(members, type(value))
        return ByAddress(members, type(value))

    typeof_impl.register(kind)(typed)


@register_default(ByAddress)
class _Model(PrimitiveModel):  # type: ignore[misc]
    """An address, for the compiler."""

    def __init__(self, manager: Any, kind: ByAddress) -> None:
        super().__init__(manager, kind, _BYTE.as_pointer())

    def from_argument(self, builder: Any, value: Any) -> Any:
        """Tell of an argument that nobody writes there, and that it can be read anywhere."""
        if isinstance(value, ir.Argument):
            for told in ("noalias", "nonnull"):
                value.add_attribute(told)
            value.attributes.align = _WORD
            value.attributes.dereferenceable = _places(self._fe_type)[-1]
        return value


@cache
def _places(kind: ByAddress) -> list[int]:
    """Where the members of a tuple stand, and where the next would, bytes."""
    context, places = cpu_target.target_context, [0]
    for member in kind.types:
        size = _places(member)[-1] if isinstance(member, ByAddress) else _size(context, member)
        places.append(places[-1] + (size + _WORD - 1) // _WORD * _WORD)
    places[-1] = max(places[-1], _WORD)
    return places


def _size(context: Any, member: Any) -> int:
    return int(context.get_abi_sizeof(context.get_value_type(member)))


def _address(context: Any, builder: Any, kind: ByAddress, value: Any, k: int) -> Any:
    """Where a member stands: a pointer to it, or its own address where it is such a tuple."""
    place = builder.gep(value, [ir.Constant(ir.IntType(64), _places(kind)[k])], inbounds=True)
    member = kind.types[k]
    if isinstance(member, ByAddress):
        return place
    return builder.bitcast(place, context.get_value_type(member).as_pointer())


def _member(context: Any, builder: Any, kind: ByAddress, value: Any, k: int) -> Any:
    member, place = kind.types[k], _address(context, builder, kind, value, k)
    found = place if isinstance(member, ByAddress) else builder.load(place)
    return impl_ret_borrowed(context, builder, member, found)


@lower_getattr_generic(ByAddress)
def _field(context: Any, builder: Any, kind: ByAddress, value: Any, name: str) -> Any:
    return _member(context, builder, kind, value, kind.fields.index(name))


@lower_builtin("static_getitem", ByAddress, types.IntegerLiteral)
def _item(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    kind, (value, k) = signature.args[0], arguments
    return _member(context, builder, kind, value, k % len(kind))


@unbox(ByAddress)
def _unbox(kind: ByAddress, given: Any, c: Any) -> NativeValue:
    """Put a tuple where kernels read it: in the frame of the call from Python."""
    words = ir.ArrayType(ir.IntType(64), _places(kind)[-1] // _WORD)
    place = c.builder.bitcast(cgutils.alloca_once(c.builder, words), _BYTE.as_pointer())
    cleanups: list[Callable[[], None]] = []
    wrong = _put(kind, given, place, c, cleanups)
    with c.builder.if_then(wrong, likely=False), cgutils.if_unlikely(c.builder, _nothing_told(c)):
        c.pyapi.err_set_string("PyExc_TypeError", f"{kind.instance_class.__name__}: a member is no array")

    def cleanup() -> None:
        for one in reversed(cleanups):
            one()

    return NativeValue(place, cleanup=cleanup if cleanups else None, is_error=wrong)


def _nothing_told(c: Any) -> Any:
    """Whether no exception tells yet what was wrong: other members than arrays raise their own."""
    return cgutils.is_null(c.builder, c.pyapi.err_occurred())


def _put(kind: ByAddress, given: Any, value: Any, c: Any, cleanups: list[Callable[[], None]]) -> Any:
    """Put the members where they are read; whether that failed of any."""
    wrong: Any = cgutils.false_bit
    for k, member in enumerate(kind.types):
        one, place = c.pyapi.tuple_getitem(given, k), _address(c.context, c.builder, kind, value, k)
        if isinstance(member, ByAddress):
            failed = _put(member, one, place, c, cleanups)
        elif isinstance(member, types.Array):
            failed = _put_array(member, one, place, c, cleanups)
        else:
            native = c.unbox(member, one)
            c.builder.store(native.value, place)
            failed = native.is_error
            cleanups += [] if native.cleanup is None else [native.cleanup]
        wrong = c.builder.or_(wrong, failed)
    return wrong


def _put_array(kind: Any, given: Any, place: Any, c: Any, cleanups: list[Callable[[], None]]) -> Any:
    """Put an array's numbers in their place at once: numba's own way is some fifty instructions for each array."""
    pointer = c.builder.bitcast(place, c.pyapi.voidptr)
    if not c.context.enable_nrt:
        return cgutils.is_not_null(c.builder, c.pyapi.numba_array_adaptor(given, pointer))

    def give_back() -> None:  # what numba takes of an argument it gives back, but it does not see these
        c.context.nrt.decref(c.builder, kind, c.builder.load(place))

    cleanups.append(give_back)
    return cgutils.is_not_null(c.builder, c.pyapi.nrt_adapt_ndarray_from_python(given, pointer))
