"""Refinement of mesh and step until an estimate of the error is small enough: the one in all studies.

Meshes or steps may be given instead, from coarse to fine; the remaining error is estimated from those.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, isfinite, isinf, nan
from typing import Any

import numpy as np

from anctmm.elements.kinds import KINDS
from anctmm.errors import ResultError
from anctmm.model.case import Case
from anctmm.model.scene import Probe
from anctmm.results.metrics import Array, common_times, history_error, rounding_at, worst
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from studies.engine.meshes import Mesh, coarsest_mesh, longest_step
from studies.engine.richardson import Part, Spacing, part_of
from studies.engine.runner import Runner
from studies.engine.trials import EXPLICIT, IMPLICIT, STATIC, Trial, explicit_limit, offer_of

#: What is refined: axes of the levels.
MESH, STEP = 0, 1
#: Elements times steps of a run at most, some ten seconds.
MOST_WORK = 4e6
#: Statuses that neither a finer mesh nor a shorter step changes.
FINAL = ("unsupported", "interrupted", "unstable", "singular", "imprecise")
#: Order in time of each integrator.
STEP_ORDERS = {EXPLICIT: 2.0, IMPLICIT: 2.0, "esdirk": 4.0, STATIC: nan}
#: Angle, rad, below which a place that rests does not turn.
TURNED = 1e-6


class Refinement:
    """Runs of a case over levels of mesh and step, each level half of the one before.

    `setting` has solver, element and integrator. Without given meshes (from coarse to fine) or steps (from long to
    short, s), they are chosen, and no run takes more than `most_work` elements times steps.
    """

    def __init__(
        self, case: Case, runner: Runner, meshes: Sequence[Mesh] = (), steps: Sequence[float] = (),
        most_work: float = MOST_WORK, **setting: Any,
    ) -> None:  # fmt: skip
        self.case, self.runner, self.most_work = case, runner, most_work
        self.meshes, self.steps, self.plain = tuple(meshes), tuple(steps), Trial.of(case, **setting)
        flexible = bool(case.scene.beams) and not KINDS[self.plain.element].rigid
        self.chooses = not meshes and flexible, not steps and not case.static
        self.refines = self.chooses[MESH] or len(meshes) > 1, self.chooses[STEP] or len(steps) > 1
        self.solutions: dict[tuple[int, int], Solution] = {}  # by level, as far as done
        self._longest: dict[int, float] = {}

    @property
    def estimates(self) -> bool:
        """Whether the whole error is estimated: neither mesh nor step, where there is one, is the same in all runs."""
        return len(self.meshes) != 1 and (len(self.steps) != 1 or self.case.static)

    @property
    def orders(self) -> tuple[float, float]:
        """Orders of theory in the mesh and in the step."""
        trial = self.plain
        return offer_of(trial.solver).order_of(trial.element), STEP_ORDERS[trial.integrator]

    def mesh_at(self, i: int) -> Mesh:
        """Mesh of a level."""
        if self.meshes:
            return self.meshes[i]
        return tuple(n * 2**i for n in coarsest_mesh(self.case, self.plain.element))

    def dt_at(self, i: int, j: int) -> float:
        """Step of a level, s: on finer meshes that of an explicit integrator is shorter."""
        if self.case.static:
            return nan
        if self.steps:
            return self.steps[j]
        if i not in self._longest:
            on_mesh = replace(self.plain, mesh=self.mesh_at(i))
            limit = explicit_limit(on_mesh) if on_mesh.integrator == EXPLICIT else inf
            self._longest[i] = longest_step(self.case, limit)
        return self._longest[i] / 2**j

    def trial(self, i: int, j: int) -> Trial:
        """The run of a level of mesh and one of step."""
        return replace(self.plain, mesh=self.mesh_at(i), dt=self.dt_at(i, j))

    def solution(self, i: int, j: int) -> Solution:
        """The run of a level, done once."""
        return self._runs([(i, j)])[0]

    def runs_along(self, i: int, j: int, axis: int) -> list[Solution]:
        """The run of a level and the next two coarser ones of an axis, MESH or STEP; none where it is not refined."""
        return self._runs(self._levels_along(i, j, axis))

    def _levels_along(self, i: int, j: int, axis: int) -> list[tuple[int, int]]:
        levels = [(i - k, j) if axis == MESH else (i, j - k) for k in range(3)]
        return [level for level in levels if min(level) >= 0] if self.refines[axis] else []

    def _runs(self, levels: Sequence[tuple[int, int]]) -> list[Solution]:
        new = [level for level in dict.fromkeys(levels) if level not in self.solutions]
        self.solutions |= zip(new, self.runner.solve_many(self.trial(*level) for level in new), strict=True)
        return [self.solutions[level] for level in levels]

    def part(self, i: int, j: int, axis: int) -> Part:
        """Part of the error that is due to the mesh or the step."""
        runs = self.runs_along(i, j, axis)
        if len(runs) < 2:
            return Part(inf) if runs else Part()
        last, before, *_ = *(self.difference(coarse, fine) for fine, coarse in pairwise(runs)), nan
        spacing = Spacing(*(self._ratio(*pair) for pair in pairwise(self._levels_along(i, j, axis))))
        return part_of(last, before, self.orders[axis], spacing)

    def _ratio(self, fine: tuple[int, int], coarse: tuple[int, int]) -> float:
        """How many times finer a level is than the one before; of the beam that is refined least."""
        if fine[MESH] == coarse[MESH]:
            return self.dt_at(*coarse) / self.dt_at(*fine)
        meshes = zip(self.mesh_at(fine[MESH]), self.mesh_at(coarse[MESH]), strict=True)
        return min(n / before for n, before in meshes)

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
            if self.trial(*finer).work > self.most_work:
                reason = f"a run of more than {self.most_work:.2g} elements times steps would be needed"
                break
            found = self._at(*finer, target)
            better = found.solution.status.ok and found.error <= best.error
            best = found if better or not best.solution.status.ok else best
        if not found.solution.status.ok:
            reason = f"{found.trial.label}: {found.solution.status}"
        return best if best.reached else replace(best, reason=reason)

    def difference(self, one: Solution, other: Solution) -> float:
        """Relative difference of two runs at the case's probes; infinite where one is not complete."""
        found = difference(one, other, self.case.probes)
        return found if isfinite(found) else inf

    def _is_final(self, status: Status) -> bool:
        """Whether neither a finer mesh nor a shorter step changes how a run ends."""
        explicit = self.plain.integrator == EXPLICIT and "stable" in status.message
        raised = not status.ok and "Error: " in status.message  # by a function of the user's scene
        return status.code in FINAL or raised or (status.code == "refused" and not explicit)

    def _at(self, i: int, j: int, target: float) -> "Refined":
        if not self.solution(i, j).status.ok:
            mesh = step = Part(inf)
        else:
            self._runs([*self._levels_along(i, j, MESH), *self._levels_along(i, j, STEP)])
            mesh, step = self.part(i, j, MESH), self.part(i, j, STEP)
        return Refined(self, i, j, self.trial(i, j), self.solutions[i, j], mesh, step, target)

    def _finer(self, found: "Refined") -> tuple[int, int]:
        """The next level: the larger part of the error is refined, both where each alone is too large."""
        i, j, half = found.i, found.j, 0.5 * found.target
        mesh, step = found.mesh.error, found.step.error
        by_mesh, by_step = self.chooses
        if not found.solution.status.ok or (by_step and isinf(step)):  # Newton may need a shorter step
            return (i, j + 1) if by_step else (i + by_mesh, j)
        return i + (by_mesh and (mesh > half or mesh >= step)), j + (by_step and (step > half or step > mesh))


