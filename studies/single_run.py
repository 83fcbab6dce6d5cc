"""One run of a case, with a given mesh and step, or with those chosen for a target error."""

from dataclasses import dataclass, replace
from io import BytesIO
from math import inf
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console

from anctmm.errors import CaseError
from anctmm.results.solution import Solution
from studies.engine.files import atomic_write
from studies.engine.refinement import Refined, Refinement
from studies.engine.runner import Runner
from studies.engine.study import Options, check_fits
from studies.engine.tables import Table, say, show_frame, write_machine, write_table
from studies.engine.trials import OURS, not_installed
from studies.engine.values import OUTPUTS_NOTE, Value, rows_of, values_of

#: Target error where none is given.
ERROR = 1e-3
NOTES = (
    "uncertainty: an estimate of the errors of mesh and step, from coarser runs; none where it was not estimated.",
    OUTPUTS_NOTE,
)


@dataclass(frozen=True)
class SingleRun:
    """A run with what is known of its error, its values, and runs of others that it is compared with.

    `others` are runs on the same mesh and by the same step, with their relative differences; `allowed` bounds these.
    """

    found: Refined
    values: tuple[Value, ...]
    others: tuple[tuple[Solution, float], ...] = ()
    allowed: float = inf

    @property
    def missed(self) -> bool:
        """Whether the run, or one that it is compared with, failed or missed the target error."""
        own = not self.found.reached and not not_installed(self.found.solution.status)
        return own or any(self.is_off(*other) for other in self.others)

    def is_off(self, other: Solution, difference: float) -> bool:
        """Whether another run failed, or differs by more than is allowed.

        One that is not installed does neither; from a run that is not, nothing differs.
        """
        if not other.status.ok:
            return not not_installed(other.status)
        return difference > self.allowed and not not_installed(self.found.solution.status)

    @property
    def absent(self) -> bool:
        """Whether one of the solvers is not installed."""
        return any(
            not_installed(x.status) for x in (self.found.solution, *(other for other, _ in self.others))
        )

    @property
    def error(self) -> str:
        """What is known of the error, in words."""
        found = self.found
        if not found.solution.status.ok:
            return "the error of an incomplete run is not known"
        if not found.parts:
            return "its error was not estimated: nothing is refined, as mesh and step are given or there are none"
        unknown = "" if found.levels.estimates else "; that of what was given is not known"
        text = f"estimated error {found.error:.1g} ({found.parts}{unknown})"
        return text if found.reached else f"{text}: above the target {found.target:g}, as {found.reason}"


def run_case(options: Options, runner: Runner) -> SingleRun:
    """Run the case of some options.

    Parameters
    ----------
    options : Options
        error: target, relative (1e-3 without it): mesh and step are refined until an estimate of the error is below it;
        by no more than that other solvers may differ, also where mesh and step are given: then nothing bounds it
        without a target. meshes, steps: at most one of each, which is not refined; with both no error is estimated.
        solvers: the first runs the case, the others run it on the same mesh and by the same step.
    runner : Runner

    Raises
    ------
    CaseError, StudyError, DiscretisationError
        If something given does not fit the case, or does not fit together.
    """
    case, error, (solver, *names) = options.case, options.error, options.solvers or (OURS,)
    check_fits(options, case)
    if error is not None and options.meshes and (options.steps or case.static) and not names:
        raise CaseError(
            f"error is {error:g} beside a mesh and a step; it needs one of them to refine, or other solvers that "
            f"may differ by it"
        )
    setting = {"element": options.element, "integrator": options.integrator}
    given: Any = {name: value for name, value in setting.items() if value}
    levels = Refinement(case, runner, options.meshes or (), options.steps or (), solver=solver, **given)
    if options.steps:
        levels.trial(0, 0).run()  # refuses a step that does not fit
    runner.heading = f"{case.name}: "
    found = levels.refined(error or ERROR)
    judged = any(levels.refines) or error is not None
    others = [runner.solve(replace(found.trial, solver=name)) for name in names]
    compared = tuple((other, levels.difference(other, found.solution)) for other in others)
    read = found.solution.status.ok or len(found.solution.t) > 1  # else nothing is there but the start
    values = tuple(values_of(found)) if read else ()
    return SingleRun(found, values, compared, found.target if judged else inf)


def write_run(run: SingleRun, folder: Path) -> bool:
    """Write solution.npz, probes.csv, values.csv, plot.png and animation.html, in place of older ones.

    A run without any output, such as one that is refused, writes nothing, and leaves the files of an earlier run.

    Returns
    -------
    bool
        Whether files were written.

    Raises
    ------
    OutputError
        If the folder cannot be written, or has no room.
    """
    solution, picture = run.found.solution, BytesIO()
    if not len(solution.t):
        return False
    write_table(
        Table("values", "Values and their uncertainty", pd.DataFrame(rows_of(run.values)), NOTES), folder
    )
    write_machine(folder)
    solution.save(folder / "solution.npz")
    atomic_write(folder / "probes.csv", solution.to_frame(run.found.levels.case.probes).to_csv())
    solution.plot().savefig(picture, format="png", dpi=150)
    atomic_write(folder / "plot.png", picture.getvalue())
    # An equilibrium has no animation, a motion before may have had one.
    (folder / "animation.html").unlink(missing_ok=True)
    if len(solution.t) > 1:
        solution.animate(folder / "animation.html")
    return True


def show(run: SingleRun, console: Console) -> None:
    """Print the setting, its error, and the values at the probes."""
    found, case = run.found, run.found.levels.case
    status, cost = found.solution.status, found.solution.cost
    say(console, f"{case.name}: {found.trial.label}", "bold")
    if case.note:
        say(console, case.note, "dim")
    say(console, f"{status}", "green" if status.ok else "red")
    say(console, run.error, "" if found.reached else "yellow")
    counts = (
        f"steps: {cost.steps}, Newton corrections: {cost.newton_iterations}, {cost.cpu_s:.2g} s of CPU time"
    )
    say(console, f"{counts}; runs in all: {len(found.levels.solutions)}")
    if run.values:
        show_frame(console, "", pd.DataFrame(rows_of(run.values))[["probe", "quantity", "digits"]])
    for other, difference in run.others:
        words, off = f"{other.status}", run.is_off(other, difference)
        if other.status.ok:
            above = f", above the target {run.allowed:g}" if off else ""
            words = f"differs by {difference:.1e}{above}; {other.cost.cpu_s:.2g} s"
        say(
            console, f"{other.solver} on the same mesh and by the same step: {words}", "yellow" if off else ""
        )
