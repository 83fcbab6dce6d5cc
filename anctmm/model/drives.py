"""Histories in time: of a clamp's angle (angle, rate, acceleration) and of loads (one value).

A history may have an attribute `breaks`, the times at which it or a derivative of it jumps: steps of runs with a
tolerance end there, and runs of a fixed step say what falls between their steps. `History` gives it to any callable.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import PropertyError
from anctmm.validation import LARGEST, answer_of, number, positive, reals, several

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
        x = np.clip(np.asarray(t, dtype=float) / self.duration, 0.0, 1.0)
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
        x = np.clip(np.asarray(t, dtype=float) / self.duration, 0.0, 1.0)
        return self.amplitude * np.sin(np.pi * x) ** 2

    @property
    def breaks(self) -> tuple[float, float]:
        """Start and end, s, where its second derivative jumps."""
        return 0.0, self.duration


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
    breaks: Sequence[float] | NDArray[np.floating] = ()

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise PropertyError(f"History function is {self.function!r}; a callable t -> value is needed")
        object.__setattr__(self, "breaks", breaks_of("History", self))

    def __call__(self, t: Any) -> Any:
        """Value at the time(s) `t` (s)."""
        return self.function(t)


def breaks_of(name: str, history: object) -> tuple[float, ...] | None:
    """Times at which a history says by its attribute `breaks` that it breaks, ascending, s; None if it says nothing.

    PropertyError if they are no finite numbers; `name` says what the history drives.
    """
    stated = getattr(history, "breaks", None)
    if stated is None:
        return None
    times = several(f"{name} breaks is", stated, "a sequence of times (s) is needed", PropertyError)
    return tuple(sorted({number(f"{name} break (s)", t) for t in times}))


def value_at(name: str, history: Callable[[Any], Any], time: float, width: int) -> Array:
    """Values of a history at one time, (width,); parameters and errors as of `tabulate`."""
    return answer_of(f"{name} at t = {time!r} s", history, time, count=width)


def tabulate(name: str, history: Callable[[Any], Any], t: Array, width: int) -> Array:
    """Values of a history at times t, s, (n, width), by one array call where the callable allows it.

    PropertyError if the callable raises, or gives another number of values, or a value that is not finite; `name`
    says what the history drives.
    """
    if not len(t):
        return np.empty((0, width))
    table = _by_one_call(history, t, width)
    for i in (0, len(t) // 2, len(t) - 1):
        value = value_at(name, history, float(t[i]), width)
        if table is not None and (np.abs(table[i] - value) > 1e-12 * np.abs(value)).any():
            table = None
    if table is None:
        return np.array([value_at(name, history, time, width) for time in t.tolist()])
    return table


def _by_one_call(history: Callable[[Any], Any], t: Array, width: int) -> Array | None:
    """A table by one call with all times; None if the history takes numbers only, or gives one that is not finite."""
    try:
        with np.errstate(all="ignore"):
            values = history(t.copy())  # it may write into what it is given
        columns = [values] if width == 1 else list(values)
        table = np.stack([np.broadcast_to(reals(c), t.shape) for c in columns], axis=1)
    except (Exception, SystemExit):  # whatever it raises on an array
        return None
    return table if table.shape[1] == width and (np.abs(table) <= LARGEST).all() else None
