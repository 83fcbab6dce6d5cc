"""What the parts of the study of extremes share: a part's answer, and rows that are kept when they are done."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from studies.engine.runner import Runner
from studies.engine.tables import Table
from studies.report.plots import Picture

#: Machine epsilon: the distance from 1 to the next number.
EPS = float(np.finfo(float).eps)
Row = dict[str, Any]


@dataclass(frozen=True)
class Part:
    """One extreme: its tables and pictures, and a sentence of what was learned from each table."""

    tables: tuple[Table, ...]
    pictures: tuple[Picture, ...]
    learned: tuple[str, ...]


@dataclass(frozen=True)
class Job:
    """Rows of a table that are computed together.

    Parameters
    ----------
    label : str
        Tells it from every other job of its module, and is shown while it runs.
    setting : mapping
        Columns that stand in its row if it fails.
    rows : callable
        Computes the rows.
    solver : str
        Name of a solver that it is only given by name; empty without one.
    """

    label: str
    setting: Mapping[str, Any]
    rows: Callable[[], list[Row]]
    solver: str = ""

    def failed(self, error: Exception) -> list[Row]:
        """The row that says why there are no others."""
        return [{**self.setting, "status": f"failed: {type(error).__name__}: {' '.join(str(error).split())}"}]


def rows_of(jobs: Sequence[Job], runner: Runner) -> list[Row]:
    """Rows of all jobs, each job kept when it is done."""
    sources = [runner.source(name) for name in dict.fromkeys(job.solver for job in jobs if job.solver)]
    code = " ".join(["extremes", *sources]) if all(sources) else ""
    found = runner.jobs([(f"extremes: {job.label}", job.rows, job.failed) for job in jobs], code)
    return [row for rows in found for row in rows]


def off(measured: float, predicted: float) -> float:
    """Relative difference of a measurement to a prediction."""
    return measured / predicted - 1.0


def worst(frame: pd.DataFrame, column: str) -> dict[Any, Any]:
    """The row with the largest size of a column."""
    sizes = frame[column].abs().to_numpy(float)
    return frame.to_dict("records")[int(np.nanargmax(sizes))]
