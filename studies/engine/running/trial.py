"""One run of one solver; every failure becomes a solution with a status."""

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError, SolverError
from anctmm.model.needs import needs
from anctmm.model.scene import Scene
from anctmm.results.ended_early import nothing
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers.foreign_code import contained, told
from anctmm.solvers.registry import Solver, static_of
from studies.engine.measuring.timing import undisturbed

STATIC = "static"
#: What tables say of the elements of a scene without beams.
NO_BEAMS = "-"
Mesh = tuple[int, ...]


@dataclass(frozen=True)
class Trial:
    """One run of one solver; nothing is checked before it runs, so that a bad case becomes a row, too.

    Parameters
    ----------
    scene : Scene
    solver : str
        Registered name.
    mesh : tuple of int
        Elements of each beam in the scene's order, or one number for all.
    element, quadrature, integrator : str
        As in Discretisation; `integrator` "static" asks for the static equilibrium.
    dt, t_end, output_dt : float
        s; of no meaning for statics.
    options : tuple of (str, value)
        Further options of the discretisation, or of the static solver; a `tolerance` among them takes the place
        of `dt`, which is then NaN.
    own : tuple of (str, value)
        Keyword arguments of the solver that no other has; not for statics.
    """

    scene: Scene
    solver: str
    mesh: Mesh
    element: str = "cable"
    quadrature: str = "full"
    integrator: str = "generalized-alpha"
    dt: float = float("nan")
    t_end: float = 0.0
    output_dt: float = 0.0
    options: tuple[tuple[str, Any], ...] = ()
    own: tuple[tuple[str, Any], ...] = ()

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
        """Whether a tolerance drives the step."""
        return "tolerance" in dict(self.options)

    @property
    def kernels(self) -> tuple[Any, ...]:
        """What is equal for runs that need the same compiled code: one of them warms up for all."""
        needed = frozenset(feature for feature, _ in needs(self.scene))
        return self.solver, self.scene.name, needed, self.element, self.quadrature, self.integrator, self.own

    @property
    def work(self) -> float:
        """A rough measure of how long it takes: elements times steps."""
        elements = sum(self.mesh) * (len(self.scene.beams) if len(self.mesh) == 1 else 1)
        steps = self.t_end / (self.output_dt if self.error_controlled else self.dt) if self.t_end else 1.0
        return max(elements, 1) * (steps if steps > 1.0 else 1.0)

    def run(self) -> Discretisation:
        """The discretisation of a dynamic case; raises what Discretisation raises."""
        step: dict[str, Any] = {} if self.error_controlled else {"dt": self.dt}
        return Discretisation(
            mesh=self.by_body, element=self.element, quadrature=self.quadrature, integrator=self.integrator,
            t_end=self.t_end, output_dt=self.output_dt, **step, **dict(self.options),
        )  # fmt: skip

    def solve(self, solver: Solver) -> Solution:
        """Run it with a solver already found by name."""
        if self.integrator != STATIC:
            return solver(self.scene, self.run(), **dict(self.own))
        return static_of(self.solver, solver)(
            self.scene,
            mesh=self.by_body,
            element=self.element,
            quadrature=self.quadrature,
            **dict(self.options),
        )

    def warm_up(self, solver: Solver) -> None:
        """Two steps (or the statics) unmeasured: whatever compiles or loads does it here."""
        step = self.output_dt if self.error_controlled else self.dt
        short = replace(self, t_end=2 * step, output_dt=step) if self.integrator != STATIC else self
        short.solve(solver)


def performed(
    case: Trial, solver: Solver, prepare: Callable[[], None], around: AbstractContextManager[object]
) -> Solution:
    """A run with nothing else at work in its process; what its solver refuses is an answer, too.

    Parameters
    ----------
    case : Trial
    solver : callable
        Found by the case's name for it.
    prepare : callable
        Called first: whatever compiles or loads does it there.
    around : context manager
        Entered for the run alone.
    """
    try:
        with undisturbed():
            prepare()
            with around:
                solution = case.solve(solver)
        if not isinstance(solution, Solution):
            raise SolverError(f"solver {case.solver!r} answered {told(solution)}; a Solution is needed")
    except AnctmmError as error:
        return nothing(case.solver, case.scene, None, Status("refused", _one_line(error)))
    return solution


def guarded(solver: str, scene: Scene, solve: Callable[[], Solution]) -> Solution:
    """What `solve` returns; whatever it raises becomes a solution with that status."""
    try:
        with contained():
            return solve()
    except AnctmmError as error:
        return nothing(solver, scene, None, Status("refused", _one_line(error)))
    except Exception as error:  # one broken solver must not end a sweep
        reason = f"{type(error).__name__}: {_one_line(error)}"
        return nothing(solver, scene, None, Status("failed", reason))


def label_of(case: Trial) -> str:
    """A run in a few words, for whoever waits for it."""
    kinds = [case.element] if isinstance(case.element, str) else list(case.element.values())
    mesh = f" {case.cut} {'/'.join(kinds)}" if case.scene.beams else ""
    return f"{case.scene.name} · {case.solver}{mesh} {case.integrator}"


def mesh_label(mesh: Mesh) -> str:
    """2/8/2 of (2, 8, 2)."""
    return "/".join(map(str, mesh))


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())


def product(
    scene: Scene,
    solvers: Iterable[str],
    meshes: Iterable[Mesh],
    steps: Iterable[float] = (float("nan"),),
    **common: Any,
) -> list[Trial]:
    """Cases of solver × mesh × step, the rest in common."""
    steps, solvers = tuple(steps), tuple(solvers)
    return [Trial(scene, s, mesh, dt=dt, **common) for mesh in meshes for dt in steps for s in solvers]
