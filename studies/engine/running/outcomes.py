"""Outcome of a case: its solution, its cost, and the reference for its error."""

from collections.abc import Callable
from dataclasses import dataclass

from anctmm.results.solution import Cost, Solution
from anctmm.results.status import Status
from studies.engine.running.trial import Trial
from studies.engine.running.turns import Interval


def not_installed(status: Status) -> bool:
    """Whether a solver did nothing since what it needs is not installed."""
    return status.code == "unsupported" and "not installed" in status.message


@dataclass(frozen=True)
class Sample:
    """What a run cost when it was timed, and when and where that was; nothing else of ours was at work then."""

    cost: Cost
    interval: Interval


@dataclass(frozen=True)
class Outcome:
    """A case, its solution with what it cost the first time, and every time it was timed."""

    case: Trial
    solution: Solution
    samples: tuple[Sample, ...] = ()

    @property
    def costs(self) -> tuple[Cost, ...]:
        """The cost of every sample."""
        return tuple(sample.cost for sample in self.samples)


@dataclass(frozen=True)
class Reference:
    """What errors are measured against.

    Parameters
    ----------
    name : str
        Solver and settings, or the exact solution.
    error_of : callable
        Solution → error.
    uncertainty : float
        The reference's own, in the unit of the error.
    solution : Solution, optional
    """

    name: str
    error_of: Callable[[Solution], float]
    uncertainty: float
    solution: Solution | None = None
