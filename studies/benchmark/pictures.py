"""Pictures of the benchmark: ratios beside their requirements, work and precision, cost against length."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from studies.benchmark.length import BASE
from studies.benchmark.peers import EXUDYN, OURS
from studies.benchmark.precision import TARGETS
from studies.engine.measuring.clock import records
from studies.engine.tables import Table
from studies.report.plots import (
    INK,
    MARKERS,
    PALETTE,
    Picture,
    floor,
    legend_below,
    picture,
    solver_colour,
    solver_marker,
)

#: Requirement and goal.
BAR, GOAL = "#1b1b1d", "#7f7f87"


def pictures(tables: Mapping[str, Table], required: Table) -> tuple[Picture, ...]:
    """All pictures."""
    frames = {name: t.frame for name, t in tables.items()}
    return (
        ratios(required.frame),
        work_and_precision(frames["work_precision"]),
        cost_of_length(frames["length"]),
        where_time_goes(frames["methods"]),
    )


def ratios(frame: pd.DataFrame) -> Picture:
    """Times less than peers, beside what is required and the goal."""
    shown = frame[frame["sense"] == "at least"].reset_index(drop=True)
    colours = {"Exudyn / ANC-TMM, explicit": PALETTE[0], "Exudyn / ANC-TMM, implicit": PALETTE[1]}

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        y = np.arange(len(shown))[::-1]
        for place, row in zip(y, records(shown), strict=True):
            colour = next((c for start, c in colours.items() if row["what"].startswith(start)), PALETTE[2])
            found, words = row["found"], f"{row['found']:.3g}"
            axes.plot([1.0, found], [place, place], color=colour, linewidth=2.2, alpha=0.6)
            axes.plot(found, place, "o", color=colour, markersize=7)
            axes.plot(row["required"], place, "|", color=BAR, markersize=13, markeredgewidth=2.2)
            axes.plot(row["goal"], place, "|", color=GOAL, markersize=13, markeredgewidth=1.4)
            axes.annotate(words, (1.01, place), xycoords=("axes fraction", "data"), va="center", fontsize=8.5)
        axes.plot([], [], "o", color=INK, label="found")
        axes.plot([], [], "|", color=BAR, markersize=12, markeredgewidth=2.2, label="required")
        axes.plot([], [], "|", color=GOAL, markersize=12, markeredgewidth=1.4, label="goal")
        axes.set(
            xscale="log", xlabel="times less CPU time than the other code (—)", ylim=(-0.7, len(shown) - 0.3)
        )
        axes.set_yticks(y, [_short(w) for w in shown["what"]])
        axes.grid(axis="y", visible=False)
        axes.set_xlim(0.9, 2.2 * float(np.nanmax(shown[["found", "required", "goal"]].to_numpy(float))))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        legend_below(figure, [axes])

    caption = (
        "CPU time of the other code over ANC-TMM's, measured in turn. Explicit: at like settings, per element and "
        "step; implicit: at equal error, both codes at their best; the last four: the four-bar by the global solver."
    )
    return picture("ratios", caption, draw, (7.6, 0.6 + 0.3 * len(shown)))


def _short(what: str) -> str:
    return (
        what.replace("Exudyn / ANC-TMM, ", "Exudyn ")
        .replace(" / ANC-TMM, explicit", "")
        .replace("cantilever-fall", "cantilever")
    )


def work_and_precision(frame: pd.DataFrame) -> Picture:
    """Fronts of error and cost of both codes, on both scenes."""
    frame = frame.assign(error=frame["robust_error"])

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, frame["scene"].nunique(), squeeze=False)[0]
        for axes, (scene, found) in zip(panels, frame.groupby("scene", sort=False), strict=True):
            for code in (OURS, EXUDYN):
                _front(axes, found[found["code"] == code], code)
            axes.set(
                xscale="log",
                yscale="log",
                xlabel="CPU time (s)",
                ylabel="relative error (—)",
                title=str(scene),
            )
            for target in TARGETS:
                axes.axhline(target, color=GOAL, linewidth=0.6, linestyle=(0, (1, 3)))
            floor(axes, found["reference_error"])
        legend_below(figure, list(panels))

    caption = (
        "Error against CPU time, each code at its best over mesh, step, quadrature, tolerance and integrator: all runs "
        "that were timed in turn, and through the best of them a line. Left and down is better; dotted, the errors at "
        "which costs are compared."
    )
    return picture("work_precision", caption, draw, (7.6, 3.9))


def _front(axes: Axes, found: pd.DataFrame, code: str) -> None:
    colour, marker = solver_colour(code), solver_marker(code)
    for integrator, runs in found.groupby("integrator", sort=False):
        hollow = integrator == "zhai"
        label = f"{'ANC-TMM' if code == OURS else 'Exudyn'}, {'explicit' if hollow else 'implicit'}"
        axes.plot(
            runs["cpu_s"], runs["error"], linestyle="none", marker=marker, color=colour, label=label, alpha=0.85,
            markerfacecolor="none" if hollow else colour, markersize=4.5,
        )  # fmt: skip
    best = found.sort_values("cpu_s")
    best = best[best["error"] < best["error"].cummin().shift(fill_value=np.inf)]
    axes.plot(best["cpu_s"], best["error"], color=colour, linewidth=1.2)


def cost_of_length(frame: pd.DataFrame) -> Picture:
    """Time and memory of an element against the number of elements."""

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        groups = frame.groupby(["element", "integrator"], sort=False)
        for i, ((element, integrator), found) in enumerate(groups):
            name = f"{element}, {'explicit' if integrator == 'zhai' else 'implicit'}"
            row, pinned = found[found["bodies"] == 1], found[found["bodies"] > 1]
            for axes, column in ((left, "ns"), (right, "bytes")):
                axes.plot(row["elements"], row[column], marker=MARKERS[i], color=PALETTE[i], label=name)
                axes.plot(
                    pinned["elements"], pinned[column], linestyle="none", marker=MARKERS[i], color=PALETTE[i],
                    markerfacecolor="none", markersize=10, label="_",
                )  # fmt: skip
            base = row[row["elements"] == BASE]["ns"].iloc[0]
            left.hlines(
                1.5 * base,
                BASE,
                row["elements"].max(),
                color=PALETTE[i],
                linewidth=0.8,
                linestyle=(0, (2, 2)),
            )
        left.plot(
            [], [], color=INK, linewidth=0.8, linestyle=(0, (2, 2)), label=f"1.5 × that at {BASE} elements"
        )
        left.plot(
            [],
            [],
            "o",
            color=INK,
            markerfacecolor="none",
            markersize=10,
            label="a chain of many pinned bodies",
        )
        right.axhline(1500.0, color=INK, linewidth=0.8, linestyle=(0, (5, 2)))
        right.annotate("required: at most 1500", (1.0, 1500.0), xycoords=("axes fraction", "data"), ha="right",
                       va="bottom", fontsize=8, xytext=(0, 2), textcoords="offset points")  # fmt: skip
        left.set(
            xscale="log",
            yscale="log",
            xlabel="elements",
            ylabel="CPU time of an element and step (ns)",
            title="Time",
        )
        right.set(
            xscale="log",
            yscale="log",
            xlabel="elements",
            ylabel="memory of an element (bytes)",
            title="Memory",
        )
        for axes in (left, right):
            _plain_ticks(axes)
        legend_below(figure, [left])

    caption = (
        "CPU time and memory (peak of all arrays beside the stored output) of an element against the number of "
        "elements in a clamped row under gravity; dashed, what is allowed."
    )
    return picture("length", caption, draw, (7.6, 4.0))


def _plain_ticks(axes: Axes) -> None:
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def where_time_goes(frame: pd.DataFrame) -> Picture:
    """Shares of a step: elastic forces, linear algebra and the rest, of each method."""
    parts: dict[str, Any] = {"ns_forces": "elastic forces", "ns_algebra": "linear algebra", "ns_rest": "rest"}

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, frame["elements"].nunique(), squeeze=False)[0]
        for axes, (elements, found) in zip(panels, frame.groupby("elements", sort=False), strict=True):
            x, width = np.arange(len(found)), 0.26
            for k, (column, label) in enumerate(parts.items()):
                axes.bar(x + (k - 1) * width, 1e-3 * found[column], width, color=PALETTE[k], label=label)
            axes.set(yscale="log", ylabel="CPU time of a step (µs)", title=f"four-bar {elements}")
            axes.set_xticks(
                x, [m.replace("-", "-\n", 1) if m != OURS else "ANC-TMM" for m in found["method"]]
            )
            axes.grid(axis="x", visible=False)
        legend_below(figure, list(panels))

    caption = (
        "Where an explicit step's time goes: the element kernels are the same, what differs is the linear algebra. "
        "Logarithmic scale; no bar where a part is lost in noise."
    )
    return picture("methods", caption, draw, (7.6, 3.6))
