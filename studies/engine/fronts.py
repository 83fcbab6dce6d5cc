"""Pareto fronts of error and cost: pure functions of a DataFrame with columns "error_bound" and "cpu_s"."""

from collections.abc import Hashable, Sequence

import numpy as np
import pandas as pd

#: Settings within this factor of a front of single runs are timed again, in turn: other work may have hidden the best.
NEAR = 1.6


def excess(rows: pd.DataFrame) -> pd.Series:
    """Cost of each row over that of the cheapest row of no larger error: 1 on the front; NaN without error or time."""
    sound = rows[np.isfinite(rows["error_bound"]) & (rows["cpu_s"] > 0.0)]
    sound = sound.sort_values(["error_bound", "cpu_s"])
    return (sound["cpu_s"] / sound["cpu_s"].cummin()).reindex(rows.index)


def front(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows that no other beats in both error and cost, from the largest error to the smallest."""
    return rows[excess(rows) == 1.0].sort_values(["cpu_s", "error_bound"])


def cost_at(rows: pd.DataFrame, error: float) -> float:
    """CPU time of the front at an error, s, interpolated in logarithms; NaN below its smallest error.

    Above its largest error its cheapest row counts.
    """
    line = front(rows)
    if line.empty or line["error_bound"].iloc[-1] > error:
        return float("nan")
    x, y = np.log(line["error_bound"].to_numpy()[::-1]), np.log(line["cpu_s"].to_numpy()[::-1])
    return float(np.exp(np.interp(np.log(error), x, y)))


def reaching(rows: pd.DataFrame, target: float) -> pd.DataFrame:
    """Rows whose error bound meets a target, the cheapest first."""
    met = rows[(rows["error_bound"] <= target) & (rows["cpu_s"] > 0.0)]
    return met.sort_values("cpu_s", kind="stable")


def robust(errors: pd.Series, group: Sequence[Hashable], tightest: Sequence[bool]) -> pd.Series:
    """Each error, or that of the run with the tightest bound of the iteration where that is larger.

    The error of a loose Newton tolerance may cancel a part of the step's error; that is chance, which rounding changes.
    """
    rows = pd.DataFrame({"error": errors.to_numpy(float), "group": list(group)}, errors.index)
    tight = rows[np.asarray(tightest, dtype=bool)].groupby("group")["error"].max()
    least = rows["group"].map(tight)
    return rows["error"].mask(least > rows["error"], least)
