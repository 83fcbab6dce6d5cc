"""Numbers with their uncertainty, read from runs: at probes, and in joints and springs."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import takewhile
from math import floor, isfinite, log10, nan
from typing import Any

import numpy as np

from anctmm.errors import ResultError
from anctmm.model.case import Case
from anctmm.model.joints import Clamp, Joint, Prismatic, Weld
from anctmm.model.places import Written
from anctmm.model.rigid_bodies import PointMass
from anctmm.results.metrics import EPS, ROUNDINGS, Array
from anctmm.results.solution import Solution
from studies.cases import place_name
from studies.engine.refinement import MESH, STEP, Refined
from studies.engine.richardson import left_in

#: Part of the error of the history that every value has at least: two runs may agree in one number by chance.
SHARE = 0.2
#: Rounding of a number, in parts of the numbers that it is the difference of.
ROUNDING = ROUNDINGS * EPS
#: Digits that are written at most.
MOST_DIGITS = 12
AT_OUTPUTS = "at the outputs"
OUTPUTS_NOTE = f"{AT_OUTPUTS}: between them it may be larger; a smaller output_dt of the case shows it."


@dataclass(frozen=True)
class Value:
    """A number with its unit and its uncertainty."""

    probe: str
    quantity: str
    unit: str
    value: float
    uncertainty: float = nan  # NaN where it was not estimated; as it is read from a run that of rounding
    size: float = 0.0  # of the history, which its error is relative to

    @property
    def text(self) -> str:
        """The value to the first digit of its uncertainty, with that and the unit."""
        if not isfinite(self.uncertainty):
            return f"{self.value:.6g} {self.unit}"
        about = float(f"{self.uncertainty:.1g}")
        return f"{rounded(self.value, about)} ± {rounded(about, about)} {self.unit}"


Reading = Callable[[Solution, Case], Iterable[Value]]
"""(solution, case) → values, with their rounding and the size that errors of histories are relative to."""


def rounded(value: float, uncertainty: float) -> str:
    """A value down to the first digit of its uncertainty; no more than twelve digits."""
    if not uncertainty > 0.0:
        return f"{value:.12g}"
    place = -floor(log10(float(f"{uncertainty:.1g}")))  # 0.00096 is shown as 0.001
    first = floor(log10(abs(value))) if value else -place
    decimals = min(place, MOST_DIGITS - 1 - first)
    if first < -4 or first > 6:
        return f"{value:.{max(first + decimals, 0)}e}"
    return f"{round(value, decimals):.{max(decimals, 0)}f}"


def at_probes(solution: Solution, case: Case) -> Iterator[Value]:
    """For each probe its place and its angle at the end, and its largest displacement."""
    when = "at rest" if case.static else f"at {solution.t[-1]:.4g} s" if len(solution.t) else ""
    for probe in case.probes if when else ():
        path, name = solution.position(probe), place_name(probe)
        moved = float(np.linalg.norm(path - path[0], axis=1).max())
        least = ROUNDING * max(case.scene.length, float(np.abs(path).max()))
        ends = (f"x {when}", path[-1, 0]), (f"y {when}", path[-1, 1]), (_largest("displacement", case), moved)
        yield from (Value(name, what, "m", float(value), least, moved) for what, value in ends)
        with suppress(ResultError):  # not every solver gives angles
            angle = solution.angle(probe)
            if not isinstance(case.scene.place(probe).body, PointMass):  # it does not turn
                yield Value(name, f"angle {when}", "rad", float(angle[-1]), ROUNDING, _size(angle))


def at_joints(solution: Solution, case: Case) -> Iterator[Value]:
    """For each joint its largest force and moment, for each connector its largest tension or moment.

    Of a motion at the outputs, of an equilibrium the last. What a solver does not give, or equilibrium alone does not
    determine, is left out.
    """
    every = list(_series(solution, case)) if len(solution.t) else []
    force = max((_size(h) for *_, unit, h in every if unit == "N"), default=0.0)
    moment = max((_size(h) for *_, unit, h in every if unit != "N"), default=0.0)
    rounding = {"N": ROUNDING * force, "N m": ROUNDING * max(moment, force * case.scene.length)}
    for name, what, unit, history in every:
        k = len(history) - 1 if case.static else int(np.abs(history).argmax())
        when = f"{what} at rest" if case.static else f"{_largest(what, case)}, at {solution.t[k]:.3g} s"
        yield Value(name, when, unit, float(history[k]), rounding[unit], _size(history))


def values_of(found: Refined, read: Reading = at_probes) -> list[Value]:
    """Values read from a run, with uncertainties from the next coarser mesh and step."""
    case, levels = found.levels.case, found.levels
    own = list(read(found.solution, case))
    if not (levels.estimates and found.known):
        return [replace(value, uncertainty=nan) for value in own]

    def numbers(axis: int) -> list[list[float]]:
        complete = takewhile(lambda run: run.status.ok, levels.runs_along(found.i, found.j, axis))
        return [[value.value for value in read(run, case)] for run in complete]

    refined = (numbers(MESH), found.mesh), (numbers(STEP), found.step)
    left = [sum(left_in([run[k] for run in runs], part) for runs, part in refined) for k in range(len(own))]
    least = [max(SHARE * found.error * value.size, value.uncertainty) for value in own]
    return [replace(v, uncertainty=max(u, e)) for v, u, e in zip(own, left, least, strict=True)]


def rows_of(values: Sequence[Value], place: str = "probe") -> list[dict[str, Any]]:
    """A row a value, with its digits in words."""
    names = "quantity", "value", "uncertainty", "unit"
    return [{place: v.probe, **{n: getattr(v, n) for n in names}, "digits": v.text} for v in values]


def _largest(what: str, case: Case) -> str:
    """Name of the largest of a history: of a motion it is that of the outputs."""
    return f"largest {what}" if case.static else f"largest {what} {AT_OUTPUTS}"


def _size(history: Array) -> float:
    return float(np.abs(history).max())


def _series(solution: Solution, case: Case) -> Iterator[tuple[str, str, str, Array]]:
    """Name, quantity, unit and history of each force or moment of a joint or a connector, N or N m."""
    for joint in case.scene.joints:
        with suppress(ResultError):
            reaction, name = solution.reaction(joint), _name_of(joint, joint.ends)
            yield name, "force", "N", np.linalg.norm(reaction[:, :2], axis=1)
            if what := _moment_of(joint):
                yield name, what, "N m", reaction[:, 2]
    for connector in case.scene.connectors:
        what, unit = ("moment", "N m") if hasattr(connector, "angle") else ("tension", "N")
        with suppress(ResultError):
            yield _name_of(connector, connector.places), what, unit, solution.tension(connector)


def _name_of(thing: object, places: Iterable[Written]) -> str:
    """Kind and places in words: "rotational spring arm.start"."""
    kind = "".join(f" {c.lower()}" if c.isupper() else c for c in type(thing).__name__).strip()
    return f"{kind} {', '.join(map(place_name, places))}"


def _moment_of(joint: Joint) -> str:
    """Name of a joint's moment; nothing where it turns freely."""
    if isinstance(joint, Clamp | Weld):
        return "moment" if joint.angle is None else "torque of the drive"
    return "moment" if isinstance(joint, Prismatic) else ""
