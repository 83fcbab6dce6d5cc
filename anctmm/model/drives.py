"""Histories in time: of a clamp's angle (angle, rate, acceleration) and of loads (one value).

A history may have an attribute `breaks`, the times at which it or a derivative of it jumps: steps of runs with a
tolerance end there, and runs of a fixed step say what falls between their steps. `History` gives it to any callable.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import PropertyError, reason
from anctmm.validation import LARGEST, number, positive, reals

Angle = Callable[[Any], tuple[Any, Any, Any]]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Quintic:
    """Rest-to-rest motion θ(t) = turn · s(t/duration), s(x) = 10x³ − 15x⁴ + 6x⁵, then held.

    Parameters
    ----------
    turn : float
        Whole angle, rad; of a guide the whole distance, m.
    duration : float
        Time it takes, s.
    """

    turn: float
    duration: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "turn", number("Quintic turn (rad)", self.turn))
        object.__setattr__(self, "duration", positive("Quintic duration (s)", self.duration))

    def __call__(self, t: Any) -> tuple[Any, Any, Any]:
        """Angle (rad) or distance (m), its rate (per s) and acceleration (per s²) at the time(s) `t` (s)."""
        x = _within(np.asarray(t, dtype=float) / self.duration)
        y = 1.0 - x
        angle = self.turn * (x**3 * (10.0 + x * (6.0 * x - 15.0)))
        rate = self.turn / self.duration * (30.0 * (x * y) ** 2)
        acceleration = self.turn / self.duration**2 * (60.0 * x * y * (y - x))
        return angle, rate, acceleration

    @property
    def breaks(self) -> tuple[float, float]:
        """Start and end, s, where its third derivative jumps."""
        return 0.0, self.duration


@dataclass(frozen=True)
class Pulse:
    """Smooth load pulse amplitude · sin²(πt/duration) on [0, duration], then zero."""

    amplitude: float
    duration: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "amplitude", number("Pulse amplitude", self.amplitude))
        object.__setattr__(self, "duration", positive("Pulse duration (s)", self.duration))

    def __call__(self, t: Any) -> Any:
        """Value at the time(s) `t` (s)."""
        x = _within(np.asarray(t, dtype=float) / self.duration)
        return self.amplitude * np.sin(np.pi * x) ** 2

    @property
    def breaks(self) -> tuple[float, float]:
        """Start and end, s, where its second derivative jumps."""
        return 0.0, self.duration


def _within(x: Any) -> Any:
    """Numbers bounded by 0 and 1; `clip` takes five times as long."""
    return np.minimum(np.maximum(x, 0.0), 1.0)


@dataclass(frozen=True)
class History:
    """A history of your own with the times at which it breaks.

    Parameters
    ----------
    function : callable
        t (s) → what a load or a clamp's angle needs.
    breaks : sequence of float
        Times at which the function or one of its derivatives jumps, s; empty for one that is smooth everywhere.

    Raises
    ------
    PropertyError
        If the function cannot be called, or a break is no finite number.

    Examples
    --------
    >>> kick = History(lambda t: (0.0, -5.0 if 2.0 <= t < 2.3 else 0.0), breaks=[2.0, 2.3])
    >>> kick(2.1)
    (0.0, -5.0)
    """

    function: Callable[[Any], Any]
    breaks: tuple[float, ...] = ()

    if TYPE_CHECKING:  # what is accepted; attributes hold what became of it

        def __init__(
            self,
            function: Callable[[Any], Any],
            breaks: Iterable[float] | NDArray[np.floating] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise PropertyError(f"History function is {self.function!r}; a callable t -> value is needed")
        object.__setattr__(self, "breaks", breaks_of("History", self))

    def __call__(self, t: Any) -> Any:
        """Value at the time(s) `t` (s)."""
        return self.function(t)


def breaks_of(name: str, history: object) -> tuple[float, ...] | None:
    """Times at which a history says that it breaks, ascending, s; None if it says nothing.

    Parameters
    ----------
    name : str
        What the history drives, for the message of an error.
    history : object
        Anything; its attribute `breaks` is read.

    Raises
    ------
    PropertyError
        If the breaks are no finite numbers.
    """
    stated = getattr(history, "breaks", None)
    if stated is None:
        return None
    if isinstance(stated, str) or not isinstance(stated, Iterable):
        raise PropertyError(f"{name} breaks is {stated!r}; a sequence of times (s) is needed")
    return tuple(sorted({number(f"{name} break (s)", t) for t in stated}))


def value_at(name: str, history: Callable[[Any], Any], time: float, width: int) -> Array:
    """Values of a history at one time, (width,); parameters and errors as of `tabulate`."""
    try:
        values = reals(history(time)).reshape(width)
    except (Exception, SystemExit) as error:  # a user's function may do anything
        raise PropertyError(
            f"{name}: the history gave no {width} finite number(s) at t = {time!r} s: {reason(error)}"
        ) from error
    _check_finite(name, values[None], np.array([time]))
    return values


def tabulate(name: str, history: Callable[[Any], Any], t: Array, width: int) -> Array:
    """Values of a history at many times, by one array call where the callable allows it.

    Parameters
    ----------
    name : str
        What the history drives, for the message of an error.
    history : callable
        t (s) → one value (`width` 1) or a sequence of `width` values.
    t : ndarray, shape (n,)
        Times, s.
    width : int
        Values expected at each time.

    Returns
    -------
    ndarray, shape (n, width)

    Raises
    ------
    PropertyError
        If the callable raises, or gives another number of values, or a value that is not finite.
    """

    def one(time: float) -> Array:
        return value_at(name, history, time, width)

    table = np.empty((len(t), width))
    if len(t) == 0:
        return table
    samples = {i: one(float(t[i])) for i in (0, len(t) // 2, len(t) - 1)}
    if not _by_one_call(history, t, table) or any(
        (np.abs(table[i] - v) > 1e-12 * np.abs(v)).any() for i, v in samples.items()
    ):
        for i, time in enumerate(t):
            table[i] = one(float(time))
    _check_finite(name, table, t)
    return table


def _by_one_call(history: Callable[[Any], Any], t: Array, table: Array) -> bool:
    """Fill a table by one call with all times; False if the history takes numbers only."""
    width = table.shape[1]
    try:
        with np.errstate(all="ignore"):
            values = history(t.copy())  # it may write into what it is given
        columns = [values] if width == 1 else list(values)
        table[:] = np.stack([np.broadcast_to(reals(c), t.shape) for c in columns], axis=1)
    except (Exception, SystemExit):  # whatever it raises on an array
        return False
    return len(columns) == width


def _check_finite(name: str, table: Array, t: Array) -> None:
    good = np.abs(table) <= LARGEST
    if not good.all():
        row = int(np.flatnonzero(~good.all(axis=1))[0])
        raise PropertyError(
            f"{name}: the history is {table[row].tolist()!r} at t = {float(t[row])!r} s; finite numbers are needed, "
            f"of size {LARGEST:g} at most"
        )
