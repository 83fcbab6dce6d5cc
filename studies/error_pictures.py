"""Pictures of errors: over meshes, over steps, and against CPU time."""

import pandas as pd
from matplotlib.figure import Figure

from studies.plots import Picture, convergence, legend_below, picture, work_precision

ELEMENT_TITLES = {"cable": "Cable elements", "shear": "Shear-deformable elements"}


def over_mesh(rows: pd.DataFrame, orders: dict[str, float]) -> Picture:
    """Error over the number of elements, each mesh at its smallest step; a panel an element kind."""
    elements = [e for e in orders if (rows["family"] == e).any()]
    finest = (
        rows[rows["error"] > 0]
        .sort_values("dt")
        .drop_duplicates(["family", "quadrature", "solver", "integrator", "elements"])
    )
    finest = finest.assign(run=finest["solver"] + ", " + finest["integrator"])

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(elements), squeeze=False)[0]
        for axes, element in zip(panels, elements, strict=True):
            mine = finest[(finest["family"] == element) & finest["quadrature"].isin(["full", "-"])]
            convergence(
                axes, mine, "run", "all_elements", "elements", -orders[element], ELEMENT_TITLES[element]
            )
        legend_below(figure, list(panels), columns=2)

    caption = (
        "Error over the mesh, each at its smallest step. Solvers with the same element and integrator lie on "
        "one another: they differ in cost, not in accuracy. Below the dashed line the reference is unknown."
    )
    return picture("convergence_mesh", caption, draw, (7.2, 4.2))


def over_step(rows: pd.DataFrame, order: float = 2.0) -> Picture:
    """Error of the implicit runs over the step, on the finest mesh; a panel an element kind."""
    implicit = rows[(rows["integrator"] == "generalized-alpha") & (rows["error"] > 0)]
    elements = [e for e in ELEMENT_TITLES if (implicit["family"] == e).any()]

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, max(len(elements), 1), squeeze=False)[0]
        for axes, element in zip(panels, elements, strict=True):
            mine = implicit[(implicit["family"] == element) & implicit["quadrature"].isin(["full", "-"])]
            mine = mine[mine["all_elements"] == mine["all_elements"].max()]
            convergence(axes, mine, "solver", "dt", "time step (s)", order, ELEMENT_TITLES[element])
        legend_below(figure, list(panels))

    caption = "Error of the generalized-α runs over the time step, on the finest mesh of the sweep."
    return picture("convergence_step", caption, draw, (7.2, 3.9))


def against_cost(rows: pd.DataFrame) -> Picture:
    """Error against CPU time, all runs; a panel an element kind."""
    elements = [e for e in ELEMENT_TITLES if ((rows["family"] == e) & (rows["error"] > 0)).any()]

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, max(len(elements), 1), squeeze=False, sharey=True)[0]
        for axes, element in zip(panels, elements, strict=True):
            work_precision(axes, rows[rows["family"] == element], ELEMENT_TITLES[element])
        for axes in panels[1:]:
            axes.set_ylabel("")
        legend_below(figure, list(panels), columns=2)

    caption = "Error against CPU time, every run of the sweep; left and down is better."
    return picture("error_cost", caption, draw, (7.2, 4.6))
