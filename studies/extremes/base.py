"""Common start of all extremes of a case: a run that is accurate enough, and variants of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from anctmm.errors import AnctmmError
from anctmm.model.case import Case
from anctmm.results.metrics import EPS, Array
from anctmm.results.solution import Solution
from studies.engine.refinement import MOST_WORK, Refined, Refinement
from studies.engine.runner import Runner
from studies.engine.study import Picture
from studies.engine.tables import Table
from studies.engine.trials import Trial

Row = dict[str, Any]
#: Error to which mesh and step are refined; by whether the run is quick.
TARGETS = {False: 1e-3, True: 1e-2}
#: Newton's tolerance of runs that differ only by rounding or by a tiny disturbance.
TIGHT = 1e-12
#: Beginning of the status of a run that would take too long.
NOT_RUN = "not run"


@dataclass(frozen=True)
class Part:
    """One extreme: its table, a sentence with its result, and its pictures."""

    table: Table
    finding: str
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Base:
    """A case with its refined run."""

    case: Case
    found: Refined  # of cables and implicit steps
    trial: Trial  # the refined run, with a tight tolerance of Newton's iteration: variants differ from it
    plain: Solution  # of that, or of the refined run where it is not complete
    runner: Runner
    quick: bool
    peer: str  # another solver with the same elements; empty without one

    @classmethod
    def of(cls, case: Case, runner: Runner, quick: bool) -> "Base":
        """Refine a case."""
        runner.heading = f"{case.name}, mesh and step: "
        found = Refinement(case, runner).refined(TARGETS[quick])
        trial = replace(found.trial, options={"newton_tolerance": TIGHT})
        plain = runner.solve(trial) if found.solution.status.ok else found.solution
        peer = next(found.others(), None)
        return cls(case, found, trial, plain, runner, quick, peer.solver if peer else "")

    @property
    def rounding(self) -> float:
        """Rounding of a coordinate of size 1, at most: each step rounds it, implicit velocities are differences."""
        steps = 1 if self.case.static else round(self.case.duration / self.trial.dt)
        return 4.0 * EPS * steps**1.5

    def run(self, trial: Trial, what: str) -> Solution:
        """Solution of a variant; whatever fails is a solution with that status."""
        self.runner.heading = f"{self.case.name}, {what}: "
        return self.runner.solve(trial)

    def row(self, status: object = "ok", **columns: Any) -> Row:
        """A row of a table."""
        return {"scene": self.case.name, **columns, "status": str(status)}

    def part(self, name: str, title: str, note: str, rows: Sequence[Row], text: str, *drawn: Picture) -> Part:
        """A part from its rows; its sentence is the first status where nothing is known."""
        known = text if good(rows) else f"{title.lower()}: {rows[0]['status']}"
        table = Table(name, title, pd.DataFrame(rows), (note,))
        return Part(table, f"{self.case.name}: {known}.", drawn)

    def swept(
        self, factors: Sequence[float], variant: Callable[[float], Trial],
        measured: Callable[[Trial, Solution], Row], column: str = "factor",
    ) -> list[Row]:  # fmt: skip
        """A row for each factor: what is measured of its variant, or why there is nothing."""
        rows = []
        for factor in factors:
            found: Row = {}
            try:
                trial = variant(factor)
                status = f"{NOT_RUN}: {trial.work:.1e} elements times steps" if trial.work > MOST_WORK else ""
            except AnctmmError as error:  # a part of a user's own kind
                status = f"does not apply: {error}"
            if not status:
                run = self.run(trial, f"{column} {factor:g}")
                status, found = str(run.status), measured(trial, run) if run.status.ok else {}
            rows.append(self.row(status, **{column: factor}, **found))
        return rows


def paths(solution: Solution, case: Case) -> Array:
    """Displacements of the probes, (n, probes, 2), m."""
    return np.stack([solution.displacement(probe) for probe in case.probes], axis=1)


def largest(solution: Solution, case: Case) -> float:
    """The largest displacement of the probes, m; 1 where nothing moves."""
    return float(np.linalg.norm(paths(solution, case), axis=2).max(initial=0.0)) or 1.0


def apart(one: Solution, other: Solution, case: Case, size: float | None = None) -> Array:
    """At each common output the largest difference of two runs at the probes, over the largest displacement.

    `size`: the largest displacement, m, that of the first without it.
    """
    u, v = paths(one, case), paths(other, case)
    if case.static:  # solvers take load steps of their own
        u, v = u[-1:], v[-1:]
    n = min(len(u), len(v))
    gap: Array = np.linalg.norm(u[:n] - v[:n], axis=2).max(axis=1, initial=0.0)
    return gap / (size or largest(one, case))


def energy_error(run: Solution) -> float:
    """Largest error of the energy over the largest kinetic energy."""
    kinetic = float(np.max(run.energy.kinetic, initial=0.0)) or 1.0
    return float(np.abs(run.energy.balance).max()) / kinetic


def good(rows: Sequence[Row]) -> list[Row]:
    """Rows of complete runs."""
    return [row for row in rows if row["status"] == "ok"]
