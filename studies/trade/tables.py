"""Tables of a trade: recommended settings, solvers at equal error, like with like, references."""

from collections.abc import Iterator, Mapping, Sequence
from math import nan
from typing import Any

import numpy as np
import pandas as pd

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import KINDS
from anctmm.model.case import Case
from anctmm.solvers import registry
from studies.engine.choices import NONE
from studies.engine.fronts import NEAR, cost_at, excess, reaching
from studies.engine.identity import identity
from studies.engine.refinement import Reference, difference, offer_of
from studies.engine.runner import Runner
from studies.engine.tables import BELOW, BUILD, Table, error_text, records
from studies.engine.timing import SHORT
from studies.engine.trials import NO_BEAMS, Trial, mesh_label
from studies.trade.levels import Levels

STEPPING = {"generalized-alpha": "implicit", "zhai": "explicit", "esdirk": "implicit, fourth order"}
#: Columns that identify a setting, and what was found with it.
SETTING = (
    "solver", "element", "quadrature", "integrator", "elements", "dt", "tolerance", "newton_tolerance", "own", "asked",
)  # fmt: skip
FOUND = (
    "error", "mesh_error", "step_error", "reference_error", "error_bound", "error_from", "cpu_s", "whole_s",
    "cpu_spread", "build_s", "repeats", "steps", "newton_iterations", "dofs",
)  # fmt: skip
BOUND = (
    "error_bound: mesh_error + step_error + reference_error. A setting meets a target if this sum does, for every "
    "solver: errors of mesh and step that cancel in part are chance, which another motion changes. mesh_error: of a "
    "run by a fine step on the same mesh against the reference; step_error: against that run, and no smaller than by "
    "the solver's tightest bound of Newton's iteration; reference_error: uncertainty of the reference. error: of the "
    "run itself against the reference."
)
TIMES = (
    f"cpu_s: of the steps; whole_s: of the whole call. Settings within {NEAR:g} times the front of their solver ran "
    "again in turn on one core, and the least of these runs counts; of a run that takes less than "
    f"{SHORT:g} s the second one in a row is timed. Of all others cpu_s is of one run."
)


def setting_of(line: Mapping[Any, Any]) -> str:
    """A setting in words."""
    rule = "" if line["quadrature"] in ("full", "-") else f" (quadrature {line['quadrature']})"
    step = f"tolerance {line['tolerance']:g}" if line["tolerance"] > 0 else f"Δt = {1e3 * line['dt']:.3g} ms"
    newton = f", Newton {line['newton_tolerance']:g}" if line["newton_tolerance"] > 0 else ""
    own = "" if line["own"] == NONE else f", {line['own']}"
    kind = STEPPING.get(line["integrator"], line["integrator"])
    beams = "" if line["elements"] == NO_BEAMS else f", {line['elements']} {line['element']} elements{rule}"
    return f"{line['solver']}, {kind}{beams}, {step}{newton}{own}"


def stepping(rows: pd.DataFrame) -> pd.Series:
    """Way to step of each row, in words."""
    kind = rows["integrator"].replace(STEPPING)
    return kind.mask(rows["tolerance"] > 0, kind + ", error-controlled")


def parts_text(line: Mapping[Any, Any]) -> str:
    """Parts of an error in words."""
    parts = [f"step {error_text(line, 'step_error', '.1g')}", f"reference {line['reference_error']:.1g}"]
    return " + ".join(parts if line["elements"] == NO_BEAMS else [f"mesh {line['mesh_error']:.1g}", *parts])


def recommended(rows: pd.DataFrame, targets: Sequence[float]) -> Table:
    """The cheapest measured setting for each target error, or the one with the smallest bound."""
    timed = rows[rows["in_turn"] & (rows["error_bound"] > 0.0)]
    lines = []
    for target in targets if len(timed) else ():
        able = reaching(timed, target)
        line = (able if len(able) else timed.sort_values("error_bound")).iloc[0].to_dict()
        status = "ok" if len(able) else "not reached: no smaller error bound was measured"
        about = {"scene": line["scene"], "target": target, "setting": setting_of(line), "status": status}
        lines.append(about | {k: line[k] for k in (*FOUND, *SETTING)})
    columns = ["scene", "target", "setting", *FOUND, "status", *SETTING]
    notes = (
        "The cheapest measured setting whose error bound meets the target. `anctmm recommend` prints its script.",
        BOUND, TIMES,
    )  # fmt: skip
    return Table("recommended", "Recommended settings", pd.DataFrame(lines, columns=columns), notes)


