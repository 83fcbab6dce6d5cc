"""Checks of user input: each error names the item, its value and what is allowed; each check returns plain values.

A number is an int, a float, a Fraction, a Decimal or a NumPy scalar, and becomes a float. Texts, truth values, complex
numbers, durations and quantities with units of another package are refused: nothing is guessed.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from decimal import Decimal
from itertools import islice
from math import isfinite
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import AnctmmError, PropertyError, reason, shown, unknown_option

Array = NDArray[np.float64]

#: Rounding of a double near 1.
EPS = float(np.finfo(float).eps)
#: Largest size of any number, and smallest of one that is not zero: their products of a few do not overflow.
LARGEST, SMALLEST = 1e100, 1e-100
#: Sizes of lengths and places, m.
LONGEST, SHORTEST = 1e15, 1e-15
#: Characters of a name, and things of one kind, at most.
NAME, MANY = 100, 1_000_000


class FrozenMapping(dict[str, Any]):
    """A mapping that can be hashed; read-only."""

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(tuple(sorted(self.items())))


def number(name: str, value: object, error: type[AnctmmError] = PropertyError) -> float:
    """Return `value` as a finite float, or raise `error` if it is no real number, or is larger than 1e100."""
    result = _real(value)
    if result is None or not isfinite(result):
        raise error(f"{name} is {shown(value)}; a finite number is needed")
    if abs(result) > LARGEST:
        raise error(f"{name} is {shown(value)}; a number from -{LARGEST:g} to {LARGEST:g} is needed")
    return result


def positive(
    name: str,
    value: object,
    error: type[AnctmmError] = PropertyError,
    low: float = SMALLEST,
    high: float = LARGEST,
) -> float:
    """Return `value` as a float greater than zero and from `low` to `high`, or raise `error`."""
    result = number(name, value, error)
    if result <= 0.0:
        raise error(f"{name} is {shown(value)}; a number greater than 0 is needed")
    if not low <= result <= high:
        raise error(f"{name} is {shown(value)}; a number from {low:g} to {high:g} is needed")
    return result


def not_negative(name: str, value: object, error: type[AnctmmError] = PropertyError) -> float:
    """Return `value` as a float of at least zero, or raise `error`."""
    result = number(name, value, error)
    if result < 0.0:
        raise error(f"{name} is {shown(value)}; a number of at least 0 is needed")
    return result


def within(
    name: str, value: object, low: float, high: float, bounds: str, error: type[AnctmmError] = PropertyError
) -> float:
    """Return `value` as a float inside an interval; `bounds` is "[]", "[)", "(]" or "()"."""
    result = number(name, value, error)
    above = result >= low if bounds[0] == "[" else result > low
    below = result <= high if bounds[1] == "]" else result < high
    if not (above and below):
        raise error(f"{name} is {shown(value)}; allowed is {bounds[0]}{low:g}, {high:g}{bounds[1]}")
    return result


def whole(name: str, value: object, high: int, error: type[AnctmmError] = PropertyError) -> int:
    """Return `value` as an int from 1 to `high`, or raise `error`."""
    if (
        not isinstance(value, Integral)
        or isinstance(value, bool | np.timedelta64)
        or not 1 <= int(value) <= high
    ):
        raise error(f"{name} is {shown(value)}; a whole number from 1 on is needed, at most {high}")
    return int(value)


def flag(name: str, value: object, error: type[AnctmmError] = PropertyError) -> bool:
    """Return `value` as a bool, or raise `error`: no other value is taken for true or false."""
    if not isinstance(value, bool | np.bool_):
        raise error(f"{name} is {shown(value)}; True or False is needed")
    return bool(value)


def text(name: str, value: object) -> str:
    """Return `value` as a plain string that can name something, or raise PropertyError."""
    if not isinstance(value, str) or not (
        0 < len(value) <= NAME and value.isprintable() and value == value.strip()
    ):
        raise PropertyError(
            f"{name} is {shown(value)}; a non-empty string of at most {NAME} printable characters is needed, with no "
            f"space before or behind"
        )
    return str.__str__(value)


def vector(name: str, value: object, high: float = LARGEST, dims: Sequence[int] = (2,)) -> tuple[float, ...]:
    """Return `value` as a tuple of finite floats of size `high` at most, or raise PropertyError.

    dims: numbers of components that are allowed, 2 or 3.
    """
    if not has_length(value, dims):
        needed = "a pair (x, y)" if 2 in dims else "a triple (x, y, z)"
        space = ", or a triple (x, y, z) in space," if len(dims) == 2 else ""
        raise PropertyError(
            f"{name} is {shown(value)}; {needed}{space} of finite numbers in a known order is needed"
        )
    given: Any = value
    found = tuple(number(f"{name}, {axis}", x) for axis, x in zip("xyz", given, strict=False))
    if max(map(abs, found)) > high:
        raise PropertyError(f"{name} is {shown(value)}; numbers from -{high:g} to {high:g} are needed")
    return found


def is_point(value: object) -> bool:
    """Whether a value is an ordered sequence or an array of two or three numbers."""
    if not has_length(value, (2, 3)):
        return False
    given: Any = value
    return all(isinstance(x, Real) and not isinstance(x, bool) for x in given)


def point(name: str, value: object) -> tuple[float, ...]:
    """Return a point of the plane or of space as a tuple of floats, no further than LONGEST from the origin."""
    return vector(name, value, LONGEST, (2, 3))


def one_of(name: str, value: object, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of the allowed names, or raise UnknownOptionError."""
    allowed = tuple(allowed)
    plain = str.__str__(value) if isinstance(value, str) else None
    if plain is None or plain not in allowed:
        raise unknown_option(name, value, sorted(allowed))
    return plain


