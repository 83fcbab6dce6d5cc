"""Consistency of drives: rates and accelerations must be the derivatives of a continuous angle or position.

A drive returns a value with its derivatives, and solvers use each of them: positions from one, velocities, work and the
start from the others. If they are no derivatives, all of this is wrong, and no energy balance shows it.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import PropertyError
from anctmm.model.connectors import Spring, free_name, name_of
from anctmm.model.drives import Pulse, Quintic, tabulate
from anctmm.model.joints import drive_of
from anctmm.model.kept import kept
from anctmm.model.scene import Scene
from anctmm.results.checks.finding import FATAL, Finding
from anctmm.results.solution import Solution

Array = NDArray[np.float64]
#: A drive's name, history, number of values and unit.
Drive = tuple[str, Callable[[Any], Any], int, str]

#: Times that are looked at, and differences in time, of the run: any of these may suit a history.
TIMES, DIFFERENCES = 8, np.array([1e-3, 1e-5, 1e-7])
#: Difference, of the largest rate, from which on a rate is none.
WRONG = 0.1
#: Roundings of a value.
ROUNDING = 8.0 * float(np.finfo(float).eps)
#: Intervals of a run that are searched for a jump, and halvings that find it; part of what a drive moves from which on
#: it counts, and part of it that is left in the end.
INTERVALS, HALVINGS, COUNTS, LEFT = 64, 20, 0.05, 0.5
#: Part of a run within which after its failure a drive may be the cause: a step that failed ends there.
MARGIN = 1e-3
#: What derivatives are called, by the order of what they are derivatives of.
NAMES = ("rate", "acceleration")


def drive_findings(solution: Solution) -> Iterator[Finding]:
    """Drives whose rate or acceleration is another one, at most of the times at which they move, or which jump."""
    if solution.run is None:
        return
    for t, message in _faults(solution.scene, solution.run.t_end):
        place = min(int(np.searchsorted(solution.t, t)), solution.t.size - 1)
        yield Finding(place, "inaccurate", message, None, None)


def with_drives(solution: Solution) -> Solution:
    """A run that has failed, whose status names the drives that jump, or whose derivatives are wrong, until then."""
    status, run = solution.status, solution.run
    if status.code not in FATAL or status.time is None or run is None:
        return solution
    end = min(status.time + MARGIN * run.t_end, run.t_end)
    causes = [message for _, message in _faults(solution.scene, end)]
    return replace(solution, status=replace(status, message="; ".join([status.message, *causes])))


def _faults(scene: Scene, end: float) -> Iterator[tuple[float, str]]:
    """Drives that are wrong until a time, s: when, and the message."""
    for drive in drives_of(scene):
        if type(drive[1]) in (Quintic, Pulse):
            continue
        for look in (_wrong, _jumps):
            try:
                told = look(drive, end)
            except PropertyError:  # a history that knows the times of steps alone
                continue
            if told is not None:
                yield told
                break


def _wrong(drive: Drive, end: float) -> tuple[float, str] | None:
    """A time at which a drive's rate or acceleration is no derivative, and the message."""
    name, history, width, unit = drive
    times = end * (np.arange(TIMES) + 0.618) / (TIMES + 0.236)
    apart = end * DIFFERENCES[:, None, None] * np.array([[-1.0], [1.0]])
    table = tabulate(name, history, np.concatenate([times, (times + apart).ravel()]), width)
    here, beside = table[:TIMES], table[TIMES:].reshape(len(DIFFERENCES), 2, TIMES, width)
    for order in range(width - 1):
        if (told := _told(here, beside, order, end)) is not None:
            k, slope = told
            return float(times[k]), (
                f"{name}: its {NAMES[order]} is {here[k, order + 1]:.6g} {unit}/s{'²' * order} at t = "
                f"{times[k]:.6g} s, where it is {slope:.6g} {unit}/s{'²' * order} by differences; the derivatives "
                f"of its {'rate' if order else 'value'} are needed"
            )
    return None


def _jumps(drive: Drive, end: float) -> tuple[float, str] | None:
    """A time at which a drive of a joint jumps, and the message; a free length may jump, as it only changes a force.

    In the interval in which the value changes most beside its rate, halved again and again, a jump stays what it is.
    """
    name, history, width, unit = drive
    if width != 3:
        return None
    times = np.linspace(0.0, end, INTERVALS + 1)
    table = tabulate(name, history, times, width)
    missed = _missed(times, table)
    k = int(np.argmax(missed))
    least = max(COUNTS * float(np.ptp(table[:, 0])), 1e3 * ROUNDING * float(np.abs(table[:, 0]).max()))
    if not missed[k] > least:
        return None
    times, table = times[k : k + 2], table[k : k + 2]
    for _ in range(HALVINGS):
        between = 0.5 * (times[0] + times[1])
        times, table = (
            np.insert(times, 1, between),
            np.insert(table, 1, tabulate(name, history, np.array([between]), width), axis=0),
        )
        missed = _missed(times, table)
        k = int(np.argmax(missed))
        if not missed[k] > LEFT * least:
            return None
        times, table = times[k : k + 2], table[k : k + 2]
    return float(times[1]), (
        f"{name}: it jumps by {table[1, 0] - table[0, 0]:.6g} {unit} at t = {times[1]:.6g} s, which no step can "
        f"follow; a drive that takes some time is needed, such as anctmm.Quintic"
    )


def _missed(times: Array, table: Array) -> Array:
    """Change of a value over intervals beside the mean of its rates, (intervals,)."""
    rates = 0.5 * (table[1:, 1] + table[:-1, 1])
    return np.asarray(np.abs(np.diff(table[:, 0]) - rates * np.diff(times)))


@kept
def drives_of(scene: Scene) -> tuple[Drive, ...]:
    """Drives of joints and of connectors."""
    driven = [drive for drive in map(drive_of, scene.joints) if drive is not None]
    found: list[Drive] = [(name, history, 3, unit) for name, history, unit in driven]
    for connector in scene.connectors:
        free = connector.length if isinstance(connector, Spring) else connector.angle
        if callable(free):
            unit = "m" if isinstance(connector, Spring) else "rad"
            found.append((f"{name_of(connector)} {free_name(connector)}", free, 2, unit))
    return tuple(found)


def _told(here: Array, beside: Array, order: int, end: float) -> tuple[int, float] | None:
    """A time at which a derivative is wrong, by number, and what it is there; None where most are right.

    here: (times, width); beside: (differences, 2, times, width), a little before and after.
    """
    value, rate = here[:, order], here[:, order + 1]
    before, after = beside[:, 0, :, order], beside[:, 1, :, order]
    steps = 2.0 * end * DIFFERENCES[:, None]
    slopes = (after - before) / steps
    largest = max(float(np.abs(rate).max()), float(np.abs(slopes[0]).max()))
    noise = ROUNDING * max(float(np.abs(value).max()), float(np.abs(after).max())) / steps
    off = np.abs(slopes - rate) - noise
    wrong = (off > WRONG * largest).all(axis=0)
    moving = (np.abs(rate) > WRONG * largest) | (np.abs(slopes[0]) > WRONG * largest)
    if 2 * wrong.sum() <= moving.sum() or not wrong.any():
        return None
    k = int(np.where(wrong, off.min(axis=0), -np.inf).argmax())
    return k, float(slopes[np.abs(off[:, k]).argmin(), k])
