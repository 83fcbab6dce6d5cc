"""The cantilever: shapes at rest and while it falls, and static convergence."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from anctmm.results.solution import Solution
from studies.report.mechanism_pictures import FRACTIONS, axis_at
from studies.report.plots import (
    INK,
    PALETTE,
    Picture,
    cut_label,
    end_cross,
    endings,
    legend_below,
    picture,
    sequence_colours,
    shapes,
)


def rest_shapes(pairs: Sequence[tuple[str, Solution, Solution | None]]) -> Picture:
    """Exact shapes at rest with a solver's nodes on them: (label, exact, computed)."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for (label, exact, computed), colour in zip(pairs, sequence_colours(len(pairs)), strict=True):
            x, y = axis_at(exact, "beam", -1)
            axes.plot(x, y, color=colour, label=label)
            if computed is not None:
                points = np.array([computed.position("beam", f)[-1] for f in FRACTIONS[::5]])
                axes.plot(points[:, 0], points[:, 1], "o", color=colour, markersize=4, markerfacecolor="none")
        axes.plot([0.0], [0.0], marker="s", color=INK, markersize=7)
        axes.set(xlabel="x (m)", ylabel="y (m)", title="At rest under end loads")
        axes.set_aspect("equal", adjustable="datalim")
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))

    caption = "Static cantilever: exact shapes (lines) and the finest cable mesh (circles)."
    return picture("static_shapes", caption, draw, (7.2, 4.6))


def fall(solution: Solution, times: Sequence[float]) -> Picture:
    """The fall: shapes at a few times, and the tip over time."""
    indices = [int(np.abs(solution.t - t).argmin()) for t in times]

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        drawn = [
            (f"{solution.t[i]:.2f} s", [axis_at(solution, "beam", i)], colour)
            for i, colour in zip(indices, sequence_colours(len(indices)), strict=True)
        ]
        shapes(left, drawn, "Falling cantilever")
        tip = solution.position("beam", 1.0)
        for k, name in enumerate("xy"):
            right.plot(solution.t, tip[:, k], color=PALETTE[k], label=name)
        right.set(xlabel="time (s)", ylabel="tip position (m)", title="Tip")
        right.legend()
        legend_below(figure, [left], columns=4)

    caption = "The cantilever released under gravity: shapes, and its tip over time (reference run)."
    return picture("fall", caption, draw, (7.2, 4.2))


def tip_errors(solutions: Mapping[str, Solution], reference: Solution) -> Picture:
    """Distance of the tip from the reference's over time."""
    mine = {
        label: (
            s.t,
            1e3
            * np.linalg.norm(
                s.displacement("beam.end") - reference.displacement("beam.end")[: len(s.t)], axis=1
            ),
        )
        for label, s in solutions.items()
        if len(s.t) == len(reference.t) or (not s.status.ok and 1 < len(s.t) < len(reference.t))
    }
    cut = endings(solutions)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        positive = {label: (t[1:], np.maximum(d[1:], 1e-9)) for label, (t, d) in mine.items()}
        for k, (label, (t, away)) in enumerate(positive.items()):
            colour = PALETTE[k % len(PALETTE)]
            axes.plot(t, away, color=colour, label=cut_label(label, cut))
            if label in cut:
                end_cross(axes, t, away, colour)
        axes.set(
            xlabel="time (s)",
            ylabel="distance of tip from reference (mm)",
            title="Error over time",
            yscale="log",
        )
        legend_below(figure, [axes], columns=2)

    return picture(
        "tip_error", "How far each mesh's tip is from the reference's during the fall.", draw, (7.2, 3.8)
    )
