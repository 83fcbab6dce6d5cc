"""Rows of a trade: each setting run, its error with its parts, and times in turn near the front."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite, nan
from typing import Any

import pandas as pd
from numpy import nansum

from anctmm.elements.kinds import KINDS
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from studies.engine.choices import choices_of, written
from studies.engine.fronts import NEAR, excess, robust
from studies.engine.refinement import STEP_ORDERS, Setup, difference, element_of
from studies.engine.runner import Runner
from studies.engine.timing import least
from studies.engine.trials import Mesh, Trial
from studies.trade.grid import EXPLICIT, Family, Grid

#: s of CPU time that a whole call of a sweep may take at most, by whether it is quick.
MOST_S = {False: 2.0, True: 1.0}
#: Steps of a first look before a run, at least; part of the run.
LOOK, LOOK_PART = 20, 0.05
#: Steps of one setting over the shortest step of the sweep, of the runs that separate the errors of step and mesh.
FINER = 4
NEWTON = 1e-10
#: Places in the list of common settings at which solvers are compared like with like.
LIKE = (0.0, 0.5, 1.0)
#: Kinds of outcome, by the code of a status.
OUTCOMES = {
    "unsupported": "not representable", "refused": "setting refused", "failed": "solver failed",
    "diverged": "solver failed", "inaccurate": "solver failed", "imprecise": "solver failed",
}  # fmt: skip
COLUMNS = (
    "scene", "solver", "element", "quadrature", "integrator", "elements", "dofs", "dt", "tolerance",
    "newton_tolerance", "own", "steps", "newton_iterations", "error", "mesh_error", "step_error", "reference_error",
    "step_reference_error", "error_bound", "error_from", "cpu_s", "cpu_spread", "build_s", "whole_s", "repeats",
    "in_turn", "excess", "status", "reference", "asked",
)  # fmt: skip


@dataclass(frozen=True)
class SameMesh:
    """A run by a fine step on one mesh, and the uncertainty of its step."""

    solution: Solution
    uncertainty: float


def solve_all(grid: Grid, runner: Runner) -> tuple[pd.DataFrame, pd.DataFrame]:
    """A row a setting with its error and the time of one run, and a row a kind of setting with its outcome.

    Settings whose run would take too long are left out.
    """
    rows: list[dict[str, Any]] = []
    looks = _first_look(grid, runner)
    rates = {f: _rate(looks[f], t) for f, t in ((f, _look(grid, f)) for f in grid.families)}
    fine: dict[tuple[str, str, str, Mesh], SameMesh | None] = {}
    alive = list(grid.families)
    for k in range(max(len(grid.meshes(f)) for f in alive)):
        alive = [f for f in alive if k < len(grid.meshes(f)) and rates.get(f, 0.0) == rates.get(f, 0.0)]
        todo = [
            (f, t) for f in alive for t in _on_mesh(grid, f, k) if rates[f] * t.work <= MOST_S[runner.quick]
        ]
        for spot in dict.fromkeys(_place(f, t) for f, t in todo):
            fine[spot] = fine.get(spot) or _fine(grid, spot, runner)
        runner.heading = f"{grid.levels.case.name}, mesh {k + 1}: "
        for place, solution in runner.each(t for _, t in todo):
            family, trial = todo[place]
            rates[family] = _rate(solution, trial) if solution.status.ok else rates[family]
            rows.append(_row(grid, family, trial, solution, fine[_place(family, trial)]))
    frame = _bounded(pd.DataFrame(rows, columns=[*COLUMNS, "trial", "tightest", "kind"]))
    return frame, _outcomes(grid, frame, {f.kind: looks[f].status for f in reversed(grid.families)})


def _outcomes(grid: Grid, rows: pd.DataFrame, looks: Mapping[tuple[str, ...], Status]) -> pd.DataFrame:
    """For each solver, element and way to step the kind of outcome: an answer, or why there is none."""
    lines = []
    for kind in dict.fromkeys(f.kind for f in grid.families):
        mine = rows[rows["kind"] == kind]
        good = int((mine["status"] == "ok").sum())
        status = looks[kind] if good or mine.empty else Status(*mine["status"].iloc[0].split(": ", 1))
        code = "answer" if good else OUTCOMES.get(status.code, "takes too long")
        lines.append({
            "scene": grid.levels.case.name, "solver": kind[0], "element": kind[1], "stepping": kind[2],
            "runs": len(mine), "answers": good, "outcome": code, "why": "" if good else status.message,
        })  # fmt: skip
    return pd.DataFrame(lines)


def time_near(
    rows: pd.DataFrame, runner: Runner, also: Sequence[int] = ()
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The rows with times in turn of those near the front of their solver (and of others), and all samples."""
    own = [excess(mine) for _, mine in rows.groupby("solver", sort=False)]
    near = pd.concat(own) <= NEAR if own else pd.Series(dtype=bool)
    chosen = sorted({*near.index[near], *also})
    rows = rows.assign(in_turn=rows.index.isin(chosen))
    samples: list[dict[str, Any]] = []
    costs = runner.time_in_turn([rows.loc[k, "trial"] for k in chosen]) if chosen else []  # type: ignore[misc]
    for k, found in zip(chosen, costs, strict=True):
        timing = least(found)
        for name in ("cpu_s", "cpu_spread", "build_s", "repeats"):
            rows.loc[k, name] = getattr(timing, name)
        samples += [
            {"row": k, "sample": n, "cpu_s": c.cpu_s, "build_s": c.build_s} for n, c in enumerate(found)
        ]
    rows["whole_s"] = rows["cpu_s"] + rows["build_s"].fillna(0.0)
    rows["excess"] = excess(rows[rows["in_turn"]]).reindex(rows.index)
    return rows, pd.DataFrame(samples, columns=["row", "sample", "cpu_s", "build_s"])


