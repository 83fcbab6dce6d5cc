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
class Other:
    """A run of another solver on the same mesh and by the same step, and its relative difference."""

    solution: Solution
    difference: float
    off: bool  # it failed, or differs by more than is allowed


@dataclass(frozen=True)
class SingleRun:
    """A run with what is known of its error, its values, and runs of others that it is compared with."""

    found: Refined
    values: tuple[Value, ...]
    others: tuple[Other, ...] = ()

    @property
    def missed(self) -> bool:
        """Whether the run, or one that it is compared with, failed or missed the target error."""
        own = not self.found.reached and not not_installed(self.found.solution.status)
        return own or any(other.off for other in self.others)

    @property
    def absent(self) -> bool:
        """Whether one of the solvers is not installed."""
        every = self.found.solution, *(other.solution for other in self.others)
        return any(not_installed(solution.status) for solution in every)


def run_case(options: Options, runner: Runner) -> SingleRun:
    """Run a case; CaseError, StudyError or DiscretisationError if what is given does not fit it or each other.

    Mesh and step are refined until an estimate of the error is below the target, unless they are given; with both no
    error is estimated. The first solver runs the case, the others on the same mesh and by the same step: they may
    differ by the target error, and without a target, where nothing is refined, by anything.
    """
    case, error, (solver, *names) = options.case, options.error, options.solvers or (OURS,)
    check_fits(options, case)
    if error is not None and options.meshes and (options.steps or case.static) and not names:
        needed = "it needs one of them to refine, or other solvers that may differ by it"
        raise CaseError(f"error is {error:g} beside a mesh and a step; {needed}")
    setting = {"element": options.element, "integrator": options.integrator}
    given: Any = {name: value for name, value in setting.items() if value}
    levels = Refinement(case, runner, options.meshes or (), options.steps or (), solver=solver, **given)
    if options.steps:
        levels.trial(0, 0).run()  # refuses a step that does not fit
    runner.heading = f"{case.name}: "
    found = levels.refined(error or ERROR)
    allowed = found.target if any(levels.refines) or error is not None else inf
    others = [_compared(found, runner.solve(replace(found.trial, solver=name)), allowed) for name in names]
    read = found.solution.status.ok or len(found.solution.t) > 1  # else nothing is there but the start
    return SingleRun(found, tuple(values_of(found)) if read else (), tuple(others))


def _compared(found: Refined, other: Solution, allowed: float) -> Other:
    """Another run beside the first; of one that is not installed nothing is off, and from it nothing differs."""
    difference = found.levels.difference(other, found.solution)
    differs = difference > allowed and not not_installed(found.solution.status)
    return Other(other, difference, differs if other.status.ok else not not_installed(other.status))


def write_run(run: SingleRun, folder: Path) -> bool:
    """Write solution.npz, probes.csv, values.csv, plot.png and animation.html, in place of older ones.

    A run without any output, such as one that is refused, writes nothing and leaves the files of an earlier run: False.
    OutputError if the folder cannot be written, or has no room.
    """
    solution, picture = run.found.solution, BytesIO()
    if not len(solution.t):
        return False
    values = pd.DataFrame(rows_of(run.values))
    write_table(Table("values", "Values and their uncertainty", values, NOTES), folder)
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
    say(console, found.estimate, "" if found.reached else "yellow")
    newton, runs = cost.newton_iterations, len(found.levels.solutions)
    say(
        console,
        f"steps: {cost.steps}, Newton corrections: {newton}, {cost.cpu_s:.2g} s of CPU time; runs: {runs}",
    )
    if run.values:
        show_frame(console, "", pd.DataFrame(rows_of(run.values))[["probe", "quantity", "digits"]])
    for other in run.others:
        words, solution = str(other.solution.status), other.solution
        if solution.status.ok:
            above = ", above what is allowed" if other.off else ""
            words = f"differs by {other.difference:.1e}{above}; {solution.cost.cpu_s:.2g} s"
        words = f"{solution.solver} on the same mesh and by the same step: {words}"
        say(console, words, "yellow" if other.off else "")
