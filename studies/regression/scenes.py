"""Histories of `anctmm check`: those of the base scenes, or those that a user's file declares."""

import re
from collections.abc import Iterable, Mapping, Set
from dataclasses import MISSING, dataclass, fields
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation, parts_of_load
from anctmm.errors import AnctmmError, reason, shown
from anctmm.model.scene import Probe, Scene
from anctmm.solvers.foreign_code import told
from anctmm.validation import one_of
from studies import scenes
from studies.scenes import END_MOMENT, TIP_FORCES, BaseScene
from studies.user_files import defined_in

#: What a user's file must define.
DECLARED = "WATCHED"
#: Names of scenes, runs and solvers become names of directories and files.
PLAIN = re.compile(r"\w[\w.+-]{0,99}")
#: Largest number of probes or solvers of a watch: an infinite iterable is refused.
MOST = 10_000
#: How equilibria are followed.
ARC_LENGTH = "arclength"
PATHS = ("load", ARC_LENGTH)
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
    path : str
        "load", or "arclength": all equilibria of the path, with their load factors.
    """

    mesh: Any
    element: Any = "cable"
    quadrature: str = "full"
    newton_tolerance: float = 1e-12
    load_steps: int = 4
    path: str = "load"

    def __post_init__(self) -> None:
        one_of("path of a Static", self.path, PATHS)
        checked = self.discretisation
        for name in ("mesh", "element", "quadrature", "newton_tolerance"):
            object.__setattr__(self, name, getattr(checked, name))
        object.__setattr__(self, "load_steps", parts_of_load(self.load_steps))

    @property
    def discretisation(self) -> Discretisation:
        """What a static solver needs to know; raises what Discretisation raises."""
        return Discretisation(
            mesh=self.mesh,
            element=self.element,
            quadrature=self.quadrature,
            newton_tolerance=self.newton_tolerance,
        )


@dataclass(frozen=True)
class FromRest(Discretisation):
    """A motion that starts from the static equilibrium of its scene, under the loads of t = 0."""

    @property
    def motion(self) -> Discretisation:
        """How it moves from there."""
        return Discretisation(**{f.name: getattr(self, f.name) for f in fields(self) if f.init})

    @property
    def equilibrium(self) -> Discretisation:
        """What a static solver needs to know."""
        return Discretisation(
            self.mesh, self.element, self.quadrature, newton_tolerance=self.newton_tolerance
        )


Run = Discretisation | Static
RUNS = (Discretisation, FromRest, Static)


@dataclass(frozen=True)
class Watch:
    """A scene, how it is run, by whom, and where it is looked at.

    Parameters
    ----------
    scene : Scene
        Its name becomes a directory's.
    probes : iterable
        "body.end" or ("body", fraction), or a point of a rigid body.
    runs : mapping of str to Discretisation or Static
        By a short name, which becomes a directory's. Few output times, so that the stored history can be read.
    solvers : iterable of str
        Registered names; one that is not installed becomes a row that says so.
    ends : str
        Code of the status with which the runs must end: "ok", or what must be found ("diverged", …); "refused" where
        the solver must raise one of `anctmm.errors`.

    Raises
    ------
    CheckError
        If something is missing, of another kind, or its name is no file name.
    UnknownNameError
        If a probe is not of the scene.
    """

    scene: Scene
    probes: tuple[Probe, ...]
    runs: Mapping[str, Run]
    solvers: tuple[str, ...] = ("anctmm",)
    ends: str = "ok"

    def __post_init__(self) -> None:
        if type(self.scene) is not Scene:
            raise CheckError(f"Watch scene is {shown(self.scene)}; a Scene is needed")
        _plain("scene name", self.scene.name)
        for name in ("probes", "solvers"):
            object.__setattr__(self, name, self._several(name, getattr(self, name)))
        for body in self.scene.beams:
            _in_a_head(body.name)
        for probe in self.probes:
            self.scene.probe(probe)
        for solver in self.solvers:
            _plain("solver", solver)
        if not isinstance(self.runs, Mapping) or not self.runs:
            raise CheckError(
                f"Watch of {self.scene.name!r} has runs {shown(self.runs)}; "
                f"a mapping of at least one name to a Discretisation or a Static is needed"
            )
        for name, run in self.runs.items():
            _plain("run name", name)
            if type(run) not in RUNS:
                raise CheckError(
                    f"run {name!r} of {self.scene.name!r} is {shown(run)}; "
                    f"a Discretisation or a Static is needed"
                )

    def _several(self, name: str, value: object) -> tuple[Any, ...]:
        """At least one thing of an ordered iterable."""
        needed = f"Watch of {self.scene.name!r} has {name} {shown(value)}; a list of at least one is needed"
        if isinstance(value, str | bytes | Set | Mapping) or not isinstance(value, Iterable):
            raise CheckError(needed)
        try:
            found = tuple(islice(value, MOST + 1))
        except Exception as error:  # an iterable of the user's own
            raise CheckError(f"{needed}, and it raises {reason(error)}") from error
        if not 0 < len(found) <= MOST:
            raise CheckError(f"{needed}, and {MOST} at most")
        return found


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
        """scene/run/solver: also its place below the baselines."""
        return f"{self.scene.name}/{self.run_name}/{self.solver}"

    def path(self, baselines: Path) -> Path:
        """The file of its stored history."""
        return baselines / f"{self.name}.csv"

    @property
    def times(self) -> NDArray[np.float64] | None:
        """When samples are taken: s, or load factors; None where all are."""
        run = self.run
        if isinstance(run, Static) and run.path == ARC_LENGTH:
            return None
        if isinstance(run, Static):
            return np.arange(run.load_steps + 1) / run.load_steps
        return run.times(run.output_steps)

    @property
    def settings(self) -> str:
        """The run in words: a history is compared with one of the same settings only."""
        told = {
            f.name: getattr(self.run, f.name)
            for f in fields(self.run)
            if f.init and (f.name in ALWAYS or f.default is MISSING or getattr(self.run, f.name) != f.default)
        }
        words = [f"{name}={_words(value)}" for name, value in told.items()]
        return ", ".join(["start=rest", *words] if isinstance(self.run, FromRest) else words)


def tasks_of(watches: tuple[Watch, ...]) -> tuple[Task, ...]:
    """Every solver of every run of every scene.

    Raises
    ------
    CheckError
        If two would share a file.
    """
    tasks = tuple(
        Task(watch.scene, watch.probes, name, run, solver, watch.ends)
        for watch in watches
        for name, run in watch.runs.items()
        for solver in watch.solvers
    )
    names = [task.name for task in tasks]
    if twice := next((n for n in names if names.count(n) > 1), None):
        raise CheckError(f"{twice!r} is watched {names.count(twice)} times; once is allowed")
    return tasks


def declared_in(path: Path) -> tuple[Watch, ...]:
    """What a user's Python file declares as WATCHED; it may import its neighbours.

    Raises
    ------
    CheckError
        If the file is not there, does not run, or declares nothing of that kind.
    """
    found = defined_in(path, DECLARED, CheckError, "--scenes")
    watches = tuple(found) if isinstance(found, list | tuple) else ()
    if not watches or not all(isinstance(w, Watch) for w in watches):
        raise CheckError(
            f"--scenes {path} defines {DECLARED} = {told(found)}; a list of at least one Watch is needed"
        )
    return watches


# --- the base scenes ---------------------------------------------------------------------------------------

#: Coarse meshes and steps: what is watched is the code, not its accuracy, and it should not take long.
FOUR_BAR_MESH = {"crank": 2, "coupler": 8, "follower": 2}
TIGHT = 1e-12
OURS, ALL = ("anctmm", "global-dae"), ("anctmm", "global-dae", "global-dae-dense")


def base_watches() -> tuple[Watch, ...]:
    """Base scenes × elements × integrators × the solvers that have them."""
    statics = [scenes.cantilever_tip_force(load) for load in TIP_FORCES]
    statics.append(scenes.cantilever_end_moment(END_MOMENT))
    mechanisms = [scenes.four_bar(), scenes.four_bar_moment()]
    return (
        *(watch for base in mechanisms for watch in _mechanism(base)),
        *_fall(scenes.cantilever_fall()),
        *(watch for base in statics for watch in _rest(base)),
    )


def _mechanism(base: BaseScene) -> tuple[Watch, ...]:
    """Explicit runs are cut short: the dense solver takes 60 µs a step. Exudyn has no explicit joints.

    The dense solver is run with one element explicitly and with the other implicitly: its kernels compile slowly.
    """

    def explicit(element: str) -> Run:
        return Discretisation(
            FOUR_BAR_MESH, element=element, integrator="zhai", dt=2.5e-5, t_end=0.6, output_dt=0.05
        )

    def implicit(element: str) -> Run:
        return Discretisation(
            FOUR_BAR_MESH,
            element=element,
            dt=5e-3,
            t_end=base.duration,
            output_dt=base.duration / 12,
            newton_tolerance=TIGHT,
        )

    return (
        Watch(base.scene, base.probes, {"cable-zhai": explicit("cable")}, ALL),
        Watch(base.scene, base.probes, {"shear-zhai": explicit("shear")}, OURS),
        Watch(base.scene, base.probes, {"cable-implicit": implicit("cable")}, (*OURS, "exudyn-cable")),
        Watch(base.scene, base.probes, {"shear-implicit": implicit("shear")}, (*ALL, "exudyn-reissner")),
    )


def _fall(base: BaseScene) -> tuple[Watch, ...]:
    """The thickness mode of the thin section needs small explicit steps with shear elements: a shorter run."""

    def explicit(element: str, dt: float, t_end: float) -> Run:
        return Discretisation(8, element, integrator="zhai", dt=dt, t_end=t_end, output_dt=t_end / 10)

    def implicit(element: str, quadrature: str = "full") -> Run:
        return Discretisation(
            8, element, quadrature, dt=2e-3, t_end=1.0, output_dt=0.1, newton_tolerance=TIGHT
        )

    def watch(runs: dict[str, Run], solvers: tuple[str, ...]) -> Watch:
        return Watch(base.scene, base.probes, runs, solvers)

    rules = {f"cable-{rule}-implicit": implicit("cable", rule) for rule in ("reduced", "lobatto")}
    return (
        watch({"cable-zhai": explicit("cable", 5e-5, 1.0)}, (*ALL, "exudyn-cable")),
        watch({"shear-zhai": explicit("shear", 2.5e-6, 0.2)}, OURS),
        watch({"cable-implicit": implicit("cable")}, (*OURS, "exudyn-cable")),
        watch(rules, (*OURS, "exudyn-cable")),
        watch({"shear-implicit": implicit("shear")}, (*ALL, "exudyn-reissner")),
        watch(
            {
                "cable-adaptive": Discretisation(
                    8,
                    integrator="generalized-alpha",
                    tolerance=1e-4,
                    t_end=0.4,
                    output_dt=0.05,
                    newton_tolerance=TIGHT,
                )
            },
            ("anctmm",),
        ),
    )


def _rest(base: BaseScene) -> tuple[Watch, ...]:
    return (
        Watch(base.scene, base.probes, {"cable-static": Static(8)}, (*OURS, "exudyn-cable")),
        Watch(base.scene, base.probes, {"shear-static": Static(8, "shear")}, (*OURS, "exudyn-reissner")),
    )


def _plain(what: str, name: object) -> None:
    if not isinstance(name, str) or not PLAIN.fullmatch(name):
        raise CheckError(
            f"{what} is {shown(name)}; letters, digits and _ . + - are allowed, at most 100: it becomes a file's name"
        )


def _in_a_head(name: str) -> None:
    """A body's name stands in the head of a stored history, whose columns are separated by commas."""
    if "," in name or not name.isprintable():
        raise CheckError(
            f"body name is {name!r}; no comma, line break or control character is allowed: it stands in the head of "
            f"a stored history"
        )


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return "/".join(f"{v} {k}" for k, v in value.items())
    return f"{value:g}" if isinstance(value, float) else str(value)
