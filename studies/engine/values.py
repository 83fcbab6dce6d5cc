"""Numbers with their uncertainty, read from runs: at probes, and in joints and springs."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import takewhile
from math import floor, inf, isfinite, log10, nan

import numpy as np
import pandas as pd

from anctmm.errors import ResultError
from anctmm.model.case import Case
from anctmm.model.joints import Clamp, Joint, Prismatic, Weld
from anctmm.model.places import Written
from anctmm.model.rigid_bodies import PointMass
from anctmm.results.metrics import EPS, ROUNDINGS
from anctmm.results.solution import Solution
from studies.engine.places import place_texts
from studies.engine.refinement import Refined
from studies.engine.richardson import left_in
from studies.engine.tables import Table

#: Part of the error of the history that every value has at least: two runs may agree in one number by chance.
SHARE = 0.2
#: Rounding of a number, in parts of the numbers that it is the difference of.
ROUNDING = ROUNDINGS * EPS
#: Digits that are counted at most; of a value whose uncertainty is not known.
MOST_DIGITS, DIGITS = 12, 6
AT_OUTPUTS = "at the outputs"
OUTPUTS_NOTE = (
    f"{AT_OUTPUTS}: between two of them it may be larger, by more than the uncertainty; a smaller output_dt of the "
    "case shows it."
)


@dataclass(frozen=True)
class Value:
    """A number with its unit and its uncertainty.

    Parameters
    ----------
    probe, quantity, unit : str
    value : float
    uncertainty : float
        NaN where it was not estimated; of a `Reading` that of rounding.
    """

    probe: str
    quantity: str
    unit: str
    value: float
    uncertainty: float = nan

    @property
    def digits(self) -> int | None:
        """Number of correct digits, to half a unit of the last of them; None where that is not known."""
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


Reading = Callable[[Solution, Case], Iterator[tuple[Value, float]]]
"""(solution, case) → values with their rounding, each with the size that errors of histories are relative to."""


def at_probes(solution: Solution, case: Case) -> Iterator[tuple[Value, float]]:
    """For each probe its place and its angle at the end, and its largest displacement."""
    if not len(solution.t):
        return
    largest = largest_of("displacement", case)
    when = "at rest" if case.static else f"at {solution.t[-1]:.4g} s"
    for probe, name in place_texts(case.probes).items():
        path = solution.position(probe)
        moved = float(np.linalg.norm(path - path[0], axis=1).max())
        least = ROUNDING * max(case.scene.length, float(np.abs(path).max()))
        yield Value(name, f"x {when}", "m", float(path[-1, 0]), least), moved
        yield Value(name, f"y {when}", "m", float(path[-1, 1]), least), moved
        yield Value(name, largest, "m", moved, least), moved
        if isinstance(case.scene.place(probe).body, PointMass):  # it does not turn
            continue
        with suppress(ResultError):  # not every solver gives angles
            angle = solution.angle(probe)
            value = Value(name, f"angle {when}", "rad", float(angle[-1]), ROUNDING)
            yield value, float(np.abs(angle).max(initial=-inf))


def at_joints(solution: Solution, case: Case) -> Iterator[tuple[Value, float]]:
    """For each joint its largest force and moment, for each connector its largest tension or moment.

    Of a motion at the outputs, of an equilibrium the last. What a solver does not give, or equilibrium alone does not
    determine, is left out.
    """
    if not len(solution.t):
        return
    every = list(_series(solution, case))
    sizes = {unit: max((s.size for s in every if s.unit == unit), default=0.0) for unit in ("N", "N m")}
    least = {"N": ROUNDING * sizes["N"], "N m": ROUNDING * max(sizes["N m"], sizes["N"] * case.scene.length)}
    for series in every:
        yield series.largest(solution, case, least[series.unit]), series.size


def largest_of(what: str, case: Case) -> str:
    """Name of the largest of a history: of a motion it is that of the outputs."""
    return f"largest {what}" if case.static else f"largest {what} {AT_OUTPUTS}"


def values_of(found: Refined, read: Reading = at_probes) -> list[Value]:
    """Values read from a run, with uncertainties from the next coarser mesh and step.

    Parameters
    ----------
    found : Refined
    read : callable
        Of all runs of a case it reads the same values, in the same order.
    """
    case, levels = found.levels.case, found.levels
    own = list(read(found.solution, case))
    if not (levels.estimates and isfinite(found.error) and found.solution.status.ok):
        return [replace(value, uncertainty=nan) for value, _ in own]
    place = found.i, found.j
    refined = [
        (_numbers(runs, case, read), part)
        for runs, part in ((levels.mesh_runs(*place), found.mesh), (levels.step_runs(*place), found.step))
    ]
    values = []
    for k, (value, size) in enumerate(own):
        apart = sum(left_in([numbers[k] for numbers in runs], part) for runs, part in refined)
        values.append(replace(value, uncertainty=max(apart, SHARE * found.error * size, value.uncertainty)))
    return values


def values_table(values: Sequence[Value]) -> Table:
    """Values as a table."""
    columns = ["probe", "quantity", "value", "uncertainty", "unit"]
    frame = pd.DataFrame([vars(v) for v in values], columns=columns)
    notes = (
        "uncertainty: an estimate of the errors of mesh and step, from coarser runs; none where it was not estimated.",
        *([OUTPUTS_NOTE] if any(AT_OUTPUTS in value.quantity for value in values) else []),
    )
    return Table("values", "Values and their uncertainty", frame, notes)


def _numbers(runs: Sequence[Solution], case: Case, read: Reading) -> list[list[float]]:
    """Values of runs on levels from fine to coarse; of those that are complete."""
    complete = takewhile(lambda solution: solution.status.ok, runs)
    return [[value.value for value, _ in read(solution, case)] for solution in complete]


@dataclass(frozen=True)
class _Series:
    """Force or moment of a joint or a connector at each output, in N or N m."""

    name: str
    what: str
    unit: str
    values: np.ndarray

    @property
    def size(self) -> float:
        return float(np.abs(self.values).max())

    def largest(self, solution: Solution, case: Case, least: float) -> Value:
        """The largest with its time; at rest the last."""
        k = len(self.values) - 1 if case.static else int(np.abs(self.values).argmax())
        when = "at rest" if case.static else f"at {solution.t[k]:.3g} s"
        quantity = f"{self.what} {when}" if case.static else f"{largest_of(self.what, case)}, {when}"
        return Value(self.name, quantity, self.unit, float(self.values[k]), least)


def _series(solution: Solution, case: Case) -> Iterator[_Series]:
    scene = case.scene
    texts = place_texts(
        [*(p for j in scene.joints for p in j.ends), *(p for c in scene.connectors for p in c.places)]
    )

    def name_of(thing: object, places: Iterable[Written]) -> str:
        return f"{_words(thing)} {', '.join(texts[place] for place in places)}"

    for joint in scene.joints:
        with suppress(ResultError):
            reaction, name = solution.reaction(joint), name_of(joint, joint.ends)
            yield _Series(name, "force", "N", np.linalg.norm(reaction[:, :2], axis=1))
            if what := _moment_of(joint):
                yield _Series(name, what, "N m", reaction[:, 2])
    for connector in scene.connectors:
        turns = hasattr(connector, "angle")
        with suppress(ResultError):
            what, unit = ("moment", "N m") if turns else ("tension", "N")
            yield _Series(name_of(connector, connector.places), what, unit, solution.tension(connector))


def _words(thing: object) -> str:
    """Name of a class in words: "rotational spring"."""
    return "".join(f" {c.lower()}" if c.isupper() else c for c in type(thing).__name__).strip()


def _moment_of(joint: Joint) -> str:
    """Name of a joint's moment; nothing where it turns freely."""
    if isinstance(joint, Clamp | Weld):
        return "moment" if joint.angle is None else "torque of the drive"
    return "moment" if isinstance(joint, Prismatic) else ""
