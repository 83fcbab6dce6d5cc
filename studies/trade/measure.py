"""Rows of a trade: each setting run, its error with its parts, and times in turn near the front."""

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import Any

import pandas as pd
from numpy import nansum

from anctmm.elements.kinds import KINDS
from anctmm.results.solution import Solution
from studies.engine.fronts import NEAR, excess, robust
from studies.engine.refinement import STEP_ORDERS, difference
from studies.engine.runner import Runner
from studies.engine.study import StudyError
from studies.engine.tables import records
from studies.engine.timing import least
from studies.engine.trials import EXPLICIT, IMPLICIT, OURS, SHARED, Trial, offer_of
from studies.trade.settings import Levels, steps_of

#: s of CPU time that a whole call of a sweep may take at most, and elements times steps, by whether it is quick.
MOST_S, MOST_WORK = {False: 2.0, True: 1.0}, {False: 4e6, True: 4e5}
#: Steps of one setting over the shortest step of the sweep, of the runs that separate the errors of step and mesh.
FINER = 4
NEWTON = 1e-10
#: Kinds of outcome, by the code of a status; any other is a failure of the solver.
OUTCOMES = {"unsupported": "not representable", "refused": "setting refused", "": "takes too long"}
#: Columns that are the same in runs that differ by the bounds of their iteration only.
SETTING = ["solver", "asked", "quadrature", "integrator", "elements", "dt", "tolerance"]
#: A run by a fine step, and the uncertainty of that step.
Fine = tuple[Solution, float] | None


