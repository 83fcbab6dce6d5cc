"""A digest of a case: whether a measured table is of the scene as it is now."""

from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from hashlib import sha256
from itertools import product
from typing import Any

import numpy as np

from anctmm.model.case import Case

#: Equal parts of the run, or of a length, at whose ends a function is evaluated.
PARTS = 256
#: Arguments for laws: lengths or angles of any size, and rates.
SIZES, RATES = [s * 10.0**k for k in range(-3, 3) for s in (-1.0, 1.0)], (-1.0, 0.0, 1.0)
#: Fields of a case that do not change what is measured.
TOLD_ONLY = ("note",)


def digest_of(case: Case) -> str:
    """A text that two cases share if their scenes, probes and times are the same to twelve digits.

    Functions, such as drives and laws, are identified by their values. A field with its default value is left out, so
    that a field added later changes no digest.
    """
    return f"sha256:{sha256(_text(case, case.duration or 1.0).encode()).hexdigest()[:16]}"


def _text(value: Any, duration: float) -> str:
    if is_dataclass(value) and not isinstance(value, type):
        parts = [
            f"{f.name}={_text(getattr(value, f.name), duration)}"
            for f in fields(value)
            if f.compare and f.repr and f.name not in TOLD_ONLY and not _is_default(value, f)
        ]
        answers = f" {_answers(value, duration)}" if callable(value) else ""
        return f"{type(value).__qualname__}({', '.join(parts)}){answers}"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_text(k, duration)}: {_text(v, duration)}' for k, v in value.items())}}}"
    if isinstance(value, tuple | list):
        return f"[{', '.join(_text(v, duration) for v in value)}]"
    if isinstance(value, float):
        return f"{value:.12g}"
    return _answers(value, duration) if callable(value) else repr(value)


def _is_default(value: Any, field: Field[Any]) -> bool:
    default = field.default_factory() if field.default_factory is not MISSING else field.default
    given = getattr(value, field.name)
    return type(given) is type(default) and not callable(given) and bool(given == default)


def _answers(function: Callable[..., Any], duration: float) -> str:
    """What a function answers: of the time, of a fraction of a length, or a law of a length, a rate and the time."""
    asked = [(duration * k / PARTS,) for k in range(PARTS + 1)] + [(k / PARTS,) for k in range(PARTS + 1)]
    laws = [(size, rate, 0.5 * duration) for size, rate in product(SIZES, RATES)]
    return "; ".join(_answer(function, arguments) for arguments in (*asked, *laws))


def _answer(function: Callable[..., Any], arguments: tuple[float, ...]) -> str:
    try:
        with np.errstate(all="ignore"):
            found = np.asarray(function(*arguments), float).ravel()
    except (Exception, SystemExit) as error:  # a user's function, which accepts one form of its arguments
        return type(error).__name__
    return ", ".join(f"{x:.12g}" for x in found.tolist())
