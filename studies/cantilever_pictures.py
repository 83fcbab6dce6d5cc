"""The cantilever: shapes at rest and while it falls, and static convergence."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from anctmm.solution import Solution
from studies.error_pictures import ELEMENT_TITLES
from studies.mechanism_pictures import FRACTIONS, axis_at
from studies.plots import (
    INK,
    PALETTE,
    Picture,
    convergence,
    histories,
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


def static_convergence(frame: pd.DataFrame, scene: str, orders: dict[str, float]) -> Picture:
    """Error over the mesh for one load; a panel an element kind, a line a solver or quadrature."""
    mine = frame[(frame["scene"] == scene) & (frame["error"] > 0)]
    elements = [e for e in orders if (mine["element"] == e).any()]

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, max(len(elements), 1), squeeze=False)[0]
        for axes, element in zip(panels, elements, strict=True):
            lines = mine[mine["element"] == element]
            rule = (
                lines["quadrature"]
                .where(lines["quadrature"] == "-", ", " + lines["quadrature"])
                .replace("-", "")
            )
            lines = lines.assign(run=lines["solver"] + rule)
            convergence(
                axes, lines, "run", "all_elements", "elements", -orders[element], ELEMENT_TITLES[element]
            )
        legend_below(figure, list(panels), columns=2)

    caption = (
        f"Static convergence to the exact continuum of each element ({scene}): extensible elastica for the "
        "cable, director continuum of Green strains for the shear element."
    )
    return picture("static_convergence", caption, draw, (7.2, 4.4))


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
        left.legend(loc="lower left", fontsize=7.5, handlelength=1.2)
        tip = solution.position("beam", 1.0)
        for k, name in enumerate("xy"):
            right.plot(solution.t, tip[:, k], color=PALETTE[k], label=name)
        right.set(xlabel="time (s)", ylabel="tip position (m)", title="Tip")
        right.legend()

    caption = "The cantilever released under gravity: shapes, and its tip over time (reference run)."
    return picture("fall", caption, draw, (7.2, 3.8))


def tip_errors(solutions: Mapping[str, Solution], reference: Solution) -> Picture:
    """Distance of the tip from the reference's over time."""
    mine = {
        label: (
            s.t,
            1e3 * np.linalg.norm(s.displacement("beam.end") - reference.displacement("beam.end"), axis=1),
        )
        for label, s in solutions.items()
        if len(s.t) == len(reference.t)
    }

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        positive = {label: (t[1:], np.maximum(d[1:], 1e-9)) for label, (t, d) in mine.items()}
        histories(axes, positive, "time (s)", "distance of tip from reference (mm)", "Error over time")
        axes.set_yscale("log")
        legend_below(figure, [axes], columns=2)

    return picture(
        "tip_error", "How far each mesh's tip is from the reference's during the fall.", draw, (7.2, 3.8)
    )
