"""Pictures as reproducible SVG: colours, markers, axes and legends that all studies share."""

import io
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anctmm.solvers import registry
from studies.engine.files import atomic_write
from studies.engine.study import Picture

#: Ink, grid and paper: the page replaces these three by its theme's.
INK, GRID, PAPER = "#1b1b1d", "#d5d5da", "#fffffe"
#: Okabe & Ito's palette, distinguishable for colour-blind readers; without the yellow, too pale on paper.
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#8c6d5a", "#7f7f87")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.6)), (0, (7, 2, 1.2, 2)))
STYLE: Any = {
    "svg.fonttype": "none", "font.family": ["DejaVu Sans"], "font.size": 9.5, "axes.titlesize": 10,
    "axes.titleweight": "bold", "axes.titlelocation": "left", "axes.spines.top": False, "axes.spines.right": False,
    "axes.edgecolor": INK, "axes.labelcolor": INK, "axes.facecolor": PAPER, "axes.grid": True, "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=PALETTE), "axes.formatter.use_mathtext": False, "grid.color": GRID,
    "grid.linewidth": 0.6, "text.color": INK, "xtick.color": INK, "ytick.color": INK, "figure.facecolor": PAPER,
    "figure.constrained_layout.use": True, "savefig.facecolor": PAPER, "legend.frameon": False,
    "legend.fontsize": 8.5, "lines.linewidth": 1.6, "lines.markersize": 5,
}  # fmt: skip


def picture(
    name: str, caption: str, draw: Callable[[Figure], None], size: tuple[float, float] = (7.0, 3.6)
) -> Picture:
    """Draw on a new figure of a size, inch, and return it as SVG."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=size)
        draw(figure)
        return as_picture(name, caption, figure)


def as_picture(name: str, caption: str, figure: Figure) -> Picture:
    """A figure as SVG; the name is also the salt of the ids inside, so that two pictures on one page share none."""
    stream = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name, "svg.fonttype": "none"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    # matplotlib leaves blanks at line ends, which every version control tool complains about
    return Picture(name, caption, re.sub(r"[ \t]+$", "", stream.getvalue(), flags=re.MULTILINE))


def write_picture(shown: Picture, folder: Path) -> None:
    """`<name>.svg`."""
    atomic_write(folder / f"{shown.name}.svg", shown.svg)


def look_of(solver: str) -> dict[str, Any]:
    """Colour and marker of a solver in every picture, by its place among all that are registered."""
    names = registry.names()
    place = names.index(solver) if solver in names else sum(solver.encode())
    return {"color": PALETTE[place % len(PALETTE)], "marker": MARKERS[place % len(MARKERS)], "markersize": 4}


def log_axes(figure: Figure, axes: Sequence[Axes], labels: Sequence[tuple[str, str]]) -> None:
    """Logarithmic axes with their labels, and one legend below all."""
    for panel, (xlabel, ylabel) in zip(axes, labels, strict=True):
        panel.set(xscale="log", yscale="log", xlabel=xlabel, ylabel=ylabel)
        panel.tick_params(axis="x", which="minor", labelrotation=45, labelsize="x-small")
    legend_below(figure, axes)


def floor(axes: Axes, uncertainty: float) -> None:
    """A line at the uncertainty of the reference."""
    if uncertainty > 0.0:
        look: Any = {"color": "#7f7f87", "linewidth": 1.0, "linestyle": (0, (2, 2))}
        axes.axhline(uncertainty, label="uncertainty of the reference", **look)


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int = 3) -> None:
    """One legend for several panels, outside of them."""
    entries: dict[str, Any] = {}
    for panel in axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    if entries:
        figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=columns)
