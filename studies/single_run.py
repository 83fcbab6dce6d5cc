"""One run of a case, with a given mesh and step, or with those chosen for a target error."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from math import inf
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from anctmm.errors import CaseError
from anctmm.model.case import Case
from anctmm.results.solution import Solution
from studies.engine.files import atomic_write, check_writable
from studies.engine.refinement import Refined, Refinement, Setup
from studies.engine.runner import Runner
from studies.engine.study import Options, check_fits
from studies.engine.tables import rich_table, say, show_table, write_machine, write_table
from studies.engine.trials import Mesh, not_installed
from studies.engine.values import Value, values_of, values_table

#: Target error where none is given.
ERROR = 1e-3


@dataclass(frozen=True)
class Other:
    """Another solver's run on the same mesh and by the same step, its relative difference, and what is allowed."""

    solution: Solution
    difference: float
    allowed: float

    @property
    def missed(self) -> bool:
        """Whether it failed, or differs by more than is allowed; one that is not installed does neither."""
        status = self.solution.status
        return self.difference > self.allowed if status.ok else not not_installed(status)

    @property
    def words(self) -> str:
        """Its difference, or why that is not known."""
        status, cost = self.solution.status, self.solution.cost.cpu_s
        if not status.ok:
            return str(status)
        above = f", above the target {self.allowed:g}" if self.missed else ""
        return f"differs by {self.difference:.1e}{above}; {cost:.2g} s"


@dataclass(frozen=True)
class SingleRun:
    """A run with what is known of its error, its values, and runs of others that it is compared with."""

    found: Refined
    values: tuple[Value, ...]
    others: tuple[Other, ...] = ()

    @property
    def solution(self) -> Solution:
        """The run's history."""
        return self.found.solution

    @property
    def missed(self) -> bool:
        """Whether the run, or one that it is compared with, failed or missed the target error.

        One that is not installed did neither; where that is the run itself, there is nothing that others differ from.
        """
        if not_installed(self.solution.status):
            return any(other.missed for other in self.others if not other.solution.status.ok)
        return not self.found.reached or any(other.missed for other in self.others)

    @property
    def absent(self) -> bool:
        """Whether one of the solvers is not installed."""
        return any(not_installed(s.status) for s in (self.solution, *(o.solution for o in self.others)))

    @property
    def error(self) -> str:
        """What is known of the error, in words."""
        found, levels = self.found, self.found.levels
        if not self.solution.status.ok:
            return "the error of an incomplete run is not known"
        if not found.parts:
            return "its error was not estimated: nothing is refined, as mesh and step are given or there are none"
        unknown = "" if levels.estimates else "; that of what was given is not known"
        text = f"estimated error {found.error:.1g} ({found.parts}{unknown})"
        return text if found.reached else f"{text}: above the target {found.target:g}, as {found.reason}"


def run_case(
    case: Case,
    runner: Runner,
    *,
    error: float | None = None,
    mesh: Mesh | None = None,
    dt: float | None = None,
    setup: Setup | None = None,
    others: Sequence[str] = (),
) -> SingleRun:
    """Run a case.

    Parameters
    ----------
    case : Case
    runner : Runner
    error : float, optional
        Target, relative: mesh and step are refined until an estimate of the error is below it; 1e-3 without it. By no
        more than that others may differ, also where mesh and step are given: then nothing bounds it without a target.
    mesh : tuple of int, optional
        Elements of each beam, or one number for all; only the step is then refined.
    dt : float, optional
        Step, s; only the mesh is then refined. With both, the run is done as it is, and no error is estimated.
    setup : Setup, optional
        ANC-TMM with cables and implicit steps without it.
    others : sequence of str
        Names of solvers that run on the same mesh and by the same step, to be compared.

    Raises
    ------
    CaseError, StudyError, DiscretisationError
        If something given does not fit the case, or does not fit together.
    """
    if error is not None and mesh is not None and (dt is not None or case.static) and not others:
        raise CaseError(
            f"error is {error:g} beside a mesh and a step; it needs one of them to refine, or other solvers that "
            f"may differ by it"
        )
    check_fits(Options(meshes=(mesh,) if mesh else None, steps=(dt,) if dt else None), case)
    levels = Refinement(case, setup or Setup(), runner, [mesh] if mesh else (), [dt] if dt else ())
    if dt is not None:
        levels.trial(0, 0).run()  # refuses a step that does not fit
    runner.heading = f"{case.name}: "
    found = levels.refined(error or ERROR)
    judged = levels.refines_mesh or levels.refines_step or error is not None
    compared = []
    for name in others:
        solution = runner.solve(replace(found.trial, solver=name))
        difference = levels.difference(solution, found.solution)
        compared.append(Other(solution, difference, found.target if judged else inf))
    read = found.solution.status.ok or len(found.solution.t) > 1  # else nothing is there but the start
    return SingleRun(found, tuple(values_of(found)) if read else (), tuple(compared))


def write_run(run: SingleRun, folder: Path) -> list[Path]:
    """Write the run's files: solution.npz, probes.csv, values.csv, plot.png, animation.html, in place of older ones.

    A run without any output, such as one that is refused, writes nothing, and leaves the files of an earlier run.

    Raises
    ------
    OutputError
        If the folder cannot be written, or has no room.
    """
    check_writable(folder)
    solution = run.solution
    if not len(solution.t):
        return []
    names = "values.csv", "solution.npz", "probes.csv", "plot.png", "animation.html"
    values, saved, table, plot, animation = (folder / name for name in names)
    write_table(values_table(run.values), folder)
    write_machine(folder)
    solution.save(saved)
    atomic_write(table, solution.to_frame(run.found.levels.case.probes).to_csv())
    picture = BytesIO()
    solution.plot().savefig(picture, format="png", dpi=150)
    atomic_write(plot, picture.getvalue())
    animation.unlink(missing_ok=True)  # an equilibrium has none, a motion before may have had one
    if len(solution.t) < 2:
        return [values, saved, table, plot]
    solution.animate(animation)
    return [values, saved, table, plot, animation]


def show(run: SingleRun, console: Console) -> None:
    """Print the setting, its error, and the values at the probes."""
    status, cost, case = run.solution.status, run.solution.cost, run.found.levels.case
    say(console, f"{case.name}: {run.found.label}", "bold")
    if case.note:
        say(console, case.note, "dim")
    say(console, f"{status}", "green" if status.ok else "red")
    say(console, run.error, "" if run.found.reached else "yellow")
    counts = (
        f"steps: {cost.steps}, Newton corrections: {cost.newton_iterations}, {cost.cpu_s:.2g} s of CPU time"
    )
    say(console, f"{counts}; runs in all: {run.found.levels.runs}")
    if run.values:
        shown = rich_table("", {"probe": False, "quantity": False, "value": False})
        for value in run.values:
            shown.add_row(*map(escape, (value.probe, value.quantity, value.text)))
        show_table(console, shown)
    for other in run.others:
        said = f"{other.solution.solver} on the same mesh and by the same step: {other.words}"
        say(console, said, "yellow" if other.missed else "")