def at_equal_error(rows: pd.DataFrame, targets: Sequence[float]) -> Table:
    """The cheapest setting of each solver for each target error, and how its time compares with the cheapest of all."""
    timed = rows[rows["in_turn"]]
    lines = [line for target in targets for line in _at(timed, target, list(dict.fromkeys(rows["solver"])))]
    columns = [
        "scene", "target", "solver", "setting", "error_bound", "dofs", "cpu_s", "whole_s", "ratio", "ratio_whole",
        "corrections_per_step", "ratio_per_correction", "ratio_at_error", "status",
    ]  # fmt: skip
    notes = (
        "For each solver its cheapest setting that meets the target, by steps (cpu_s) and by the whole call (whole_s); "
        "ratio, ratio_whole: over the cheapest of all solvers. ratio_at_error: of the steps at exactly the target, "
        "interpolated on each solver's own front; it does not depend on the errors that the meshes and steps happen to "
        "have.",
        "corrections_per_step: Newton's; ratio_per_correction: of the CPU time of an element's correction: the rest "
        "of the ratio is due to more steps, more corrections a step, or more elements. Solvers end their iteration by "
        "criteria of their own (Exudyn ignores newton_tolerance), so that they do not take the same corrections.",
    )  # fmt: skip
    return Table("at_equal_error", "Solvers at equal error", pd.DataFrame(lines, columns=columns), notes)


def _at(timed: pd.DataFrame, target: float, solvers: Sequence[str]) -> Iterator[dict[str, Any]]:
    best = {s: reaching(timed[timed["solver"] == s], target).head(1) for s in solvers}
    found = {s: records(rows)[0] for s, rows in best.items() if len(rows)}
    exact = {s: cost_at(timed[timed["solver"] == s], target) for s in solvers}
    if not found:
        return
    base = min(found.values(), key=lambda line: line["cpu_s"])
    whole = min(line["whole_s"] for line in found.values())
    for solver in sorted(solvers, key=lambda s: found[s]["cpu_s"] if s in found else np.inf):
        about = {"scene": timed["scene"].iloc[0], "target": target, "solver": solver}
        if solver not in found:
            bounds = timed[timed["solver"] == solver]["error_bound"]
            least = f"{bounds.min():.1e} at best" if bounds.notna().any() else "no run with an error"
            yield about | {"setting": "-", "status": f"not reached: {least}"}
            continue
        line = found[solver]
        yield about | {
            **{k: line[k] for k in ("error_bound", "dofs", "cpu_s", "whole_s")}, "setting": setting_of(line),
            "ratio": line["cpu_s"] / base["cpu_s"], "ratio_whole": line["whole_s"] / whole,
            "corrections_per_step": _per_step(line), "ratio_per_correction": _correction(line) / _correction(base),
            "ratio_at_error": exact[solver] / exact[base["solver"]], "status": "ok",
        }  # fmt: skip


def _per_step(line: Mapping[str, Any]) -> float:
    return line["newton_iterations"] / line["steps"] if line["newton_iterations"] and line["steps"] else nan


def _correction(line: Mapping[str, Any]) -> float:
    """CPU time of a Newton correction and coordinate, s; NaN of explicit steps."""
    return line["cpu_s"] / line["newton_iterations"] / line["dofs"] if line["newton_iterations"] else nan


def same_setting(rows: pd.DataFrame, chosen: Sequence[int]) -> Table:
    """Solvers at the same elements, mesh, step and integrator: ratios to the cheapest."""
    same = ["scene", "element", "quadrature", "integrator", "elements", "dt"]
    lines = rows.loc[
        list(chosen), [*same, "solver", "dofs", "error", "steps", "newton_iterations", "cpu_s", "whole_s"]
    ]
    groups = lines.groupby(same, sort=False)
    lines = lines.assign(
        ratio=lines["cpu_s"] / groups["cpu_s"].transform("min"),
        ratio_whole=lines["whole_s"] / groups["whole_s"].transform("min"),
        corrections_per_step=lines["newton_iterations"]
        / lines["steps"].where(lines["newton_iterations"] > 0),
    )
    each = lines["cpu_s"] / lines["newton_iterations"].where(lines["newton_iterations"] > 0)
    least = lines.groupby(same, sort=False)["cpu_s"].transform("idxmin").map(each)
    lines["ratio_per_correction"] = each / least
    notes = (
        "Each by the tightest bounds of its iteration. ratio: of the steps, over the cheapest at that setting; "
        "ratio_whole: of whole calls; ratio_per_correction: of a Newton correction, which is the ratio without the "
        "different numbers of corrections.",
    )
    columns = [
        *same, "solver", "dofs", "error", "cpu_s", "whole_s", "ratio", "ratio_whole", "corrections_per_step",
        "ratio_per_correction",
    ]  # fmt: skip
    shown = lines.sort_values([*same, "ratio"], kind="stable")[columns].reset_index(drop=True)
    return Table("same_setting", "Solvers at the same elements, mesh and step", shown, notes)