@dataclass(frozen=True)
class Refined:
    """A run with the estimate of its error: also a reference for the errors of other runs."""

    levels: Refinement
    i: int  # level of its mesh
    j: int  # level of its step
    trial: Trial
    solution: Solution
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
    def estimate(self) -> str:
        """Its estimated error in words, and why it is above the target."""
        if not self.solution.status.ok:
            return "the error of an incomplete run is not known"
        named = zip(("mesh", "step"), self.levels.refines, (self.mesh, self.step), strict=True)
        parts = ", ".join(f"{name} {part.error:.1g}" for name, refined, part in named if refined)
        if not parts:
            return "its error was not estimated: nothing is refined, as mesh and step are given or there are none"
        given = "" if self.levels.estimates else "; that of what was given is not known"
        short = "" if self.reached else f": above the target {self.target:g}, as {self.reason}"
        return f"estimated error {self.error:.1g} ({parts}{given}){short}"

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
        why = self.reason or "no coarser run is complete"
        return self.trial.label if self.known else f"none: {self.trial.label}: {why}"

    def others(self) -> Iterator[Solution]:
        """Complete runs of other solvers with the same element at the same setting."""
        for name in registry.names() if self.known else ():
            trial = replace(self.trial, solver=name)
            can = trial.used == trial.element and not offer_of(name).lacking({trial.element})
            if can and trial != self.trial and (solution := self.levels.runner.solve(trial)).status.ok:
                yield solution

    def error_of(self, solution: Solution) -> float:
        """Error of a solution against this one; NaN where one of them is not complete."""
        return difference(solution, self.solution, self.levels.case.probes) if self.known else nan


def difference(one: Solution, other: Solution, probes: Sequence[Probe]) -> float:
    """Relative difference of two runs: the largest over the probes of RMS in time over the maximum in time.

    It is that of displacements, of equilibria the last ones; where a probe rests and turns, that of its angles. NaN
    where one is not complete, or they have no two times in common.
    """
    mine, theirs = common_times(one.t, other.t)
    if not (one.status.ok and other.status.ok) or (mine.size < 2 and not other.static):
        return nan
    if other.static:
        mine = theirs = np.array([-1])

    def at(probe: Probe) -> float:
        u, v = one.displacement(probe), other.displacement(probe)
        with suppress(ResultError):  # not every solver gives angles
            if (turned := turned_in_place(other, probe)) is not None:
                u, v = one.angle(probe)[:, None], turned[:, None]
        return history_error(u[mine], v[theirs], rounding_at(other, probe))

    return worst(map(at, probes))


def rests(solution: Solution, probe: Probe) -> bool:
    """Whether a probe moves by no more than rounding."""
    moved = np.linalg.norm(solution.displacement(probe), axis=1).max(initial=0.0)
    return bool(moved <= rounding_at(solution, probe))


def turned_in_place(solution: Solution, probe: Probe) -> Array | None:
    """Angle of a probe that rests and turns, such as an axle, rad; None of others, and where a solver gives none."""
    if rests(solution, probe):
        with suppress(ResultError):
            angle = solution.angle(probe)
            return angle if np.abs(angle).max(initial=0.0) > TURNED else None
    return None
