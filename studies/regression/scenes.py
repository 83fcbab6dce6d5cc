"""What `anctmm check` watches: scenes, their runs, and what is read of each run."""

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any, Literal

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError, shown
from anctmm.model.scene import Probe, Scene
from anctmm.validation import whole
from studies.engine.files import file_name
from studies.user_files import listed_in

#: Newton tolerance of stored runs: a looser one makes wide tolerances.
TIGHT = 1e-12
MOST_STEPS = 1000
#: Settings of a run that are always listed; others only if they differ from the default.
ALWAYS = ("mesh", "element", "quadrature", "integrator", "dt", "t_end", "output_dt")


class CheckError(AnctmmError, ValueError):
    """The runs to check, or their stored histories, cannot be determined."""


@dataclass(frozen=True)
class Static:
    """A static equilibrium as a history over the load factor.

    Parameters
    ----------
    mesh, element, quadrature, newton_tolerance
        As in Discretisation.
    load_steps : int
        Equal parts of the load; a sample after each.
    """

    mesh: Any
    element: Any = "cable"
    quadrature: str = "full"
    newton_tolerance: float = TIGHT
    load_steps: int = 4

    def __post_init__(self) -> None:
        whole("load_steps", self.load_steps, MOST_STEPS, CheckError)
        _ = self.discretisation

    @property
    def discretisation(self) -> Discretisation:
        """What a static solver needs to know; raises what Discretisation raises."""
        tight = self.newton_tolerance
        return Discretisation(self.mesh, self.element, self.quadrature, newton_tolerance=tight)


Motion = Discretisation | Static


@dataclass(frozen=True)
class Read:
    """A run of which something else than its motion is read.

    "start=rest": the motion from the static equilibrium under the loads of t = 0. "forces": reactions, section forces
    and tensions, after the run was saved and loaded. "compared with": `anctmm.compare` of two runs, the second one the
    reference. "modes": natural ones about the equilibrium, or in a steady spin.
    """

    what: Literal["start=rest", "forces", "compared with", "modes"]  # as in the settings of stored histories
    runs: tuple[Motion, ...]
    spin: float = 0.0  # rad/s


Run = Motion | Read


def motions_of(run: Run) -> tuple[Motion, ...]:
    """The motions and equilibria within a run."""
    return run.runs if isinstance(run, Read) else (run,)


def settings_of(run: Run) -> str:
    """A run in words: a history is compared with one of the same settings only."""
    if isinstance(run, Read):
        what = f"modes=6, at_rest={not run.spin}, spin={run.spin:g}" if run.what == "modes" else run.what
        parts = [*map(settings_of, run.runs)]
        parts.insert(len(parts) // 2, what)  # between two runs, before one
        return ", ".join(parts)
    return ", ".join(
        f"{f.name}={_words(getattr(run, f.name))}"
        for f in fields(run)
        if f.init and (f.name in ALWAYS or f.default is MISSING or getattr(run, f.name) != f.default)
    )


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return "/".join(f"{v} {k}" for k, v in value.items())
    return f"{value:g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Watch:
    """A scene, its runs, its solvers, and the places at which its motion is read.

    Parameters
    ----------
    scene : Scene
    probes : list or tuple
        "body.end" or ("body", fraction), or a point of a rigid body.
    runs : mapping of str to Discretisation or Static
        By a short name. Few output times, so that the stored history can be read.
    solvers : list or tuple of str
        Registered names; one that is not installed becomes a row that says so.
    ends : str
        Code of the status with which the runs must end: "ok", or what must be found ("diverged", …); "refused" where
        the solver must raise one of `anctmm.errors`.

    CheckError if something is missing or of another kind, UnknownNameError if a probe is not of the scene.
    """

    scene: Scene
    probes: tuple[Probe, ...]
    runs: Mapping[str, Run]
    solvers: tuple[str, ...] = ("anctmm",)
    ends: str = "ok"

    def __post_init__(self) -> None:
        if type(self.scene) is not Scene:
            raise CheckError(f"Watch scene is {shown(self.scene)}; a Scene is needed")
        whose = f"of {self.scene.name!r}"
        for name, kind in (("probes", list | tuple), ("solvers", list | tuple), ("runs", Mapping)):
            value = getattr(self, name)
            if not isinstance(value, kind) or not value:
                needed = f"a {'mapping' if name == 'runs' else 'list'} of at least one"
                raise CheckError(f"Watch {whose} has {name} {shown(value)}; {needed} is needed")
        for name, run in self.runs.items():
            if not isinstance(run, Run):
                wrong = f"run {name!r} {whose} is {shown(run)}"
                raise CheckError(f"{wrong}; a Discretisation or a Static is needed")
        for probe in self.probes:
            self.scene.probe(probe)


@dataclass(frozen=True)
class Task:
    """One solver's run of one watched scene."""

    scene: Scene
    probes: tuple[Probe, ...]
    run_name: str
    run: Run
    solver: str
    ends: str = "ok"

    @property
    def name(self) -> str:
        """scene/run/solver, each as the name of a file: also its place below the baselines."""
        return "/".join(file_name(str(part)) for part in (self.scene.name, self.run_name, self.solver))

    def path(self, baselines: Path) -> Path:
        """The file of its stored history."""
        return baselines / f"{self.name}.csv"


def tasks_of(watches: Iterable[Watch]) -> tuple[Task, ...]:
    """Every solver of every run of every scene; CheckError if two would share a file."""
    tasks = tuple(
        Task(watch.scene, tuple(watch.probes), name, run, solver, watch.ends)
        for watch in watches
        for name, run in watch.runs.items()
        for solver in watch.solvers
    )
    names = [task.name for task in tasks]
    if twice := next((n for n in names if names.count(n) > 1), None):
        raise CheckError(f"{twice!r} is watched {names.count(twice)} times; once is allowed")
    return tasks


def declared_in(path: Path) -> tuple[Watch, ...]:
    """The WATCHED of a user's Python file, which may import its neighbours; CheckError if there is none."""
    return listed_in(path, "WATCHED", Watch, CheckError, "--scenes")
