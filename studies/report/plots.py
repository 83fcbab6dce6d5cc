"""Pictures as reproducible SVG: colours, markers, ticks and legends that all studies share."""

import io
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

from anctmm.solvers import registry
from studies.engine.files import atomic_write
from studies.engine.pictures import Picture

__all__ = ["Picture", "picture", "write_picture"]

#: Ink, grid and paper: the page replaces these three by its theme's.
INK, GRID, PAPER = "#1b1b1d", "#d5d5da", "#fffffe"
#: Ink on dark and on pale cells: the same in both themes of the page, as the cells are.
ON_DARK, ON_PALE = "#fffffd", "#101012"
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
    name: str, caption: str, draw: Callable[[Figure], None], size: tuple[float, float] = (7.0, 3.6),
    alone: bool = False, source: str | None = None,
) -> Picture:  # fmt: skip
    """Draw on a new figure and return it as SVG.

    Parameters
    ----------
    name : str
        Also the salt of the ids inside, so that two pictures on one page share none.
    caption : str
    draw : callable
        Draws on the figure it is given.
    size : (float, float)
        inch.
    alone : bool
        Letters as outlines, for pictures that are shown where no font is known; else as text.
    source : str, optional
        Origin, for its metadata.
    """
    with mpl.rc_context(STYLE | {"svg.hashsalt": name, "svg.fonttype": "path" if alone else "none"}):
        figure = Figure(figsize=size)
        draw(figure)
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None, "Source": source})
    # matplotlib leaves blanks at line ends, which every version control tool complains about
    return Picture(name, caption, re.sub(r"[ \t]+$", "", stream.getvalue(), flags=re.MULTILINE))


def write_picture(shown: Picture, folder: Path) -> None:
    """`<name>.svg`."""
    atomic_write(folder / f"{shown.name}.svg", shown.svg)


def solver_colour(name: str) -> str:
    """The colour of a solver in every picture, by its place among all that are registered."""
    return PALETTE[_number(name) % len(PALETTE)]


def solver_marker(name: str) -> str:
    """The marker of a solver in every picture."""
    return MARKERS[_number(name) % len(MARKERS)]


def _number(name: str) -> int:
    names = registry.names()
    return names.index(name) if name in names else sum(name.encode())


def sequence_colours(n: int) -> list[Any]:
    """`n` colours in an order the eye sees, legible on light and dark paper."""
    return [mpl.colormaps["viridis"](x) for x in np.linspace(0.2, 0.88, n)]


def log_ticks(axis: Axis, low: float, high: float) -> None:
    """Ticks of a logarithmic axis that are few, and at least two."""
    narrow = np.floor(np.log10(high)) - np.ceil(np.log10(low)) < 1  # fewer than two powers of ten
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,), numticks=9))
    axis.set_minor_formatter(NullFormatter())
    shown = [s * 10.0**k for k in range(-30, 30) for s in (1.0, 2.0, 5.0) if low <= s * 10.0**k <= high]
    if len(shown) < 2:  # the locator above would fall back to many ticks whose labels overlap
        axis.set_major_locator(MaxNLocator(nbins=3))
        axis.set_minor_locator(NullLocator())
    if narrow:
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def floor(axes: Axes, uncertainties: pd.Series, side: str = "right") -> None:
    """A line at the uncertainty of the reference, where it is not far below everything drawn."""
    known = uncertainties[uncertainties > 0.0]
    if known.empty:
        return
    level = float(known.max())
    if level < axes.get_ylim()[0] / 30.0:
        return
    axes.axhline(level, color="#7f7f87", linewidth=1.0, linestyle=(0, (2, 2)))
    place = (0.99 if side == "right" else 0.01, level)
    axes.annotate(
        "uncertainty of the reference", place, xycoords=("axes fraction", "data"), ha=side, va="bottom",
        fontsize=7.5, color=INK,
    )  # fmt: skip


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int = 3) -> None:
    """One legend for several panels, outside of them."""
    entries: dict[str, Any] = {}
    for panel in axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside lower center",
        ncols=min(columns, max(len(entries), 1)),
    )