def like_with_like(grid: Grid, rows: pd.DataFrame) -> list[int]:
    """Rows of the same elements, mesh, step and integrator, by the tightest bounds, that several solvers have."""
    found: list[int] = []
    plain = rows[rows["tightest"] & (rows["status"] == "ok") & ~(rows["tolerance"] > 0.0)]
    plain = plain[plain["element"] == plain["asked"]]
    same = ["element", "quadrature", "integrator", "elements", "dt"]
    shared = plain[plain.groupby(same)["solver"].transform("nunique") > 1]
    for _, own in shared.groupby(["element", "integrator"], sort=False):
        settings = own.drop_duplicates(same)[same]
        for part in LIKE:
            chosen = settings.iloc[[round(part * (len(settings) - 1))]]
            found += own.reset_index().merge(chosen, on=same)["index"].tolist()
    return list(dict.fromkeys(found))


def _on_mesh(grid: Grid, family: Family, k: int) -> list[Trial]:
    mesh = grid.meshes(family)[k]
    return family.trials(grid.levels.case, mesh, grid.steps(family, mesh))


def _look(grid: Grid, family: Family) -> Trial:
    """A part of a run on the coarsest mesh: some steps, or the interval of an output."""
    first = _on_mesh(grid, family, 0)[0]
    if first.error_controlled:
        return replace(first, t_end=first.output_dt)
    steps = max(LOOK, round(LOOK_PART * first.t_end / first.dt))
    return replace(first, t_end=steps * first.dt, output_dt=steps * first.dt)


def _first_look(grid: Grid, runner: Runner) -> dict[Family, Solution]:
    """A few steps of each family on its coarsest mesh: what is refused or takes too long is not run further."""
    runner.heading = f"{grid.levels.case.name}, first look: "
    found = runner.solve_many(_look(grid, family) for family in grid.families)
    return dict(zip(grid.families, found, strict=True))


def _rate(look: Solution, trial: Trial) -> float:
    """CPU time of a call for an element and step, s; NaN of a run that is refused."""
    return nansum([look.cost.cpu_s, look.cost.build_s]) / trial.work if look.cost.steps else nan


def _place(family: Family, trial: Trial) -> tuple[str, str, str, Mesh]:
    """Whose mesh it is: of elements of ours the same for all solvers."""
    ours = element_of(family.solver, family.element) in KINDS
    return ("" if ours else family.solver), family.element, family.quadrature, trial.mesh


