"""One run of a case, with a given mesh and step, or with those chosen for a target error."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from math import inf, isfinite
from pathlib import Path

from anctmm.errors import CaseError
from anctmm.model.case import Case
from anctmm.results.solution import Solution
from anctmm.validation import positive
from studies.engine.accuracy.digits import Value, values_of, values_table
from studies.engine.accuracy.dynamics import check_mesh
from studies.engine.accuracy.refinement import Refined, Refinement, Setup
from studies.engine.runner import Runner
from studies.engine.running.outcomes import not_installed
from studies.engine.running.rows import element_of
from studies.engine.running.trial import Mesh
from studies.engine.storage.files import atomic_write, check_writable
from studies.engine.tables import write_machine, write_table

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
    def told(self) -> str:
        """How far it differs, or why that is not known, in words."""
        if not isfinite(self.difference):
            status = self.solution.status
            return "the difference is not known" if status.ok else str(status)
        above = f", above the target {self.allowed:g}" if self.missed else ""
        own = f", with {self.element} elements" if self.element else ""
        return f"differs by {self.difference:.1e}{above}{own}"


@dataclass(frozen=True)
class SingleRun:
    """What a run gave.

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
        return self.found.timed

    @property
    def good(self) -> bool:
        """Whether the run is whole, and its error, where it was estimated, is small enough."""
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
                told = f"estimated error {found.error:.1g} ({mesh}, {step})"
            case True, False:
                told = f"estimated error of the {mesh}{'' if self.case.static else '; that of the step is not known'}"
            case False, True:
                known = "; that of the mesh is not known" if levels.meshes else ""
                told = f"estimated error of the {step}{known}"
            case _ if not self.case.scene.beams and self.case.static:
                return "an equilibrium of rigid bodies and masses: there is no mesh or step to refine"
            case _:
                return "its error was not estimated, as mesh and step were given; --error does it"
        return told if found.reached else f"{told}: above the target {found.target:g}, as {found.reason}"

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
    """Write the run's files: solution.npz, probes.csv, values.csv, plot.png, animation.html; older ones go.

    Parameters
    ----------
    run : SingleRun
    folder : Path
        Made if it is not there.

    Returns
    -------
    list of Path
        What was written: of a run without any output only the values.

    Raises
    ------
    OutputError
        If the folder cannot be written, or has no room.
    """
    check_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    write_table(values_table(run.values), folder)
    write_machine(folder)
    solution = run.solution
    for name in OF_SOLUTION:  # of a run before, which may have had what this one has not
        with suppress(OSError):  # who writes the new one says what is wrong
            (folder / name).unlink(missing_ok=True)
    written = [folder / "values.csv"]
    if not len(solution.t):
        return written
    written += [folder / name for name in OF_SOLUTION]
    kept, table, plot, animation = written[1:]
    solution.save(kept)
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
    solution = runner.sweep([trial], budget_s=0.0)[0].solution
    own = element_of(name, found.levels.setup.element)
    other = own if found.levels.case.scene.beams and own != found.levels.setup.own_element else ""
    return Other(name, solution, found.levels.difference(solution, found.solution), allowed, other)
