"""Summary of the trade for the results page: the recommended setting for each scene and target error, and why."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from studies.engine.measuring.clock import records
from studies.engine.running.trial import NO_BEAMS
from studies.engine.tables import Table, error_text, times
from studies.trade.choice import CONTROLLED, stepping

#: What another way to step is called beside the one chosen.
OTHER_STEPS = {
    "explicit": "explicit steps",
    "implicit": "fixed steps of second order",
    "implicit, error-controlled": "error-controlled steps",
    "implicit, fourth order": "steps of fourth order",
    "implicit, fourth order, error-controlled": "error-controlled steps of fourth order",
}
PARTS = {
    "mesh": "the mesh's part {mesh} outweighs the step's {step}",
    "step": "the step's part {step} outweighs the mesh's {mesh}",
    "both": "mesh {mesh} and step {step} in balance",
}


def advice(best: pd.DataFrame, rivals: pd.DataFrame) -> Table:
    """The recommended settings to be read, with the reason.

    Parameters
    ----------
    best, rivals : DataFrame
        `recommended` and `by_rival` of the trade.
    """
    notes = (
        "The cheapest measured setting that surely meets the error: its own and its reference's uncertainty together "
        "are below the target. Elements as 2/6/2 are those of the scene's beams, in their order; a step may be driven "
        "by an error's tolerance instead.",
        "Why: where its error comes from, which says what to refine next, and how many times more the cheapest "
        "measured settings of other kinds cost for that error: other steps or elements of one solver, other solvers.",
        "`anctmm recommend SCENE --error E` prints the script that runs it, and its runners-up.",
    )
    return Table(
        "advice", "What to take for a target error, and why", pd.DataFrame(_rows(best, rivals)), notes
    )


def _rows(best: pd.DataFrame, rivals: pd.DataFrame) -> list[dict[str, Any]]:
    rows = []
    for line in records(best):
        rule = "" if line["quadrature"] in ("full", "-") else f", {line['quadrature']}"
        step = f"tolerance {line['tolerance']:g}" if line["tolerance"] > 0 else f"{1e3 * line['dt']:.3g} ms"
        kind, no_beams = _stepping(line), line["elements"] == NO_BEAMS
        rows.append({
            "scene": line["scene"], "target_error": line["target_error"], "solver": line["solver"],
            "element": NO_BEAMS if no_beams else line["element"] + rule, "elements": line["elements"],
            "step": f"{kind.removesuffix(CONTROLLED)}, {step}",
            "error": _rounded(line["error"]), "reference_error": _rounded(line["reference_error"]),
            "cpu_ms": _rounded(1e3 * line["cpu_s"]),
            "why": _why(line, kind, rivals) if line["status"] == "ok" else line["status"],
        })  # fmt: skip
    return rows


def _why(line: Mapping[Any, Any], kind: str, rivals: pd.DataFrame) -> str:
    others = rivals[
        (rivals["scene"] == line["scene"]) & (rivals["target_error"] == line["target_error"])
        & (rivals["status"] == "ok")
    ]  # fmt: skip
    mesh, step = (error_text(line, f"{part}_error", ".1g") for part in ("mesh", "step"))
    part = PARTS.get(line["error_from"], "").format(mesh=mesh, step=step)
    if line["elements"] == NO_BEAMS:
        part = f"the whole error is the step's, {step}"
    costs = ", ".join(f"{name} {times(ratio)}×" for name, ratio in _costs(line, kind, others))
    return "; ".join(filter(None, (part, costs or "no other kind measured reaches this error")))


def _costs(line: Mapping[Any, Any], kind: str, others: pd.DataFrame) -> list[tuple[str, float]]:
    """Other kinds and how many times more they cost, the cheapest first."""
    own = others["solver"] == line["solver"]
    same_element, same_stepping = others["element"] == line["element"], others["stepping"] == kind
    stepped = others[own & same_element & ~same_stepping]
    shaped = others[own & ~same_element & same_stepping]
    peers = others[~own].sort_values("ratio").drop_duplicates("solver")
    found = [
        *((OTHER_STEPS.get(r["stepping"], r["stepping"]), r["ratio"]) for r in records(stepped)),
        *((f"{r['element']} elements", r["ratio"]) for r in records(shaped)),
        *((r["solver"], r["ratio"]) for r in records(peers)),
    ]
    return sorted(found, key=lambda f: f[1])


def _stepping(line: Mapping[Any, Any]) -> str:
    return str(stepping(pd.DataFrame([line])).iloc[0])


def _rounded(value: float) -> float:
    """Two digits: more would be noise to whoever chooses a setting; the other tables have them."""
    return float(f"{value:.2g}")
