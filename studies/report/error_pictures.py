"""Pictures of errors: over meshes, over steps, and against CPU time."""

from collections.abc import Mapping
from math import isnan
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure

from anctmm.elements.kinds import KINDS, flexible
from studies.engine.tables import error_text
from studies.report.plots import (
    DASHES,
    Picture,
    convergence,
    legend_below,
    picture,
    solver_colour,
    solver_marker,
    work_precision,
)

ELEMENT_TITLES = {
    **{name: KINDS[name].title.capitalize() for name in flexible()},
    "reissner": "Reissner's rods",
}
#: Observed by theory: how the error of each element falls with the mesh.
MESH_ORDERS = {**{name: KINDS[name].order for name in flexible()}, "reissner": 2.0}
SHORT = {"generalized-alpha": "implicit", "zhai": "explicit", "esdirk": "fourth order", "static": ""}
#: Quadratures other than the first have shades of their solver's colour, half of which is one of these.
RULE_SHADES = {"reduced": "#ffffff", "lobatto": "#7f7f87"}


def styled(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows with a label and a look: colour and marker show the solver, shades the quadrature, hollow and dotted the
    explicit runs.
    """
    rule = rows["quadrature"].where(rows["quadrature"].isin(list(RULE_SHADES)), "")
    parts = pd.DataFrame(
        {"a": rows["solver"], "b": rows["integrator"].map(lambda i: SHORT.get(i, i)), "c": rule}
    )
    return rows.assign(
        tip=[_tip(line) for line in rows.to_dict("records")],
        label=[", ".join(p for p in line if p) for line in parts.itertuples(index=False)],
        colour=[_shade(solver_colour(s), r) for s, r in zip(rows["solver"], rule, strict=True)],
        marker=[solver_marker(s) for s in rows["solver"]],
        dash=[DASHES[2] if i == "zhai" else "-" for i in rows["integrator"]],
        hollow=[i == "zhai" for i in rows["integrator"]],
    )


def _shade(colour: str, rule: str) -> str:
    red, green, blue = 0.5 * (np.array(to_rgb(colour)) + to_rgb(RULE_SHADES.get(rule, colour)))
    return to_hex((float(red), float(green), float(blue)))


def _tip(line: Mapping[Any, Any]) -> str:
    step = "" if isnan(line["dt"]) else f", Δt {line['dt']:.3g} s"
    kind = SHORT.get(line["integrator"], line["integrator"])
    words = " ".join(w for w in (line["solver"], kind, f"{line['elements']} {line['element']}") if w)
    cost = f", {1e3 * line['cpu_s']:.3g} ms" if line["cpu_s"] > 0 else ""
    return f"{words}{step}: error {error_text(line)}{cost}"


def of_sweep(rows: pd.DataFrame, timed: pd.DataFrame | None, mesh: str) -> list[Picture]:
    """Errors over the mesh, over steps on one mesh if runs with several were made, and against CPU time.

    Nothing where no error is known.
    """
    if not (rows["error"] > 0).any():
        return []
    steps = [] if timed is None else [over_step(timed, mesh)]
    return [over_mesh(rows), *steps, against_cost(rows)]


def over_mesh(rows: pd.DataFrame, name: str = "convergence_mesh", caption: str = "") -> Picture:
    """Error over the number of elements, each mesh at its smallest step; a panel an element kind."""
    keys = ["family", "quadrature", "solver", "integrator", "elements"]
    finest = rows[rows["error"] > 0].sort_values("dt").drop_duplicates(keys).sort_index()
    lines = styled(_like_with_like(finest))

    def draw(figure: Figure) -> None:
        elements = _families(lines)
        panels = figure.subplots(1, len(elements), squeeze=False)[0]
        for axes, element in zip(panels, elements, strict=True):
            mine = lines[lines["family"] == element]
            convergence(
                axes, mine, "all_elements", "elements", -MESH_ORDERS[element], ELEMENT_TITLES[element]
            )
        for axes in panels[1:]:
            axes.set_ylabel("")
        legend_below(figure, list(panels))

    standard = (
        "Error over the mesh, each at its smallest step. Solvers with one element lie on one another: they differ "
        "in cost, not in accuracy. Below the dashed line the reference itself is not known."
    )
    return picture(name, caption or standard, draw, (7.2, 4.2))


def over_step(rows: pd.DataFrame, mesh: str, order: float = 2.0) -> Picture:
    """Error of the step alone, against fine steps on the same mesh; a panel an element kind."""
    lines = styled(rows[rows["error"] > 0])

    def draw(figure: Figure) -> None:
        elements = _families(lines)
        panels = figure.subplots(1, max(len(elements), 1), squeeze=False)[0]
        for axes, element in zip(panels, elements, strict=True):
            mine = lines[lines["family"] == element]
            convergence(axes, mine, "dt", "time step (s)", order, ELEMENT_TITLES[element])
        for axes in panels[1:]:
            axes.set_ylabel("")
        legend_below(figure, list(panels))

    caption = f"Error of the time step alone: {mesh} elements, against the explicit solver's finest step on that mesh."
    return picture("convergence_step", caption, draw, (7.2, 4.0))


def against_cost(rows: pd.DataFrame) -> Picture:
    """Error against CPU time, all runs; a panel an element kind."""
    points = styled(rows)

    def draw(figure: Figure) -> None:
        elements = _families(points[points["error"] > 0])
        panels = figure.subplots(1, max(len(elements), 1), squeeze=False, sharey=True)[0]
        for axes, element in zip(panels, elements, strict=True):
            work_precision(axes, points[points["family"] == element], ELEMENT_TITLES[element])
        for axes in panels[1:]:
            axes.set_ylabel("")
        legend_below(figure, list(panels))

    caption = "Error against CPU time, every run of the sweep; left and down is better. Hollow: explicit."
    return picture("error_cost", caption, draw, (7.2, 4.8))


def _families(rows: pd.DataFrame) -> list[str]:
    return [e for e in ELEMENT_TITLES if (rows["family"] == e).any()]


def _like_with_like(rows: pd.DataFrame) -> pd.DataFrame:
    """Of quadratures other than the full one, one solver's: the others' would lie on it."""
    full = rows["quadrature"].isin(["full", "-"])
    return rows[full | (rows["solver"] == rows["solver"].iloc[0])] if len(rows) else rows
