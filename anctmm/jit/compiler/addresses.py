"""Machine code that other machine code calls by its address: kernels compiled separately from their callers.

Callers know such a kernel by a name, which contains its types; LLVM gets its address before it loads them.
"""

import hashlib
from collections.abc import Iterable
from importlib import import_module
from typing import Any, NamedTuple

import llvmlite.binding as llvm

from anctmm.jit.files.code_digest import signature_text
from anctmm.jit.files.one_compiler import is_taken

#: Of the names by which callers know separate kernels.
PREFIX = "anctmm."


class Declared(NamedTuple):
    """A separate kernel for arguments of some types."""

    kernel: Any
    types: tuple[Any, ...]


class Needed(NamedTuple):
    """The same, as other processes find it: what is kept beside machine code that calls it."""

    module: str
    name: str
    types: tuple[Any, ...]


#: Kernels that callers know, by name.
_declared: dict[str, Declared] = {}


def name_of(kernel: Any, arguments: tuple[Any, ...]) -> str:
    """The name by which callers know a separate kernel for arguments of such types.

    Parameters
    ----------
    kernel : SeparateKernel
    arguments : tuple
        Types of numba's.
    """
    function, text = kernel.py_func, signature_text(arguments).encode()
    name = f"{PREFIX}{function.__module__}.{function.__qualname__}.{hashlib.sha256(text).hexdigest()[:16]}"
    _declared.setdefault(name, Declared(kernel, arguments))
    return name


def called_in(module: Any) -> list[str]:
    """Names of the separate kernels that a module of LLVM's calls."""
    return [f.name for f in module.functions if f.is_declaration and f.name.startswith(PREFIX)]


def named_in(code: str) -> list[Declared]:
    """The separate kernels that code calls, written as LLVM's text."""
    return [found for name, found in _declared.items() if name in code]


def needed_in(module: Any) -> list[Needed]:
    """The separate kernels that a module of LLVM's calls."""
    called = [(_declared[name].kernel.py_func, _declared[name].types) for name in called_in(module)]
    return [Needed(function.__module__, function.__qualname__, arguments) for function, arguments in called]


def names_of(needed: Iterable[Needed]) -> list[str]:
    """The names of what machine code on disk calls, which are known from now on."""
    names = []
    for module, name, arguments in needed:
        kernel: Any = import_module(module)
        for part in name.split("."):
            kernel = getattr(kernel, part)
        names.append(name_of(kernel.kernel, arguments))
    return names


def find(names: Iterable[str]) -> None:
    """Compile or load separate kernels, and give LLVM their addresses before it loads machine code that calls them.

    Those that another process compiles now come last.
    """
    waiting = dict.fromkeys(names)
    while waiting:
        name = next(
            (name for name in waiting if not _is_made_elsewhere(*_declared[name])), next(iter(waiting))
        )
        del waiting[name]
        kernel, arguments = _declared[name]
        kernel.compile(arguments)
        found = kernel.overloads[arguments]
        address = found.library.get_pointer_to_function(found.fndesc.llvm_func_name)
        if not address:
            raise RuntimeError(f"{name} has no machine code")
        llvm.add_symbol(name, address)


def _is_made_elsewhere(kernel: Any, arguments: tuple[Any, ...]) -> bool:
    """Whether another process is compiling a kernel."""
    if arguments in kernel.overloads:
        return False
    file = kernel._cache.file_of(arguments)
    return is_taken(file) and not file.exists()
