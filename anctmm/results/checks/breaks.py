"""Loads and drives that change within a fixed step, detected by their own breaks.

A fixed step evaluates a history at its two ends. Changes between them are unknown unless the history states its breaks:
then the impulse of a step with breaks inside is integrated from break to break and compared with that of the two end
values. Histories without stated breaks are not examined, because that would take thousands of calls.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.drives import breaks_of, tabulate
from anctmm.model.loads import load_text, width_of
from anctmm.results.checks.drives import Drive, drives_of
from anctmm.results.checks.finding import Finding
from anctmm.results.solution import Solution

Array = NDArray[np.float64]

#: Part of the whole impulse of a load, or of the largest way of a drive, that a step may miss.
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
            width = width_of(load)
            name = load_text(load)
            yield from _of_load(name, load.value, width, solution, run)
    for drive in drives_of(scene):
        yield from _of_drive(drive, solution, run)


def broken_steps(breaks: tuple[float, ...] | None, run: Discretisation) -> dict[int, list[float]]:
    """Breaks strictly inside a step, by the number of the step's start."""
    found: dict[int, list[float]] = {}
    for t in breaks or ():
        place = t / run.exact_dt
        if 0.0 < place < run.steps and abs(place - round(place)) > CLOSE:
            found.setdefault(int(place), []).append(t)
    return found


def _of_load(
    name: str, history: Callable[[Any], Any], width: int, solution: Solution, run: Discretisation
) -> Iterator[Finding]:
    breaks = breaks_of(name, history)
    steps = broken_steps(breaks, run)
    if not steps:
        return
    inside = [t for t in breaks or () if 0.0 < t < run.t_end]
    whole = _integral(name, history, width, [0.0, *inside, run.t_end], absolute=True)
    for step, times in steps.items():
        ends = run.times(np.array([step, step + 1]))
        true = _integral(name, history, width, [float(ends[0]), *times, float(ends[1])])
        seen = 0.5 * run.exact_dt * tabulate(name, history, ends, width).sum(axis=0)
        if (np.abs(true - seen) > MISSED * whole.max()).any():
            unit = "N s" if width == 2 else "N m s"
            yield _finding(
                solution,
                float(ends[0]),
                f"{name}: it breaks within the step from t = {float(ends[0]):.6g} s; its impulse there is "
                f"{_said(true)} {unit}, of which steps of {run.exact_dt:g} s include {_said(seen)}; "
                f"{_advice(times, run)}",
            )
            return


def _of_drive(drive: Drive, solution: Solution, run: Discretisation) -> Iterator[Finding]:
    name, history, width, unit = drive
    breaks = breaks_of(name, history)
    steps = broken_steps(breaks, run)
    if not steps:
        return
    inside = [t for t in breaks or () if 0.0 < t < run.t_end]
    values = tabulate(name, history, np.append(0.0, _points([0.0, *inside, run.t_end])[0]), width)[:, 0]
    largest = np.abs(values - values[0]).max()
    for step, times in steps.items():
        ends = run.times(np.array([step, step + 1]))
        t, _ = _points([float(ends[0]), *times, float(ends[1])])
        (a, b), h = tabulate(name, history, ends, width), float(ends[1] - ends[0])
        x = (t - ends[0]) / h
        y = 1.0 - x
        cubic = y * y * (1.0 + 2.0 * x) * a[0] + x * x * (1.0 + 2.0 * y) * b[0]
        cubic += h * x * y * (y * a[1] - x * b[1])
        off = float(np.abs(tabulate(name, history, t, width)[:, 0] - cubic).max())
        if off > MISSED * largest:
            moves = "turns" if unit == "rad" else "moves"
            yield _finding(
                solution,
                float(ends[0]),
                f"{name}: it breaks within the step from t = {float(ends[0]):.6g} s and {moves} there by {off:.3g} "
                f"{unit}, which steps of {run.exact_dt:g} s do not include; {_advice(times, run)}",
            )
            return


def _points(times: list[float]) -> tuple[Array, Array]:
    """Gauss points between the times, and their weights, s."""
    a, b = np.array(times[:-1]), np.array(times[1:])
    t = 0.5 * (a + b)[:, None] + 0.5 * (b - a)[:, None] * _POINTS
    return t.ravel(), (0.5 * (b - a)[:, None] * _WEIGHTS).ravel()


def _integral(
    name: str, history: Callable[[Any], Any], width: int, times: list[float], *, absolute: bool = False
) -> Array:
    """Impulse of a load from the first to the last time, (width,); that of its size if `absolute`."""
    t, weights = _points(times)
    values = tabulate(name, history, t, width)
    return weights @ (np.abs(values) if absolute else values)  # type: ignore[no-any-return]


def _finding(solution: Solution, t: float, message: str) -> Finding:
    output = min(int(np.searchsorted(solution.t, t, side="right")), max(solution.t.size - 1, 0))
    return Finding(output, "inaccurate", message, None, None)


def _said(values: Array) -> str:
    return ", ".join(f"{v:.3g}" for v in values)


def _advice(times: list[float], run: Discretisation) -> str:
    apart = float(np.diff(times).min()) if len(times) > 1 else run.exact_dt
    return f"a dt below {0.1 * apart:.2g} s may help, or steps that end at its breaks, or `tolerance`"
