"""Tables of a trade: recommended settings, solvers at equal error, like with like, references."""

from ast import literal_eval
from collections.abc import Mapping, Sequence
from math import nan
from typing import Any

import pandas as pd

from anctmm.model.case import Case
from anctmm.results.solution import Solution
from studies.engine.fronts import NEAR, cost_at, front, reaching
from studies.engine.identity import identity
from studies.engine.refinement import difference
from studies.engine.runner import Runner
from studies.engine.tables import Table, records
from studies.engine.timing import SHORT
from studies.engine.trials import NO_BEAMS
from studies.trade.measure import Levels

STEPPING = {"generalized-alpha": "implicit", "zhai": "explicit", "esdirk": "implicit, fourth order"}
#: Columns that identify a setting, and what was found with it.
SETTING = [
    "solver", "element", "quadrature", "integrator", "elements", "dt", "tolerance", "newton_tolerance", "own", "asked",
]  # fmt: skip
FOUND = [
    "error", "mesh_error", "step_error", "reference_error", "error_bound", "cpu_s", "whole_s", "cpu_spread", "build_s",
    "repeats", "steps", "newton_iterations", "dofs",
]  # fmt: skip
#: Columns that are the same in runs that are compared like with like; and ratios of those runs.
SAME = ["scene", "element", "quadrature", "integrator", "elements", "dt"]
RATIOS = ["ratio", "ratio_whole", "corrections_per_step", "ratio_per_correction"]
BOUND = (
    "error_bound: mesh_error + step_error + reference_error; a setting meets a target if this sum does, as errors that "
    "cancel in part are chance. mesh_error: of a run by a fine step on the same mesh against the reference; "
    "step_error: against that run, and no smaller than by the solver's tightest bound of Newton's iteration; "
    "reference_error: uncertainty of the reference. error: of the run itself against the reference."
)
TIMES = (
    f"cpu_s: of the steps; whole_s: of the whole call; within {NEAR:g} times the front of their solver the least of "
    f"runs in turn on one core (below {SHORT:g} s of the second call in a row), else of one run."
)
EQUAL = (
    "The cheapest setting of each solver that meets the target, by steps (cpu_s) and whole call (whole_s); ratio, "
    "ratio_whole: over the cheapest of all; ratio_at_error: on each solver's own front, at exactly the target.",
    "corrections_per_step: Newton's; ratio_per_correction: of the CPU time of a coordinate's correction. Solvers end "
    "their iteration by criteria of their own (Exudyn ignores newton_tolerance).",
)
SAME_NOTE = "Each by the tightest bounds of its iteration; ratios as at equal error, over the cheapest at that setting."
REFERENCES = (
    "uncertainty: of mesh and step, by Richardson's extrapolation. check: another solver at the same mesh and step; "
    "one that shares the elements checks elimination and time stepping, others check the forces, too.",
    "from_cable: difference of the model to that of cables. case: identity of scene, probes and times.",
)


def setting_of(line: Mapping[Any, Any]) -> str:
    """A setting in words."""
    rule = "" if line["quadrature"] in ("full", "-") else f" (quadrature {line['quadrature']})"
    step = f"tolerance {line['tolerance']:g}" if line["tolerance"] > 0 else f"Δt = {1e3 * line['dt']:.3g} ms"
    newton = f", Newton {line['newton_tolerance']:g}" if line["newton_tolerance"] > 0 else ""
    own = "".join(f", {k}={v!r}" for k, v in literal_eval(line["own"]).items())
    kind = STEPPING.get(line["integrator"], line["integrator"])
    beams = "" if line["elements"] == NO_BEAMS else f", {line['elements']} {line['element']} elements{rule}"
    return f"{line['solver']}, {kind}{beams}, {step}{newton}{own}"


def stepping(rows: pd.DataFrame) -> pd.Series:
    """Way to step of each row, in words."""
    kind = rows["integrator"].replace(STEPPING)
    return kind.mask(rows["tolerance"] > 0, kind + ", error-controlled")


def parts_text(line: Mapping[Any, Any]) -> str:
    """Parts of an error in words."""
    mesh = "" if line["elements"] == NO_BEAMS else f"mesh {line['mesh_error']:.1g} + "
    return f"{mesh}step {line['step_error']:.1g} + reference {line['reference_error']:.1g}"


def recommended(rows: pd.DataFrame, targets: Sequence[float]) -> Table:
    """The cheapest measured setting for each target error, or the one with the smallest bound."""
    timed = rows[rows["in_turn"] & (rows["error_bound"] > 0.0)]
    lines = []
    for target in targets if len(timed) else ():
        able = reaching(timed, target)
        line = (able if len(able) else timed.sort_values("error_bound")).iloc[0].to_dict()
        status = "ok" if len(able) else "not reached: no smaller error bound was measured"
        lines.append(line | {"target": target, "setting": setting_of(line), "status": status})
    frame = pd.DataFrame(lines, columns=["scene", "target", "setting", *FOUND, "status", *SETTING])
    note = "The cheapest measured setting whose error bound meets the target. `anctmm recommend` prints its script."
    return Table("recommended", "Recommended settings", frame, (note, BOUND, TIMES))