def solve_all(levels: Levels, settings: pd.DataFrame, runner: Runner) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A row a setting with its error and the time of one run, and a row a kind of setting with its outcome.

    Runs go from coarse to fine, of all solvers in turn. Settings that would take too long, by the time of the runs
    before, are left out, and so is what follows a refused run. StudyError if all would take too long.
    """
    rows: list[dict[str, Any]] = []
    rates: dict[tuple[str, ...], float] = {}  # s by elements times steps; NaN of what was refused
    fine: dict[tuple[Any, ...], Fine] = {}
    most = MOST_WORK[runner.quick]
    for place, batch in settings.groupby("round"):
        able = [
            t.work <= most and rates.get(_family(t), 0.0) * t.work <= MOST_S[runner.quick]
            for t in batch["trial"]
        ]
        batch, runner.heading = batch[able], f"{levels.case.name}, level {place}: "
        for setting, solution in zip(records(batch), runner.solve_many(batch["trial"]), strict=True):
            trial, cost = setting["trial"], solution.cost
            rates[_family(trial)] = nansum([cost.cpu_s, cost.build_s]) / trial.work if cost.steps else nan
            own = _owner(trial), trial.element, trial.quadrature, trial.mesh
            if solution.status.ok and own not in fine:
                fine[own] = _fine(levels, trial, runner)
            rows.append(_row(levels, setting, solution, fine.get(own)))
    if not rows:
        too_long = f"each setting of case {levels.case.name!r} takes more than {most:g} elements times steps"
        raise StudyError(f"{too_long}; a shorter motion, a larger --error or longer steps are needed")
    frame = pd.DataFrame(rows)
    same = list(frame[SETTING].astype(str).itertuples(index=False, name=None))
    step = robust(frame["step_error"].astype(float), same, frame["tightest"].to_list())
    bound = frame["mesh_error"] + step + frame["reference_error"]
    return frame.assign(step_error=step, error_bound=bound), _outcomes(levels, settings, frame)


def _family(trial: Trial) -> tuple[str, ...]:
    """What is the same on all meshes by all steps."""
    return trial.solver, trial.element, trial.quadrature, trial.integrator, str(trial.options)


def _owner(trial: Trial) -> str:
    """Whose elements it has: ours, which all solvers share, or those of its solver."""
    return OURS if trial.used in KINDS else trial.solver


def _fine(levels: Levels, trial: Trial, runner: Runner) -> Fine:
    """A run by a fine step on a mesh: by the fourth-order steps of ANC–TMM, or else by second order of the solver."""
    solver, shortest = _owner(trial), min(levels.steps)
    tight = {k: NEWTON if k == "newton_tolerance" else v for k, v in offer_of(solver).choices[0].items()}
    fourth = replace(trial, solver=solver, integrator="esdirk", options=tuple(tight.items()), dt=shortest)
    second = replace(fourth, integrator=IMPLICIT, dt=shortest / FINER)
    explicit = replace(fourth, integrator=EXPLICIT, options=(), dt=nan)
    runner.heading = f"{levels.case.name}, error of the step: "
    for one in [fourth, second, explicit] if solver == OURS else [second, explicit]:
        one = one if one.dt > 0.0 else replace(one, dt=min(steps_of(levels, one)))
        finest, twice = runner.solve_many([one, replace(one, dt=2.0 * one.dt)])
        if finest.status.ok and twice.status.ok:
            left = 2.0 / (2.0 ** STEP_ORDERS[one.integrator] - 1.0)
            return finest, left * difference(twice, finest, levels.case.probes)
    return None


def _row(levels: Levels, setting: dict[str, Any], solution: Solution, fine: Fine) -> dict[str, Any]:
    trial, cost = setting["trial"], solution.cost
    reference, asked = levels.reference_of(trial.element), dict(trial.options)
    return {
        "scene": levels.case.name, "solver": trial.solver, "element": trial.used, "asked": trial.element,
        "quadrature": KINDS[trial.element].quadrature_shown(trial.quadrature), "integrator": trial.integrator,
        "elements": trial.cut, "dofs": solution.dofs, "dt": trial.dt, "tolerance": asked.get("tolerance", nan),
        "newton_tolerance": asked.get("newton_tolerance", nan),
        "own": str({k: v for k, v in trial.options if k not in SHARED}), "steps": cost.steps,
        "newton_iterations": cost.newton_iterations, "error": reference.error_of(solution),
        "mesh_error": reference.error_of(fine[0]) if fine else nan,
        "step_error": difference(solution, fine[0], levels.case.probes) if fine else nan,
        "reference_error": reference.uncertainty, "step_reference_error": fine[1] if fine else nan,
        "cpu_s": cost.cpu_s, "cpu_spread": nan, "build_s": cost.build_s, "repeats": 1,
        "status": str(solution.status), "reference": reference.name,
        "trial": trial, "tightest": setting["tightest"], "kind": setting["kind"],
    }  # fmt: skip


def _outcomes(levels: Levels, settings: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """For each solver, element and way to step the kind of outcome: an answer, or why there is none."""
    lines = []
    for solver, element, stepping in settings["kind"].drop_duplicates():
        status = rows.loc[rows["kind"] == (solver, element, stepping), "status"]
        good = int(status.str.startswith("ok").sum())
        code, _, why = status.iloc[0].partition(": ") if len(status) else ("", "", "")
        lines.append({
            "scene": levels.case.name, "solver": solver, "element": element, "stepping": stepping,
            "runs": len(status), "answers": good,
            "outcome": "answer" if good else OUTCOMES.get(code, "solver failed"), "why": "" if good else why,
        })  # fmt: skip
    return pd.DataFrame(lines)


def time_near(rows: pd.DataFrame, runner: Runner, also: Sequence[int]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The rows with times in turn of those near the front of their solver (and of others), and all samples."""
    near = pd.concat([excess(mine) for _, mine in rows.groupby("solver", sort=False)]) <= NEAR
    chosen = sorted({*near.index[near], *also})
    costs = runner.time_in_turn(list(rows.loc[chosen, "trial"]))
    rows = rows.assign(in_turn=rows.index.isin(chosen))
    rows.update(pd.DataFrame(list(map(least, costs)), index=chosen))
    rows["whole_s"] = rows["cpu_s"] + rows["build_s"].fillna(0.0)
    rows["excess"] = excess(rows[rows["in_turn"]]).reindex(rows.index)
    pairs = [(k, cost) for k, found in zip(chosen, costs, strict=True) for cost in found]
    return rows, pd.DataFrame([{"row": k, "cpu_s": c.cpu_s, "build_s": c.build_s} for k, c in pairs])


def like_with_like(rows: pd.DataFrame) -> Sequence[int]:
    """Rows of the same elements, mesh, step and integrator, by the tightest bounds, that several solvers have."""
    found: list[int] = []
    plain = rows[rows["tightest"] & (rows["status"] == "ok") & ~(rows["tolerance"] > 0.0)]
    plain = plain[plain["element"] == plain["asked"]]
    same = ["element", "quadrature", "integrator", "elements", "dt"]
    shared = plain[plain.groupby(same)["solver"].transform("nunique") > 1]
    for _, own in shared.groupby(["element", "integrator"], sort=False):
        settings = own.drop_duplicates(same)[same]
        chosen = settings.iloc[[0, len(settings) // 2, -1]].drop_duplicates()  # coarse, usual and fine
        found += own.reset_index().merge(chosen, on=same)["index"].tolist()
    return found
