"""Arrays that kernels write into, once more: what one run fills is no other run's."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
#: Arrays of a copy, made one after another, each from those before.
Makers = list[Callable[[list[Any]], Any]]


def writes(*names: str) -> Callable[[type[T]], type[T]]:
    """Say of a named tuple which of its fields kernels write into; the others, runs may share."""

    def say(kind: type[T]) -> type[T]:
        kind.written = names  # type: ignore[attr-defined]
        return kind

    return say


def copier(thing: T) -> Callable[[], T]:
    """What makes copies of tuples of arrays, with arrays of their own; those that share memory do so again.

    Parameters
    ----------
    thing : tuple, ndarray or other
        Tuples are gone through, of named ones only what kernels write into, where `writes` says that: the rest is
        taken as it is. So is what is no array.
    """
    makers: Makers = []
    build = _builder(thing, makers, {})

    def copy() -> T:
        arrays: list[Any] = []
        for make in makers:
            arrays.append(make(arrays))
        return build(arrays)  # type: ignore[no-any-return]

    return copy


def _builder(thing: Any, makers: Makers, places: dict[int, int]) -> Callable[[list[Any]], Any]:
    """What puts a thing together of the arrays that the makers make; they are added, and their places by identity."""
    if isinstance(thing, np.ndarray):
        place = _place(thing, makers, places)
        return lambda arrays: arrays[place]
    if not isinstance(thing, tuple):
        return lambda _: thing
    names = getattr(thing, "_fields", range(len(thing)))
    written = getattr(thing, "written", names)
    parts = [(k, _builder(thing[k], makers, places)) for k, name in enumerate(names) if name in written]
    make = getattr(thing, "_make", tuple)

    def build(arrays: list[Any]) -> Any:
        fresh = list(thing)
        for k, part in parts:
            fresh[k] = part(arrays)
        return make(fresh)

    return build


def _place(array: Any, makers: Makers, places: dict[int, int]) -> int:
    """Where a copy of an array stands: of one that is part of another, the same part of the other's copy."""
    if id(array) not in places:
        base = array.base
        if isinstance(base, np.ndarray):
            makers.append(_part(array, base, _place(base, makers, places)))
        else:
            makers.append(lambda _: array.copy(order="K"))
        places[id(array)] = len(makers) - 1
    return places[id(array)]


def _part(array: Any, base: Any, of: int) -> Callable[[list[Any]], Any]:
    """What makes that part of a base's copy that an array is of the base."""
    shape, kind, strides = array.shape, array.dtype, array.strides
    alike = array.size == base.size and kind == base.dtype
    if alike and array.flags.c_contiguous and base.flags.c_contiguous:
        return lambda arrays: arrays[of].reshape(shape)
    offset = array.__array_interface__["data"][0] - base.__array_interface__["data"][0]
    return lambda arrays: np.ndarray(shape, kind, arrays[of], offset, strides)
