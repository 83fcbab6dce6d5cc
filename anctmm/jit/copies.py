"""Arrays that kernels write into, once more: what one run fills is no other run's."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

import numpy as np

T = TypeVar("T")
#: What makes one array of a copy, from those before it.
Maker = Callable[[list[Any]], Any]


def writes(*names: str) -> Callable[[type[T]], type[T]]:
    """Say of a named tuple which of its fields kernels write into; the others, runs may share."""

    def say(kind: type[T]) -> type[T]:
        kind.written = names  # type: ignore[attr-defined]
        return kind

    return say


class Copies(Generic[T]):
    """Copies of tuples of arrays, with arrays of their own; those that share memory do so again.

    Parameters
    ----------
    thing : tuple, ndarray or other
        Tuples are gone through, of named ones only what kernels write into, where `writes` says that: the rest is
        taken as it is. So is what is no array. Nothing is written into it.
    """

    def __init__(self, thing: T) -> None:
        self._makers: list[Maker] = []
        self._owners: dict[int, Any] = {}
        self._places: dict[int, int] = {}
        self._build = self._builder(thing)
        self._returned: list[tuple[list[Any], T]] = []

    @contextmanager
    def one(self) -> Iterator[T]:
        """A copy for the context alone; unless an exception ends it, a later one may be of the same arrays."""
        try:
            arrays, copy = self._returned.pop()
        except IndexError:
            arrays, copy = self._new()
        else:
            for place, first in self._owners.items():
                arrays[place][...] = first
        yield copy
        self._returned.append((arrays, copy))

    def _new(self) -> tuple[list[Any], T]:
        """New arrays and a copy made of them."""
        arrays: list[Any] = []
        for make in self._makers:
            arrays.append(make(arrays))
        return arrays, self._build(arrays)

    def _builder(self, thing: Any) -> Callable[[list[Any]], Any]:
        """What puts a thing together of the arrays that the makers make; these are added."""
        if isinstance(thing, np.ndarray):
            place = self._place(thing)
            return lambda arrays: arrays[place]
        if not isinstance(thing, tuple):
            return lambda _: thing
        names = getattr(thing, "_fields", range(len(thing)))
        written = getattr(thing, "written", names)
        parts = [(k, self._builder(thing[k])) for k, name in enumerate(names) if name in written]
        make = getattr(thing, "_make", tuple)

        def build(arrays: list[Any]) -> Any:
            fresh = list(thing)
            for k, part in parts:
                fresh[k] = part(arrays)
            return make(fresh)

        return build

    def _place(self, array: Any) -> int:
        """Where a copy of an array stands: of one that is part of another, the same part of the other's copy."""
        if id(array) not in self._places:
            base = array.base
            if isinstance(base, np.ndarray):
                self._makers.append(_part(array, base, self._place(base)))
            else:
                self._owners[len(self._makers)] = array
                self._makers.append(lambda _: array.copy(order="K"))
            self._places[id(array)] = len(self._makers) - 1
        return self._places[id(array)]


def _part(array: Any, base: Any, of: int) -> Maker:
    """What makes that part of a base's copy that an array is of the base."""
    shape, kind, strides = array.shape, array.dtype, array.strides
    alike = array.size == base.size and kind == base.dtype
    if alike and array.flags.c_contiguous and base.flags.c_contiguous:
        return lambda arrays: arrays[of].reshape(shape)
    offset = array.__array_interface__["data"][0] - base.__array_interface__["data"][0]
    return lambda arrays: np.ndarray(shape, kind, arrays[of], offset, strides)
