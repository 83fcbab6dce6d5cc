"""Refinement of mesh and step until an estimate of the error is small enough: the one in all studies.

Meshes or steps may be given instead, from coarse to fine; the remaining error is estimated from those.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, isinf, nan

import numpy as np

from anctmm.elements.kinds import KINDS
from anctmm.errors import AnctmmError, ResultError
from anctmm.model.case import Case
from anctmm.model.scene import Probe
from anctmm.results.metrics import Array, common_times, history_error, rounding_at, worst
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from anctmm.solvers.capabilities import Offer
from studies.engine.meshes import coarsest_mesh, explicit_limit, longest_step
from studies.engine.richardson import Part, Spacing, part_of
from studies.engine.runner import Runner
from studies.engine.trials import Mesh, Trial

EXPLICIT = "zhai"
#: What is refined: axes of the levels.
MESH, STEP = 0, 1
#: Elements times steps of a run at most, some ten seconds; steps of a motion that an equilibrium counts as.
MOST_WORK, STATIC_STEPS = 4e6, 100.0
#: Statuses that neither a finer mesh nor a shorter step changes.
FINAL = ("unsupported", "interrupted", "unstable", "singular", "imprecise")
#: Order in time of each integrator.
STEP_ORDERS = {EXPLICIT: 2.0, "generalized-alpha": 2.0, "esdirk": 4.0}
#: Angle, rad, below which a place that rests does not turn.
TURNED = 1e-6


@dataclass(frozen=True)
class Setup:
    """Solver, element and integrator: all but mesh and step."""

    solver: str = "anctmm"
    element: str = "cable"
    integrator: str = "generalized-alpha"

    @property
    def own_element(self) -> str:
        """The element that the solver uses for this one."""
        return offer_of(self.solver).element_of(self.element)

    @property
    def orders(self) -> tuple[float, float]:
        """Orders of theory in the mesh and in the step."""
        return offer_of(self.solver).order_of(self.element), STEP_ORDERS[self.integrator]


def offer_of(solver: str) -> Offer:
    """Capabilities of a solver; everything of one that cannot be loaded, whose rows say why."""
    try:
        return registry.offer_of(registry.load(solver))
    except AnctmmError:
        return Offer()


class Refinement:
    """Runs of a case over levels of mesh and step, each level half of the one before.

    Without given meshes (from coarse to fine) or steps (from long to short, s), they are chosen, and no run takes more
    than `most_work` elements times steps.
    """

    def __init__(
        self, case: Case, setup: Setup, runner: Runner, meshes: Sequence[Mesh] = (), steps: Sequence[float] = (),
        most_work: float = MOST_WORK,
    ) -> None:  # fmt: skip
        self.case, self.setup, self.runner = case, setup, runner
        self.meshes, self.steps, self.most_work = tuple(meshes), tuple(steps), most_work
        flexible = bool(case.scene.beams) and not KINDS[setup.element].rigid
        self.chooses = not meshes and flexible, not steps and not case.static
        self.refines = self.chooses[MESH] or len(meshes) > 1, self.chooses[STEP] or len(steps) > 1
        self.solutions: dict[tuple[int, int], Solution] = {}  # by level, as far as done
        self._limits: dict[int, float] = {}

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
            mesh = Trial(self.case.scene, self.setup.solver, self.mesh_at(i)).by_body
            explicit = self.setup.integrator == EXPLICIT
            limit = explicit_limit(self.case, mesh, element=self.setup.element) if explicit else inf
            self._limits[i] = longest_step(self.case, limit)
        return self._limits[i] / 2**j

    def trial(self, i: int, j: int) -> Trial:
        """The run of a level of mesh and one of step."""
        s, mesh, dt = self.setup, self.mesh_at(i), self.dt_at(i, j)
        return Trial.of(self.case, s.solver, mesh, element=s.element, integrator=s.integrator, dt=dt)

    def solution(self, i: int, j: int) -> Solution:
        """The run of a level, done once."""
        self._solve([(i, j)])
        return self.solutions[i, j]

    def runs_along(self, i: int, j: int, axis: int) -> list[Solution]:
        """The run of a level and the next two coarser ones of an axis, MESH or STEP; none where it is not refined."""
        return [self.solution(*level) for level in self._levels_along(i, j, axis)]

    def _levels_along(self, i: int, j: int, axis: int) -> list[tuple[int, int]]:
        levels = [(i - k, j) if axis == MESH else (i, j - k) for k in range(3)]
        return [level for level in levels if min(level) >= 0] if self.refines[axis] else []

    def _solve(self, levels: Sequence[tuple[int, int]]) -> None:
        new = [level for level in dict.fromkeys(levels) if level not in self.solutions]
        found = self.runner.solve_many(self.trial(*level) for level in new)
        self.solutions |= dict(zip(new, found, strict=True))

    def part(self, i: int, j: int, axis: int) -> Part:
        """Part of the error that is due to the mesh or the step."""
        runs = self.runs_along(i, j, axis)
        if len(runs) < 2:
            return Part(inf) if runs else Part()
        before = self.difference(runs[2], runs[1]) if len(runs) > 2 else nan
        spacing = Spacing(self._ratio(i, j, axis), self._ratio(i, j, axis, 1))
        return part_of(self.difference(runs[1], runs[0]), before, self.setup.orders[axis], spacing)

    def refined(self, target: float) -> "Refined":
        """Refine mesh and step until the estimated error is no larger than a target, relative."""
        i = len(self.meshes) - 1 if self.meshes else int(self.chooses[MESH])
        j = len(self.steps) - 1 if self.steps else int(self.chooses[STEP])
        best = found = self._at(i, j, target)
        reason = ""
        while not (found.reached or self._is_final(found.solution.status)):
            finer = self._finer(found)
            if finer == (found.i, found.j):
                reason = "only the given mesh and step may be used"
                break
            if self._work(self.trial(*finer)) > self.most_work:
                reason = f"a run of more than {self.most_work:.2g} elements times steps would be needed"
                break
            found = self._at(*finer, target)
            better = found.solution.status.ok and found.error <= best.error
            best = found if better or not best.solution.status.ok else best
        if not found.solution.status.ok:
            reason = f"{found.label}: {found.solution.status}"
        return best if best.reached else replace(best, reason=reason)

    def difference(self, one: Solution, other: Solution) -> float:
        """Relative difference of two runs at the case's probes; infinite where one is not complete."""
        if not (one.status.ok and other.status.ok):
            return inf
        found = difference(one, other, self.case.probes)
        return found if isfinite(found) else inf

    def _work(self, trial: Trial) -> float:
        """Elements times steps of a run, or what an equilibrium counts as."""
        return trial.elements * STATIC_STEPS if self.case.static else trial.work

    def _is_final(self, status: Status) -> bool:
        """Whether neither a finer mesh nor a shorter step changes how a run ends."""
        explicit = self.setup.integrator == EXPLICIT and "stable" in status.message
        raised = not status.ok and "Error: " in status.message  # by a function of the user's scene
        return status.code in FINAL or raised or (status.code == "refused" and not explicit)

    def _ratio(self, i: int, j: int, axis: int, below: int = 0) -> float:
        """How many times finer a level (or one below it) is than the one before; of the beam that is refined least."""
        if (i, j)[axis] - below <= 0:
            return 2.0
        if axis == STEP:
            return self.dt_at(i, j - below - 1) / self.dt_at(i, j - below)
        fine, coarse = self.mesh_at(i - below), self.mesh_at(i - below - 1)
        return min(n / before for n, before in zip(fine, coarse, strict=True))

    def _at(self, i: int, j: int, target: float) -> "Refined":
        if not self.solution(i, j).status.ok:
            return Refined(self, i, j, Part(inf), Part(inf), target)
        self._solve([*self._levels_along(i, j, MESH), *self._levels_along(i, j, STEP)])
        return Refined(self, i, j, self.part(i, j, MESH), self.part(i, j, STEP), target)

    def _finer(self, found: "Refined") -> tuple[int, int]:
        """The next level: the larger part of the error is refined, both where each alone is too large."""
        i, j, half = found.i, found.j, 0.5 * found.target
        mesh, step = found.mesh.error, found.step.error
        by_mesh, by_step = self.chooses
        incomplete = not found.solution.status.ok or (by_step and isinf(step))
        if incomplete:  # Newton's iteration may need a shorter step
            return (i, j + 1) if by_step else (i + by_mesh, j)
        return i + (by_mesh and (mesh > half or mesh >= step)), j + (by_step and (step > half or step > mesh))


