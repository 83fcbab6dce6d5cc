"""Calls of a kernel whose arguments have the same types each time.

At each call from Python numba finds the types of all arguments, to choose one of the versions that it has compiled:
some 25 µs for the hundred arrays of a scene, while the call itself takes 1 µs. Here the types are found once.
"""

from typing import Any

from anctmm.jit.deferred import Deferred
from anctmm.jit.interpreting import here, mode


class Checking:
    """Whether types are looked at in each call, too: tests do that, because a kernel reads other types as garbage."""

    on = False


class Direct:
    """A kernel, called past numba's choice of a version.

    Parameters
    ----------
    kernel : Deferred
        All calls are to have arguments of the same types as the first one.
    """

    def __init__(self, kernel: Deferred) -> None:
        self._kernel = kernel
        self._types: tuple[Any, ...] = ()
        self._entry: Any = None

    def __call__(self, *arguments: Any) -> Any:
        """Call from Python.

        Raises
        ------
        TypeError
            Where types are checked and others than those of the first call.
        """
        if mode.on or here.on:
            return self._kernel(*arguments)
        entry = self._entry or self._found(arguments)
        if Checking.on and self._types and _types_of(arguments) != self._types:
            raise TypeError(f"{self._kernel.__qualname__}: {_types_of(arguments)} instead of {self._types}")
        return entry(*arguments)

    def _found(self, arguments: tuple[Any, ...]) -> Any:
        """The entry of the version for these arguments; the function itself where nothing is compiled."""
        made = getattr(self._kernel, "kernel", self._kernel)
        if hasattr(made, "overloads"):
            self._types = _types_of(arguments)
            self._entry = made.compile(self._types)
        else:
            self._entry = made
        return self._entry


def _types_of(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """The types of arguments, as numba finds them."""
    from numba.core.typing.typeof import Purpose, typeof

    return tuple(typeof(argument, Purpose.argument) for argument in arguments)
