"""Loading of the compiler at the first call of a kernel: numba takes longer to load than this whole package.

Until then a kernel is the Python function that it is made from, and the registration of types and functions waits.
"""

from collections.abc import Callable, Mapping
from functools import update_wrapper
from importlib import import_module
from threading import Lock, RLock
from typing import Any

from anctmm.jit.interpreting import here, mode

Function = Callable[..., Any]

#: What the compiler puts in the place of a function: the implementations of each, which are functions themselves.
implementations: dict[Function, list[Function]] = {}

#: Registrations to make when numba is loaded; None afterwards.
_waiting: list[Callable[[], object]] | None = []
#: Of that list, never held while a module is loaded; and held by the thread that makes a kernel.
_listing, _making = Lock(), RLock()


class Deferred:
    """A kernel that is made when it is called first, or when another kernel that calls it is compiled.

    Parameters
    ----------
    function : callable
        Not compiled.
    options : mapping
        Of its compilation, numba's `targetoptions`.
    make : callable
        Makes the kernel, of the function and the options.

    Notes
    -----
    To numba it is the kernel itself (`_numba_type_`), and it has all attributes of that.
    """

    py_func: Function

    def __init__(
        self,
        function: Function,
        options: Mapping[str, Any],
        make: Callable[[Function, Mapping[str, Any]], Any],
    ) -> None:
        update_wrapper(self, function)
        self.py_func, self.targetoptions = function, options
        self._make, self._made = make, None

    def __call__(self, *args: Any, **kws: Any) -> Any:
        """Call from Python."""
        if mode.on or here.on:
            return self.py_func(*args, **kws)
        made = self._made
        return (self.kernel if made is None else made)(*args, **kws)

    @property
    def kernel(self) -> Any:
        """The kernel; the function itself where numba's compiler is switched off."""
        if self._made is None:
            with _making:
                if self._made is None:
                    self._made = self._make(self.py_func, self.targetoptions)
        return self._made

    @property
    def _numba_type_(self) -> Any:
        """What numba asks objects for that it does not know."""
        return self.kernel._numba_type_

    def __reduce__(self) -> str:
        """Known by its name to other processes, as functions are."""
        return self.__qualname__  # type: ignore[no-any-return]

    def __getattr__(self, name: str) -> Any:
        """What else a kernel has."""
        if name.startswith("__"):  # Python asks for some that no kernel has
            raise AttributeError(name)
        return getattr(self.kernel, name)


def when_loaded(tell: Callable[[], object]) -> None:
    """Call something when the compiler is loaded; at once if it is."""
    with _listing:
        if _waiting is not None:
            _waiting.append(tell)
            return
    tell()


def compiled_in(module: str) -> None:
    """Load a module with the compiler: it holds what kernels call in the place of functions of the module that says so.

    Parameters
    ----------
    module : str
        Its name, since it imports the module that says so.
    """
    when_loaded(lambda: import_module(module))


def tell_compiler() -> None:
    """Tell numba what waits, and from now on at once: for modules that load numba."""
    global _waiting
    with _listing:
        waiting, _waiting = _waiting or [], None
    for tell in waiting:
        tell()
