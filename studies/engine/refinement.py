"""Refinement of mesh and step until an estimate of the error is small enough: the one in all studies.

Meshes or steps may be given instead, from coarse to fine; the remaining error is estimated from those.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, isinf, nan
from typing import Any

import numpy as np

from anctmm.discretise.discretisation import INTEGRATORS
from anctmm.elements.kinds import KINDS, QUADRATURES
from anctmm.errors import AnctmmError, ResultError
from anctmm.model.case import Case
from anctmm.model.scene import Probe
from anctmm.results.metrics import common_times, compare, history_error, rounding_at, worst
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from anctmm.solvers.capabilities import Offer
from anctmm.validation import one_of
from studies.engine.meshes import coarsest_mesh, explicit_limit, longest_step
from studies.engine.richardson import Part, Spacing, part_of
from studies.engine.runner import Runner
from studies.engine.trials import STATIC, Mesh, Trial

#: Elements times steps of a run at most, some ten seconds; halvings of mesh or step at most.
MOST_WORK, MOST_HALVINGS = 4e6, 20
#: Steps of a motion that an equilibrium counts as.
STATIC_STEPS = 100.0
#: Statuses that neither a finer mesh nor a shorter step changes.
FINAL = ("unsupported", "interrupted", "unstable", "singular", "imprecise")
#: Order in time of each integrator.
STEP_ORDERS = {"zhai": 2.0, "generalized-alpha": 2.0, "esdirk": 4.0}
#: Angle, rad, below which a place that rests does not turn.
TURNED = 1e-6


@dataclass(frozen=True)
class Setup:
    """Solver, element, quadrature and integrator: all but mesh and step.

    Raises
    ------
    UnknownOptionError
        Naming the option that is not known.
    """

    solver: str = "anctmm"
    element: str = "cable"
    integrator: str = "generalized-alpha"
    quadrature: str = "full"
    options: tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        one_of("solver", self.solver, registry.names())
        one_of("element", self.element, KINDS)
        one_of("integrator", self.integrator, INTEGRATORS)
        one_of("quadrature", self.quadrature, QUADRATURES)

    @property
    def own_element(self) -> str:
        """The element that the solver uses for this one."""
        return element_of(self.solver, self.element)

    @property
    def mesh_order(self) -> float:
        """Order in space of that element."""
        return order_of(self.solver, self.element)

    @property
    def step_order(self) -> float:
        """Order in time of the integrator."""
        return STEP_ORDERS[self.integrator]


def offer_of(solver: str) -> Offer:
    """Capabilities of a solver; everything of one that cannot be loaded, whose rows say why."""
    try:
        return registry.offer_of(registry.load(solver))
    except AnctmmError:
        return Offer()


def element_of(solver: str, asked: str) -> str:
    """Name of the element that a solver uses for a requested one."""
    return offer_of(solver).element_of(asked)


def order_of(solver: str, asked: str) -> float:
    """Order in space of the element that a solver uses for a requested one."""
    return offer_of(solver).order_of(asked)


@dataclass(frozen=True)
class Reference:
    """A solution that errors are measured against.

    Parameters
    ----------
    name : str
        Solver and settings; why there is none.
    uncertainty : float
        Of the reference itself, in the unit of the error.
    solution : Solution, optional
    probes : tuple
        Where histories are compared.
    """

    name: str
    uncertainty: float = nan
    solution: Solution | None = None
    probes: tuple[Probe, ...] = ()

    def error_of(self, solution: Solution) -> float:
        """Error of a solution; NaN of one that is not complete."""
        if self.solution is None or not solution.status.ok:
            return nan
        return difference(solution, self.solution, self.probes)


def difference(one: Solution, other: Solution, probes: Sequence[Probe]) -> float:
    """Relative difference of two complete runs at probes: of displacements, of equilibria the last ones.

    Where a probe rests and turns, of its angles.
    """
    if other.static:
        moved = [_last_difference(one, other, probe) for probe in probes]
    else:
        moved = [compare(one, other, probes).error]
    return worst([*moved, *(turn_difference(one, other, probe) for probe in probes)])


class Refinement:
    """Runs of a case over levels of mesh and step, each level half of the one before.

    Parameters
    ----------
    case : Case
    setup : Setup
    runner : Runner
    meshes : sequence of tuple of int
        Of its levels, from coarse to fine, one or more; without any, meshes are chosen.
    steps : sequence of float
        Of its levels, from long to short, s, one or more; without any, steps are chosen.
    most_work : float
        Elements times steps of a run at most, where mesh or step is chosen.
    """

    def __init__(
        self, case: Case, setup: Setup, runner: Runner, meshes: Sequence[Mesh] = (), steps: Sequence[float] = (),
        most_work: float = MOST_WORK,
    ) -> None:  # fmt: skip
        self.case, self.setup, self.runner = case, setup, runner
        self.meshes, self.steps, self.most_work = tuple(meshes), tuple(steps), most_work
        self._solutions: dict[tuple[int, int], Solution] = {}
        self._limits: dict[int, float] = {}

    @property
    def chooses_mesh(self) -> bool:
        """Whether meshes are chosen."""
        return not self.meshes and bool(self.case.scene.beams) and not KINDS[self.setup.element].rigid

    @property
    def chooses_step(self) -> bool:
        """Whether steps are chosen."""
        return not self.steps and not self.case.static

    @property
    def refines_mesh(self) -> bool:
        """Whether there are meshes to compare."""
        return self.chooses_mesh or len(self.meshes) > 1

    @property
    def refines_step(self) -> bool:
        """Whether there are steps to compare."""
        return self.chooses_step or len(self.steps) > 1

    @property
    def runs(self) -> int:
        """Runs done so far."""
        return len(self._solutions)

    @property
    def estimates(self) -> bool:
        """Whether the whole error is estimated: neither mesh nor step, where there is one, is the same in all runs."""
        return len(self.meshes) != 1 and (len(self.steps) != 1 or self.case.static)

    def mesh_at(self, i: int) -> Mesh:
        """Mesh of a level."""
        if self.meshes:
            return self.meshes[i]
        return tuple(n * 2**i for n in coarsest_mesh(self.case, self.setup.element))

    def dt_at(self, i: int, j: int) -> float:
        """Step of a level, s: on finer meshes that of an explicit integrator is shorter."""
        if self.case.static:
            return nan
        if self.steps:
            return self.steps[j]
        if i not in self._limits:
            self._limits[i] = self._longest_step(i)
        return self._limits[i] / 2**j

    def trial(self, i: int, j: int) -> Trial:
        """The run of a level of mesh and one of step."""
        setup, case = self.setup, self.case
        return Trial(
            case.scene, setup.solver, self.mesh_at(i), setup.element, setup.quadrature,
            STATIC if case.static else setup.integrator, self.dt_at(i, j), case.duration, case.interval, setup.options,
        )  # fmt: skip

    def work(self, i: int, j: int) -> float:
        """Elements times steps of a level, or what an equilibrium counts as."""
        trial = self.trial(i, j)
        return trial.elements * STATIC_STEPS if self.case.static else trial.work

    def solution(self, i: int, j: int) -> Solution:
        """The run of a level, done once."""
        if (i, j) not in self._solutions:
            self._solutions[i, j] = self.runner.solve(self.trial(i, j))
        return self._solutions[i, j]

    def mesh_runs(self, i: int, j: int) -> list[Solution]:
        """The run of a level and those on the next two coarser meshes; nothing where no mesh is refined."""
        return [self.solution(k, j) for k in (i, i - 1, i - 2) if k >= 0] if self.refines_mesh else []

    def step_runs(self, i: int, j: int) -> list[Solution]:
        """The run of a level and those by the next two longer steps; nothing where no step is refined."""
        return [self.solution(i, k) for k in (j, j - 1, j - 2) if k >= 0] if self.refines_step else []

    def mesh_part(self, i: int, j: int) -> Part:
        """Part of the error that is due to the mesh."""
        spacing = Spacing(*(self._finer_mesh(k) for k in (i, i - 1)))
        return self._part(self.mesh_runs(i, j), self.setup.mesh_order, spacing)

    def step_part(self, i: int, j: int) -> Part:
        """Part of the error that is due to the step."""
        spacing = Spacing(*(self.dt_at(i, k - 1) / self.dt_at(i, k) if k > 0 else 2.0 for k in (j, j - 1)))
        return self._part(self.step_runs(i, j), self.setup.step_order, spacing)

    def refined(self, target: float) -> "Refined":
        """Refine mesh and step until the estimated error is no larger than a target, relative."""
        i = len(self.meshes) - 1 if self.meshes else int(self.chooses_mesh)
        j = len(self.steps) - 1 if self.steps else int(self.chooses_step)
        best: Refined | None = None
        failed: Refined | None = None
        reason = ""
        for _ in range(2 * MOST_HALVINGS):
            if (self.chooses_mesh or self.chooses_step) and self.work(i, j) > self.most_work:
                reason = f"a run of more than {self.most_work:.2g} elements times steps would be needed"
                break
            found = self._at(i, j, target)
            if best is None or not best.solution.status.ok or found.error <= best.error:
                best = found
            if found.reached or self._is_final(found.solution.status):
                break
            failed = failed if found.solution.status.ok else found
            finer = self._finer(found)
            if finer == (i, j):
                reason = "only the given mesh and step may be used"
                break
            i, j = finer
        best = best or self._at(i, j, target)
        if not best.solution.status.ok:
            reason = str(best.solution.status)
        elif failed is not None and failed.i >= best.i and failed.j >= best.j:
            reason = f"{failed.label} ends early ({failed.solution.status}), and {reason}"
        return replace(best, reason="" if best.reached else reason)

    def difference(self, one: Solution, other: Solution) -> float:
        """Relative difference of two runs at the case's probes; infinite where one is not complete."""
        if not (one.status.ok and other.status.ok):
            return inf
        found = difference(one, other, self.case.probes)
        return found if isfinite(found) else inf

    def _is_final(self, status: Status) -> bool:
        """Whether neither a finer mesh nor a shorter step changes how a run ends."""
        explicit = self.setup.integrator == "zhai" and "stable" in status.message
        raised = not status.ok and "Error: " in status.message  # by a function of the user's scene
        return status.code in FINAL or raised or (status.code == "refused" and not explicit)

    def _at(self, i: int, j: int, target: float) -> "Refined":
        if self.runner.spread or self.solution(i, j).status.ok:
            around = [level for level in self._around(i, j) if level not in self._solutions]
            found = self.runner.solve_many(self.trial(*level) for level in around)
            self._solutions |= dict(zip(around, found, strict=True))
        complete = self.solution(i, j).status.ok
        bad = Part(inf)
        mesh, step = (self.mesh_part(i, j), self.step_part(i, j)) if complete else (bad, bad)
        return Refined(self, i, j, mesh, step, complete and mesh.error + step.error <= target, target)

    def _around(self, i: int, j: int) -> list[tuple[int, int]]:
        """Levels whose runs estimate the error of one."""
        coarser_meshes = [(k, j) for k in (i - 1, i - 2) if k >= 0 and self.refines_mesh]
        coarser_steps = [(i, k) for k in (j - 1, j - 2) if k >= 0 and self.refines_step]
        return [(i, j), *coarser_meshes, *coarser_steps]

    def _finer(self, found: "Refined") -> tuple[int, int]:
        """The next level: the larger part of the error is refined, both where each alone is too large."""
        i, j, half = found.i, found.j, 0.5 * found.target
        mesh, step = found.mesh.error, found.step.error
        unknown = self.chooses_step and isinf(step)
        if not found.solution.status.ok or unknown:  # a shorter step helps where Newton's iteration fails
            return (i, j + 1) if self.chooses_step else (i + self.chooses_mesh, j)
        coarser_mesh = self.chooses_mesh and (mesh > half or mesh >= step)
        coarser_step = self.chooses_step and (step > half or step > mesh)
        return i + coarser_mesh, j + coarser_step

    def _finer_mesh(self, i: int) -> float:
        """How many times finer the mesh of a level is than the one before, of the beam that is refined least."""
        if i <= 0 or not self.meshes:
            return 2.0
        return min(n / before for n, before in zip(self.meshes[i], self.meshes[i - 1], strict=True))

    def _part(self, runs: Sequence[Solution], theory: float, spacing: Spacing) -> Part:
        """The error of the first of runs on levels from fine to coarse."""
        if not runs:
            return Part()
        if len(runs) < 2:
            return Part(inf)
        before = self.difference(runs[2], runs[1]) if len(runs) > 2 else nan
        return part_of(self.difference(runs[1], runs[0]), before, theory, spacing)

    def _longest_step(self, i: int) -> float:
        """Step of the coarsest level, s, a whole part of the interval of output."""
        limit = inf
        if self.setup.integrator == "zhai":
            mesh = Trial(self.case.scene, self.setup.solver, self.mesh_at(i)).by_body
            limit = explicit_limit(
                self.case, mesh, element=self.setup.element, quadrature=self.setup.quadrature
            )
        return longest_step(self.case, limit)


