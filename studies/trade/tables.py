"""Tables and sentences of the trade: what to take for a target error, and why."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite, nan
from typing import Any, NamedTuple

import pandas as pd

from anctmm.discretise.discretisation import Discretisation
from anctmm.model.case import Case
from anctmm.model.needs import needs
from anctmm.results.metrics import compare
from anctmm.solvers.capabilities import NEWTON_TOLERANCES
from studies.engine.accuracy.dynamics import REISSNER
from studies.engine.accuracy.robust import NOTE as ROBUST
from studies.engine.answers import Answer
from studies.engine.measuring.clock import records
from studies.engine.measuring.timing import SHORT
from studies.engine.pareto_front import NEAR, cost_at
from studies.engine.running.outcomes import Reference
from studies.engine.running.trial import NO_BEAMS, mesh_label
from studies.engine.tables import BELOW, BUILD, Table, error_text, failed, milliseconds, times
from studies.trade import step_orders
from studies.trade.case_digest import digest_of
from studies.trade.choice import (
    KIND,
    STEPPING,
    known_error,
    nearest,
    parts_of,
    reaching,
    setting_of,
    stepping,
)
from studies.trade.plan import MOST_EXPLICIT, TARGETS
from studies.trade.second_road import Second

#: The target error that sentences speak of, or else the smallest.
TARGET = 1e-3
#: What was found with a recommended setting.
FOUND = (
    "error", "robust_error", "reference_error", "mesh_error", "step_error", "step_reference_error", "error_from",
    "cpu_spread", "build_s", "repeats",
)  # fmt: skip
#: Columns that identify a setting.
SETTING = (
    "solver", "element", "quadrature", "integrator", "elements", "dt", "tolerance", "newton_tolerance", "own",
    "stretch",
)  # fmt: skip


@dataclass(frozen=True)
class Traded:
    """One scene's points: a row a setting, the references by element, and all raw times.

    Of references also what second roads gave, and rows of the order of their steps; and sentences about solvers that
    are not timed.
    """

    base: Case
    frame: pd.DataFrame
    references: Mapping[str, Reference]
    samples: list[dict[str, Any]]
    second: Mapping[str, Second] = field(default_factory=dict)
    orders: Sequence[Mapping[str, Any]] = ()
    said: Sequence[str] = ()


def notes(fine_steps: Sequence[float]) -> tuple[str, ...]:
    """What a reader of the points must know, with the fine steps of the scenes, s."""
    return (
        "error: over the probes, the largest of RMS in time of |u − u_ref| / max in time of |u_ref|, against a fine "
        "mesh and step of the same element; reference_error: that reference's own uncertainty. Cable and shear "
        "element are two models: their distance stands in the table of references.",
        BELOW,
        "step_error: against ANC–TMM with a step of "
        f"{' or '.join(f'{h:.3g}' for h in dict.fromkeys(fine_steps))} s on the same mesh, known to "
        "step_reference_error; "
        "mesh_error: of that run against the reference; error_from: the one more than twice the other. The two may "
        "cancel in part; a loose Newton tolerance counts as the step's.",
        "dt, or tolerance where the error drives the step. Explicit runs at 0.8 of the stability limit and at half of "
        f"that, where elements × steps are at most {MOST_EXPLICIT:g}.",
        "Every solver ran on the same meshes with the same steps and tried all that it says it can choose beside "
        "them: newton_tolerance, the bound of the last correction "
        f"({', '.join(f'{t:g}' for t in NEWTON_TOLERANCES)}); own, keyword arguments of its own (Exudyn: bounds of the "
        "residual, relative and absolute in N, and when it takes a new tangent; its linear solver is the faster one of "
        "that size).",
        f"cpu_s: of the steps; settings within {NEAR:g} times their solver's front (in_turn) ran "
        "again in turn, and the least of these runs counts; of a run that takes less than "
        f"{SHORT:g} s the second one in a row is timed. excess: cost over that of the cheapest setting of no larger "
        "robust_error: 1 on the front.",
        ROBUST,
        "opensees: frames of its own, on finer meshes and where they can do the scene: they know no whole turn of a "
        "beam. They are measured against the cable's reference, of the same continuum.",
        BUILD,
        REISSNER,
    )


def recommended(points: pd.DataFrame, targets: Sequence[float] = TARGETS) -> Table:
    """The cheapest measured setting for each scene and target error, or the nearest if none reaches it."""
    rows = []
    for scene, mine in points[points["error"] > 0].groupby("scene", sort=False):
        for target in targets:
            able = reaching(mine, target)
            line = (able if len(able) else nearest(mine)).iloc[0].to_dict()
            status = "ok" if len(able) else "not reached: no smaller error was measured"
            about = {
                "scene": scene,
                "target_error": target,
                "cpu_s": line["cpu_s"],
                "setting": setting_of(line),
            }
            rows.append(
                about | {k: line[k] for k in FOUND} | {"status": status} | {k: line[k] for k in SETTING}
            )
    said = (
        "The cheapest measured setting whose robust_error and its reference's uncertainty together are below the "
        "target. `anctmm recommend` prints the script that runs it.",
    )
    columns = ["scene", "target_error", "cpu_s", "setting", *FOUND, "status", *SETTING]
    frame = pd.DataFrame(rows, columns=columns)  # also where no run has an error
    return Table("recommended", "What to take for a target error", frame, said)


def by_rival(points: pd.DataFrame, targets: Sequence[float] = TARGETS) -> Table:
    """The cheapest setting of each kind (solver, element, how it steps) for each scene and target error."""
    points = points.assign(stepping=stepping(points))
    rows = []
    for scene, mine in points.groupby("scene", sort=False):
        for target in targets:
            able = reaching(mine, target)
            at_error = {kind: cost_at(_priced(own), target) for kind, own in mine.groupby(KIND, sort=False)}
            least = min(filter(isfinite, at_error.values()), default=nan)
            for kind, own in mine.groupby(KIND, sort=False):
                first = able.merge(pd.DataFrame([dict(zip(KIND, kind, strict=True))]), on=KIND).head(1)
                about = {"scene": scene, "target_error": target, **dict(zip(KIND, kind, strict=True))}
                if first.empty:
                    reason = _at_best(own)
                    rows.append(about | {"status": reason})
                    continue
                line = first.iloc[0].to_dict()
                rows.append(about | {
                    "setting": setting_of(line), "error": line["error"], "robust_error": line["robust_error"],
                    "reference_error": line["reference_error"],
                    "cpu_s": line["cpu_s"], "build_s": line["build_s"],
                    "ratio": line["cpu_s"] / able["cpu_s"].iloc[0], "cpu_s_at_error": at_error[kind],
                    "ratio_at_error": at_error[kind] / least, "status": "ok",
                })  # fmt: skip
    columns = [
        "scene", "target_error", *KIND, "setting", "error", "robust_error", "reference_error", "cpu_s",
        "build_s", "ratio", "cpu_s_at_error", "ratio_at_error", "status",
    ]  # fmt: skip
    frame = pd.DataFrame(rows).reindex(columns=columns)
    frame["setting"] = frame["setting"].astype(object).fillna("-")
    frame = frame.sort_values(
        ["scene", "target_error", "ratio"], ascending=[False, False, True], kind="stable"
    )
    said = (
        "ratio: cost of the setting over that of the cheapest setting of all kinds for that error.",
        "cpu_s_at_error: cost of exactly that error, interpolated between the neighbours on the kind's own front in "
        "logarithms of error and cost, as the benchmark's equal error is; ratio_at_error: over the cheapest kind's. "
        "These do not depend on which errors the meshes and steps tried happen to have.",
    )
    return Table("by_rival", "The cheapest of each kind: why", frame.reset_index(drop=True), said)


def _at_best(own: pd.DataFrame) -> str:
    """Why a kind does not meet a target error."""
    errors = own["robust_error"]
    if not errors.min() > 0.0:
        return "no run ended well"
    best = records(own.sort_values("robust_error"))[0]
    return f"not reached: {error_text(best, 'robust_error', '.1e')} at best"


class Priced(NamedTuple):
    """An error and its cost, s."""

    error: float
    cpu_s: float


def _priced(rows: pd.DataFrame) -> list[Priced]:
    """Robust errors and times of the rows that have both."""
    sound = rows[(rows["robust_error"] > 0.0) & (rows["cpu_s"] > 0.0)]
    return [Priced(float(e), float(c)) for e, c in zip(sound["robust_error"], sound["cpu_s"], strict=True)]


def on_front(points: pd.DataFrame) -> pd.DataFrame:
    """Rows that no other of their scene beats in both error and cost."""
    return points[points["excess"] == 1.0].sort_values(["scene", "cpu_s"]).drop(columns=["family", "excess"])


def references(traded: Sequence[Traded]) -> Table:
    """What errors are measured against, how well it is known, and how far the two models are apart."""
    rows = []
    for t in traded:
        cable = t.references.get("cable")
        for element, found in t.references.items():
            both = cable is not None and cable.solution is not None and found.solution is not None
            apart = compare(found.solution, cable.solution, t.base.probes).error if both else float("nan")  # type: ignore
            second = t.second.get(element, Second())
            rows.append({
                "scene": t.base.scene.name, "element": element, **_found_with(found), "reference": found.name,
                "uncertainty": found.uncertainty, "second_road": second.name, "apart": second.apart,
                "from_cable": apart, "case": digest_of(t.base),
                "status": "ok" if found.solution is not None else found.name,
            })  # fmt: skip
    said = (
        "element: whose settings are measured against it, with others of the same continuum; with: the element that "
        "it is found with, and whether clamps free the stretch there: below 1e-6 a stretch that is held rules the "
        "error of any mesh.",
        "uncertainty: differences to a coarser mesh and to a coarser step, added. second_road: another solver with "
        "another method in time; apart: its difference to the reference, its own errors of mesh and step included. "
        "from_cable: difference of the model to that of cables: no mesh of either removes it. case: digest of scene, "
        "probes and times.",
    )
    return Table("references", "References and the distance of the models", pd.DataFrame(rows), said)


def orders(traded: Sequence[Traded]) -> Table:
    """At which order the steps of the references converge."""
    frame = pd.DataFrame([row for t in traded for row in t.orders], columns=list(step_orders.COLUMNS))
    return Table("reference_steps", "References: the order of their steps", frame, step_orders.NOTES)


def _found_with(reference: Reference) -> dict[str, Any]:
    """How a reference was found: element, integrator, mesh and step; NaN and "-" where there is none."""
    solution = reference.solution
    if solution is None or not isinstance(solution.run, Discretisation):
        return {"with": "-", "integrator": "-", "elements": "-", "dt": nan}
    meshes = solution.run.of(solution.scene).values()
    free = any(feature == "free-stretch" for feature, _ in needs(solution.scene))
    kinds = "/".join(dict.fromkeys(kind for _, kind in meshes)) or NO_BEAMS
    return {
        "with": f"{kinds}, stretch free" if free else kinds,
        "integrator": solution.run.integrator,
        "elements": mesh_label(tuple(n for n, _ in meshes)) or NO_BEAMS,
        "dt": solution.run.dt,
    }


def histories(traded: Sequence[Traded]) -> Table:
    """Displacements of the probes in the references: what a rerun is compared with."""
    parts = []
    for t in traded:
        for element, found in t.references.items():
            if found.solution is None:
                continue
            for probe in t.base.probes:
                body, fraction = t.base.scene.probe(probe)
                u = found.solution.displacement(probe)
                about = {
                    "scene": t.base.scene.name,
                    "element": element,
                    "body": body,
                    "fraction": fraction,
                }
                parts.append(pd.DataFrame({**about, "t": found.solution.t, "u_x": u[:, 0], "u_y": u[:, 1]}))
    frame = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()
    said = ("Displacements of the probes, m, over time, s.",)
    return Table("histories", "Histories of the references", frame, said)


# --- what was found ------------------------------------------------------------------------------------------


def answers(best: pd.DataFrame, rivals: pd.DataFrame) -> list[Answer]:
    """For each scene what to take, what it costs, and what the others cost."""
    return [_answer(mine, rivals) for _, mine in best.groupby("scene", sort=False)]


def _answer(best: pd.DataFrame, rivals: pd.DataFrame) -> Answer:
    """Of one scene, for the target error that sentences speak of."""
    target = headline(best)
    line = best[best["target_error"] == target].iloc[0].to_dict()
    question = f"{line['scene']}: what to take for an error of {target:g}?"
    if line["status"] != "ok":
        return Answer(question, f"error {error_text(line)}", f"{line['status']}: {setting_of(line)}.")
    others = _against(rivals[rivals["scene"] == line["scene"]], target)
    known = f"its error is {known_error(line)}"
    take = "; ".join(filter(None, (f"Take {setting_of(line)}: {known}", others)))
    return Answer(question, f"{milliseconds(line['cpu_s'])} of CPU time", f"{take}.")


def headline(best: pd.DataFrame) -> float:
    """The target error that sentences speak of."""
    return TARGET if (best["target_error"] == TARGET).any() else float(best["target_error"].min())


def _against(rivals: pd.DataFrame, target: float) -> str:
    """How much more the other kinds cost, as a range over the scenes."""
    # the cheapest itself, of ratio 1, is none of the others
    others = (rivals["ratio"] > 1.0) & (rivals["ratio_at_error"] > 1.0)
    sound = rivals[(rivals["target_error"] == target) & (rivals["status"] == "ok") & others]
    own = sound["solver"] == "anctmm"
    kinds = {
        "explicit steps": own & (sound["stepping"] == "explicit") & (sound["element"] == "cable"),
        "steps of fourth order": own & (sound["stepping"] == STEPPING["esdirk"]),
        "error-controlled steps": own
        & sound["stepping"].str.contains("controlled")
        & (sound["element"] == "cable"),
        "shear elements": own & (sound["stepping"] == "implicit") & (sound["element"] == "shear"),
        "the sparse global solver": (sound["solver"] == "global-dae") & (sound["stepping"] == "implicit"),
        "Exudyn": (sound["solver"] == "exudyn-cable") & (sound["stepping"] == "implicit"),
    }
    cheapest = {name: sound[mine].groupby("scene")["ratio_at_error"].min() for name, mine in kinds.items()}
    parts = [f"{name} {_range(ratios)}" for name, ratios in cheapest.items() if len(ratios)]
    return (
        f"at exactly that error the cheapest of other kinds cost more: {', '.join(parts)} times"
        if parts
        else ""
    )


def where_high_order_pays(rivals: pd.DataFrame) -> list[str]:
    """For each scene the target errors at which our steps of fourth order cost less than those of second order.

    Each with the cheaper one of cubic and quintic cables.
    """
    said = []
    names = STEPPING["generalized-alpha"], STEPPING["esdirk"]
    cables = rivals["element"].isin(["cable", "quintic"])
    ours = rivals[(rivals["solver"] == "anctmm") & cables & (rivals["status"] == "ok")]
    for scene, mine in ours.groupby("scene", sort=False):
        second, fourth = (
            mine[mine["stepping"] == name].groupby("target_error")["cpu_s_at_error"].min() for name in names
        )
        if fourth.empty:
            continue
        ratios = {
            float(t): float(second[t] / fourth[t])
            for t in sorted(set(second.index) & set(fourth.index), reverse=True)
        }
        parts = ", ".join(f"{times(ratio)} at {target:g}" for target, ratio in ratios.items())
        alone = sorted(set(fourth.index) - set(second.index), reverse=True)
        met = f"; it alone meets {', '.join(f'{t:g}' for t in alone)}" if alone else ""
        paying = [t for t in ratios if all(ratio > 1.0 for other, ratio in ratios.items() if other <= t)]
        pays = (
            f"pays from a target error of {max(paying):g} on"
            if paying
            else "does not pay at the target errors"
        )
        if parts or alone:
            said.append(
                f"{scene}: fourth order in time {pays if parts else 'has no rival'} (cost of second order over that of "
                f"fourth, at equal error: {parts or '-'}{met})."
            )
    return said


def _range(values: pd.Series) -> str:
    low, high = times(values.min()), times(values.max())
    return low if low == high else f"{low} to {high}"


def _sources(points: pd.DataFrame) -> str:
    shares = points[points["excess"] == 1.0]["error_from"].value_counts(normalize=True)
    if shares.empty:
        return ""
    words = {"mesh": "the mesh", "step": "the step", "both": "both alike", "-": "an unknown part"}
    parts = ", ".join(f"{words[str(k)]} for {100 * v:.0f} %" for k, v in shares.items())
    return f"Of the settings on the front the error comes from {parts}."


def _models(known: pd.DataFrame) -> str:
    """How far apart the models of the two elements are."""
    apart = known[(known["element"] == "shear") & (known["from_cable"] > 0)]
    if apart.empty:
        return ""
    parts = ", ".join(f"{r['from_cable']:.2g} apart on the {r['scene']}" for r in records(apart))
    return (
        f"Cable and shear elements are two models, {parts}: the element is chosen for the model, and an error is that "
        "of computing it."
    )


def findings(points: pd.DataFrame, best: Table, rivals: Table, known: Table) -> list[str]:
    """Sentences from the tables."""
    said = [
        f"{r['scene']}, error {r['target_error']:g}: {setting_of(r)}: {milliseconds(r['cpu_s'])}, measured error "
        f"{error_text(r)} ({parts_of(r)})."
        if r["status"] == "ok"
        else f"{r['scene']}, error {r['target_error']:g}: {r['status']} ({error_text(r)})."
        for r in records(best.frame)
    ]
    said += filter(
        None,
        [
            *map(str, answers(best.frame, rivals.frame)),
            *where_high_order_pays(rivals.frame),
            _models(known.frame),
            _sources(points),
        ],
    )
    if failures := len(failed(points)):
        said.append(f"{failures} of {len(points)} runs did not end well; their rows say why.")
    return said
