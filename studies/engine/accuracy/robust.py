"""Errors that a loose Newton tolerance cannot make smaller by chance."""

from collections.abc import Hashable, Sequence

import numpy as np
import pandas as pd

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
