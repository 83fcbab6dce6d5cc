"""Automatic choice of mesh and step: both are refined until an estimate of the error is small enough.

Meshes or steps may be given instead, from coarse to fine; the remaining error is estimated from those.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import ceil, inf, isfinite, isinf, nan
from typing import Any

from anctmm.discretise.discretisation import INTEGRATORS
from anctmm.discretise.methods import METHODS
from anctmm.elements.kinds import KINDS, QUADRATURES
from anctmm.errors import AnctmmError
from anctmm.integrators.broken_law import law_raised
from anctmm.model.case import Case
from anctmm.results.metrics import compare, history_error, rounding_at, worst
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from anctmm.validation import one_of
from studies.engine.accuracy.dynamics import AS_GIVEN, with_stretch
from studies.engine.accuracy.resting import turned_apart
from studies.engine.accuracy.richardson import Part, Spacing, part_of
from studies.engine.measuring.setting import stable_step
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Outcome, Reference
from studies.engine.running.rows import element_of, order_of
from studies.engine.running.trial import STATIC, Mesh, Trial

#: Of the longest beam on the coarsest mesh: of elements of fourth order, and of others.
COARSEST, COARSEST_OF_LOW_ORDER = 2, 4
#: Steps of the coarsest run at least.
FEWEST_STEPS = 50
#: Elements times steps of a run at most, some ten seconds; halvings of mesh or step at most.
MOST_WORK, MOST_HALVINGS = 4e6, 20
#: An equilibrium is taken to be so many steps of a motion.
STATIC_STEPS = 100.0
#: Statuses that neither a finer mesh nor a shorter step changes: finer elements only make a scene softer, and rounding
#: worse.
FINAL = ("unsupported", "refused", "interrupted", "unstable", "singular", "imprecise")


@dataclass(frozen=True)
class Setup:
    """Who solves, with which element and integrator: all but mesh and step.

    Parameters
    ----------
    solver, element, integrator, quadrature : str
    stretch : str
        Of the scene's clamps, see `studies.engine.accuracy.dynamics.with_stretch`.
    options : tuple of (str, value)
        Further options of the discretisation.

    Raises
    ------
    UnknownOptionError
        Naming what is not known.
    """

    solver: str = "anctmm"
    element: str = "cable"
    integrator: str = "generalized-alpha"
    quadrature: str = "full"
    stretch: str = AS_GIVEN
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
        return float(METHODS[self.integrator].order)

    def __str__(self) -> str:
        return f"{self.solver}, {self.own_element}, {self.integrator}"


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
        self,
        case: Case,
        setup: Setup,
        runner: Runner,
        meshes: Sequence[Mesh] = (),
        steps: Sequence[float] = (),
        most_work: float = MOST_WORK,
    ) -> None:
        self.case, self.setup, self.runner = case, setup, runner
        self.meshes, self.steps, self.most_work = tuple(meshes), tuple(steps), most_work
        self._outcomes: dict[tuple[int, int], Outcome] = {}
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
        return len(self._outcomes)

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
            with_stretch(case.scene, setup.stretch), setup.solver, self.mesh_at(i), setup.element, setup.quadrature,
            STATIC if case.static else setup.integrator, self.dt_at(i, j), case.duration, case.interval, setup.options,
        )  # fmt: skip

    def work(self, i: int, j: int) -> float:
        """Elements times steps of a level, or what an equilibrium takes of them."""
        elements = sum(self.mesh_at(i)) * (len(self.case.scene.beams) if len(self.mesh_at(i)) == 1 else 1)
        return max(elements, 1) * (
            STATIC_STEPS if self.case.static else self.case.duration / self.dt_at(i, j)
        )

    def outcome(self, i: int, j: int) -> Outcome:
        """The run of a level, done once."""
        if (i, j) not in self._outcomes:
            self._outcomes[i, j] = self.runner.solve(self.trial(i, j))
        return self._outcomes[i, j]

    def timed(self, i: int, j: int) -> Solution:
        """The run of a level with the times that it took."""
        outcome = self.outcome(i, j)
        if not outcome.samples:
            outcome = self._outcomes[i, j] = self.runner.sweep([self.trial(i, j)], budget_s=0.0)[0]
        samples = outcome.samples[:1]
        return replace(outcome.solution, cost=samples[0].cost) if samples else outcome.solution

    def solution(self, i: int, j: int) -> Solution:
        """What it gave."""
        return self.outcome(i, j).solution

    def mesh_runs(self, i: int, j: int) -> list[Solution]:
        """The run of a level and those on the next two coarser meshes; nothing where no mesh is chosen."""
        return [self.solution(k, j) for k in (i, i - 1, i - 2) if k >= 0] if self.refines_mesh else []

    def step_runs(self, i: int, j: int) -> list[Solution]:
        """The run of a level and those by the next two coarser steps; nothing where no step is chosen."""
        return [self.solution(i, k) for k in (j, j - 1, j - 2) if k >= 0] if self.refines_step else []

    def mesh_part(self, i: int, j: int) -> Part:
        """What the mesh adds to the error."""
        spacing = Spacing(*(self._finer_mesh(k) for k in (i, i - 1)))
        return self._part(self.mesh_runs(i, j), self.setup.mesh_order, spacing)

    def step_part(self, i: int, j: int) -> Part:
        """What the step adds to the error."""
        spacing = Spacing(*(self.dt_at(i, k - 1) / self.dt_at(i, k) if k > 0 else 2.0 for k in (j, j - 1)))
        return self._part(self.step_runs(i, j), self.setup.step_order, spacing)

    def refined(self, target: float) -> "Refined":
        """Refine mesh and step until the estimated error is no larger than a target.

        Parameters
        ----------
        target : float
            Relative, as the error of `anctmm.compare`.
        """
        i = len(self.meshes) - 1 if self.meshes else int(self.chooses_mesh)
        j = len(self.steps) - 1 if self.steps else int(self.chooses_step)
        best: Refined | None = None
        failed: Refined | None = None
        reason = ""
        for _ in range(2 * MOST_HALVINGS):
            chosen = self.chooses_mesh or self.chooses_step
            if chosen and self.work(i, j) > self.most_work:
                reason = f"a run of more than {self.most_work:.2g} elements times steps would be needed"
                break
            found = self._at(i, j, target)
            if best is None or not best.solution.status.ok or found.error <= best.error:
                best = found
            if found.reached or _is_final(found.solution.status):
                break
            failed = failed if found.solution.status.ok else found
            finer = self._finer(found)
            if finer == (i, j):
                reason = "only the given mesh and step may be used"
                break
            i, j = finer
        if best is None:  # the first run is too long already
            best = self._at(i, j, target)
        if not best.solution.status.ok:
            reason = str(best.solution.status)
        elif failed is not None and failed.i >= best.i and failed.j >= best.j:  # why none was better
            reason = f"{failed.label} ends early ({failed.solution.status}), and {reason}"
        return replace(best, reason="" if best.reached else reason)

    def _at(self, i: int, j: int, target: float) -> "Refined":
        self.runner.compute([self.trial(*level) for level in self._around(i, j)])
        whole = self.solution(i, j).status.ok
        bad = Part(inf)
        mesh, step = (self.mesh_part(i, j), self.step_part(i, j)) if whole else (bad, bad)
        return Refined(self, i, j, mesh, step, whole and mesh.error + step.error <= target, target)

    def _around(self, i: int, j: int) -> list[tuple[int, int]]:
        """Levels whose runs estimate the error of one."""
        coarser_meshes = [(k, j) for k in (i - 1, i - 2) if k >= 0 and self.refines_mesh]
        coarser_steps = [(i, k) for k in (j - 1, j - 2) if k >= 0 and self.refines_step]
        return [(i, j), *coarser_meshes, *coarser_steps]

    def _finer(self, found: "Refined") -> tuple[int, int]:
        """The next level: what adds more to the error is refined, both where each alone is too much."""
        i, j, half = found.i, found.j, 0.5 * found.target
        mesh, step = found.mesh.error, found.step.error
        unknown = self.chooses_step and isinf(step)  # a run by a longer step is not whole
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

    def difference(self, one: Solution, other: Solution) -> float:
        """Relative difference of two runs at the case's probes; infinite where one is not whole.

        Of displacements; where a probe rests and turns, of its angles.
        """
        if not (one.status.ok and other.status.ok):
            return inf
        probes = self.case.probes
        if self.case.static:
            moved = [_apart(one, other, probe) for probe in probes]
        else:
            moved = [compare(one, other, probes).error]
        found = worst([*moved, *(turned_apart(one, other, probe, self.case.static) for probe in probes)])
        return found if isfinite(found) else inf

    def _longest_step(self, i: int) -> float:
        """Step of the coarsest level, s, a whole part of the interval of output."""
        case = self.case
        limit = inf
        if self.setup.integrator == "zhai":
            options = {"element": self.setup.element, "quadrature": self.setup.quadrature}
            mesh = Trial(case.scene, self.setup.solver, self.mesh_at(i)).by_body
            with suppress(AnctmmError):  # the solver itself says what it cannot do
                limit = stable_step(case.scene, mesh, options)
        return longest_step(case, limit)


def _is_final(status: Status) -> bool:
    """Whether neither a finer mesh nor a shorter step changes how a run ends."""
    return status.code in FINAL or law_raised(status)


@dataclass(frozen=True)
class Refined:
    """A run and what is known of its error.

    Parameters
    ----------
    levels : Refinement
        Where it comes from.
    i, j : int
        Its levels of mesh and step.
    mesh, step : Part
        What each adds to the error.
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
        """What the run gave."""
        return self.levels.solution(self.i, self.j)

    @property
    def timed(self) -> Solution:
        """The same with the times that it took."""
        return self.levels.timed(self.i, self.j)

    @property
    def trial(self) -> Trial:
        """The run."""
        return self.levels.trial(self.i, self.j)

    @property
    def label(self) -> str:
        """The run in words."""
        trial = self.trial
        step = "" if self.levels.case.static else f" dt={trial.dt:.4g}"
        mesh = f" {trial.cut}" if trial.scene.beams else ""
        return f"{trial.solver} {trial.integrator}{mesh}{step}"

    @property
    def reference(self) -> Reference:
        """The run as what errors are measured against."""
        best, probes = self.solution, self.levels.case.probes
        if not best.status.ok or not isfinite(self.error):
            why = self.reason or "no coarser run is complete"
            return Reference(f"none: {self.label}: {why}", lambda s: nan, nan)
        return Reference(self.label, lambda s: compare(s, best, probes).error, self.error, best)


