"""Fair timing: one thread, no garbage collection, after a warm-up, runs in turn, raw samples stored."""

import gc
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from anctmm.results.solution import Cost

Sample = TypeVar("Sample")

#: s; of a call that takes less, the second one in a row is timed: the first one of a setting has preparations of 1 to
#: 2 ms, as much as the steps of a short run.
SHORT = 0.1


@dataclass(frozen=True)
class Timing:
    """Summary of repeated measurements."""

    cpu_s: float  # of the steps, s
    cpu_spread: float  # (largest − smallest) / cpu_s; NaN for one sample
    build_s: float  # of the calls beside their steps, s; NaN where a solver does not give it
    repeats: int


@contextmanager
def undisturbed() -> Iterator[None]:
    """One thread in every numerical library, and no garbage collection."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        with threadpool_limits(limits=1):
            yield
    finally:
        if was_on:
            gc.enable()


@contextmanager
def pinned() -> Iterator[None]:
    """Keep this thread, and what it starts, on one of the cores it may use, where the system can do that."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def least(costs: Sequence[Cost]) -> Timing:
    """The least of the samples of runs that are compared in turn: no disturbance makes a run faster than it is."""
    cpu = np.array([cost.cpu_s for cost in costs])
    spread = float(np.ptp(cpu) / cpu.min()) if cpu.size > 1 and cpu.min() > 0.0 else float("nan")
    return Timing(float(cpu.min()), spread, float(np.min([c.build_s for c in costs])), len(cpu))


def settled(call: Callable[[], Sample], short: float = SHORT) -> Sample:
    """Answer of a call when all is ready for it: of one that takes less than `short` (s) that of the second call."""
    began = perf_counter()
    found = call()
    return call() if perf_counter() - began < short else found


def in_turn(
    calls: Mapping[str, Callable[[], Sample]],
    rounds: int,
    warm: Mapping[str, Callable[[], object]] | None = None,
) -> dict[str, list[Sample]]:
    """Call several contestants in turn, on one core, after one unmeasured round: all meet the same disturbances."""
    found: dict[str, list[Sample]] = {name: [] for name in calls}
    with undisturbed():
        for begin in (calls if warm is None else warm).values():  # what compiles may use every core
            begin()
        with pinned():
            for _ in range(rounds):
                for name, call in calls.items():
                    found[name].append(call())
    return found
