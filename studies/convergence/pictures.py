"""Pictures of convergence: error over the mesh and over the step, a picture a case."""

from collections.abc import Iterator

import pandas as pd
from matplotlib.figure import Figure

from studies.engine.running.trial import NO_BEAMS
from studies.engine.storage.files import file_name
from studies.report.plots import DASHES, PALETTE, Picture, legend_below, log_ticks, picture

MARKERS = "os^vD"


def pictures(meshes: pd.DataFrame, steps: pd.DataFrame) -> Iterator[Picture]:
    """A picture of each scene that has errors to be drawn."""
    for scene in dict.fromkeys([*meshes["scene"], *steps["scene"]]):
        panels = [
            (rows[(rows["scene"] == scene) & (rows["error"] > 0.0)], column, label)
            for rows, column, label in (
                (meshes, "dofs", "unknown coordinates"),
                (steps, "dt", "time step (s)"),
            )
        ]
        panels = [panel for panel in panels if len(panel[0]) > 1]
        if panels:
            yield _picture(str(scene), panels)


def _picture(scene: str, panels: list[tuple[pd.DataFrame, str, str]]) -> Picture:
    def draw(figure: Figure) -> None:
        row = figure.subplots(1, len(panels), squeeze=False)[0]
        for axes, (rows, column, label) in zip(row, panels, strict=True):
            groups = rows.groupby(["solver", "element", "integrator"], sort=False)
            for k, (names, line) in enumerate(groups):
                about = ", ".join(str(name) for name in names if name != NO_BEAMS)
                axes.plot(
                    line[column], line["error"], label=about, color=PALETTE[k % len(PALETTE)],
                    marker=MARKERS[k % len(MARKERS)], markersize=4, linestyle=DASHES[k % len(DASHES)],
                )  # fmt: skip
            axes.set(xscale="log", yscale="log", xlabel=label, ylabel="relative error")
            log_ticks(axes.xaxis, *axes.get_xlim())
            log_ticks(axes.yaxis, *axes.get_ylim())
        legend_below(figure, list(row), 2)

    caption = (
        f"{scene}: distance to the finest run over mesh and step; the finest point of each line is an estimate of "
        "what is left."
    )
    return picture(f"convergence_{file_name(scene)}", caption, draw, (7.2, 3.6))
