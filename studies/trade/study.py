"""The trade of error for time of one case: every solver over meshes and steps, and the front."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.cases import assumptions_of
from studies.engine.files import file_name
from studies.engine.fronts import front
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Picture, Result, StudyError, check_fits, check_taken
from studies.engine.tables import Table, error_text, milliseconds, records, times
from studies.report.plots import floor, log_axes, picture, solver_colour, solver_marker
from studies.trade.measure import like_with_like, solve_all, time_near
from studies.trade.settings import grid, levels_of, not_timed
from studies.trade.tables import (
    at_equal_error,
    front_table,
    histories,
    parts_text,
    points_table,
    recommended,
    references,
    same_setting,
)

#: The target error that sentences speak of, or else the smallest.
TARGET = 1e-3
QUESTION = "Solver, element, quadrature, integrator, mesh and step: what does an error cost?"
LEFT_OUT = "quintic and shear elements, all quadratures but one, and most meshes and steps."
INDEPENDENCE = (
    "Independence: the global DAE shares the elements of ANC–TMM, so that their agreement checks elimination and time "
    "stepping; Exudyn, OpenSees, PyElastica and exact solutions have elements of their own and check the forces.",
)


def run(options: Options, runner: Runner) -> Result:
    """Run the study of a case that moves.

    Raises
    ------
    StudyError
        If the case is static, or nothing is run with the options.
    """
    check_taken(options, "trade")
    case = options.case
    if case.static:
        raise StudyError(
            f"case {case.name!r} is a static equilibrium; a motion (t_end) is needed to trade error for time: "
            f"`anctmm study convergence` shows its errors over the mesh"
        )
    check_fits(options, case)
    levels = levels_of(case, options, runner)
    rows, kinds = solve_all(levels, grid(levels, options), runner)
    note = "outcome: of all runs of a solver, element and way to step."
    outcome = Table("outcomes", "Outcomes by solver", kinds, (note,))
    known = references(levels, runner)
    plain = Result(
        "trade", "Accuracy and cost", QUESTION, _why_none(rows, kinds), (*assumptions_of(case), *INDEPENDENCE),
        (outcome, known), good=False,
    )  # fmt: skip
    if not (rows["error_bound"] > 0.0).any():
        return plain
    like = like_with_like(rows)
    runner.heading = f"{case.name}, "
    rows, samples = time_near(rows, runner, like)
    best, equal = recommended(rows, levels.targets), at_equal_error(rows, levels.targets)
    late = tuple(why for _, why in not_timed(case, options))
    return replace(
        plain, good=True, findings=(*_findings(best.frame, equal.frame), *late),
        tables=(
            best, equal, same_setting(rows, like), outcome, known, front_table(rows), points_table(rows),
            histories(levels), Table("samples", "Raw time samples", samples, place="study"),
        ),
        pictures=(_picture(case.name, rows),), answers=tuple(_answers(best.frame, equal.frame)),
        shown=("recommended", "at_equal_error"), left_out=LEFT_OUT if options.quick and not options.element else "",
    )  # fmt: skip


def _why_none(rows: pd.DataFrame, kinds: pd.DataFrame) -> tuple[str, ...]:
    """Sentences where no setting has an error."""
    named = rows["reference"].iloc[0] if len(rows) else "no run was done"
    why = [f"{r['solver']}, {r['element']}: {r['outcome']}: {r['why']}" for r in records(kinds) if r["why"]]
    return f"No setting has an error; reference: {named}.", *why


def _answers(best: pd.DataFrame, equal: pd.DataFrame) -> list[Answer]:
    line = records(best[best["target"] == _headline(best)])[0]
    question = f"{line['scene']}: which setting for an error of {line['target']:g}?"
    if line["status"] != "ok":
        return [Answer(question, f"error {line['error_bound']:.1g}", f"{line['status']}: {line['setting']}.")]
    figure = f"{milliseconds(line['cpu_s'])} of steps, {milliseconds(line['whole_s'])} of the whole call"
    take = f"{line['setting']} ({line['dofs']} coordinates, one thread): error bound {line['error_bound']:.1g}, of "
    return [Answer(question, figure, f"{take}{parts_text(line)}. {_others(equal, line['target'])}".strip())]


def _headline(best: pd.DataFrame) -> float:
    return TARGET if (best["target"] == TARGET).any() else float(best["target"].min())


def _others(equal: pd.DataFrame, target: float) -> str:
    """Ratios of the other solvers at a target, in words."""
    slower = equal[(equal["target"] == target) & (equal["ratio"] > 1.0)]
    parts = [
        f"{r['solver']} {times(r['ratio'])} times by steps, {times(r['ratio_whole'])} by whole calls"
        for r in records(slower)
    ]
    return f"Other solvers at their best settings take longer: {'; '.join(parts)}." if parts else ""


def _findings(best: pd.DataFrame, equal: pd.DataFrame) -> list[str]:
    """Sentences from the tables."""
    said = [
        f"{r['scene']}, error {r['target']:g}: {r['setting']}: {milliseconds(r['cpu_s'])} of steps, "
        f"{milliseconds(r['whole_s'])} of the whole call, error bound {r['error_bound']:.2g} ({parts_text(r)}), "
        f"measured error {error_text(r)}."
        if r["status"] == "ok"
        else f"{r['scene']}, error {r['target']:g}: {r['status']} ({r['error_bound']:.1g})."
        for r in records(best)
    ]
    target = _headline(best)
    others = _others(equal, target)
    return [*said, *([f"{best['scene'].iloc[0]}, error {target:g}: {others}"] if others else [])]


def _picture(scene: str, rows: pd.DataFrame) -> Picture:
    """Error bound against CPU time, one line a solver: its front."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for solver, own in rows[rows["in_turn"]].groupby("solver", sort=False):
            line, name = front(own), str(solver)
            look: Any = {"color": solver_colour(name), "marker": solver_marker(name), "markersize": 4}
            axes.plot(line["cpu_s"], line["error_bound"], label=name, **look)
        floor(axes, float(np.nanmax(rows["reference_error"])))
        log_axes(figure, [axes], [("CPU time of the steps (s)", "relative error (bound)")])

    caption = f"{scene}: Pareto front of each solver, error bound against CPU time of the steps."
    return picture(f"front_{file_name(scene)}", caption, draw, (7.2, 4.4))
