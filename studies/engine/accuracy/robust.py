"""Errors that neither a loose Newton tolerance nor a lucky step can make smaller by chance."""

from collections.abc import Hashable, Sequence

import numpy as np
import pandas as pd

#: Part by which two steps may differ and be one.
CLOSE = 1e-9
#: What a reader of such errors must know.
NOTE = (
    "robust_error: no smaller than the error of the same mesh and step with the tightest bound of Newton's iteration "
    "that its solver tried. What a loose bound leaves may cancel a part of the step's error; that is chance, which "
    "rounding changes. Fronts, recommendations and costs at equal error are those of robust_error, for every solver."
)


def robust_errors(errors: pd.Series, alike: Sequence[Hashable], tightest: Sequence[bool]) -> pd.Series:
    """Each error, or that of the run alike with the tightest bound where that is larger.

    Parameters
    ----------
    errors : Series
        Of runs; NaN of one that failed.
    alike : sequence of hashable
        What a run shares with those that differ from it in the bounds of the iteration alone.
    tightest : sequence of bool
        Whether it has the tightest bounds of its solver.

    Returns
    -------
    Series
        NaN where `errors` has it.
    """
    rows = pd.DataFrame({"error": errors.to_numpy(float), "alike": list(alike)})
    tight = rows[np.asarray(tightest, dtype=bool)].groupby("alike")["error"].max()
    least = rows["alike"].map(tight)
    return pd.Series(rows["error"].where(~(least > rows["error"]), least).to_numpy(float), index=errors.index)


def halved_errors(
    errors: pd.Series, alike: Sequence[Hashable], sizes: Sequence[float], part: float = 0.5
) -> pd.Series:
    """Each error, or the largest of the runs alike with steps from its own down to half of it where that is larger.

    Whoever takes a step without a reference checks it by one of half its length. Errors of second order fall by four
    then, and this leaves them as they are. One that grows was small because its parts, or what Newton's iteration left,
    cancelled at that step: nobody can choose such a step beforehand.

    Parameters
    ----------
    errors : Series
        Of runs; NaN of one that failed.
    alike : sequence of hashable
        What a run shares with those that differ from it in the step alone.
    sizes : sequence of float
        Steps, s; or tolerances that steps follow.
    part : float
        Of a size, down to which others count.

    Returns
    -------
    Series
        NaN where `errors` has it.
    """
    rows = pd.DataFrame(
        {"error": errors.to_numpy(float), "alike": list(alike), "size": np.asarray(sizes, dtype=float)}
    )
    found = rows["error"].copy()
    for _, group in rows.groupby("alike"):
        error, size = group["error"].to_numpy(), group["size"].to_numpy()
        checked = (size <= size[:, None] * (1.0 + CLOSE)) & (size >= part * size[:, None] * (1.0 - CLOSE))
        found[group.index] = np.nanmax(np.where(checked, error, -np.inf), axis=1, initial=-np.inf)
    return pd.Series(found.where(rows["error"].notna()).to_numpy(float), index=errors.index)
