"""Results as bytes and back, by data alone: reading them runs no code, whoever wrote them.

A text in JSON describes the result, and behind it stand its arrays. Kept are numbers, texts, containers, NumPy's
arrays, and instances of dataclasses and named tuples, whose fields are set without a call. A class is looked up among
those that this process has loaded already: nothing is imported.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

#: Bytes of the number that says how long the description is.
_LENGTH = 8
#: Kinds of numbers that an array may hold: numbers, truth values, texts and times; no objects.
_KINDS = "biufcSUmM"


class NotPlain(Exception):
    """A result that is more than data, or bytes that are no result."""


def encode(value: Any, given: Sequence[Any] = ()) -> bytes:
    """A result as bytes.

    Parameters
    ----------
    value : object
    given : sequence
        Parts of it that `decode` will be given again, such as a scene with functions of the user's.

    Raises
    ------
    NotPlain
        Naming what is no data.
    """
    arrays: list[bytes] = []
    try:
        text = json.dumps(_plain(value, given, arrays)).encode()
    except (
        RecursionError,
        ValueError,
    ) as error:  # a result that holds itself, a number of thousands of digits
        raise NotPlain(f"{type(error).__name__}: {error}") from error
    return b"".join([len(text).to_bytes(_LENGTH, "little"), text, *arrays])


def decode(content: bytes, given: Sequence[Any] = ()) -> Any:
    """The result of which `encode` made these bytes.

    Raises
    ------
    NotPlain
        If they are no result, or one of a class that is not loaded or has changed.
    """
    end = _LENGTH + int.from_bytes(content[:_LENGTH], "little")
    try:
        return _value(json.loads(content[_LENGTH:end]), given, memoryview(content)[end:])
    except (LookupError, ValueError, TypeError, AttributeError) as error:
        raise NotPlain(f"{type(error).__name__}: {error}") from error


def _plain(value: Any, given: Sequence[Any], arrays: list[bytes]) -> Any:
    """What JSON can hold of a value: itself, or a dictionary with one key, which says what it is."""
    for number, known in enumerate(given):
        if value is known or (type(value) is type(known) and is_dataclass(known) and value == known):
            return {"given": number}
    if value is None or type(value) in (bool, int, float, str):
        return value
    inside = [_plain(v, given, arrays) for v in _items(value)]
    if type(value) is list:
        return inside
    if type(value) in (tuple, set, frozenset, dict):
        return {type(value).__name__: inside}
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in _KINDS:
        arrays.append(np.ascontiguousarray(value).tobytes())
        whole = "array" if isinstance(value, np.ndarray) else "scalar"
        return {whole: [value.dtype.str, list(value.shape), sum(map(len, arrays[:-1]))]}
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


def _items(value: Any) -> list[Any]:
    """What stands inside a container."""
    if isinstance(value, dict):
        return [list(pair) for pair in value.items()]
    if isinstance(value, list | tuple | set | frozenset):
        return list(value)
    if is_dataclass(value) and not isinstance(value, type):
        return [getattr(value, f.name) for f in fields(value)]
    return []


def _value(plain: Any, given: Sequence[Any], arrays: memoryview) -> Any:  # one branch a kind
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
            return _array(kind == "scalar", arrays, *content)
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


def _array(scalar: bool, arrays: memoryview, dtype: str, shape: list[int], offset: int) -> Any:
    kind = np.dtype(dtype)
    if kind.kind not in _KINDS:
        raise NotPlain(f"arrays of {dtype} are no data")
    count = int(np.prod(shape, dtype=np.int64))
    found = np.frombuffer(arrays, kind, count, offset) if count else np.empty(0, kind)
    return found[0] if scalar else found.reshape(shape).copy()


def _instance(name: str, names: list[str], values: list[Any]) -> Any:
    """An instance of a dataclass with the fields it had."""
    kind = _class(name, object)
    if not is_dataclass(kind) or [f.name for f in fields(kind)] != names:
        raise NotPlain(f"{name} has other fields now")
    made = object.__new__(kind)
    for field, value in zip(names, values, strict=True):
        object.__setattr__(made, field, value)
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
