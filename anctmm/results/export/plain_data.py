"""Results as plain data and back: reading them runs no code, whoever wrote them.

A text in JSON describes the result; its arrays are stored beside it. Possible are numbers, texts, containers, NumPy
arrays, and instances of dataclasses, whose fields are set without a call. A class is looked up among those that this
process has already loaded: nothing is imported.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

#: Kinds of numbers that an array may hold: numbers, truth values and texts; no objects.
_KINDS = "biufcSU"

Arrays = dict[str, np.ndarray]


class NotPlain(Exception):
    """A result that is more than data, or data that are no result."""


def describe(value: Any, given: Sequence[Any] = ()) -> tuple[str, Arrays]:
    """A result as a text in JSON and its arrays, by the places where they stand in it.

    `given` are parts of it that `rebuild` will be given again, such as a scene with functions of the user's.

    Raises
    ------
    NotPlain
        Naming what is no data.
    """
    arrays: Arrays = {}
    try:
        return json.dumps(_plain(value, given, arrays, ())), arrays
    except (RecursionError, ValueError) as error:
        # a result that holds itself, or a number of thousands of digits
        raise NotPlain(f"{type(error).__name__}: {error}") from error


def rebuild(text: str | bytes, arrays: Mapping[str, np.ndarray], given: Sequence[Any] = ()) -> Any:
    """The result that `describe` made a text and arrays of.

    Raises
    ------
    NotPlain
        If they are none, or one of a class that is not loaded or has changed.
    """
    try:
        return _value(json.loads(text), given, arrays)
    except (LookupError, ValueError, TypeError, AttributeError) as error:
        raise NotPlain(f"{type(error).__name__}: {error}") from error


def _plain(value: Any, given: Sequence[Any], arrays: Arrays, path: tuple[str, ...]) -> Any:
    """What JSON can hold of a value: itself, or a dictionary with one key, which says what it is."""
    for number, known in enumerate(given):
        if value is known or (type(value) is type(known) and is_dataclass(known) and value == known):
            return {"given": number}
    if value is None or type(value) in (bool, int, float, str):
        return value

    def inside(part: Any, *names: Any) -> Any:
        return _plain(part, given, arrays, (*path, *map(str, names)))

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
    raise NotPlain(f"{type(value).__name__} {getattr(value, '__qualname__', '')!r} is no data")


def _value(plain: Any, given: Sequence[Any], arrays: Mapping[str, np.ndarray]) -> Any:
    """The value of which `_plain` made this."""
    if isinstance(plain, list):
        return [_value(part, given, arrays) for part in plain]
    if not isinstance(plain, dict):
        return plain
    ((kind, content),) = plain.items()
    match kind:
        case "given":
            return given[content]
        case "array":
            return arrays[content].copy()
        case "scalar":
            return arrays[content][()]
        case "tuple" | "dict":
            return {"tuple": tuple, "dict": dict}[kind](_value(content, given, arrays))
        case "mapping":
            made = dict.__new__(_class(content[0], dict))
            dict.update(made, _value(content[1], given, arrays))
            return made
        case "number":
            return float.__new__(_class(content[0], float), content[1])
        case "dataclass":
            name, names, parts = content
            return _instance(name, names, _value(parts, given, arrays))
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
