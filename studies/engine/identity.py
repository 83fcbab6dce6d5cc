"""Identity of a value: a text that two values share only if they compute the same.

Data count with all digits, functions and classes of users with their code, constants, defaults, closures and the
globals that they name. Modules of users count with their files. Files that a function reads while it runs do not.
"""

import hashlib
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import cloudpickle
import numpy as np

from studies.engine.provenance import PACKAGES

#: Directories of installed code, which versions identify.
INSTALLED = tuple(Path(p).resolve() for p in {*sysconfig.get_paths().values(), sys.prefix, sys.base_prefix})


def identity(value: Any) -> str:
    """Digest of a value and of all that it is made of."""
    return hashlib.sha256(_text(value, ()).encode(errors="backslashreplace")).hexdigest()[:32]


def _text(value: Any, outer: tuple[int, ...]) -> str:
    """A value in words; outer: values that it is a part of, which recursive functions name again."""
    if value is None or isinstance(value, str | bytes | bool | int | float | complex | np.generic):
        return f"{type(value).__name__} {value!r}"
    if id(value) in outer:
        return f"above {outer.index(id(value))}"
    parts = ", ".join(_text(part, (*outer, id(value))) for part in _parts(value))
    return f"{_name(value)}({parts})"


def _name(value: Any) -> str:
    kind = value if isinstance(value, type) else type(value)
    return f"{kind.__module__}.{kind.__qualname__}"


def _parts(value: Any) -> Iterator[Any]:
    """What a value is made of, in an order that does not depend on the process."""
    match value:
        case np.ndarray() if not value.dtype.hasobject:
            yield from (str(value.dtype), value.shape, hashlib.sha256(value.tobytes()).digest())
        case Mapping():
            yield from (pair for pair in value.items())
        case list() | tuple():
            yield from value
        case set() | frozenset():
            yield from sorted(value, key=repr)
        case partial():
            yield from (value.func, value.args, value.keywords)
        case MethodType():
            yield from (value.__self__, value.__func__)
        case FunctionType():
            yield from _of_function(value)
        case staticmethod() | classmethod():
            yield value.__func__
        case property():
            yield from (value.fget, value.fset)
        case BuiltinFunctionType():
            yield f"{value.__module__}.{value.__qualname__}"
        case ModuleType():
            yield from (value.__name__, _file_of(value))
        case type():
            yield from _of_class(value)
        case _:
            yield from _of_object(value)


def _of_object(value: Any) -> Iterator[Any]:
    yield from _of_class(type(value))
    if is_dataclass(value):
        yield from ((f.name, getattr(value, f.name)) for f in fields(value) if f.init)
    elif hasattr(value, "__dict__"):
        yield vars(value)
    else:
        yield cloudpickle.dumps(value)


def _of_class(kind: type) -> Iterator[Any]:
    """Code of a class of the user's; those of this project and of installed packages count by their names."""
    for base in kind.__mro__:
        if not _is_known(base):
            yield from (
                (name, f) for name, f in sorted(vars(base).items()) if callable(f) or isinstance(f, property)
            )


def _is_known(thing: Any) -> bool:
    """Whether code is of this project or installed."""
    name = str(getattr(thing, "__module__", ""))
    if name.partition(".")[0] in (*PACKAGES, "builtins"):
        return True
    module = sys.modules.get(name)
    return module is not None and name != "__main__" and not _file_of(module)


def _file_of(module: ModuleType) -> str:
    """Digest of the file of a user's module; nothing for one that is installed, built in or of this project."""
    file = getattr(module, "__file__", None)
    if not file or module.__name__.partition(".")[0] in PACKAGES:
        return ""
    path = Path(file).resolve()
    if any(path.is_relative_to(place) for place in INSTALLED) or not path.is_file():
        return ""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _of_function(function: FunctionType) -> Iterator[Any]:
    if _is_known(function) and not function.__closure__:
        yield f"{function.__module__}.{function.__qualname__}"
        return
    yield from _of_code(function.__code__)
    yield from (function.__defaults__, function.__kwdefaults__)
    yield from (cell.cell_contents for cell in function.__closure__ or ())
    named = sorted({name for code in _codes(function.__code__) for name in code.co_names})
    yield from ((name, function.__globals__[name]) for name in named if name in function.__globals__)


def _of_code(code: CodeType) -> Iterator[Any]:
    for inner in _codes(code):
        constants = tuple(c for c in inner.co_consts if not isinstance(c, CodeType))
        yield from (inner.co_code, constants, inner.co_names, inner.co_varnames)


def _codes(code: CodeType) -> Iterator[CodeType]:
    """The code of a function and of those inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)
