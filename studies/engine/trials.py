"""One run of one solver; every failure becomes a solution with a status."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError, SolverError, shown
from anctmm.model.case import Case
from anctmm.model.scene import Scene
from anctmm.results.ended_early import nothing
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from anctmm.solvers.foreign_code import contained
from anctmm.solvers.registry import Solver, static_of
from studies.engine.timing import settled, undisturbed

STATIC = "static"
#: Elements of a scene without beams in tables.
NO_BEAMS = "-"
Mesh = tuple[int, ...]
Given = tuple[tuple[str, Any], ...]
#: Options that a discretisation takes; others are keyword arguments of one solver.
SHARED = {field.name for field in fields(Discretisation) if field.init}
#: Kinds of runs that this process has done, whose code is compiled and loaded.
_warm: set[tuple[Any, ...]] = set()


@dataclass(frozen=True)
class Trial:
    """One run of one solver; nothing is checked before it runs, so that a bad case becomes a row, too."""

    scene: Scene
    solver: str
    mesh: Mesh  # elements of each beam in the scene's order, or one number for all
    element: Any = "cable"
    quadrature: str = "full"
    integrator: str = "generalized-alpha"  # "static" for the static equilibrium
    dt: float = float("nan")  # s
    t_end: float = 0.0  # s
    output_dt: float = 0.0  # s
    options: Given = ()  # of discretisation (a `tolerance` in the place of `dt`), statics, and of this solver alone

    @classmethod
    def of(cls, case: Case, solver: str, mesh: Mesh, **setting: Any) -> "Trial":
        """A run of a case over its whole duration."""
        integrator = setting.pop("integrator", cls.integrator)
        return cls(
            case.scene, solver, mesh, integrator=STATIC if case.static else integrator, t_end=case.duration,
            output_dt=case.interval, **setting,
        )  # fmt: skip

    @property
    def cut(self) -> str:
        """Elements of each beam as tables show them, 2/8/2; "-" without beams."""
        return mesh_label(self.mesh) if self.scene.beams else NO_BEAMS

    @property
    def by_body(self) -> int | dict[str, int]:
        """The mesh as the discretisation takes it."""
        if len(self.mesh) == 1:
            return self.mesh[0]
        names = [body.name for body in self.scene.beams]
        if len(names) != len(self.mesh):
            raise SolverError(
                f"mesh {mesh_label(self.mesh)} has {len(self.mesh)} numbers; scene {self.scene.name!r} needs "
                f"1 or {len(names)}, for {'/'.join(names)}"
            )
        return dict(zip(names, self.mesh, strict=True))

    @property
    def error_controlled(self) -> bool:
        """Whether a tolerance controls the step."""
        return "tolerance" in dict(self.options)

    @property
    def step(self) -> float:
        """The step, s, or the interval of output where a tolerance controls it."""
        return self.output_dt if self.error_controlled else self.dt

    @property
    def elements(self) -> int:
        """Number of all elements."""
        return max(sum(self.mesh) * (len(self.scene.beams) if len(self.mesh) == 1 else 1), 1)

    @property
    def work(self) -> float:
        """A rough measure of how long it takes: elements times steps."""
        return self.elements * (max(self.t_end / self.step, 1.0) if self.t_end else 1.0)

    @property
    def label(self) -> str:
        """The run in a few words, for progress."""
        kinds = [self.element] if isinstance(self.element, str) else dict.fromkeys(self.element.values())
        mesh = f" {self.cut} {'/'.join(kinds)}" if self.scene.beams else ""
        return f"{self.scene.name}: {self.solver}{mesh} {self.integrator}"

    @property
    def own(self) -> Given:
        """Options that only this solver has."""
        return tuple((name, value) for name, value in self.options if name not in SHARED)

    def run(self) -> Discretisation:
        """The discretisation of a motion; raises what Discretisation raises."""
        given: dict[str, Any] = {name: value for name, value in self.options if name in SHARED}
        if not self.error_controlled:
            given["dt"] = self.dt
        return Discretisation(
            mesh=self.by_body, element=self.element, quadrature=self.quadrature, integrator=self.integrator,
            t_end=self.t_end, output_dt=self.output_dt, **given,
        )  # fmt: skip

    def solve(self, solver: Solver) -> Solution:
        """Run it with a solver."""
        if self.integrator != STATIC:
            solution = solver(self.scene, self.run(), **dict(self.own))
        else:
            solution = static_of(self.solver, solver)(
                self.scene, mesh=self.by_body, element=self.element, quadrature=self.quadrature, **dict(self.options)
            )  # fmt: skip
        if not isinstance(solution, Solution):
            raise SolverError(f"solver {self.solver!r} answered {shown(solution)}; a Solution is needed")
        return solution

    def warm_up(self, solver: Solver) -> None:
        """Compile and load what the run needs, by two steps (or the statics)."""
        about = self.solver, self.scene.name, str(self.element), self.quadrature, self.integrator
        kind = (*about, self.own, self.error_controlled)
        if kind not in _warm:
            steps: dict[str, Any] = (
                {} if self.integrator == STATIC else {"t_end": 2 * self.step, "output_dt": self.step}
            )
            replace(self, **steps).solve(solver)
            _warm.add(kind)


def solved(trial: Trial, resolve: Callable[[str], Solver] = registry.solver) -> Solution:
    """Run a case on one thread after a warm-up; of a short run the second one in a row gives the times.

    Whatever fails is a solution with that status.
    """

    def solve() -> Solution:
        solver = resolve(trial.solver)
        with undisturbed():
            trial.warm_up(solver)
            return settled(lambda: trial.solve(solver))

    return guarded(trial, solve)


def guarded(trial: Trial, solve: Callable[[], Solution]) -> Solution:
    """Answer of `solve`; whatever it raises becomes a solution with that status."""
    try:
        with contained():
            return solve()
    except AnctmmError as error:
        status = Status("refused", " ".join(str(error).split()))
    except Exception as error:  # one broken solver must not end a study
        status = Status("failed", f"{type(error).__name__}: {' '.join(str(error).split())}")
    return nothing(trial.solver, trial.scene, None, status)


def not_installed(status: Status) -> bool:
    """Whether a solver did nothing since what it needs is not installed."""
    return status.code == "unsupported" and "not installed" in status.message


def mesh_label(mesh: Mesh) -> str:
    """2/8/2 of (2, 8, 2)."""
    return "/".join(map(str, mesh))
