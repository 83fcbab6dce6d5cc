"""Distance of each choice of kinds to the richest model against its cost."""

from math import inf

import pandas as pd
from matplotlib.figure import Figure

from anctmm.results.export.pictures import literal
from studies.engine.pictures import Picture
from studies.engine.storage.files import file_name
from studies.report.plots import INK, PALETTE, PAPER, floor, legend_below, log_ticks, picture

#: Characters of a label at most.
LONGEST = 30
#: A choice is nearer than another if its distance is less than this part of the other's.
NEARER = 0.95


def cost_picture(scene: str, frame: pd.DataFrame, uncertainty: float) -> Picture | None:
    """The picture of a scene; none where no choice has a time and a distance."""
    shown = frame[frame["status"].eq("ok") & (frame["cpu_s"] > 0.0)].sort_values("cpu_s")
    shown = shown.assign(error=shown["error"].clip(lower=uncertainty if uncertainty > 0.0 else None))
    shown = shown[shown["error"] > 0.0]
    if shown.empty:
        return None
    best = shown[shown["error"] < NEARER * shown["error"].cummin().shift(fill_value=inf)]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, (integrator, runs) in enumerate(shown.groupby("integrator", sort=True)):
            axes.plot(
                runs["cpu_s"], runs["error"], "os^"[k], color=PALETTE[k], markerfacecolor="none", label=str(integrator)
            )  # fmt: skip
        axes.plot(
            best["cpu_s"], best["error"], "-", color=INK, linewidth=0.8, label="nothing cheaper is nearer"
        )
        axes.margins(x=0.25, y=0.15)
        for place, point in enumerate(best.to_dict("records")):
            text = str(point["model"])
            axes.annotate(
                literal(text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"), (point["cpu_s"], point["error"]),
                xytext=(4, 7), textcoords="offset points", fontsize=8, zorder=5 + place,
                bbox={"facecolor": PAPER, "edgecolor": "none", "alpha": 0.8, "pad": 0.6},  # markers may lie below
            )  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel="CPU time (s)", ylabel="distance to the richest model")
        if uncertainty > 0.0:
            axes.set_ylim(
                min(axes.get_ylim()[0], uncertainty / 3.0), max(axes.get_ylim()[1], 10.0 * uncertainty)
            )
            floor(axes, pd.Series([uncertainty]))
        log_ticks(axes.xaxis, *axes.get_xlim())
        log_ticks(axes.yaxis, *axes.get_ylim())
        legend_below(figure, [axes], 3)

    caption = (
        f"{scene}: every choice of kinds by beam, its distance to the richest model against CPU time; the line joins "
        "those that nothing cheaper beats. What is nearer than the richest model is known stands on the dashed line."
    )
    return picture(f"fidelity_{file_name(scene)}", caption, draw, (7.2, 4.0))