@dataclass(frozen=True)
class Refined:
    """A run with the estimate of its error: also a reference for the errors of other runs."""

    levels: Refinement
    i: int  # level of its mesh
    j: int  # level of its step
    mesh: Part
    step: Part
    target: float
    reason: str = ""  # why the target is not reached

    @property
    def error(self) -> float:
        """Estimated, of mesh and step together; infinite where nothing is known."""
        return self.mesh.error + self.step.error

    @property
    def reached(self) -> bool:
        """Whether the estimated error is no larger than the target."""
        return self.solution.status.ok and self.error <= self.target

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
        mesh = f" {trial.cut} {self.levels.setup.own_element}" if trial.scene.beams else ""
        return f"{trial.solver} {trial.integrator}{mesh}{step}"

    @property
    def parts(self) -> str:
        """Estimated parts of the error in words; empty where nothing is refined."""
        named = zip(("mesh", "step"), self.levels.refines, (self.mesh, self.step), strict=True)
        return ", ".join(f"{name} {part.error:.1g}" for name, refined, part in named if refined)

    @property
    def known(self) -> bool:
        """Whether its error is known, so that it is a reference."""
        return self.solution.status.ok and isfinite(self.error)

    @property
    def uncertainty(self) -> float:
        """Of the reference: its error; NaN where that is not known."""
        return self.error if self.known else nan

    @property
    def name(self) -> str:
        """Of the reference: solver and settings, or why there is none."""
        return (
            self.label if self.known else f"none: {self.label}: {self.reason or 'no coarser run is complete'}"
        )

    def error_of(self, solution: Solution) -> float:
        """Error of a solution against this one; NaN where one of them is not complete."""
        if not (self.known and solution.status.ok):
            return nan
        return difference(solution, self.solution, self.levels.case.probes)


