"""Results as bytes and back, as plain data: reading them runs no code, whoever wrote them.

A text in JSON describes the result; its arrays are stored beside it. Possible are numbers, texts, containers, NumPy
arrays, and instances of dataclasses and named tuples, whose fields are set without a call. A class is looked up among
those that this process has already loaded: nothing is imported.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from typing import Any

import numpy as np

#: Bytes of the number that says how long the description is.
_LENGTH = 8
#: Kinds of numbers that an array may hold: numbers, truth values, texts and times; no objects.
_KINDS = "biufcSUmM"

Arrays = dict[str, np.ndarray]


class NotPlain(Exception):
    """A result that is more than data, or bytes that are no result."""


def describe(value: Any, given: Sequence[Any] = ()) -> tuple[str, Arrays]:
    """A result as a text in JSON and its arrays, by the places where they stand in it.

    Parameters
    ----------
    value : object
    given : sequence
        Parts of it that `rebuild` will be given again, such as a scene with functions of the user's.

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


def encode(value: Any, given: Sequence[Any] = ()) -> bytes:
    """A result as bytes; parameters and errors as of `describe`."""
    text, arrays = describe(value, given)
    table = {name: [array.dtype.str, list(array.shape)] for name, array in arrays.items()}
    head = json.dumps([table, text]).encode()
    return b"".join([len(head).to_bytes(_LENGTH, "little"), head, *(a.tobytes() for a in arrays.values())])


def decode(content: bytes, given: Sequence[Any] = ()) -> Any:
    """The result of which `encode` made these bytes; errors as of `rebuild`."""
    end = _LENGTH + int.from_bytes(content[:_LENGTH], "little")
    arrays: Arrays = {}
    try:
        table, text = json.loads(content[_LENGTH:end])
        for name, (dtype, shape) in table.items():
            kind, count = np.dtype(dtype), int(np.prod(shape, dtype=np.int64))
            if kind.kind not in _KINDS:
                raise NotPlain(f"arrays of {dtype} are no data")
            found = np.frombuffer(content, kind, count, end) if count else np.empty(0, kind)
            arrays[name] = found.reshape(shape)
            end += found.nbytes
    except (LookupError, ValueError, TypeError, AttributeError) as error:
        raise NotPlain(f"{type(error).__name__}: {error}") from error
    return rebuild(text, arrays, given)


def _plain(value: Any, given: Sequence[Any], arrays: Arrays, path: tuple[str, ...]) -> Any:
    """What JSON can hold of a value: itself, or a dictionary with one key, which says what it is."""
    for number, known in enumerate(given):
        if value is known or (type(value) is type(known) and is_dataclass(known) and value == known):
            return {"given": number}
    if value is None or type(value) in (bool, int, float, str):
        return value
    inside = [_plain(v, given, arrays, (*path, name)) for name, v in _items(value)]
    if isinstance(value, dict):
        keys = [_plain(key, given, arrays, (*path, str(key), "key")) for key in value]
        inside = [list(pair) for pair in zip(keys, inside, strict=True)]
    if type(value) is list:
        return inside
    if type(value) in (tuple, set, frozenset, dict):
        return {type(value).__name__: inside}
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in _KINDS:
        name = ".".join(path) or "value"
        while name in arrays:
            name += "_"
        arrays[name] = np.ascontiguousarray(value).reshape(value.shape)
        return {"array" if isinstance(value, np.ndarray) else "scalar": name}
    if type(value) is complex:
        return {"complex": [value.real, value.imag]}
    if type(value) is bytes:
        return {"bytes": value.hex()}
    if is_dataclass(value) and not isinstance(value, type):
        return {"dataclass": [_name(value), [f.name for f in fields(value)], inside]}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {"namedtuple": [_name(value), list(value._fields), inside]}
    if isinstance(value, dict):
        return {"mapping": [_name(value), inside]}
    if isinstance(value, float):
        return {"number": [_name(value), float(value)]}
    raise NotPlain(f"{type(value).__name__} {getattr(value, '__qualname__', '')!r} is no data")


def _items(value: Any) -> list[tuple[str, Any]]:
    """What stands inside a container, each with the name of its place."""
    if isinstance(value, dict):
        return [(str(key), inside) for key, inside in value.items()]
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return list(zip(value._fields, value, strict=True))
    if isinstance(value, list | tuple | set | frozenset):
        return [(str(number), inside) for number, inside in enumerate(value)]
    if is_dataclass(value) and not isinstance(value, type):
        return [(f.name, getattr(value, f.name)) for f in fields(value)]
    return []


def _value(plain: Any, given: Sequence[Any], arrays: Mapping[str, np.ndarray]) -> Any:  # one branch a kind
    if isinstance(plain, list):
        return [_value(p, given, arrays) for p in plain]
    if not isinstance(plain, dict):
        return plain
    ((kind, content),) = plain.items()
    match kind:
        case "given":
            return given[content]
        case "tuple" | "set" | "frozenset" | "dict":
            make = {"tuple": tuple, "set": set, "frozenset": frozenset, "dict": dict}[kind]
            return make(_value(content, given, arrays))
        case "array" | "scalar":
            return arrays[content][()] if kind == "scalar" else arrays[content].copy()
        case "complex":
            return complex(*content)
        case "bytes":
            return bytes.fromhex(content)
        case "dataclass":
            return _instance(content[0], content[1], _value(content[2], given, arrays))
        case "namedtuple":
            return _tuple(content[0], content[1], _value(content[2], given, arrays))
        case "mapping":
            mapping = dict.__new__(_class(content[0], dict))
            dict.update(mapping, _value(content[1], given, arrays))
            return mapping
        case "number":
            return float.__new__(_class(content[0], float), content[1])
    raise NotPlain(f"{kind!r} is no kind of data")


def _instance(name: str, names: list[str], values: list[Any]) -> Any:
    """An instance of a dataclass with the fields it had.

    A field that came last, and later, has its default, or is what its metadata find for it by a function "earlier" of
    the instance.
    """
    kind = _class(name, object)
    now = fields(kind) if is_dataclass(kind) else ()
    later = now[len(names) :]
    known = all("earlier" in f.metadata or f.default is not MISSING for f in later)
    if [f.name for f in now[: len(names)]] != names or not known or not now:
        raise NotPlain(f"{name} has other fields now")
    made = object.__new__(kind)
    for known_name, value in zip(names, values, strict=True):
        object.__setattr__(made, known_name, value)
    for f in later:
        find = f.metadata.get("earlier")
        object.__setattr__(made, f.name, find(made) if find else f.default)
    return made


def _tuple(name: str, names: list[str], values: list[Any]) -> Any:
    kind = _class(name, tuple)
    if list(getattr(kind, "_fields", ())) != names:
        raise NotPlain(f"{name} has other fields now")
    return tuple.__new__(kind, values)


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