@dataclass(frozen=True)
class Refined:
    """A run with the estimate of its error.

    Parameters
    ----------
    levels : Refinement
        Where it comes from.
    i, j : int
        Its levels of mesh and step.
    mesh, step : Part
        Parts of its error.
    reached : bool
        Whether the estimated error is no larger than the target.
    target : float
    reason : str
        Why it is not reached.
    """

    levels: Refinement
    i: int
    j: int
    mesh: Part
    step: Part
    reached: bool
    target: float
    reason: str = ""

    @property
    def error(self) -> float:
        """Estimated, of mesh and step together; infinite where nothing is known."""
        return self.mesh.error + self.step.error

    @property
    def solution(self) -> Solution:
        """Its solution."""
        return self.levels.solution(self.i, self.j)

    @property
    def trial(self) -> Trial:
        """The run."""
        return self.levels.trial(self.i, self.j)

    @property
    def label(self) -> str:
        """The run in words."""
        trial = self.trial
        step = "" if self.levels.case.static else f" dt={trial.dt:.4g}"
        mesh = f" {trial.cut} {trial.element}" if trial.scene.beams else ""
        return f"{trial.solver} {trial.integrator}{mesh}{step}"

    @property
    def reference(self) -> Reference:
        """The run as a reference for errors."""
        if not self.solution.status.ok or not isfinite(self.error):
            return Reference(f"none: {self.label}: {self.reason or 'no coarser run is complete'}")
        return Reference(self.label, self.error, self.solution, self.levels.case.probes)


