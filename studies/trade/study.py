"""The trade of error for time of one case: every solver over meshes and steps, and the front."""

from dataclasses import replace

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.cases import assumptions_of
from studies.engine.files import file_name
from studies.engine.fronts import front
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Picture, Result, StudyError, check_fits
from studies.engine.tables import BUILD, Table, milliseconds, records
from studies.report.plots import floor, log_axes, look_of, picture
from studies.trade import tables as made
from studies.trade.measure import grid, levels_of, like_with_like, not_timed, solve_all, time_near

#: The target error that sentences speak of, or else the smallest.
TARGET = 1e-3
QUESTION = "Solver, element, quadrature, integrator, mesh and step: what does an error cost?"
LEFT_OUT = "quintic and shear elements, all quadratures but one, and most meshes and steps."
INDEPENDENCE = (
    "Independence: the global DAE shares the elements of ANC–TMM, so that their agreement checks elimination and time "
    "stepping; Exudyn, OpenSees, PyElastica and exact solutions have elements of their own and check the forces."
)


def run(options: Options, runner: Runner) -> Result:
    """Run the study of a case that moves; StudyError if it is static, or nothing is run with the options."""
    case = options.case
    if case.static:
        raise StudyError(f"case {case.name!r} is a static equilibrium; a trade needs a motion (t_end)")
    check_fits(options, case)
    levels = levels_of(case, options, runner)
    rows, kinds = solve_all(levels, grid(levels, options), runner)
    note = "outcome: of all runs of a solver, element and way to step."
    common = Table("outcomes", "Outcomes by solver", kinds, (note,)), made.references(levels, runner)
    none = f"No setting has an error; reference: {rows['reference'].iloc[0]}."
    why = (f"{r['solver']}, {r['element']}: {r['outcome']}: {r['why']}" for r in records(kinds) if r["why"])
    plain = Result(
        "trade", "Accuracy and cost", QUESTION, (none, *why), (*assumptions_of(case), INDEPENDENCE), common, good=False
    )  # fmt: skip
    if not (rows["error_bound"] > 0.0).any():
        return plain
    like = like_with_like(rows)
    runner.heading = f"{case.name}, "
    timed, samples = time_near(rows, runner, like)
    rows = timed.drop(columns=["trial", "tightest"])
    best, equal = made.recommended(rows, levels.targets), made.at_equal_error(rows, levels.targets)
    answer = _answer(best.frame, equal.frame)
    late = (why for _, why in not_timed(case, options))
    return replace(
        plain, good=True, findings=(f"{answer.question} {answer.figure}: {answer.take}", *late),
        tables=(
            best, equal, made.same_setting(rows, like), *common, made.front_table(rows), made.histories(levels),
            Table("points", "All settings", rows, (made.BOUND, made.TIMES, BUILD), "study"),
            Table("samples", "Raw time samples", samples, place="study"),
        ),
        pictures=(_picture(case.name, rows),), answers=(answer,),
        shown=("recommended", "at_equal_error"), left_out=LEFT_OUT if options.quick and not options.element else "",
    )  # fmt: skip


def _answer(best: pd.DataFrame, equal: pd.DataFrame) -> Answer:
    """The cheapest setting at one target, its cost, and how much longer other solvers take."""
    target = TARGET if (best["target"] == TARGET).any() else best["target"].min()
    line = records(best[best["target"] == target])[0]
    question = f"{line['scene']}: which setting for an error of {target:g}?"
    if line["status"] != "ok":
        return Answer(question, f"error {line['error_bound']:.1g}", f"{line['status']}: {line['setting']}.")
    slower = "; ".join(
        f"{r['solver']} {r['ratio']:.3g} times by steps, {r['ratio_whole']:.3g} by whole calls"
        for r in records(equal[(equal["target"] == target) & (equal["ratio"] > 1.0)])
    )
    others = f" Other solvers at their best settings take longer: {slower}." if slower else ""
    bound = f"error bound {line['error_bound']:.2g} ({made.parts_text(line)}), error {line['error']:.2g}"
    figure = f"{milliseconds(line['cpu_s'])} of steps, {milliseconds(line['whole_s'])} of the whole call"
    take = f"{line['setting']} ({line['dofs']} coordinates, one thread): {bound}.{others}"
    return Answer(question, figure, take)


def _picture(scene: str, rows: pd.DataFrame) -> Picture:
    """Error bound against CPU time, one line a solver: its front."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for solver, own in rows[rows["in_turn"]].groupby("solver", sort=False):
            line, name = front(own), str(solver)
            axes.plot(line["cpu_s"], line["error_bound"], label=name, **look_of(name))
        floor(axes, float(np.nanmax(rows["reference_error"])))
        log_axes(figure, [axes], [("CPU time of the steps (s)", "relative error (bound)")])

    caption = f"{scene}: Pareto front of each solver, error bound against CPU time of the steps."
    return picture(f"front_{file_name(scene)}", caption, draw, (7.2, 4.4))
