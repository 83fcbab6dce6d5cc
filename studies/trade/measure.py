"""Rows of a trade: each solver with every freedom on meshes and steps by refinement; errors and times of all."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import inf, isinf, nan
from typing import Any

import pandas as pd
from numpy import nansum

from anctmm.elements.kinds import KINDS, QUADRATURES
from anctmm.model.case import Case
from anctmm.model.needs import features_of
from anctmm.results.solution import Solution
from anctmm.solvers import registry
from anctmm.solvers.capabilities import NEWTON_TOLERANCES
from studies.cases import place_name
from studies.engine.fronts import NEAR, excess, robust
from studies.engine.meshes import Mesh, StudyError, step_below
from studies.engine.refinement import STEP_ORDERS, Refined, Refinement, difference, rests
from studies.engine.runner import Runner
from studies.engine.study import Options
from studies.engine.tables import records
from studies.engine.timing import least
from studies.engine.trials import EXPLICIT, IMPLICIT, OURS, Trial, explicit_limit, offer_of

#: Target errors; the smallest by default, by whether the run is quick.
TARGETS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
SMALLEST = {False: 1e-5, True: 1e-3}
#: Part of the smallest target error that a reference may be uncertain by.
SHARE = 0.3
#: Levels of mesh and of step of a quick run beside the finest, every second one; steps at most; doublings of the mesh
#: in addition for a solver whose own element is of lower order.
FEWEST, MOST_STEPS, MORE_MESHES = 2, 8, 2
#: Tolerances of the error-controlled steps; of a quick run.
TOLERANCES = {False: (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5), True: (1e-2, 1e-3, 1e-4)}
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


@dataclass(frozen=True)
class Levels:
    """Meshes, steps, references and targets of a case."""

    case: Case
    meshes: Mapping[str, tuple[Mesh, ...]]  # by element, from coarse to fine
    steps: tuple[float, ...]  # from long to short, s
    references: Mapping[str, Refined]  # by element
    targets: tuple[float, ...]  # from the largest to the smallest

    def reference_of(self, element: str) -> Refined:
        """The reference of an element, or of another one with the same continuum."""
        return self.references[same_continuum(element, self.references)]


def same_continuum(element: str, known: Mapping[str, object]) -> str:
    """The element, of those with references, that has the continuum of another one."""
    same = (e for e in known if e in KINDS and KINDS[e].continuum == KINDS[element].continuum)
    return element if element in known else next(same, element)


def levels_of(case: Case, options: Options, runner: Runner) -> Levels:
    """Refine a case with each element, and use the levels of the refinement as the settings to try.

    StudyError if none of the probes moves.
    """
    quick, smallest = options.quick, options.error or SMALLEST[options.quick]
    targets = (*(target for target in TARGETS if target > 1.01 * smallest), smallest)
    models = ("cable",) if quick or not case.scene.beams else ("cable", "shear")
    if options.element:  # references are of one element of each continuum
        models = ("cable" if options.element == "quintic" else options.element,)
    runner.heading = f"{case.name}, reference: "
    found = {e: Refinement(case, runner, element=e).refined(SHARE * smallest) for e in models}
    complete = [run.solution for run in found.values() if run.solution.status.ok]
    if complete and all(rests(solution, probe) for solution in complete for probe in case.probes):
        probes = ", ".join(map(place_name, case.probes))
        raise StudyError(f"case {case.name!r} has probes {probes}, none of which moves; at least one must")
    meshes = {
        e: options.meshes or _few(run.levels.mesh_at, run.i if run.known else 0, quick)
        for e, run in found.items()
    }
    if "cable" in meshes and not quick and case.scene.beams:  # of high order: coarser meshes suffice
        meshes["quintic"] = options.meshes or meshes["cable"][: (len(meshes["cable"]) + 1) // 2]
    first = found[models[0]]
    steps = options.steps or _few(lambda j: first.levels.dt_at(first.i, j), first.j, quick)[-MOST_STEPS:]
    asked = {e: those for e, those in meshes.items() if options.element in (None, e)}
    return Levels(case, asked, steps, found, targets)


def _few(at: Callable[[int], Any], last: int, quick: bool) -> tuple[Any, ...]:
    """Levels up to that of a reference; of a quick run the last and some before it, every second one."""
    levels = [at(k) for k in range(last + 1)]
    return tuple(levels[::-2][FEWEST::-1] if quick else levels)


def grid(levels: Levels, options: Options) -> pd.DataFrame:
    """Every solver with every freedom that it offers, on the same meshes with the same steps: a row a setting.

    Columns: trial; tightest (whether the bounds of the iteration are the tightest of the solver); round (place in the
    order of the runs, from coarse to fine). StudyError without any row.
    """
    late = dict(not_timed(levels.case, options))
    solvers = [solver for solver in options.solvers or registry.names() if solver not in late]
    pairs = product(levels.meshes, solvers)
    every = [family for pair in pairs for family in _families(levels, *pair, options)]
    if not every:
        asked = " ".join(filter(None, (options.element, options.integrator))) or "a run"
        raise StudyError(f"{asked} is asked for; no solver of {', '.join(solvers)} offers that")
    rows = [
        {"trial": replace(family, mesh=mesh, dt=dt), "tightest": tightest, "round": (k, j)}
        for family, tightest in every
        for k, mesh in enumerate(_meshes_of(levels, family, options.quick))
        for j, dt in enumerate(steps_of(levels, replace(family, mesh=mesh)))
    ]
    return pd.DataFrame(rows)


def not_timed(case: Case, options: Options) -> Iterator[tuple[str, str]]:
    """Solvers that take part only if they are asked for by name, and why."""
    for solver in () if options.solvers else registry.names():
        if slow := sorted(set(features_of(case.scene)) & offer_of(solver).slow_with):
            things = ", ".join(f.replace("-", " ") for f in slow)
            why = f"its model has {things} for verification and not for speed (as by Python callbacks in each step)"
            yield solver, f"{solver} is not timed: {why}; --solvers {solver} times it all the same."


def _families(levels: Levels, element: str, solver: str, options: Options) -> Iterator[tuple[Trial, bool]]:
    """Runs of a solver and an element without mesh and step, and whether the bounds of the iteration are tightest."""
    offer, quick = offer_of(solver), options.quick
    if (offer.element and element not in offer.limits) or offer.lacking({element}):
        return
    own = KINDS.get(offer.element_of(element))
    rules = own.quadratures if own and own.quadratures and levels.case.scene.beams else QUADRATURES[:1]
    slow = frozenset() if options.solvers else offer.slow_with  # made for verification, and not for speed
    integrators = [i for i in offer.integrators if options.integrator in (None, i) and i not in slow]
    for quadrature, integrator in product(rules[-1:] if quick else rules, integrators):
        plain = Trial.of(levels.case, solver, element=element, quadrature=quadrature, integrator=integrator)
        if integrator == EXPLICIT:
            yield plain, True
            continue
        yield from ((replace(plain, options=given), k == 0) for k, given in enumerate(offer.choices))
        for tolerance in TOLERANCES[quick]:
            given = {"tolerance": tolerance, "newton_tolerance": NEWTON_TOLERANCES[-1]}
            yield replace(plain, options=given), True


def _meshes_of(levels: Levels, family: Trial, quick: bool) -> tuple[Mesh, ...]:
    """Meshes from coarse to fine; finer ones where the solver's own element is of lower order."""
    meshes = levels.meshes[family.element]
    order = offer_of(family.solver).order_of(family.element)
    if order >= KINDS[family.element].order or len(meshes) < 2 or quick:
        return meshes
    return (*meshes, *(tuple(2**k * n for n in meshes[-1]) for k in range(1, MORE_MESHES + 1)))


