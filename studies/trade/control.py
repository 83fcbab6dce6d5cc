"""Cost of error-controlled steps relative to the best fixed step on the same mesh, and their errors."""

from collections.abc import Iterator
from typing import Any

import pandas as pd

from anctmm.solvers.capabilities import NEWTON_TOLERANCES
from studies.engine.accuracy.robust import halved_errors, robust_errors
from studies.engine.pareto_front import cost_at
from studies.engine.tables import Table
from studies.trade.plan import EXPLICIT
from studies.trade.tables import Priced

#: What two runs must have in common for their steps to be compared.
ALIKE = ["scene", "element", "quadrature", "stretch", "elements"]
COLUMNS = (
    *ALIKE, "integrator", "tolerance", "step_error", "error_over_asked", "cpu_s", "ratio_at_error", "ratio_at_target",
    "ratio_to_any", "steps", "newton_iterations", "status",
)  # fmt: skip
NOTES = (
    "step_error: of the step alone, against a fine step on the same mesh; error_over_asked: over the tolerance. Where "
    "a step of the whole interval of output is better than asked, it is far below 1.",
    "ratio_at_error: cost over that of the best fixed step of the same integrator on the same mesh with the same "
    "step_error, interpolated on the front of all steps and Newton tolerances tried, none of which counts with a "
    "smaller error than the tightest, nor than steps shorter by up to a half; ratio_at_target: the same at the "
    "tolerance itself; ratio_to_any: at the same "
    "step_error, over the best fixed implicit step of any integrator of ANC-TMM. Times of the sweep are single samples "
    "unless the setting is near the front.",
)


def error_control(points: pd.DataFrame) -> Table:
    """A row for every error-controlled setting of ANC-TMM.

    Parameters
    ----------
    points : DataFrame
        All settings of the trade.
    """
    rows = [line for _, alike in points.groupby(ALIKE, sort=False) for line in _rows(alike)]
    frame = pd.DataFrame(rows, columns=list(COLUMNS))
    return Table("error_control", "What error control costs beside the best fixed step", frame, NOTES)


def _rows(alike: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Error-controlled settings of one mesh, each beside fixed steps of its integrator, and of all."""
    ours = alike[(alike["solver"] == "anctmm") & (alike["integrator"] != EXPLICIT)]
    fixed = ours[~(ours["tolerance"] > 0) & (ours["step_error"] > 0.0) & (ours["cpu_s"] > 0.0)]
    tightest = (fixed["newton_tolerance"] == NEWTON_TOLERANCES[0]).to_list()
    steps = list(zip(fixed["integrator"], fixed["dt"], strict=True))
    robust = robust_errors(fixed["step_error"], steps, tightest)
    bounds = list(zip(fixed["integrator"], fixed["newton_tolerance"], strict=True))
    fixed = fixed.assign(step_error=halved_errors(robust, bounds, fixed["dt"].to_list()))
    of_any = _priced(fixed)
    for integrator, mine in ours[ours["tolerance"] > 0].groupby("integrator", sort=False):
        of_same = _priced(fixed[fixed["integrator"] == integrator])
        for line in mine.sort_values("tolerance", ascending=False).to_dict("records"):
            error, asked, cost = line["step_error"], line["tolerance"], line["cpu_s"]
            yield {str(name): value for name, value in line.items()} | {
                "error_over_asked": error / asked,
                "ratio_at_error": cost / cost_at(of_same, error),
                "ratio_at_target": cost / cost_at(of_same, asked),
                "ratio_to_any": cost / cost_at(of_any, error),
            }


def _priced(rows: pd.DataFrame) -> list[Priced]:
    """Errors and costs of settings."""
    return [Priced(float(e), float(s)) for e, s in zip(rows["step_error"], rows["cpu_s"], strict=True)]
