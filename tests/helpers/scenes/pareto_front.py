"""Pareto fronts of error and cost: non-dominated settings, settings near the front, and the cheapest for an error."""

from collections.abc import Iterable
from typing import Protocol, TypeVar

import numpy as np
import pandas as pd

#: Settings within this factor of a front of single runs are timed again, in turn: other work may have hidden the best.
NEAR = 1.6


class Measured(Protocol):
    """Anything with an error and a CPU time, s."""

    @property
    def error(self) -> float:
        """Relative."""

    @property
    def cpu_s(self) -> float:
        """s."""


Point = TypeVar("Point", bound=Measured)


def front(points: Iterable[Point]) -> list[Point]:
    """Points that no other beats in both error and cost, from the largest error to the smallest."""
    kept: list[Point] = []
    for p in sorted((p for p in points if np.isfinite(p.error)), key=lambda p: (p.cpu_s, p.error)):
        if not kept or p.error < kept[-1].error:
            kept.append(p)
    return kept


def cost_at(points: Iterable[Measured], error: float) -> float:
    """CPU time of the front at an error, s, interpolated in logarithms; NaN below its smallest error.

    Above its largest error its cheapest point counts.
    """
    line = front(points)
    if not line or line[-1].error > error:
        return float("nan")
    x, y = np.log([p.error for p in line][::-1]), np.log([p.cpu_s for p in line][::-1])
    return float(np.exp(np.interp(np.log(error), x, y)))


def excess(rows: pd.DataFrame) -> pd.Series:
    """How many times the cost of the cheapest row of no larger error each row has: 1 on the front, else more.

    Parameters
    ----------
    rows : DataFrame
        With columns "robust_error" and "cpu_s"; a row without both has NaN.
    """
    sound = rows[np.isfinite(rows["robust_error"]) & (rows["cpu_s"] > 0.0)]
    sound = sound.sort_values(["robust_error", "cpu_s"])
    return (sound["cpu_s"] / sound["cpu_s"].cummin()).reindex(rows.index)