def rests(solution: Solution, probe: Probe) -> bool:
    """Whether a probe moves by no more than rounding."""
    moved = np.linalg.norm(solution.displacement(probe), axis=1).max(initial=0.0)
    return bool(moved <= rounding_at(solution, probe))


def turn_at_rest(solution: Solution, probe: Probe) -> Any:
    """Angles of a probe that turns and does not move, rad; None of any other, and where the solver gives none."""
    if not rests(solution, probe):
        return None
    try:
        angle = solution.angle(probe)
    except ResultError:
        return None
    return angle if np.abs(angle).max(initial=0.0) > TURNED else None


def turn_difference(one: Solution, other: Solution, probe: Probe) -> float:
    """Relative difference of the angles of a probe that rests: RMS in time, of equilibria at the last.

    Zero of a probe that moves, or does not turn in the second solution, and where a solver gives no angles.
    """
    known = turn_at_rest(other, probe)
    if known is None:
        return 0.0
    try:
        found = one.angle(probe)
    except ResultError:
        return 0.0
    mine, theirs = common_times(one.t, other.t)
    apart = found[mine] - known[theirs]
    size = float(np.abs(known[theirs]).max())
    return float(abs(apart[-1]) if other.static else np.sqrt(np.mean(apart**2))) / size


def _last_difference(one: Solution, other: Solution, probe: Probe) -> float:
    """Difference of the last displacements of two equilibria, relative to them; of a place that rests in m."""
    u, v = one.displacement(probe)[-1:], other.displacement(probe)[-1:]
    return history_error(u, v, rounding_at(other, probe))
