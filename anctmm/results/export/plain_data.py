"""Results as plain data and back: reading them runs no code, whoever wrote them.

A text in JSON describes the result; its arrays are stored beside it. Possible are numbers, texts, containers, NumPy
arrays, and instances of dataclasses, whose fields are set without a call. A class is looked up among those that this
process has already loaded: nothing is imported. Of functions only the name is written.
"""

import json
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from anctmm.errors import ResultError

#: Kinds of numbers that an array may hold: numbers, truth values and texts; no objects.
_KINDS = "biufcSU"

Arrays = dict[str, np.ndarray]


class NotPlain(Exception):
    """A result that is more than data, or data that are no result."""


class NotSaved:
    """Represents a function that a file cannot contain, by its name."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __call__(self, *_: object) -> Any:
        """Raises ResultError."""
        raise ResultError(
            f"function {self.name} was not saved with the solution; `load` takes it from a scene"
        )

    def __repr__(self) -> str:
        return f"<{self.name}, not saved>"


def describe(value: Any) -> tuple[str, Arrays]:
    """A result as a text in JSON and its arrays, by their places in it; NotPlain where something is no data."""
    arrays: Arrays = {}
    try:
        return json.dumps(_plain(value, arrays, ())), arrays
    except (RecursionError, ValueError) as error:  # it holds itself, or a number of thousands of digits
        raise NotPlain(f"{type(error).__name__}: {error}") from error


def rebuild(text: str | bytes, arrays: Mapping[str, np.ndarray]) -> Any:
    """What `describe` made a text and arrays of; NotPlain if they are none, or of a class that has changed."""
    try:
        return _value(json.loads(text), arrays)
    except (LookupError, ValueError, TypeError, AttributeError) as error:
        raise NotPlain(f"{type(error).__name__}: {error}") from error


def _plain(value: Any, arrays: Arrays, path: tuple[str, ...]) -> Any:
    """What JSON can hold of a value: itself, or a dictionary with one key, which says what it is."""
    if value is None or type(value) in (bool, int, float, str):
        return value

    def inside(part: Any, *names: Any) -> Any:
        return _plain(part, arrays, (*path, *map(str, names)))

    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in _KINDS:
        name = ".".join(path) or "value"
        while name in arrays:
            name += "_"
        arrays[name] = np.ascontiguousarray(value).reshape(value.shape)
        return {"array" if isinstance(value, np.ndarray) else "scalar": name}
    if isinstance(value, dict):
        pairs = [[inside(key, key, "key"), inside(v, key)] for key, v in value.items()]
        return {"dict": pairs} if type(value) is dict else {"mapping": [_name(value), pairs]}
    if type(value) in (list, tuple):
        parts = [inside(v, k) for k, v in enumerate(value)]
        return parts if type(value) is list else {"tuple": parts}
    if is_dataclass(value) and not isinstance(value, type):
        names = [f.name for f in fields(value)]
        return {"dataclass": [_name(value), names, [inside(getattr(value, name), name) for name in names]]}
    if isinstance(value, float):
        return {"number": [_name(value), float(value)]}
    if isinstance(value, NotSaved):
        return {"function": value.name}
    if callable(value) and not isinstance(value, type):
        return {"function": getattr(value, "__qualname__", type(value).__name__)}
    raise NotPlain(f"{type(value).__name__} {getattr(value, '__qualname__', '')!r} is no data")


def _value(plain: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """The value of which `_plain` made this."""
    if isinstance(plain, list):
        return [_value(part, arrays) for part in plain]
    if not isinstance(plain, dict):
        return plain
    ((kind, content),) = plain.items()
    match kind:
        case "array":
            return arrays[content].copy()
        case "scalar":
            return arrays[content][()]
        case "tuple" | "dict":
            return {"tuple": tuple, "dict": dict}[kind](_value(content, arrays))
        case "mapping":
            made = dict.__new__(_class(content[0], dict))
            dict.update(made, _value(content[1], arrays))
            return made
        case "number":
            return float.__new__(_class(content[0], float), content[1])
        case "function":
            return NotSaved(str(content))
        case "dataclass":
            return _instance(content[0], content[1], _value(content[2], arrays))
    raise NotPlain(f"{kind!r} is no kind of data")


def _instance(name: str, names: list[str], values: list[Any]) -> Any:
    """An instance of a dataclass with the fields it had."""
    kind = _class(name, object)
    if not is_dataclass(kind) or [f.name for f in fields(kind)] != names:
        raise NotPlain(f"{name} has other fields now")
    made = object.__new__(kind)
    for known, value in zip(names, values, strict=True):
        object.__setattr__(made, known, value)
    return made


def _name(value: Any) -> str:
    kind = type(value)
    if _class(name := f"{kind.__module__}:{kind.__qualname__}", object) is not kind:
        raise NotPlain(f"{name} cannot be found by its name")
    return name


def _class(name: str, base: type) -> type[Any]:
    """A class that is loaded, and derived from a base."""
    module, _, path = name.partition(":")
    found: Any = sys.modules.get(module)
    for part in path.split("."):
        found = getattr(found, part, None)
    if not (isinstance(found, type) and issubclass(found, base)):
        raise NotPlain(f"class {name} is not loaded")
    return found