def coarsest_mesh(case: Case, element: str) -> Mesh:
    """A few elements for each beam, by its length."""
    kind = KINDS[element]
    lengths = [beam.length for beam in case.scene.beams]
    if kind.rigid or not lengths:
        return (1,) * max(len(lengths), 1)
    most = COARSEST if kind.order >= 4.0 else COARSEST_OF_LOW_ORDER
    return tuple(ceil(most * length / max(lengths) * (1.0 - 1e-9)) for length in lengths)


def longest_step(case: Case, limit: float = inf) -> float:
    """The longest step to begin with, s: a whole part of the interval of output, no longer than a limit."""
    limit = min(limit, case.duration / FEWEST_STEPS)
    return case.interval / _parts(case.interval / limit * (1.0 - 1e-9))


def _parts(least: float) -> int:
    """The smallest of 1, 2, 5, 10, 20, … that is no smaller: steps that are easy to read; of many, a whole number."""
    if least > 1000.0:
        return ceil(least)
    return next(n * 10**k for k in range(4) for n in (1, 2, 5) if n * 10**k >= least)


def _apart(one: Solution, other: Solution, probe: str | tuple[str, float]) -> float:
    """Difference of the last displacements of two equilibria, relative to them; of a place that rests in m."""
    u, v = one.displacement(probe)[-1:], other.displacement(probe)[-1:]
    return history_error(u, v, rounding_at(other, probe))
