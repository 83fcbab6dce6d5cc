"""Values of a run with their uncertainty: how many of their digits are correct."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import takewhile
from math import floor, inf, isfinite, log10, nan

import numpy as np
import pandas as pd

from anctmm.errors import ResultError
from anctmm.model.case import Case
from anctmm.model.rigid_bodies import PointMass
from anctmm.results.metrics import EPS, ROUNDINGS
from anctmm.results.solution import Solution
from studies.engine.accuracy.refinement import Refined
from studies.engine.accuracy.richardson import left_in
from studies.engine.place_texts import place_texts
from studies.engine.tables import Table

#: Part of the whole history's error that every value has at least: two runs may agree in one number by chance.
#: A tenth was seen to be too small by an eighth.
SHARE = 0.2
#: What rounding leaves of a number, in parts of what it is the difference of: no value is better known.
ROUNDING = ROUNDINGS * EPS
#: Digits that are counted at most.
MOST_DIGITS = 12
#: What is the largest of a motion is so of its outputs: its name says it, and a note what that means.
AT_OUTPUTS = "at the outputs"
OUTPUTS_NOTE = (
    f"{AT_OUTPUTS}: between two of them it may be larger, by more than the uncertainty; a smaller output_dt of the "
    "case shows it."
)
#: Digits of a value whose uncertainty is not known.
DIGITS = 6


@dataclass(frozen=True)
class Value:
    """A number with its unit, and how far it may be from the exact one.

    Parameters
    ----------
    probe, quantity, unit : str
    value : float
    uncertainty : float
        NaN where it was not estimated; of a `Reading` what rounding leaves.
    """

    probe: str
    quantity: str
    unit: str
    value: float
    uncertainty: float = nan

    @property
    def digits(self) -> int | None:
        """How many digits hold: to half a unit of the last of them; None where that is not known."""
        if not isfinite(self.uncertainty) or not self.value:
            return None
        if not self.uncertainty > 0.0:
            return MOST_DIGITS
        first = floor(log10(abs(self.value)))
        return min(max(floor(first + 1 + log10(0.5 / self.uncertainty)), 0), MOST_DIGITS)

    @property
    def text(self) -> str:
        """The value to its last sure digit, with its uncertainty and unit."""
        if not isfinite(self.uncertainty):
            return f"{self.value:.{DIGITS}g} {self.unit}"
        about = f"{self.uncertainty:.1g}"
        if 10.0 <= self.uncertainty < 1e6:  # no power of ten where the number is as short
            about = f"{float(about):.0f}"
        return f"{rounded(self.value, self.uncertainty)} ± {about} {self.unit}"


def rounded(value: float, uncertainty: float) -> str:
    """A value down to the first digit of its uncertainty; no more than twelve digits."""
    if not uncertainty > 0.0:
        return f"{value:.12g}"
    place = -floor(log10(float(f"{uncertainty:.1g}")))  # 0.00096 is shown as 0.001
    if abs(value) < 0.5 * uncertainty:  # no digit holds
        return f"{0.0:.{min(place, 11)}f}" if 0 <= place <= 6 else "0"
    first = floor(log10(abs(value))) if value else -place
    if first < -4 or first > 6:
        return f"{value:.{min(max(first + place, 0), 11)}e}"
    return f"{round(value, place) if place < 0 else value:.{max(min(place, 11 - first), 0)}f}"


def at_probes(solution: Solution, case: Case) -> Iterator[tuple[Value, float]]:
    """For each probe its place and its angle at the end, and its largest displacement, as a `Reading`."""
    if not len(solution.t):
        return
    largest = largest_of("displacement", case)
    when = "at rest" if case.static else f"at {solution.t[-1]:.4g} s"
    for probe, name in place_texts(case.probes).items():
        path = solution.position(probe)
        way = float(np.linalg.norm(path - path[0], axis=1).max())
        least = ROUNDING * max(case.scene.length, float(np.abs(path).max()))
        yield Value(name, f"x {when}", "m", float(path[-1, 0]), least), way
        yield Value(name, f"y {when}", "m", float(path[-1, 1]), least), way
        yield Value(name, largest, "m", way, least), way
        if isinstance(case.scene.place(probe).body, PointMass):  # it does not turn
            continue
        with suppress(ResultError):  # not every solver keeps angles
            angle = solution.angle(probe)
            yield (
                Value(name, f"angle {when}", "rad", float(angle[-1]), ROUNDING),
                float(np.abs(angle).max(initial=-inf)),
            )


def largest_of(what: str, case: Case) -> str:
    """What the largest of a history is called: of a motion it is that of the outputs."""
    return f"largest {what}" if case.static else f"largest {what} {AT_OUTPUTS}"


Reading = Callable[[Solution, Case], Iterator[tuple[Value, float]]]
"""(solution, case) → values with what rounding leaves, each with a size that its uncertainty is at home in."""


def values_of(found: Refined, read: Reading = at_probes) -> list[Value]:
    """What is read off a run, with uncertainties from the next coarser mesh and step.

    Parameters
    ----------
    found : Refined
    read : callable
        What is read off a solution: of all runs of a case the same values, in the same order.

    Returns
    -------
    list of Value
    """
    case, levels = found.levels.case, found.levels
    own = list(read(found.solution, case))
    known = levels.estimates and isfinite(found.error) and found.solution.status.ok
    if not known:
        return [replace(value, uncertainty=nan) for value, _ in own]
    place = found.i, found.j
    ways = [
        (_numbers(runs, case, read), part)
        for runs, part in ((levels.mesh_runs(*place), found.mesh), (levels.step_runs(*place), found.step))
    ]
    values = []
    for k, (value, size) in enumerate(own):
        apart = sum(left_in([numbers[k] for numbers in way], part) for way, part in ways)
        values.append(replace(value, uncertainty=max(apart, SHARE * found.error * size, value.uncertainty)))
    return values


def values_table(values: Sequence[Value]) -> Table:
    """Values as a table."""
    columns = ["probe", "quantity", "value", "uncertainty", "unit"]
    frame = pd.DataFrame([vars(v) for v in values], columns=columns)
    notes = (
        "uncertainty: an estimate of what mesh and step leave, from coarser runs; none where it was not estimated.",
        *([OUTPUTS_NOTE] if any(AT_OUTPUTS in value.quantity for value in values) else []),
    )
    return Table("values", "Values and their uncertainty", frame, notes)


def _numbers(runs: Sequence[Solution], case: Case, read: Reading) -> list[list[float]]:
    """Values of runs on levels from fine to coarse; of those that are whole."""
    whole = takewhile(lambda solution: solution.status.ok, runs)
    return [[value.value for value, _ in read(solution, case)] for solution in whole]
