"""Named tuples that kernels get by their address: one number in the place of all their arrays."""

from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numba import typeof, types
from numba.extending import typeof_impl
from numpy.typing import NDArray

from anctmm.kernels.intrinsics import Reference

T = TypeVar("T", bound=type)


class _Stored:
    """What such a class has beside its entries."""

    @cached_property
    def words(self: Any) -> NDArray[np.int64]:
        """Its entries as numba has them in memory: of an array, sizes and address."""
        words: list[int] = []
        for one in self:
            if isinstance(one, np.ndarray):
                if not one.flags.c_contiguous:
                    raise TypeError(f"arrays of {type(self).__name__} must be contiguous")
                words += [0, 0, one.size, one.itemsize, one.ctypes.data, *one.shape, *one.strides]
            else:
                words.append(one.address if isinstance(one, _Stored) else one)
        return np.array(words, dtype=np.int64)

    @property
    def address(self) -> int:
        """Where these words stand, for as long as this object lives."""
        return int(self.words.ctypes.data)

    def __reduce__(self: Any) -> Any:
        """Copies have words of their own."""
        return type(self), tuple(self)


def by_address(kind: T) -> T:
    """Let kernels get a class of named tuples by its address; they cannot set its entries.

    Entries are integers, contiguous arrays, and named tuples of other such classes.
    """
    names = {"__module__": kind.__module__, "__doc__": kind.__doc__}
    found = type(kind.__name__, (_Stored, kind), names)

    def reference_to(value: Any, _: Any) -> Any:
        assert value.address  # refuses what cannot be stored
        return Reference(types.NamedTuple([typeof(one) for one in value], kind))

    typeof_impl.register(found)(reference_to)
    return found  # type: ignore[return-value]