def at_equal_error(rows: pd.DataFrame, targets: Sequence[float]) -> Table:
    """The cheapest setting of each solver for each target error, and how its time compares with the cheapest of all."""
    columns = [
        "scene", "target", "solver", "setting", "error_bound", "dofs", "cpu_s", "whole_s", *RATIOS, "ratio_at_error",
        "status",
    ]  # fmt: skip
    frames = [_at(rows, target) for target in targets]
    frames = [frame for frame in frames if len(frame)] or [pd.DataFrame(columns=columns)]
    frame = pd.concat(frames, ignore_index=True)[columns]
    return Table("at_equal_error", "Solvers at equal error", frame, EQUAL)


def _at(rows: pd.DataFrame, target: float) -> pd.DataFrame:
    """A row a solver at one target, the cheapest first; none where no solver meets it."""
    timed, solvers = rows[rows["in_turn"]], rows["solver"].unique()
    met = reaching(timed, target)
    if met.empty:
        return met
    best = with_ratios(met.drop_duplicates("solver"))
    exact = {s: cost_at(timed[timed["solver"] == s], target) for s in solvers}
    best["setting"] = [setting_of(line) for line in records(best)]
    best["ratio_at_error"] = best["solver"].map(exact) / exact[best["solver"].iloc[0]]
    missed = timed.groupby("solver")["error_bound"].min().reindex(solvers).drop(best["solver"])
    why = [f"not reached: {b:.1e} at best" if b > 0 else "not reached: no run with an error" for b in missed]
    others = pd.DataFrame({"solver": missed.index, "setting": "-", "status": why})
    return pd.concat([best.assign(status="ok"), others]).assign(target=target, scene=timed["scene"].iloc[0])


def with_ratios(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of one comparison with their ratios to the cheapest, by steps, whole calls and Newton corrections."""
    corrections = rows["newton_iterations"].where(rows["newton_iterations"] > 0)
    each = rows["cpu_s"] / corrections / rows["dofs"]
    return rows.assign(
        ratio=rows["cpu_s"] / rows["cpu_s"].min(),
        ratio_whole=rows["whole_s"] / rows["whole_s"].min(),
        corrections_per_step=corrections / rows["steps"],
        ratio_per_correction=each / each.to_numpy()[int(rows["cpu_s"].to_numpy().argmin())],
    )


def same_setting(rows: pd.DataFrame, chosen: Sequence[int]) -> Table:
    """Solvers at the same elements, mesh, step and integrator: ratios to the cheapest."""
    columns = [*SAME, "solver", "dofs", "error", "cpu_s", "whole_s", *RATIOS]
    frames = [with_ratios(own) for _, own in rows.loc[list(chosen)].groupby(SAME, sort=False)]
    frame = pd.concat(frames or [pd.DataFrame(columns=columns)])
    shown = frame.sort_values([*SAME, "ratio"], kind="stable")[columns].reset_index(drop=True)
    return Table("same_setting", "Solvers at the same elements, mesh and step", shown, (SAME_NOTE,))


def front_table(rows: pd.DataFrame) -> Table:
    """Settings on the front of their solver, element and way to step; excess is 1 on the front of all."""
    timed = rows[rows["in_turn"] & (rows["error_bound"] > 0.0)]
    kinds = [timed["solver"], timed["element"], stepping(timed)]
    fronts = [front(own) for _, own in timed.groupby(kinds, sort=False)]
    frame = pd.concat(fronts or [timed]).sort_values(["solver", "cpu_s"]).reset_index(drop=True)
    note = "excess: cost over that of the cheapest setting of no larger error bound: 1 on the front of all."
    return Table("front", "Pareto fronts of all solvers", frame, (note, BOUND, TIMES), "files")


def references(levels: Levels, runner: Runner) -> Table:
    """References of errors, their uncertainty, an independent check of each, and the difference of the models."""
    runner.heading = f"{levels.case.name}, check of the reference: "
    cable = levels.references.get("cable")
    lines = []
    for element, found in levels.references.items():
        check, trial = next(found.others(), None), found.trial
        apart = difference(check, found.solution, levels.case.probes) if check else nan
        lines.append({
            "scene": levels.case.name, "element": element, "integrator": trial.integrator, "elements": trial.cut,
            "dt": trial.dt, "uncertainty": found.uncertainty, "check": check.solver if check else "-",
            "check_difference": apart, "from_cable": cable.error_of(found.solution) if cable is not None else nan,
            "case": identity(levels.case), "status": "ok" if found.known else found.name,
        })  # fmt: skip
    return Table("references", "References", pd.DataFrame(lines), REFERENCES)


def histories(levels: Levels) -> Table:
    """Displacements of the probes in the references: `anctmm recommend` compares its rerun with them."""
    known = {element: found.solution for element, found in levels.references.items() if found.known}
    frames = [history(levels.case, solution).assign(element=element) for element, solution in known.items()]
    columns = ["scene", "element", "body", "fraction", "t", "u_x", "u_y"]
    frame = pd.concat(frames, ignore_index=True)[columns] if frames else pd.DataFrame(columns=columns)
    return Table("histories", "Histories of the references", frame, ("m, over time, s.",), "files")


def history(case: Case, solution: Solution) -> pd.DataFrame:
    """Displacements of the probes over time, one probe after the other."""
    frames = []
    for probe in case.probes:
        (body, fraction), (x, y) = case.scene.probe(probe), solution.displacement(probe).T
        about = {"scene": case.name, "body": body, "fraction": fraction, "t": solution.t}
        frames.append(pd.DataFrame({**about, "u_x": x, "u_y": y}))
    return pd.concat(frames, ignore_index=True)
