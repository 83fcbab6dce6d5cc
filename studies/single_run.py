"""One run of a case, with a given mesh and step, or with those chosen for a target error."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from math import inf, isfinite
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from anctmm.errors import CaseError
from anctmm.model.case import Case
from anctmm.results.solution import Solution
from anctmm.validation import positive
from studies.engine.console import say, show_table
from studies.engine.files import atomic_write, check_writable
from studies.engine.refinement import Refined, Refinement, Setup, element_of
from studies.engine.runner import Runner
from studies.engine.study import check_mesh
from studies.engine.tables import write_machine, write_table
from studies.engine.trials import Mesh, not_installed
from studies.engine.values import Value, values_of, values_table

#: Files of a solution, the last only where something moves.
OF_SOLUTION = "solution.npz", "probes.csv", "plot.png", "animation.html"
#: Target error where none is given.
ERROR = 1e-3


@dataclass(frozen=True)
class Other:
    """Another solver's run on the same mesh and by the same step.

    Parameters
    ----------
    solver : str
    solution : Solution
    difference : float
        From the run itself, relative; infinite where one is not whole.
    allowed : float
        Largest difference that is no miss; infinite where none is known.
    element : str
        That it has used, if it is another one than the run's.
    """

    solver: str
    solution: Solution
    difference: float
    allowed: float = inf
    element: str = ""

    @property
    def missed(self) -> bool:
        """Whether it failed, or differs by more than is allowed; one that is not installed does neither."""
        status = self.solution.status
        return self.difference > self.allowed if status.ok else not not_installed(status)

    @property
    def words(self) -> str:
        """Its difference, or why that is not known, in words."""
        if not isfinite(self.difference):
            status = self.solution.status
            return "the difference is not known" if status.ok else str(status)
        above = f", above the target {self.allowed:g}" if self.missed else ""
        own = f", with {self.element} elements" if self.element else ""
        return f"differs by {self.difference:.1e}{above}{own}"


@dataclass(frozen=True)
class SingleRun:
    """A run and its values.

    Parameters
    ----------
    case : Case
    found : Refined
        The run, and what is known of its error.
    values : tuple of Value
    others : tuple of Other
    """

    case: Case
    found: Refined
    values: tuple[Value, ...]
    others: tuple[Other, ...] = ()

    @property
    def solution(self) -> Solution:
        """The run's history."""
        return self.found.solution

    @property
    def good(self) -> bool:
        """Whether the run is complete, and its error, where it was estimated, meets the target."""
        return self.solution.status.ok and self.found.reached

    @property
    def missed(self) -> bool:
        """Whether the run, or one that it is compared with, failed or missed the target error.

        One that is not installed did neither; where that is the run itself, there is nothing that others differ from.
        """
        if not_installed(self.solution.status):
            return any(other.missed for other in self.others if not other.solution.status.ok)
        return not self.good or any(other.missed for other in self.others)

    @property
    def absent(self) -> bool:
        """Whether one of the solvers is not installed."""
        return any(map(not_installed, (self.solution.status, *(o.solution.status for o in self.others))))

    @property
    def setting(self) -> str:
        """Mesh and step in words."""
        trial, case = self.found.trial, self.case
        step = "static equilibrium" if case.static else f"{trial.integrator}, Δt = {trial.dt:.4g} s"
        beams = f", {trial.cut} {self.found.levels.setup.own_element} elements" if case.scene.beams else ""
        return f"{trial.solver}{beams}, {step}"

    @property
    def error(self) -> str:
        """What is known of the error, in words."""
        found, levels = self.found, self.found.levels
        if not self.solution.status.ok:
            return "the error of an incomplete run is not known"
        mesh, step = f"mesh {found.mesh.error:.1g}", f"step {found.step.error:.1g}"
        match levels.refines_mesh, levels.refines_step:
            case True, True:
                text = f"estimated error {found.error:.1g} ({mesh}, {step})"
            case True, False:
                text = f"estimated error of the {mesh}{'' if self.case.static else '; that of the step is not known'}"
            case False, True:
                known = "; that of the mesh is not known" if levels.meshes else ""
                text = f"estimated error of the {step}{known}"
            case _ if not self.case.scene.beams and self.case.static:
                return "an equilibrium of rigid bodies and masses: there is no mesh or step to refine"
            case _:
                return "its error was not estimated, as mesh and step were given; --error does it"
        return text if found.reached else f"{text}: above the target {found.target:g}, as {found.reason}"

    @property
    def effort(self) -> str:
        """What it took, in words."""
        runs, cost = self.found.levels.runs, self.solution.cost
        steps = f"{_count(cost.steps, 'step')}, {_count(cost.newton_iterations, 'Newton correction')}"
        time = f", {cost.cpu_s:.2g} s of CPU time" if isfinite(cost.cpu_s) else ""
        return f"{steps}{time}; {_count(runs, 'run')} in all"


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

    Returns
    -------
    SingleRun

    Raises
    ------
    CaseError, StudyError, DiscretisationError
        If something given does not fit the case, or does not fit together.
    """
    setup = setup or Setup()
    if error is not None:
        error = positive("error", error, CaseError)
        if mesh is not None and (dt is not None or case.static) and not others:
            raise CaseError(
                f"error is {error:g} beside a mesh and a step; it needs one of them to refine, or other solvers that "
                f"may differ by it"
            )
    if mesh is not None:
        check_mesh(case.scene, mesh)
    if dt is not None and case.static:
        raise CaseError(f"dt is {dt:g} s for case {case.name!r}, a static equilibrium; it has no step")
    levels = Refinement(case, setup, runner, [mesh] if mesh else (), [dt] if dt else ())
    if dt is not None:
        levels.trial(0, 0).run()  # refuses a step that does not fit
    runner.heading = f"{case.name}: "
    found = levels.refined(ERROR if error is None else error)
    judged = levels.refines_mesh or levels.refines_step or error is not None
    allowed = found.target if judged else inf
    compared = tuple(_other(found, name, runner, allowed) for name in others)
    read = found.solution.status.ok or len(found.solution.t) > 1  # else nothing is there but the start
    return SingleRun(case, found, tuple(values_of(found)) if read else (), compared)


def write_run(run: SingleRun, folder: Path) -> list[Path]:
    """Write the run's files: solution.npz, probes.csv, values.csv, plot.png, animation.html, in place of older ones.

    A run without any output, such as one that is refused, writes nothing, and leaves the files of an earlier run.

    Parameters
    ----------
    run : SingleRun
    folder : Path
        Made if it is not there.

    Returns
    -------
    list of Path
        Written files.

    Raises
    ------
    OutputError
        If the folder cannot be written, or has no room.
    """
    check_writable(folder)
    solution = run.solution
    if not len(solution.t):
        return []
    write_table(values_table(run.values), folder)
    write_machine(folder)
    for name in OF_SOLUTION:  # an equilibrium has no animation, a motion before may have had one
        (folder / name).unlink(missing_ok=True)
    written = [folder / "values.csv"]
    written += [folder / name for name in OF_SOLUTION]
    saved, table, plot, animation = written[1:]
    solution.save(saved)
    atomic_write(table, solution.to_frame(run.case.probes).to_csv())
    picture = BytesIO()
    solution.plot().savefig(picture, format="png", dpi=150)
    atomic_write(plot, picture.getvalue())
    if len(solution.t) < 2:
        return written[:-1]
    solution.animate(animation)
    return written


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _other(found: Refined, name: str, runner: Runner, allowed: float) -> Other:
    trial = replace(found.trial, solver=name)
    solution = runner.solve(trial)
    own = element_of(name, found.levels.setup.element)
    other = own if found.levels.case.scene.beams and own != found.levels.setup.own_element else ""
    return Other(name, solution, found.levels.difference(solution, found.solution), allowed, other)


def show(run: SingleRun, console: Console) -> None:
    """Print the setting, its error, and the values at the probes."""
    say(console, f"{run.case.name}: {run.setting}", "bold")
    if run.case.note:
        say(console, run.case.note, "dim")
    say(console, f"{run.solution.status}", "green" if run.solution.status.ok else "red")
    say(console, run.error, "" if run.good else "yellow")
    say(console, run.effort)
    if run.values:
        shown = Table("probe", "quantity", "value", box=None, padding=(0, 2, 0, 0), header_style="dim")
        for value in run.values:
            shown.add_row(*map(escape, (value.probe, value.quantity, value.text)))
        show_table(console, shown)
    for other in run.others:
        cost = other.solution.cost.cpu_s
        time = f"; {cost:.2g} s" if isfinite(cost) else ""
        said = f"{other.solver} on the same mesh and by the same step: {other.words}{time}"
        say(console, said, "yellow" if other.missed else "")
