"""Histories of loads, drives and free lengths: what is wrong with them, or what steps miss of them.

A drive returns a value with its derivatives, and solvers use each of them: positions from one, velocities, work and the
start from the others. If they are no derivatives, all of this is wrong, and no energy balance shows it.

A fixed step evaluates a history at its two ends. Changes between them are unknown unless the history states its breaks:
then the integral over a step with breaks inside, from break to break, is compared with the trapezoidal rule of the end
values. Histories without stated breaks are not examined, because that would take thousands of calls.
"""

from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import PropertyError
from anctmm.model.drives import Quintic, breaks_of
from anctmm.results.checks.finding import Finding
from anctmm.results.checks.scales import History, drives_of, histories_of_loads
from anctmm.results.solution import Solution
from anctmm.validation import EPS

Array = NDArray[np.float64]

#: Difference, of the largest rate, from which on a rate is none; part of the integral over the run of a load, or of
#: what a drive adds to its start, that a step may miss.
WRONG = 0.1


def break_findings(solution: Solution) -> Iterator[Finding]:
    """Loads and drives of which a step of fixed length misses a large part."""
    run, scene = solution.run, solution.scene
    if run is None or run.tolerance is not None:
        return
    for history in [*histories_of_loads(scene), *drives_of(scene)]:
        breaks = breaks_of(history.name, history.history) or ()
        whole = [0.0, *(t for t in breaks if 0.0 < t < run.t_end), run.t_end]
        for times in _broken_steps(breaks, run):
            t, weights = _points(times)
            seen = 0.5 * (times[-1] - times[0]) * history.moved(np.array(times)[[0, -1]]).sum(axis=0)
            missed = np.abs(weights @ history.moved(t) - seen)
            t, weights = _points(whole)
            if (missed > WRONG * (weights @ np.abs(history.moved(t))).max()).any():
                output = min(int(np.searchsorted(solution.t, times[0], side="right")), solution.t.size - 1)
                message = (
                    f"{history.name}: it breaks within the step from t = {times[0]:.6g} s, of which steps of "
                    f"{run.exact_dt:g} s miss a large part; a dt below {0.1 * min(np.diff(times)):.2g} s may help, or "
                    f"steps that end at its breaks, or `tolerance`"
                )
                yield Finding(output, "inaccurate", message)
                break


def _broken_steps(breaks: tuple[float, ...], run: Discretisation) -> Iterator[list[float]]:
    """Start of each step that has breaks strictly inside, these, and its end, s."""
    found: dict[int, list[float]] = {}
    for t in breaks:
        place = t / run.exact_dt
        if 0.0 < place < run.steps and abs(place - round(place)) > 1e-6:
            found.setdefault(int(place), []).append(t)
    for step, times in found.items():
        first, last = run.times(np.array([step, step + 1])).tolist()
        yield [first, *times, last]


def _points(times: list[float]) -> tuple[Array, Array]:
    """Gauss points from each time to the next, between which a history is smooth, and their weights, s."""
    x, w = np.polynomial.legendre.leggauss(8)
    a, b = np.array(times[:-1])[:, None], np.array(times[1:])[:, None]
    return (0.5 * (a + b) + 0.5 * (b - a) * x).ravel(), (0.5 * (b - a) * w).ravel()


def drive_findings(solution: Solution) -> Iterator[Finding]:
    """Drives whose rate or acceleration is another one, at most of the times at which they move, or which jump."""
    if solution.run is None:
        return
    for drive in drives_of(solution.scene):
        if type(drive.history) is Quintic:
            continue
        with suppress(PropertyError):  # of a history that knows the times of steps alone
            found = _wrong(drive, solution.run.t_end) or _jump(drive, solution.run.t_end)
            if found is not None:
                output = min(int(np.searchsorted(solution.t, found[0])), solution.t.size - 1)
                yield Finding(output, "inaccurate", found[1])


def _wrong(drive: History, end: float) -> tuple[float, str] | None:
    """A time at which a drive's rate or acceleration is no derivative, and the message."""
    times: Any = end * (np.arange(8) + 0.618) / 8.236
    steps: Any = end * np.array([[1e-3], [1e-5], [1e-7]])
    here, before, after = (drive.at((times + step).ravel()) for step in (0.0, -steps, steps))
    for order in range(drive.width - 1):
        ahead, back = (x[:, order].reshape(len(steps), -1) for x in (after, before))
        rate, slopes = here[:, order + 1], (ahead - back) / (2.0 * steps)
        largest = max(float(np.abs(rate).max()), float(np.abs(slopes[0]).max()))
        rounding = 8.0 * EPS * max(np.abs(ahead).max(), np.abs(back).max())
        off = np.abs(slopes - rate) - rounding / (2.0 * steps)
        wrong = (off > WRONG * largest).all(axis=0)
        moving = np.maximum(np.abs(rate), np.abs(slopes[0])) > WRONG * largest
        if 2 * wrong.sum() > moving.sum() and wrong.any():
            k = int(np.where(wrong, off.min(axis=0), -np.inf).argmax())
            name, of, unit = ("acceleration", "rate", "/s²") if order else ("rate", "value", "/s")
            slope = float(slopes[np.abs(off[:, k]).argmin(), k])
            return float(times[k]), (
                f"{drive.name}: its {name} is {rate[k]:.6g} {drive.unit}{unit} at t = {times[k]:.6g} s, where it is "
                f"{slope:.6g} {drive.unit}{unit} by differences; the derivatives of its {of} are needed"
            )
    return None


def _jump(drive: History, end: float) -> tuple[float, str] | None:
    """A time at which a drive of a joint jumps, and the message; a free length may jump, as it only changes a force.

    In the interval in which the value changes most beside its rate, halved again and again, a jump stays what it is.
    """
    if drive.width != 3:
        return None
    times = np.linspace(0.0, end, 65)
    table = drive.at(times)
    least = max(0.05 * float(np.ptp(table[:, 0])), 1e4 * EPS * float(np.abs(table[:, 0]).max()))
    for _ in range(21):
        missed = np.abs(np.diff(table[:, 0]) - 0.5 * (table[1:, 1] + table[:-1, 1]) * np.diff(times))
        k = int(np.argmax(missed))
        if not missed[k] > 0.5 * least:
            return None
        jump, times = table[k + 1, 0] - table[k, 0], np.linspace(times[k], times[k + 1], 3)
        table = np.stack([table[k], drive.at(times[1:2])[0], table[k + 1]])
    return float(times[-1]), (
        f"{drive.name}: it jumps by {jump:.6g} {drive.unit} at t = {times[-1]:.6g} s, which no step can follow; a "
        f"drive that takes some time is needed, such as anctmm.Quintic"
    )