def front_table(rows: pd.DataFrame) -> Table:
    """Settings on the front of their solver, element and way to step; excess is 1 on the front of all."""
    timed = rows[rows["in_turn"] & (rows["error_bound"] > 0.0)]
    kinds = [timed["solver"], timed["element"], stepping(timed)]
    own = (
        pd.concat([excess(mine) for _, mine in timed.groupby(kinds, sort=False)])
        if len(timed)
        else timed["excess"]
    )
    chosen = timed[own.reindex(timed.index) == 1.0].sort_values(["solver", "cpu_s"])
    notes = (
        "excess: cost over that of the cheapest setting of no larger error bound: 1 on the front of all.",
        BOUND,
        TIMES,
    )
    return Table("front", "Pareto fronts of all solvers", _public(chosen), notes, "files")


def points_table(rows: pd.DataFrame) -> Table:
    """All settings."""
    return Table("points", "All settings", _public(rows), (BOUND, TIMES, BELOW, BUILD), "study")


def _public(rows: pd.DataFrame) -> pd.DataFrame:
    return rows.drop(columns=["trial", "tightest", "kind"]).reset_index(drop=True)


def references(levels: Levels, runner: Runner) -> Table:
    """References of errors, their uncertainty, an independent check of each, and the difference of the models."""
    cable = levels.references.get("cable")
    lines = []
    for element, found in levels.references.items():
        checker, apart = _checked(levels.case, element, found, runner)
        both = cable is not None and cable.solution is not None and found.solution is not None
        lines.append({
            "scene": levels.case.name, "element": element, **_setting(found), "uncertainty": found.uncertainty,
            "check": checker, "check_difference": apart,
            "from_cable": difference(found.solution, cable.solution, levels.case.probes) if both else nan,  # type: ignore
            "case": identity(levels.case), "status": "ok" if found.solution is not None else found.name,
        })  # fmt: skip
    notes = (
        "uncertainty: of mesh and step, by Richardson's extrapolation over levels that are halved. check: another "
        "solver at the same mesh and step; where it shares the elements it checks elimination and time stepping, and a "
        "solver with elements of its own checks the forces, too.",
        "from_cable: difference of the model to that of cables, which no mesh removes. case: identity of scene, probes "
        "and times.",
    )
    return Table("references", "References", pd.DataFrame(lines), notes)


def _checked(case: Case, element: str, found: Reference, runner: Runner) -> tuple[str, float]:
    """The first other solver with the same element that runs the reference's setting, and its difference."""
    if found.solution is None or not isinstance(found.solution.run, Discretisation):
        return "-", nan
    run = found.solution.run
    mesh = tuple(n for n, _ in run.of(case.scene).values()) or (1,)
    runner.heading = f"{case.name}, check of the reference: "
    for solver in registry.names():
        offer = offer_of(solver)
        if (
            solver == found.solution.solver
            or offer.element_of(element) != element
            or offer.lacking({element})
        ):
            continue
        trial = Trial(
            case.scene,
            solver,
            mesh,
            element,
            run.quadrature,
            run.integrator,
            run.dt,
            case.duration,
            case.interval,
        )
        solution = runner.solve(trial)
        if solution.status.ok:
            return solver, found.error_of(solution)
    return "-", nan


def _setting(reference: Reference) -> dict[str, Any]:
    """Integrator, mesh and step of a reference; NaN and "-" where there is none."""
    solution = reference.solution
    if solution is None or not isinstance(solution.run, Discretisation):
        return {"integrator": "-", "elements": "-", "dt": nan}
    meshes = [n for n, _ in solution.run.of(solution.scene).values()]
    return {
        "integrator": solution.run.integrator, "elements": mesh_label(tuple(meshes)) or NO_BEAMS, "dt": solution.run.dt,
    }  # fmt: skip


def histories(levels: Levels) -> Table:
    """Displacements of the probes in the references: `anctmm recommend` compares its rerun with them."""
    parts = []
    for element, found in levels.references.items():
        for probe in levels.case.probes if found.solution is not None else ():
            body, fraction = levels.case.scene.probe(probe)
            u = found.solution.displacement(probe)  # type: ignore[union-attr]
            about = {"scene": levels.case.name, "element": element, "body": body, "fraction": fraction}
            parts.append(pd.DataFrame({**about, "t": found.solution.t, "u_x": u[:, 0], "u_y": u[:, 1]}))  # type: ignore
    frame = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
    notes = ("Displacements of the probes, m, over time, s.",)
    return Table("histories", "Histories of the references", frame, notes, "files")


def family_of(element: str, known: Sequence[str]) -> str:
    """The element, of those with references, that has the continuum of another one."""
    alike = (e for e in known if e in KINDS and KINDS[e].continuum == KINDS[element].continuum)
    return element if element in known else next(alike, element)