def difference(one: Solution, other: Solution, probes: Sequence[Probe]) -> float:
    """Relative difference of two complete runs: the largest over the probes of RMS in time over the maximum in time.

    It is that of displacements, of equilibria the last ones; where a probe rests and turns, that of its angles. NaN
    where the runs have no two times in common.
    """
    mine, theirs = common_times(one.t, other.t)
    if other.static:
        mine = theirs = np.array([-1])
    elif mine.size < 2:
        return nan

    def at(probe: Probe) -> float:
        turn = _angle(other, probe) if rests(other, probe) else None
        if turn is None or np.abs(turn).max(initial=0.0) <= TURNED:
            u, v = one.displacement(probe)[mine], other.displacement(probe)[theirs]
            return history_error(u, v, rounding_at(other, probe))
        own = _angle(one, probe)
        return 0.0 if own is None else history_error(own[mine], turn[theirs])

    return worst(map(at, probes))


def rests(solution: Solution, probe: Probe) -> bool:
    """Whether a probe moves by no more than rounding."""
    moved = np.linalg.norm(solution.displacement(probe), axis=1).max(initial=0.0)
    return bool(moved <= rounding_at(solution, probe))


def _angle(solution: Solution, probe: Probe) -> Array | None:
    """Angles of a probe, rad, (n, 1); None where a solver gives none."""
    try:
        return solution.angle(probe)[:, None]
    except ResultError:
        return None
