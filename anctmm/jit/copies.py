"""Copies of arrays that kernels write to, so that no two runs share them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")
#: Room for all arrays of a copy, by the kind of their numbers: so they are filled at once.
Room = dict[Any, NDArray[Any]]
#: What makes one array of a copy, in this room, from those before it.
Maker = Callable[[Room, list[Any]], Any]
#: Numbers after which each array begins in its room: vectors of a processor are no longer.
APART = 8


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
        self._places: dict[int, int] = {}
        self._sizes: dict[Any, int] = {}
        self._owners: list[tuple[NDArray[Any], int]] = []
        self._build = self._builder(thing)
        self._first: Room = {kind: np.zeros(size, kind) for kind, size in self._sizes.items()}
        for array, begin in self._owners:
            _within(self._first, array, begin)[...] = array
        self._returned: list[tuple[Room, T]] = []

    @contextmanager
    def one(self) -> Iterator[T]:
        """A copy for the context alone; unless an exception ends it, a later one may be of the same arrays."""
        try:
            room, copy = self._returned.pop()
        except IndexError:
            room, copy = self._make()
        else:
            for kind, first in self._first.items():
                room[kind][:] = first
        yield copy
        self._returned.append((room, copy))

    def new(self) -> T:
        """A copy that is nobody else's, now or later."""
        return self._make()[1]

    def _make(self) -> tuple[Room, T]:
        """New arrays and a copy made of them."""
        room = {kind: first.copy() for kind, first in self._first.items()}
        arrays: list[Any] = []
        for make in self._makers:
            arrays.append(make(room, arrays))
        return room, self._build(arrays)

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
                begin = self._sizes.get(array.dtype, 0)
                self._sizes[array.dtype] = begin + array.size + -array.size % APART
                self._owners.append((array, begin))
                self._makers.append(lambda room, _: _within(room, array, begin))
            self._places[id(array)] = len(self._makers) - 1
        return self._places[id(array)]


def _within(room: Room, array: NDArray[Any], begin: int) -> NDArray[Any]:
    """The part of a room that is the place of an array, which owns its numbers: they lie side by side in any order."""
    part = room[array.dtype][begin : begin + array.size]
    return np.ndarray(array.shape, array.dtype, part, 0, array.strides)


def _part(array: Any, base: Any, of: int) -> Maker:
    """What makes that part of a base's copy that an array is of the base."""
    shape, kind, strides = array.shape, array.dtype, array.strides
    alike = array.size == base.size and kind == base.dtype
    if alike and array.flags.c_contiguous and base.flags.c_contiguous:
        return lambda _, arrays: arrays[of].reshape(shape)
    offset = array.__array_interface__["data"][0] - base.__array_interface__["data"][0]
    return lambda _, arrays: np.ndarray(shape, kind, arrays[of], offset, strides)