def answer_of(what: str, function: Callable[..., Any], *arguments: float, count: int) -> Array:
    """Numbers that a user's function answers, (count,).

    PropertyError if it raises, or answers with something else than so many finite numbers; `what` names it and its
    arguments.
    """
    needed = f"{'one finite number is' if count == 1 else f'{count} finite numbers are'} needed"
    try:
        answer = function(*arguments)
    except (Exception, SystemExit) as raised:  # a user's function may do anything
        raise PropertyError(f"{what} raises {reason(raised)}; {needed}") from raised
    try:
        found = reals(answer).reshape(count)
    except (TypeError, ValueError):
        found = np.full(count, np.nan)
    if not (np.abs(found) <= LARGEST).all():
        raise PropertyError(f"{what} gives {shown(answer)}; {needed}, of size {LARGEST:g} at most")
    return found


def reals(value: Any) -> Array:
    """Numbers of any shape as an array of floats; TypeError or ValueError if there are others than real numbers."""
    array = np.asarray(value)
    if array.dtype.kind in "iuf":
        return array.astype(np.float64)
    plain = [_real(x) for x in array.ravel().tolist()] if array.dtype.kind == "O" else [None]
    if None in plain:
        raise TypeError(f"{shown(value)} is no real number, nor an array of them")
    return np.array(plain, dtype=np.float64).reshape(array.shape)


def _real(value: object) -> float | None:
    """A real number as a float, infinite where it is too large; None if it is none."""
    if type(value) is np.ndarray and value.ndim == 0:
        value = value.item()
    if not isinstance(value, Real | Decimal) or isinstance(value, bool | np.timedelta64):
        return None
    try:
        return float(value)
    except OverflowError:
        return float("inf")
    except Exception:  # a number of another package, or a Decimal that signals
        return None


def has_length(value: object, lengths: Sequence[int]) -> bool:
    """Whether a value is an ordered sequence or an array of so many things; texts, sets and mappings are none."""
    if isinstance(value, np.ndarray):
        return type(value) is np.ndarray and value.ndim == 1 and len(value) in lengths
    if not isinstance(value, Sequence) or isinstance(value, str | bytes | bytearray | memoryview):
        return False
    return len(value) in lengths


def several(what: str, things: object, needed: str, error: type[AnctmmError]) -> list[Any]:
    """Things of an ordered iterable that ends, as a list; the error names what they are and what is needed."""
    single = getattr(things, "ndim", 1) == 0  # an array of one number says that it is iterable
    if single or isinstance(things, str | bytes | Set | Mapping) or not isinstance(things, Iterable):
        raise error(f"{what} {shown(things)}; {needed}")
    found = list(islice(things, MANY + 1))
    if len(found) > MANY:
        raise error(f"{what} {shown(things)} of more than {MANY} things; {needed}, and {MANY} at most")
    return found
