"""User functions that Exudyn calls at the times of its steps; their errors are stored and raised afterwards."""

from collections.abc import Callable
from typing import Any

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError

#: Part of a step by which Exudyn's time may miss that of a step and still mean it: what rounding adds up to.
DRIFT = 1e-3
#: What the user's functions raised while Exudyn called them: some of its modules wrap it in an error of their own.
FAILED: list[AnctmmError] = []


def remembered(history: Callable[[float], Any], run: Discretisation | None) -> Callable[[float], Any]:
    """The same history at the times of a run, computed once for the many evaluations of a Newton iteration."""
    last: list[Any] = [None, None]

    def value(t: float) -> Any:
        if last[0] != t:
            try:
                last[:] = t, history(t if run is None else undrifted(t, run))
            except AnctmmError as error:
                FAILED.append(error)
                raise
        return last[1]

    return value


def undrifted(t: float, run: Discretisation) -> float:
    """The time of the step that t is up to rounding, s; never after the end of the run."""
    step = round(t / run.exact_dt)
    exact = run.t_end if step >= run.steps else step * run.t_end / run.steps
    return exact if abs(t - exact) <= DRIFT * run.exact_dt else min(t, run.t_end)
