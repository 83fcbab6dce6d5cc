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
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import cloudpickle
import numpy as np

from studies.engine.provenance import PACKAGES

#: Directories of installed code, which versions identify.
INSTALLED = tuple(Path(p).resolve() for p in {*sysconfig.get_paths().values(), sys.prefix, sys.base_prefix})
#: Attributes that functions of all kinds, and their code, are made of.
MADE_OF: dict[type, tuple[str, ...]] = {
    partial: ("func", "args", "keywords"), MethodType: ("__self__", "__func__"), staticmethod: ("__func__",),
    classmethod: ("__func__",), property: ("fget", "fset"),
    CodeType: ("co_code", "co_consts", "co_names", "co_varnames"),
}  # fmt: skip
PLAIN = str | bytes | bool | int | float | complex | np.generic | None


def identity(value: Any) -> str:
    """Digest of a value and of all that it is made of."""
    return hashlib.sha256(_text(value, ()).encode(errors="backslashreplace")).hexdigest()[:32]


def _text(value: Any, outer: tuple[int, ...]) -> str:
    """A value in words; outer: values that it is a part of, which recursive functions name again."""
    if isinstance(value, PLAIN):
        return f"{type(value).__name__} {value!r}"
    if id(value) in outer:
        return f"above {outer.index(id(value))}"
    kind = value if isinstance(value, type) else type(value)
    parts = ", ".join(_text(part, (*outer, id(value))) for part in _parts(value))
    return f"{kind.__module__}.{kind.__qualname__}({parts})"


def _parts(value: Any) -> Iterator[Any]:
    """What a value is made of, in an order that does not depend on the process."""
    match value:
        case np.ndarray() if not value.dtype.hasobject:
            yield from (str(value.dtype), value.shape, hashlib.sha256(value.tobytes()).digest())
        case Mapping():
            yield from value.items()
        case list() | tuple():
            yield from value
        case set() | frozenset():
            yield from sorted(value, key=repr)
        case FunctionType():
            yield from _of_function(value)
        case partial() | MethodType() | CodeType() | staticmethod() | classmethod() | property():
            yield from (getattr(value, name) for name in MADE_OF[type(value)])
        case ModuleType():
            yield from (value.__name__, _digest(value.__name__))
        case type():
            yield from _of_class(value)
        case _:
            yield from _of_class(type(value))
            if is_dataclass(value):
                yield from ((f.name, getattr(value, f.name)) for f in fields(value) if f.init)
            else:
                yield vars(value) if hasattr(value, "__dict__") else cloudpickle.dumps(value)


def _of_class(kind: type) -> Iterator[Any]:
    """Code of a class of the user's; those of this project and of installed packages count by their names."""
    for base in (base for base in kind.__mro__ if not _is_known(base.__module__)):
        members = sorted(vars(base).items())
        yield from ((name, f) for name, f in members if callable(f) or isinstance(f, property))


def _of_function(function: FunctionType) -> Iterator[Any]:
    yield from (cell.cell_contents for cell in function.__closure__ or ())
    module = str(function.__globals__.get("__name__"))  # a wrapper has the __module__ of what it wraps
    if _is_known(module):
        yield f"{module}.{function.__qualname__}"
        return
    yield from (function.__code__, function.__defaults__, function.__kwdefaults__)
    for name in sorted(_names(function.__code__) & function.__globals__.keys()):
        yield name, function.__globals__[name]


def _names(code: CodeType) -> set[str]:
    """Names that a function and those inside it use."""
    inside = [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return set(code.co_names).union(*map(_names, inside))


def _is_known(name: str) -> bool:
    """Whether code of a module is of this project or installed."""
    loaded = name in sys.modules and name != "__main__"
    return name.partition(".")[0] in (*PACKAGES, "builtins") or (loaded and not _digest(name))


def _digest(name: str) -> str:
    """Digest of the file of a user's module; nothing for one that is installed, built in or of this project."""
    path = Path(getattr(sys.modules.get(name), "__file__", None) or "").resolve()
    known = name.partition(".")[0] in PACKAGES or any(path.is_relative_to(place) for place in INSTALLED)
    return "" if known or not path.is_file() else hashlib.sha256(path.read_bytes()).hexdigest()
