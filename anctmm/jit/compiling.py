"""Decorators for kernels.

Each decorator turns a function into a kernel, or into a part of kernels, when it is needed (`deferred`). Kernels are
stored on disk (`kernel_files`), under a hash of all code that they contain (`code_digest`).
"""

from collections.abc import Callable, Mapping
from typing import Any

from anctmm.jit.deferred import Deferred, implementations, when_loaded
from anctmm.jit.interpreting import by_python

#: Fused multiply-add may be used; nothing else is reordered, and NaN and infinity keep their meaning. numba's runtime
#: is left out: what would take memory does not compile, and no reference to an array is counted, which costs some 5 ns
#: each and halved the speed of short chains.
OPTIONS: dict[str, Any] = {
    "fastmath": {"contract"},
    "error_model": "numpy",
    "_nrt": False,
    "no_cfunc_wrapper": True,  # an entry for C that nobody calls
}


def kernel(function: Callable[..., Any], allocates: bool = False) -> Any:
    """Compile a function in nopython mode on first use, kept on disk; only with `allocates` may it take memory."""
    return _kept(function, _nrt=allocates)


def vectorized(function: Callable[..., Any]) -> Any:
    """A kernel with a large loop over elements, optimised before it becomes part of the kernels that call it.

    Optimised as part of a large caller only, such a loop stays scalar: forces of shear elements took 2.8 times as long.
    """
    return _deferred(function, _vectorized_kernel, {"optimized": True})


def allocating_kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that takes memory: for preparations, not for the steps of a run."""
    return kernel(function, allocates=True)


def inlined(function: Callable[..., Any]) -> Any:
    """Make a function part of the kernels that call it, before types are known: by itself it is compiled for Python."""
    return _kept(function, inline="always")


def embedded(function: Callable[..., Any]) -> Any:
    """Make a function part of the kernels that call it, once compiled by itself: quicker, if it is large."""
    return _compiled(function, forceinline=True)


def summed(function: Callable[..., Any]) -> Any:
    """As `embedded`, for sums over many terms: they may be added up in any order, several at once."""
    return _compiled(function, forceinline=True, fastmath={"contract", "reassoc"})


def shared(function: Callable[..., Any]) -> Any:
    """Make a function part of the kernels that call it, whose calls share its code: for much work at several places."""
    return _compiled(function)


def separate(function: Callable[..., Any]) -> Any:
    """Compile a function by itself, kept on disk, for Python and for kernels that find it by its address.

    For large parts of several kernels, whose annotations give the types of their results: they are compiled at the
    same time as their callers.
    """
    return _deferred(function, _separate_kernel, {})


def merged(function: Callable[..., Any]) -> Any:
    """Make a function part of the kernels that call it, as `embedded` does, and keep it: Python calls it too."""
    return _kept(function, forceinline=True)


def _kept(function: Callable[..., Any], **options: Any) -> Any:
    """A kernel that is kept on disk."""
    return _deferred(function, _kept_kernel, options)


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    """A kernel that is compiled with those that call it."""
    return _deferred(function, _kernel, options)


def _deferred(function: Callable[..., Any], make: Callable[..., Any], options: Mapping[str, Any]) -> Deferred:
    return Deferred(function, {"nopython": True, "boundscheck": None, **OPTIONS, **options}, make)


def _kernel(function: Callable[..., Any], options: Mapping[str, Any]) -> Any:
    """The kernel of a function; the function itself where numba's compiler is switched off."""
    from anctmm.jit.compiler.kernels import Kernel

    return _made(Kernel, function, options)


def _kept_kernel(function: Callable[..., Any], options: Mapping[str, Any]) -> Any:
    """The same, which knows its files."""
    from anctmm.jit.compiler.kernels import Kernel

    return _with_files(_made(Kernel, function, options), options)


def _vectorized_kernel(function: Callable[..., Any], options: Mapping[str, Any]) -> Any:
    """The same, which is optimised by itself: an option that numba does not know, by which files differ."""
    from anctmm.jit.compiler.kernels import VectorizedKernel

    known = {name: value for name, value in options.items() if name != "optimized"}
    return _with_files(_made(VectorizedKernel, function, known), options)


def _separate_kernel(function: Callable[..., Any], options: Mapping[str, Any]) -> Any:
    """The same, of a kernel that is compiled apart from its callers."""
    from anctmm.jit.compiler.separate import SeparateKernel

    return _with_files(_made(SeparateKernel, function, options), options)


def _made(kind: Callable[..., Any], function: Callable[..., Any], options: Mapping[str, Any]) -> Any:
    from numba.core import config

    settings: Any = config
    return function if settings.DISABLE_JIT else kind(function, targetoptions=dict(options))


def _with_files(made: Any, options: Mapping[str, Any]) -> Any:
    from anctmm.jit.compiler.kernel_files import KernelFiles

    if hasattr(made, "targetoptions"):  # no function
        made._cache = KernelFiles(made.py_func, options)
    return made


def uncompiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function that a kernel was made of, for what is done once: small, it runs sooner than it compiles.

    Kernels that it calls are run by Python, too: those that are parts of kernels are not kept, and would be compiled
    in each process.
    """
    plain: Callable[..., Any] = getattr(function, "py_func", function)
    return plain if getattr(plain, "py_func", None) is plain else by_python(plain)


def chosen_by_types(function: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make the decorated function choose, by the types of the arguments, what kernels call in the place of `function`.

    Without numba's compiler `function` itself is called.
    """

    def decorate(choose: Callable[..., Any]) -> Callable[..., Any]:
        implementations.setdefault(function, []).append(choose)

        def tell() -> None:
            from numba.extending import overload

            options: Any = OPTIONS
            overload(function, jit_options=options, inline="always")(choose)

        when_loaded(tell)
        return choose

    return decorate
