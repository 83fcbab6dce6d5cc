"""Runs that end before their time: interrupted, broken off by a load or a drive, or not begun."""

from typing import Any

import numpy as np

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import PropertyError
from anctmm.model.scene import Scene
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status


class _EndedEarly(BaseException):
    """A run that ended early, with its history."""

    def __init__(self, solution: Solution) -> None:
        super().__init__(solution.status.message)
        self.solution = solution

    def __reduce__(self) -> tuple[Any, ...]:  # copies are made of the solution, not of the message
        return type(self), (self.solution,)


class Interrupted(_EndedEarly, KeyboardInterrupt):
    """A run that was stopped by Ctrl-C.

    Parameters
    ----------
    solution : Solution
        The history until then, with the status "interrupted".
    """


class HistoryError(_EndedEarly, PropertyError):
    """The history of a load or of a drive failed in the middle of a run.

    Parameters
    ----------
    solution : Solution
        What was computed until then, with the status "failed".
    """


def broken_off(reason: PropertyError, when: float) -> Status:
    """The status of a run that could not go on from a time, s, for what the history of a load or a drive does there."""
    return Status("failed", str(reason), time=when)


def interruption(when: float) -> Status:
    """The status of a run that Ctrl-C stopped at a time, s."""
    return Status("interrupted", f"the run was interrupted at t = {when:.6g} s", time=when)


def interruption_of_load(factor: float) -> Status:
    """The status of a search for equilibria that Ctrl-C stopped after one at a load factor."""
    message = f"the search for equilibria was interrupted beyond {factor:.6g} of the load"
    return Status("interrupted", message, time=factor)


def nothing(solver: str, scene: Scene, run: Discretisation | None, status: Status) -> Solution:
    """The answer of a solver that cannot do a scene: no history, and a status that says why."""
    return Solution(solver, scene, run, np.empty(0), {}, Energy.unknown(0), Cost(), status)