def _fine(grid: Grid, place: tuple[str, str, str, Mesh], runner: Runner) -> SameMesh | None:
    """A run by a fine step on a mesh: by the fourth-order steps of ANC–TMM, or else by second order of the solver."""
    solver, element, quadrature, mesh = place
    case, shortest = grid.levels.case, min(grid.levels.steps)
    runner.heading = f"{case.name}, error of the step: "
    tries = [(Setup.solver, "esdirk", shortest)] if not solver else []
    tries += [
        (solver or Setup.solver, "generalized-alpha", shortest / FINER),
        (solver or Setup.solver, EXPLICIT, nan),
    ]
    for name, integrator, dt in tries:
        family = Family(name, element, quadrature, integrator, *_tight(name, integrator))
        dt = dt if isfinite(dt) else min(grid.steps(family, mesh))
        one, twice = runner.solve_many(family.trials(case, mesh, (dt, 2.0 * dt)))
        if one.status.ok and twice.status.ok:
            order = STEP_ORDERS[integrator]
            return SameMesh(one, difference(twice, one, case.probes) / (2.0**order - 1.0) * 2.0)
    return None


def _tight(solver: str, integrator: str) -> tuple[Any, Any]:
    """Tightest bounds of the iteration that a solver offers; of our own options tighter ones."""
    if integrator == EXPLICIT:
        return (), ()
    shared, own = choices_of(solver)[0]
    return tuple((k, NEWTON if k == "newton_tolerance" else v) for k, v in shared), own


def _row(
    grid: Grid, family: Family, trial: Trial, solution: Solution, fine: SameMesh | None
) -> dict[str, Any]:
    reference = grid.levels.reference_of(family.element)
    asked = dict(family.options)
    kind = KINDS[family.element]
    complete = solution.status.ok
    return {
        "scene": grid.levels.case.name, "solver": family.solver,
        "element": element_of(family.solver, family.element), "asked": family.element,
        "quadrature": kind.quadrature_shown(family.quadrature), "integrator": family.integrator,
        "elements": trial.cut, "dofs": solution.dofs, "dt": trial.dt,
        "tolerance": asked.get("tolerance", nan), "newton_tolerance": asked.get("newton_tolerance", nan),
        "own": written(family.own), "steps": solution.cost.steps,
        "newton_iterations": solution.cost.newton_iterations,
        "error": reference.error_of(solution),
        "mesh_error": reference.error_of(fine.solution) if fine else nan,
        "step_error": difference(solution, fine.solution, grid.levels.case.probes) if fine and complete else nan,
        "step_reference_error": fine.uncertainty if fine else nan,
        "reference_error": reference.uncertainty, "reference": reference.name,
        "cpu_s": solution.cost.cpu_s, "cpu_spread": nan, "build_s": solution.cost.build_s, "repeats": 1,
        "status": str(solution.status), "trial": trial, "tightest": family.tightest, "kind": family.kind,
    }  # fmt: skip


def _bounded(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows with robust errors of the step, and the bound of the error: the sum of its parts and of the reference's."""
    if rows.empty:
        return rows
    alike = ["solver", "asked", "quadrature", "integrator", "elements", "dt", "tolerance"]
    settings = list(rows[alike].astype(str).itertuples(index=False, name=None))
    rows["step_error"] = robust(rows["step_error"].astype(float), settings, rows["tightest"].to_list())
    rows["error_bound"] = rows["mesh_error"] + rows["step_error"] + rows["reference_error"]
    rows["error_from"] = [_weigh(m, s) for m, s in zip(rows["mesh_error"], rows["step_error"], strict=True)]
    return rows


def _weigh(mesh: float, step: float) -> str:
    """The larger part of an error: "mesh", "step", or "both" where neither is twice the other; "-" if unknown."""
    if not (mesh >= 0.0 and step >= 0.0):
        return "-"
    if mesh > 2.0 * step:
        return "mesh"
    return "step" if step > 2.0 * mesh else "both"
