"""A run of fixed steps: in batches that Ctrl-C can come between, with the inputs of each."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import PropertyError
from anctmm.integrators.output import Record
from anctmm.integrators.state import State
from anctmm.kernels.pacing import paced, part_by_part
from anctmm.results.ended_early import HistoryError, Interrupted, broken_off, interruption
from anctmm.results.status import Status
from anctmm.system.system import System

Array = NDArray[np.float64]

#: Seconds that a step takes for each node, about.
STEP = 2e-6


def take_batches(
    system: System, record: Record, state: State, width: int, batch: Callable[[int, int], int]
) -> int:
    """Take all steps of a run.

    Parameters
    ----------
    system : System
    record : Record
    state : State
    width : int
        Numbers tabulated for each step.
    batch : callable
        Takes the steps of a range; the step that failed, or −1.

    Returns
    -------
    int
        The step that failed, or −1.

    Raises
    ------
    Interrupted, HistoryError
        With the history until then.
    """
    run, failed = system.run, -1

    def until(step: int, status: Status) -> object:
        return record.solution(1 + (step - 1) // run.stride if step > 0 else 0, status, state, step)

    def part(begin: int, end: int) -> None:
        nonlocal failed
        failed = failed if failed >= 0 else batch(begin, end)

    for begin, end in paced(run.steps + 1, STEP * system.mesh.nodes, width):
        try:
            part(begin, end)
        except KeyboardInterrupt:
            when = float(run.times(np.array([begin]))[0])
            raise Interrupted(until(begin, interruption(when))) from None  # type: ignore[arg-type]
        except PropertyError as error:  # of a load or a drive: the first time that fails, not one far ahead
            step, own = part_by_part(part, begin, end, PropertyError)
            when = float(run.times(np.array([step]))[0])
            if failed < 0:
                raise HistoryError(until(step, broken_off(own or error, when))) from error  # type: ignore[arg-type]
        if failed >= 0:
            return failed
    return -1
