"""Fair timing: one thread, no garbage collection, after a warm-up, runs in turn, raw samples stored."""

import gc
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from anctmm.results.solution import Cost

Sample = TypeVar("Sample")
Key = TypeVar("Key")

#: s; of a call that takes less, the second one in a row is timed: the first one of a setting has preparations of 1 to
#: 2 ms, as much as the steps of a short run.
SHORT = 0.1


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


def least(costs: Sequence[Cost]) -> dict[str, float]:
    """The least of the samples of runs that are compared in turn: no disturbance makes a run faster than it is.

    cpu_s, build_s (NaN where a solver does not give it); cpu_spread: (largest − smallest) / cpu_s, NaN of one sample.
    """
    cpu = np.array([cost.cpu_s for cost in costs])
    spread = float(np.ptp(cpu) / cpu.min()) if cpu.size > 1 and cpu.min() > 0.0 else float("nan")
    build = float(np.min([cost.build_s for cost in costs]))
    return {"cpu_s": float(cpu.min()), "cpu_spread": spread, "build_s": build, "repeats": len(cpu)}


def settled(call: Callable[[], Sample], short: float = SHORT) -> Sample:
    """Answer of a call when all is ready for it: of one that takes less than `short` (s) that of the second call."""
    began = perf_counter()
    found = call()
    return call() if perf_counter() - began < short else found


def in_turn(calls: Mapping[Key, Callable[[], Sample]], rounds: int) -> dict[Key, list[Sample]]:
    """Call several contestants, which are warmed up, in turn on one core: all meet the same disturbances."""
    found: dict[Key, list[Sample]] = {name: [] for name in calls}
    with undisturbed(), pinned():
        for _ in range(rounds):
            for name, call in calls.items():
                found[name].append(call())
    return found
