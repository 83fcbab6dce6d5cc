"""Common start of all extremes of a case: a run that is accurate enough, and variants of it."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.model.case import Case
from anctmm.results.solution import Solution
from studies.engine.accuracy.refinement import Refined, Refinement, Setup
from studies.engine.runner import Runner
from studies.engine.running.trial import STATIC, Trial
from studies.extremes.parts import EPS

Array = NDArray[np.float64]
#: Error to which mesh and step are refined; by whether the run is quick.
TARGETS = {False: 1e-3, True: 1e-2}
#: Newton's tolerance of runs that differ only by rounding or by a tiny disturbance.
TIGHT = 1e-12


@dataclass(frozen=True)
class Base:
    """A case with its refined run.

    Parameters
    ----------
    case : Case
    found : Refined
        Of cables and implicit steps.
    runner : Runner
    quick : bool
    """

    case: Case
    found: Refined
    runner: Runner
    quick: bool

    @classmethod
    def of(cls, case: Case, runner: Runner, quick: bool) -> "Base":
        """Refine a case."""
        runner.heading = f"{case.name}, mesh and step: "
        return cls(case, Refinement(case, Setup(), runner).refined(TARGETS[quick]), runner, quick)

    @property
    def trial(self) -> Trial:
        """The refined run, with a tight tolerance of Newton's iteration."""
        return replace(self.found.trial, options=(("newton_tolerance", TIGHT),))

    @property
    def steps(self) -> int:
        """Steps of the refined run; of an equilibrium 1."""
        return 1 if self.case.static else round(self.case.duration / self.trial.dt)

    @property
    def rounding(self) -> float:
        """Of a coordinate of size 1, at most: each step rounds it, implicit velocities are differences of them."""
        return 4.0 * EPS * self.steps**1.5

    def run(self, trial: Trial, what: str) -> Solution:
        """Run it now; whatever fails is a solution with that status."""
        self.runner.on_job(f"{self.case.name}: {what}", 0, 1)
        return self.runner.attempt(trial)

    def plain(self) -> Solution:
        """The refined run once more, tightly."""
        return self.run(self.trial, "refined run")

    def row(self, what: str, **columns: Any) -> dict[str, Any]:
        """A row of a table."""
        return {"scene": self.case.name, "what": what, **columns}

    def static(self) -> bool:
        """Whether it is a static case."""
        return self.found.trial.integrator == STATIC


def paths(solution: Solution, case: Case) -> Array:
    """Displacements of the probes, (n, probes, 2), m."""
    return np.stack([solution.displacement(probe) for probe in case.probes], axis=1)


def size_of(u: Array) -> float:
    """The largest displacement, m; 1 where nothing moves."""
    return float(np.linalg.norm(u, axis=2).max(initial=0.0)) or 1.0


def apart(
    one: Solution, other: Solution, case: Case, length: float = 1.0, size: float | None = None
) -> tuple[Array, Array]:
    """Common times, and by time the largest distance of two runs at the probes over the largest displacement.

    Parameters
    ----------
    one, other : Solution
    case : Case
    length : float
        Units of length of the other in a metre; its times are taken to be those of the first.
    size : float, optional
        The largest displacement, m; that of the first without it.
    """
    u, v = paths(one, case), paths(other, case) / length
    n = min(len(u), len(v))
    return one.t[:n], np.linalg.norm(u[:n] - v[:n], axis=2).max(axis=1, initial=0.0) / (size or size_of(u))
