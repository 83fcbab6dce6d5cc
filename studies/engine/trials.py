"""One run of one solver; every failure becomes a solution with a status."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from math import inf, nan
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError, UnsupportedError
from anctmm.model.case import Case
from anctmm.model.scene import Scene
from anctmm.results.ended_early import nothing
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from anctmm.solvers.capabilities import Offer
from anctmm.solvers.foreign_code import contained
from anctmm.solvers.registry import Solver, static_of
from anctmm.validation import FrozenMapping
from studies.engine.meshes import Mesh, by_beam, mesh_label, stable_step
from studies.engine.timing import settled, undisturbed

#: The solver whose runs choose meshes and steps; integrators of equilibria, and of explicit and implicit steps.
OURS = "anctmm"
STATIC, EXPLICIT, IMPLICIT = "static", "zhai", "generalized-alpha"
#: Steps of a motion that an equilibrium counts as.
STATIC_STEPS = 100.0
#: Part of the largest stable step that explicit runs take: deformation raises the highest frequency.
MARGIN = 0.8
#: Elements of a scene without beams in tables.
NO_BEAMS = "-"
#: Options that a discretisation takes; others are keyword arguments of one solver.
SHARED = {field.name for field in fields(Discretisation) if field.init}
#: Kinds of runs that this process has done, whose code is compiled and loaded.
_warm: set[tuple[Any, ...]] = set()


@dataclass(frozen=True)
class Trial:
    """One run of one solver; nothing is checked before it runs, so that a bad case becomes a row, too."""

    scene: Scene
    solver: str
    mesh: Mesh
    element: Any = "cable"
    quadrature: str = "full"
    integrator: str = IMPLICIT  # "static" for the static equilibrium
    dt: float = nan  # s
    t_end: float = 0.0  # s
    output_dt: float = 0.0  # s
    #: Of the discretisation (a `tolerance` in the place of `dt`), of statics, and of this solver alone.
    options: Mapping[str, Any] = FrozenMapping()

    @classmethod
    def of(cls, case: Case, solver: str = OURS, mesh: Mesh = (1,), **setting: Any) -> "Trial":
        """A run of a case over its whole duration."""
        setting |= {"integrator": STATIC} if case.static else {}
        return cls(case.scene, solver, mesh, t_end=case.duration, output_dt=case.interval, **setting)

    @property
    def cut(self) -> str:
        """Elements of each beam as tables show them, 2/8/2; "-" without beams."""
        return mesh_label(self.mesh) if self.scene.beams else NO_BEAMS

    @property
    def by_beam(self) -> int | dict[str, int]:
        """The mesh as the discretisation takes it."""
        return by_beam(self.scene, self.mesh)

    @property
    def used(self) -> str:
        """The element that the solver uses for the one asked for, or all of them."""
        if isinstance(self.element, str):
            return offer_of(self.solver).element_of(self.element)
        return "/".join(dict.fromkeys(self.element.values()))

    @property
    def error_controlled(self) -> bool:
        """Whether a tolerance controls the step."""
        return "tolerance" in self.options

    @property
    def kind(self) -> tuple[str, Any, str]:
        """Solver, element and way to step."""
        controlled = ", error-controlled" if self.error_controlled else ""
        return self.solver, self.element, f"{self.integrator}{controlled}"

    @property
    def work(self) -> float:
        """A rough measure of how long it takes: elements times steps (or outputs, where a tolerance controls steps)."""
        return self.elements * (max(self.t_end / self._step, 1.0) if self.t_end else STATIC_STEPS)

    @property
    def elements(self) -> int:
        """Number of all elements."""
        return max(sum(self.mesh) * (len(self.scene.beams) if len(self.mesh) == 1 else 1), 1)

    @property
    def label(self) -> str:
        """The run in a few words."""
        mesh = f" {self.cut} {self.used}" if self.scene.beams else ""
        return f"{self.solver} {self.integrator}{mesh}" + (f" dt={self.dt:.4g}" if self.dt > 0.0 else "")

    @property
    def _step(self) -> float:
        return self.output_dt if self.error_controlled else self.dt

    @property
    def _model(self) -> dict[str, Any]:
        return {"mesh": self.by_beam, "element": self.element, "quadrature": self.quadrature}

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of the discretisation of a motion."""
        step = {} if self.error_controlled else {"dt": self.dt}
        times = {"integrator": self.integrator, **step, "t_end": self.t_end, "output_dt": self.output_dt}
        return self._model | times | {k: value for k, value in self.options.items() if k in SHARED}

    @property
    def own(self) -> dict[str, Any]:
        """Options that its solver alone has."""
        return {k: value for k, value in self.options.items() if k not in SHARED}

    def run(self) -> Discretisation:
        """The discretisation of a motion; raises what Discretisation raises."""
        return Discretisation(**self.arguments)

    def solve(self, solver: Solver) -> Solution:
        """Run it with a solver."""
        if self.integrator != STATIC:
            return solver(self.scene, self.run(), **self.own)
        return static_of(self.solver, solver)(self.scene, **self._model, **self.options)

    def warm_up(self, solver: Solver) -> None:
        """Compile and load what the run needs, by two steps (or the statics)."""
        kind = self.solver, self.scene.name, self.element, self.quadrature, self.integrator, *self.options
        if kind not in _warm:
            replace(self, t_end=2.0 * self._step, output_dt=self._step).solve(solver)
            _warm.add(kind)


def offer_of(solver: str) -> Offer:
    """Capabilities of a solver; everything of one that cannot be loaded, whose rows say why."""
    try:
        return registry.offer_of(registry.load(solver))
    except AnctmmError:
        return Offer()


def explicit_limit(trial: Trial) -> float:
    """A safe explicit step on the mesh of a run, s; infinite where none is too long, or the solver must answer."""
    try:
        limit = stable_step(trial.scene, trial.by_beam, element=trial.element, quadrature=trial.quadrature)
    except AnctmmError:
        return inf
    return MARGIN * limit if limit < trial.output_dt else inf


def solved(trial: Trial, resolve: Callable[[str], Solver] = registry.solver) -> Solution:
    """Run a case on one thread after a warm-up; of a short run the second one in a row gives the times.

    Whatever fails is a solution with that status.
    """
    try:
        with contained(), undisturbed():
            solver = resolve(trial.solver)
            trial.warm_up(solver)
            return settled(lambda: trial.solve(solver))
    except AnctmmError as error:
        code = "unsupported" if isinstance(error, UnsupportedError) else "refused"
        status = Status(code, " ".join(str(error).split()))
    except Exception as error:  # one broken solver must not end a study
        status = Status("failed", f"{type(error).__name__}: {' '.join(str(error).split())}")
    return nothing(trial.solver, trial.scene, None, status)


def not_installed(status: Status) -> bool:
    """Whether a solver did nothing since what it needs is not installed."""
    return status.code == "unsupported" and "not installed" in status.message
