"""Checks at the door: each names the thing, its value and what is allowed."""

from collections.abc import Iterable
from math import isfinite

from anctmm.errors import AnctmmError, PropertyError, UnknownOptionError


def number(name: str, value: object, error: type[AnctmmError] = PropertyError) -> float:
    """Return `value` as a finite float.

    Raises
    ------
    AnctmmError
        Of the class `error`, if `value` is no finite real number.
    """
    try:
        result = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise error(f"{name} is {value!r}; a finite number is needed") from None
    if not isfinite(result):
        raise error(f"{name} is {value!r}; a finite number is needed")
    return result


def positive(name: str, value: object, error: type[AnctmmError] = PropertyError) -> float:
    """Return `value` as a float greater than zero, or raise `error`."""
    result = number(name, value, error)
    if result <= 0.0:
        raise error(f"{name} is {value!r}; a number greater than 0 is needed")
    return result


def not_negative(name: str, value: object, error: type[AnctmmError] = PropertyError) -> float:
    """Return `value` as a float of at least zero, or raise `error`."""
    result = number(name, value, error)
    if result < 0.0:
        raise error(f"{name} is {value!r}; a number of at least 0 is needed")
    return result


def within(
    name: str, value: object, low: float, high: float, bounds: str, error: type[AnctmmError] = PropertyError
) -> float:
    """Return `value` as a float inside an interval; `bounds` is "[]", "[)", "(]" or "()"."""
    result = number(name, value, error)
    above = result >= low if bounds[0] == "[" else result > low
    below = result <= high if bounds[1] == "]" else result < high
    if not (above and below):
        raise error(f"{name} is {value!r}; allowed is {bounds[0]}{low:g}, {high:g}{bounds[1]}")
    return result


def vector(name: str, value: object, error: type[AnctmmError] = PropertyError) -> tuple[float, float]:
    """Return `value` as a pair of finite floats, or raise `error`."""
    try:
        x, y = tuple(value)  # type: ignore[arg-type, var-annotated]
    except (TypeError, ValueError):
        raise error(f"{name} is {value!r}; a pair of finite numbers (x, y) is needed") from None
    return number(f"{name}, x", x, error), number(f"{name}, y", y, error)


def one_of(name: str, value: object, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of the allowed names.

    Raises
    ------
    UnknownOptionError
        If it is not.
    """
    allowed = sorted(allowed)
    if not isinstance(value, str) or value not in allowed:
        raise UnknownOptionError(f"{name} is {value!r}; allowed are {', '.join(map(repr, allowed))}")
    return value
