"""Loads and drives that change within a fixed step, detected by their own breaks.

A fixed step evaluates a history at its two ends. Changes between them are unknown unless the history states its breaks:
then the integral over a step with breaks inside, from break to break, is compared with that of the two end values.
Histories without stated breaks are not examined, because that would take thousands of calls.
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
            yield from _of_load(load_text(load), load.value, width_of(load), solution, run)
    for drive in drives_of(scene):
        yield from _of_drive(*drive, solution, run)


def _broken_steps(name: str, history: Any, run: Discretisation) -> Iterator[list[float]]:
    """Start of each step that has breaks strictly inside, these, and its end, s."""
    found: dict[int, list[float]] = {}
    for t in breaks_of(name, history) or ():
        place = t / run.exact_dt
        if 0.0 < place < run.steps and abs(place - round(place)) > CLOSE:
            found.setdefault(int(place), []).append(t)
    for step, times in found.items():
        first, last = run.times(np.array([step, step + 1])).tolist()
        yield [first, *times, last]


def _of_load(
    name: str, history: Any, width: int, solution: Solution, run: Discretisation
) -> Iterator[Finding]:
    def values(t: Array) -> Array:
        return tabulate(name, history, t, width)

    whole: Any = None
    for times in _broken_steps(name, history, run):
        if whole is None:
            inside = [t for t in breaks_of(name, history) or () if 0.0 < t < run.t_end]
            whole = _integral(lambda t: np.abs(values(t)), [0.0, *inside, run.t_end]).max()
        true, seen = (
            _integral(values, times),
            0.5 * run.exact_dt * values(np.array(times)[[0, -1]]).sum(axis=0),
        )
        if (np.abs(true - seen) > MISSED * whole).any():
            sizes = f"its impulse there is {_shown(true)}, of which steps of {run.exact_dt:g} s include {_shown(seen)}"
            yield _finding(solution, name, times, f"{sizes} {'N s' if width == 2 else 'N m s'}")
            return


def _of_drive(
    name: str, history: Any, width: int, unit: str, solution: Solution, run: Discretisation
) -> Iterator[Finding]:
    def way(t: Array) -> Array:
        return tabulate(name, history, t, width)[:, :1]

    for times in _broken_steps(name, history, run):
        (a, b), h = tabulate(name, history, np.array(times)[[0, -1]], width), times[-1] - times[0]
        cubic = 0.5 * h * (a[0] + b[0]) + h * h * (a[1] - b[1]) / 12.0
        off = abs(float(_integral(way, times)[0]) - cubic) / h
        points = np.linspace(0.0, run.t_end, 8 * len(times) + 1)
        moved = way(np.concatenate([points, times]))
        if off > MISSED * float(np.abs(moved - moved[0]).max()):
            said = f"it moves there by {off:.3g} {unit} in the mean, which steps of {run.exact_dt:g} s do not include"
            yield _finding(solution, name, times, said)
            return


def _integral(values: Values, times: list[float]) -> Array:
    """Integral from the first to the last time, smooth between two of them, (width,)."""
    a, b = np.array(times[:-1])[:, None], np.array(times[1:])[:, None]
    t, weights = 0.5 * (a + b) + 0.5 * (b - a) * _POINTS, 0.5 * (b - a) * _WEIGHTS
    return weights.ravel() @ values(t.ravel())  # type: ignore[no-any-return]


def _finding(solution: Solution, name: str, times: list[float], said: str) -> Finding:
    output = min(int(np.searchsorted(solution.t, times[0], side="right")), max(solution.t.size - 1, 0))
    advice = f"a dt below {0.1 * min(np.diff(times)):.2g} s may help, or steps that end at its breaks, or `tolerance`"
    message = f"{name}: it breaks within the step from t = {times[0]:.6g} s; {said}; {advice}"
    return Finding(output, "inaccurate", message)


def _shown(values: Array) -> str:
    return ", ".join(f"{v:.3g}" for v in values)
