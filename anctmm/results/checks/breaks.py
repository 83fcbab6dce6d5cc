"""Loads and drives that change within a fixed step, detected by their own breaks.

A fixed step evaluates a history at its two ends. Changes between them are unknown unless the history states its breaks:
then the integral over a step with breaks inside, from break to break, is compared with that of the end values: by the
trapezoidal rule of loads, and with the rates of drives. Histories without stated breaks are not examined, because that
would take thousands of calls.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.drives import breaks_of, tabulate
from anctmm.model.loads import load_text, width_of
from anctmm.results.checks.drives import drives_of
from anctmm.results.checks.finding import Finding
from anctmm.results.solution import Solution

Array = NDArray[np.float64]
#: Times → numbers, (times, width).
Values = Callable[[Array], Array]

#: Part of the whole impulse of a load, or of the largest way of a drive over a step, that a step may miss.
MISSED = 0.1
#: Part of a step within which a break and its end are one.
CLOSE = 1e-6
#: Gauss points between two breaks.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def break_findings(solution: Solution) -> Iterator[Finding]:
    """Loads and drives of which a step of fixed length misses a large part."""
    run, scene = solution.run, solution.scene
    if run is None or run.tolerance is not None:
        return
    for load in scene.loads:
        if callable(load.value):
            yield from _missed(load_text(load), load.value, width_of(load), "", solution, run)
    for drive in drives_of(scene):
        yield from _missed(drive.name, drive.history, drive.width, drive.unit, solution, run)


def _missed(
    name: str, history: Any, width: int, unit: str, solution: Solution, run: Discretisation
) -> Iterator[Finding]:
    """The first step that misses a large part of a load, or of a drive, which has a unit."""

    def values(t: Array) -> Array:
        found = tabulate(name, history, t, width)
        return found[:, :1] - start if unit else found

    start = tabulate(name, history, np.zeros(1), width)[0, 0] if unit else 0.0
    breaks = breaks_of(name, history) or ()
    whole = [0.0, *(t for t in breaks if 0.0 < t < run.t_end), run.t_end]
    for times in _broken_steps(breaks, run):
        ends, h = np.array(times)[[0, -1]], times[-1] - times[0]
        true, seen = _integral(values, times), 0.5 * h * values(ends).sum(axis=0)
        if unit:
            rates = tabulate(name, history, ends, width)[:, 1]
            seen = seen + h * h * (rates[0] - rates[1]) / 12.0
            most = h * float(np.abs(values(_points(whole)[0])).max())
        else:
            most = float(_integral(lambda t: np.abs(values(t)), whole).max())
        if (np.abs(true - seen) > MISSED * most).any():
            exact, known = (", ".join(f"{v:.3g}" for v in part) for part in (true, seen))
            of = f"{unit} s" if unit else "N s" if width == 2 else "N m s"
            message = (
                f"{name}: it breaks within the step from t = {times[0]:.6g} s; its integral over that is {exact} {of}, "
                f"of which steps of {run.exact_dt:g} s include {known}; a dt below {0.1 * min(np.diff(times)):.2g} s "
                f"may help, or steps that end at its breaks, or `tolerance`"
            )
            output = min(int(np.searchsorted(solution.t, times[0], side="right")), solution.t.size - 1)
            yield Finding(output, "inaccurate", message)
            return


def _broken_steps(breaks: tuple[float, ...], run: Discretisation) -> Iterator[list[float]]:
    """Start of each step that has breaks strictly inside, these, and its end, s."""
    found: dict[int, list[float]] = {}
    for t in breaks:
        place = t / run.exact_dt
        if 0.0 < place < run.steps and abs(place - round(place)) > CLOSE:
            found.setdefault(int(place), []).append(t)
    for step, times in found.items():
        first, last = run.times(np.array([step, step + 1])).tolist()
        yield [first, *times, last]


def _points(times: list[float]) -> tuple[Array, Array]:
    """Gauss points between the times, and their weights, s."""
    a, b = np.array(times[:-1])[:, None], np.array(times[1:])[:, None]
    return (0.5 * (a + b) + 0.5 * (b - a) * _POINTS).ravel(), (0.5 * (b - a) * _WEIGHTS).ravel()


def _integral(values: Values, times: list[float]) -> Array:
    """Integral from the first to the last time, smooth between two of them, (width,)."""
    t, weights = _points(times)
    return weights @ values(t)  # type: ignore[no-any-return]
