"""Times of alternating runs: samples in nanoseconds per unit of work, their medians and spreads."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import process_time_ns
from typing import Any

import numpy as np
import pandas as pd

from anctmm.results.solution import Solution
from studies.engine.measuring.timing import in_turn

#: One measurement: CPU time of one unit of work (an element and step, say), ns.
Sampler = Callable[[], float]


@dataclass(frozen=True)
class Effort:
    """How long to measure.

    Parameters
    ----------
    quick : bool
        The smallest measurement that shows the point.
    rounds : int
        Samples of every contestant.
    stretch : float
        Shortest time of a sample of a kernel, s.
    """

    quick: bool

    @property
    def rounds(self) -> int:
        """Samples of every contestant."""
        return 3 if self.quick else 7

    @property
    def stretch(self) -> float:
        """Shortest time of a sample of a kernel, s: well above the clock's grain."""
        return 0.002 if self.quick else 0.01

    @property
    def steps(self) -> float:
        """Factor of the number of steps of a sample."""
        return 0.25 if self.quick else 1.0


@dataclass
class Samples:
    """Raw samples of all contests of a session."""

    rows: list[dict[str, Any]] = field(default_factory=list)

    def keep(self, part: str, name: str, values: Sequence[float]) -> None:
        """Remember the samples of a contestant, ns."""
        self.rows += [{"part": part, "what": name, "sample": k, "ns": v} for k, v in enumerate(values)]


def sampled_in_turn(
    part: str, samplers: Mapping[str, Sampler], rounds: int, samples: Samples
) -> dict[str, list[float]]:
    """Sample contestants in turn, and keep the samples.

    Parameters
    ----------
    part : str
        Name of the contest.
    samplers : mapping of name to Sampler
    rounds : int
        Measured rounds.
    samples : Samples
        The raw values are added to it.

    Returns
    -------
    dict of name to list of float
        ns, one for each round.
    """
    found = in_turn(samplers, rounds)
    for name, values in found.items():
        samples.keep(part, name, values)
    return found


def figures(values: Sequence[float]) -> dict[str, float]:
    """Median, spread, (largest − smallest) / median, and number of samples, those lost in noise left out."""
    kept = np.array([v for v in values if v > 0.0])
    if not kept.size:
        return {"ns": float("nan"), "spread": float("nan"), "repeats": 0}
    median = float(np.median(kept))
    return {"ns": median, "spread": float(np.ptp(kept)) / median, "repeats": len(kept)}


def records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Rows of a frame."""
    return [{str(k): v for k, v in row.items()} for row in frame.to_dict("records")]


def ratio(slow: Sequence[float], fast: Sequence[float]) -> float:
    """Median of the ratios of samples taken in the same round, those lost in noise left out."""
    ratios = [a / b for a, b in zip(slow, fast, strict=True) if a > 0.0 and b > 0.0]
    return float(np.median(ratios)) if ratios else float("nan")


def more_than_noise(ns: float) -> float:
    """A time that is found as a difference, or NaN where other work on the machine has made it negative."""
    return ns if ns > 0.0 else float("nan")


def repeated(call: Callable[[int], object], units: float, stretch: float) -> Sampler:
    """Sampler of a compiled loop.

    Parameters
    ----------
    call : callable
        Does its work as often as it is told.
    units : float
        Units of work done each time.
    stretch : float
        s; the first sample compiles and finds how many repeats take as long.
    """
    count = 0

    def sample() -> float:
        nonlocal count
        if count == 0:
            call(1)
            count = 1
            while _time(call, count) < 1e9 * stretch:
                count *= 2
        return _time(call, count) / (count * units)

    return sample


def marched(solve: Callable[[], Solution], elements: int, runs: list[Solution]) -> Sampler:
    """Sampler of whole runs, of an element and step; the last run is left in `runs`."""

    def sample() -> float:
        runs[:] = [solve()]
        cost = runs[0].cost
        return 1e9 * cost.cpu_s / (max(cost.steps, 1) * elements)

    return sample


def between(
    run: Callable[[int], Solution], steps: int, units: float, seen: list[Solution], again: int = 1
) -> Sampler:
    """Sampler of steps alone: the difference of a run and one three times as long, which are left in `seen`.

    Parameters
    ----------
    run : callable
        Does so many steps.
    steps : int
    units : float
        Units of work of a step.
    seen : list of Solution
        Without their histories: they are long.
    again : int
        Pairs of runs that make a sample: it is their median, NaN where the machine's noise is larger.
    """

    def pair() -> float:
        seen[:] = [replace(run(k * steps), fields={}) for k in (1, 3)]
        short, whole = (s.cost for s in seen)
        return 1e9 * (whole.cpu_s - short.cpu_s) / (max(whole.steps - short.steps, 1) * units)

    return lambda: more_than_noise(float(np.median([pair() for _ in range(again)])))


def _time(call: Callable[[int], object], count: int) -> float:
    start = process_time_ns()
    call(count)
    return float(process_time_ns() - start)
