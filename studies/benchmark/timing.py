"""Times of runs in turn, on one thread, with every sample stored."""

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from anctmm.results.solution import Solution


@dataclass(frozen=True)
class Sample:
    """Costs of one call: CPU time of its steps and of the whole call (without compiling), and its counts."""

    steps_s: float
    call_s: float
    steps: int
    corrections: int
    dofs: int
    status: str

    @property
    def step_s(self) -> float:
        """CPU time of a step, s."""
        return self.steps_s / max(self.steps, 1)


def sampled(call: Callable[[], Solution]) -> Sample:
    """The sample of a call."""
    begun = process_time()
    found = call()
    cost = found.cost
    compiling = 0.0 if np.isnan(cost.compile_s) else cost.compile_s
    return Sample(
        cost.cpu_s, process_time() - begun - compiling, cost.steps, cost.newton_iterations, found.dofs,
        str(found.status),
    )  # fmt: skip


@contextmanager
def alone() -> Iterator[None]:
    """One thread in every numerical library, and no garbage collection."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        with threadpool_limits(limits=1):
            yield
    finally:
        if was_on:
            gc.enable()


def in_turn(calls: Mapping[str, Callable[[], Solution]], rounds: int) -> dict[str, list[Sample]]:
    """Call several contestants in turn, after one unmeasured round: disturbances meet all of them.

    Parameters
    ----------
    calls : mapping of name to callable
    rounds : int
        Measured rounds.

    Returns
    -------
    dict of name to list of Sample
        One for each round.
    """
    found: dict[str, list[Sample]] = {name: [] for name in calls}
    with alone():
        for call in calls.values():
            call()
        for _ in range(rounds):
            for name, call in calls.items():
                found[name].append(sampled(call))
    return found


def summary(samples: Sequence[Sample], base: Sequence[Sample], elements: int) -> dict[str, Any]:
    """Medians and spreads of a contestant, and its ratios to another one that ran in the same rounds."""
    step = np.array([s.step_s for s in samples])
    one = samples[-1]
    corrections = one.corrections / max(one.steps, 1)
    other = base[-1].corrections / max(base[-1].steps, 1)
    ratio = _ratio([s.step_s for s in samples], [s.step_s for s in base])
    return {
        "elements": elements, "coordinates": one.dofs, "steps": one.steps,
        "ns_element_step": 1e9 * float(np.median(step)) / elements,
        "spread": float(np.ptp(step) / np.median(step)),
        "corrections_step": corrections or np.nan,
        "ratio_step": ratio,
        "ratio_correction": ratio * other / corrections if corrections and other else np.nan,
        "call_ms": 1e3 * float(np.median([s.call_s for s in samples])),
        "ratio_call": _ratio([s.call_s for s in samples], [s.call_s for s in base]),
        "repeats": len(samples), "status": next((s.status for s in samples if s.status != "ok"), "ok"),
    }  # fmt: skip


def _ratio(times: Sequence[float], base: Sequence[float]) -> float:
    """Median over the rounds."""
    return float(np.median(np.array(times) / np.array(base)))
