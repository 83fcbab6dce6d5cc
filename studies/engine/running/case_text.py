"""A text that identifies a run uniquely, with all digits, and the modules that it consists of."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from studies.engine.storage.sources import OURS


def case_key(case: Any) -> str:
    """A text that identifies a case, with every digit of every number."""
    return _text(case)


def _text(value: Any) -> str:
    """A value with all that makes it, whatever its own representation leaves out."""
    if is_dataclass(value) and not isinstance(value, type):
        parts = (f"{f.name}={_text(getattr(value, f.name))}" for f in fields(value) if f.init)
        return f"{_class(value)}({', '.join(parts)})"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_text(k)}: {_text(v)}' for k, v in value.items())}}}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, set | frozenset):
        return f"{{{', '.join(sorted(map(_text, value)))}}}"
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
    try:
        return repr(value)
    except Exception:  # a function of the user's own; such cases are not kept
        return f"{_class(value)} {id(value)}"


def _class(value: Any) -> str:
    return f"{type(value).__module__}.{type(value).__qualname__}"


def parts(value: Any) -> Iterator[Any]:
    """A value and all that it is made of."""
    yield value
    if is_dataclass(value) and not isinstance(value, type):
        inside: Iterable[Any] = (getattr(value, f.name) for f in fields(value) if f.init)
    elif isinstance(value, Mapping):
        inside = (*value.keys(), *value.values())
    else:
        inside = value if isinstance(value, tuple | list | set | frozenset) else ()
    for part in inside:
        yield from parts(part)


def classes(value: Any) -> set[str]:
    """Modules of the classes of a value and of its parts: a drive's law is code of its class."""
    return {type(v).__module__ for v in parts(value) if is_dataclass(v) and not isinstance(v, type)}


def reproducible(value: Any) -> bool:
    """Whether a text identifies a value: data and classes of this suite only.

    The text of a plain function is an address. What a class of the user's computes may depend on more than its fields
    and its source: on a file that it, or its module, has read.
    """
    plain = str | bytes | int | float | complex | np.generic | Mapping | tuple | list | set | frozenset
    return all(
        v is None
        or isinstance(v, plain)
        or (isinstance(v, np.ndarray) and not v.dtype.hasobject)
        or (is_dataclass(v) and type(v).__module__.partition(".")[0] in OURS)
        for v in parts(value)
    )