def steps_of(levels: Levels, trial: Trial) -> tuple[float, ...]:
    """Steps on a mesh, s: explicit ones take the largest safe step and half of it; a tolerance has none."""
    if trial.error_controlled:
        return (nan,)
    limit = explicit_limit(trial) if trial.integrator == EXPLICIT else inf
    if isinf(limit):
        return levels.steps
    largest = step_below(levels.case, limit)
    return largest, largest / 2.0


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
    fourth = replace(trial, solver=solver, integrator="esdirk", options=tight, dt=shortest)
    second = replace(fourth, integrator=IMPLICIT, dt=shortest / FINER)
    explicit = replace(fourth, integrator=EXPLICIT, options={}, dt=nan)
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
    reference, asked = levels.reference_of(trial.element), trial.options
    return {
        "scene": levels.case.name, "solver": trial.solver, "element": trial.used, "asked": trial.element,
        "quadrature": KINDS[trial.element].quadrature_shown(trial.quadrature), "integrator": trial.integrator,
        "elements": trial.cut, "dofs": solution.dofs, "dt": trial.dt, "tolerance": asked.get("tolerance", nan),
        "newton_tolerance": asked.get("newton_tolerance", nan),
        "own": str(trial.own), "steps": cost.steps,
        "newton_iterations": cost.newton_iterations, "error": reference.error_of(solution),
        "mesh_error": reference.error_of(fine[0]) if fine else nan,
        "step_error": difference(solution, fine[0], levels.case.probes) if fine else nan,
        "reference_error": reference.uncertainty, "step_reference_error": fine[1] if fine else nan,
        "cpu_s": cost.cpu_s, "cpu_spread": nan, "build_s": cost.build_s, "repeats": 1,
        "status": str(solution.status), "reference": reference.name,
        "trial": trial, "tightest": setting["tightest"],
    }  # fmt: skip


def _outcomes(levels: Levels, settings: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """For each solver, element and way to step the kind of outcome: an answer, or why there is none."""
    kinds, ran = (frame["trial"].map(lambda trial: trial.kind) for frame in (settings, rows))
    lines = []
    for solver, element, stepping in kinds.drop_duplicates():
        status = rows.loc[ran == (solver, element, stepping), "status"]
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
