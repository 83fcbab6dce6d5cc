"""Consistency of drives: rates and accelerations must be the derivatives of a continuous angle or position.

A drive returns a value with its derivatives, and solvers use each of them: positions from one, velocities, work and the
start from the others. If they are no derivatives, all of this is wrong, and no energy balance shows it.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import PropertyError
from anctmm.model.connectors import Spring, free_name, name_of
from anctmm.model.drives import Quintic, tabulate
from anctmm.model.joints import drive_of
from anctmm.model.scene import Scene
from anctmm.results.checks.finding import Finding
from anctmm.results.checks.scales import EPS
from anctmm.results.solution import Solution

Array = NDArray[np.float64]

#: Times that are looked at, and differences in time, of the run: any of these may suit a history.
TIMES, DIFFERENCES = 8, np.array([1e-3, 1e-5, 1e-7])
#: Difference, of the largest rate, from which on a rate is none.
WRONG = 0.1
#: Roundings of a value.
ROUNDING = 8.0 * EPS
#: Intervals of a run that are searched for a jump, and halvings that find it; part of what a drive moves from which on
#: it counts.
INTERVALS, HALVINGS, COUNTS = 64, 20, 0.05
#: What derivatives are called, by the order of what they are derivatives of.
NAMES = ("rate", "acceleration")


class Drive(NamedTuple):
    """A drive of a joint, or the free length or angle of a connector, which gives `width` numbers."""

    name: str
    history: Callable[[Any], Any]
    width: int
    unit: str

    def at(self, times: Array) -> Array:
        """Values and derivatives, (times, width)."""
        return tabulate(self.name, self.history, times, self.width)


def drives_of(scene: Scene) -> Iterator[Drive]:
    """Drives of joints and of connectors."""
    for joint in scene.joints:
        if (drive := drive_of(joint)) is not None:
            yield Drive(drive[0], drive[1], 3, drive[2])
    for connector in scene.connectors:
        free, unit = (connector.length, "m") if isinstance(connector, Spring) else (connector.angle, "rad")
        if callable(free):
            yield Drive(f"{name_of(connector)} {free_name(connector)}", free, 2, unit)


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


def _wrong(drive: Drive, end: float) -> tuple[float, str] | None:
    """A time at which a drive's rate or acceleration is no derivative, and the message."""
    times = end * (np.arange(TIMES) + 0.618) / (TIMES + 0.236)
    steps = end * DIFFERENCES[:, None]
    table = drive.at(np.concatenate([times, (times - steps).ravel(), (times + steps).ravel()]))
    here, before, after = np.split(table, [TIMES, TIMES * (1 + len(DIFFERENCES))])
    for order in range(drive.width - 1):
        ahead, back = (x[:, order].reshape(len(steps), TIMES) for x in (after, before))
        rate, slopes = here[:, order + 1], (ahead - back) / (2.0 * steps)
        largest = max(float(np.abs(rate).max()), float(np.abs(slopes[0]).max()))
        off = np.abs(slopes - rate) - ROUNDING * np.abs(table[:, order]).max() / (2.0 * steps)
        wrong = (off > WRONG * largest).all(axis=0)
        moving = np.maximum(np.abs(rate), np.abs(slopes[0])) > WRONG * largest
        if wrong.any() and 2 * wrong.sum() > moving.sum():
            k = int(np.where(wrong, off.min(axis=0), -np.inf).argmax())
            unit, slope = f"{drive.unit}/s{'²' * order}", float(slopes[np.abs(off[:, k]).argmin(), k])
            return float(times[k]), (
                f"{drive.name}: its {NAMES[order]} is {rate[k]:.6g} {unit} at t = {times[k]:.6g} s, where it is "
                f"{slope:.6g} {unit} by differences; the derivatives of its {'rate' if order else 'value'} are needed"
            )
    return None


def _jump(drive: Drive, end: float) -> tuple[float, str] | None:
    """A time at which a drive of a joint jumps, and the message; a free length may jump, as it only changes a force.

    In the interval in which the value changes most beside its rate, halved again and again, a jump stays what it is.
    """
    if drive.width != 3:
        return None
    times = np.linspace(0.0, end, INTERVALS + 1)
    table = drive.at(times)
    least = max(COUNTS * float(np.ptp(table[:, 0])), 1e3 * ROUNDING * float(np.abs(table[:, 0]).max()))
    for _ in range(HALVINGS + 1):
        missed = np.abs(np.diff(table[:, 0]) - 0.5 * (table[1:, 1] + table[:-1, 1]) * np.diff(times))
        k = int(np.argmax(missed))
        if not missed[k] > 0.5 * least:
            return None
        middle = np.array([0.5 * (times[k] + times[k + 1])])
        jump, later = table[k + 1, 0] - table[k, 0], float(times[k + 1])
        times = np.array([times[k], middle[0], times[k + 1]])
        table = np.stack([table[k], drive.at(middle)[0], table[k + 1]])
    return later, (
        f"{drive.name}: it jumps by {jump:.6g} {drive.unit} at t = {later:.6g} s, which no step can follow; a drive "
        f"that takes some time is needed, such as anctmm.Quintic"
    )
