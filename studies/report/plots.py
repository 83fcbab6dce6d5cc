"""Pictures as reproducible SVG: what the studies draw, and how it looks."""

import io
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote, unquote

import matplotlib as mpl
import numpy as np
import pandas as pd
from cycler import cycler
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from anctmm.results.solution import Solution
from studies.engine.pictures import Picture
from studies.engine.storage.files import atomic_write

Array = NDArray[np.float64]
Curve = tuple[Array, Array]
NOTHING_CUT: Mapping[str, str] = MappingProxyType({})

#: Ink, grid and paper: the page replaces these three by its theme's.
INK, GRID, PAPER = "#1b1b1d", "#d5d5da", "#fffffe"
#: Ink on dark and on pale cells: the same in both themes of the page, as the cells are.
ON_DARK, ON_PALE = "#fffffd", "#101012"
#: Okabe & Ito's palette, distinguishable for colour-blind readers; without the yellow, too pale on paper.
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#8c6d5a", "#7f7f87")
#: One colour a solver in every picture; others take what is left.
SOLVER_COLOURS = {
    "anctmm": PALETTE[0],
    "global-dae": PALETTE[1],
    "exudyn-cable": PALETTE[2],
    "global-dae-dense": PALETTE[3],
    "exudyn-reissner": PALETTE[5],
    "pyelastica": PALETTE[6],
    "opensees": PALETTE[4],
}
#: Begins the id of a group whose markers have texts.
TIPS = "tips:"
#: One of each known solver, and the last of all others.
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1.2, 1.6)), (0, (7, 2, 1.2, 2)))
STYLE: Any = {
    "svg.fonttype": "none",
    "font.family": ["DejaVu Sans"],
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.facecolor": PAPER,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "axes.prop_cycle": cycler(color=PALETTE),
    "axes.formatter.use_mathtext": False,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "figure.facecolor": PAPER,
    "figure.constrained_layout.use": True,
    "savefig.facecolor": PAPER,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.6,
    "lines.markersize": 5,
}


def picture(
    name: str,
    caption: str,
    draw: Callable[[Figure], None],
    size: tuple[float, float] = (7.0, 3.6),
    alone: bool = False,
    source: str | None = None,
) -> Picture:
    """Draw on a new figure and keep it as SVG.

    Parameters
    ----------
    name : str
        Also the salt of the ids inside, so that two pictures on one page share none.
    caption : str
        What is to be seen.
    draw : callable
        Draws on the figure it is given.
    size : (float, float)
        inch.
    alone : bool
        Letters as outlines, for pictures that are shown where no font is known; else as text, which a page can search.
    source : str, optional
        What it was made of, kept in its metadata.
    """
    with mpl.rc_context(STYLE | {"svg.hashsalt": name, "svg.fonttype": "path" if alone else "none"}):
        figure = Figure(figsize=size)
        draw(figure)
        stream = io.StringIO()
        figure.savefig(stream, format="svg", metadata={"Date": None, "Source": source})
    # matplotlib leaves blanks at line ends, which every version control tool complains about
    svg = re.sub(r"[ \t]+$", "", stream.getvalue(), flags=re.MULTILINE)
    return Picture(name, caption, _titled(svg))


def tell(artist: Artist, tips: Iterable[str]) -> None:
    """Give the markers of an artist texts that a reader sees on pointing at them."""
    artist.set_gid(TIPS + quote(json.dumps(list(tips)), safe=""))


def _titled(svg: str) -> str:
    """The texts of `tell`, as titles of the markers they belong to."""
    first, *groups = re.split(rf'<g id="{TIPS}(.*?)">', svg)
    parts = [first]
    for k, (tips, group) in enumerate(zip(groups[::2], groups[1::2], strict=True)):
        texts = json.loads(unquote(tips))
        pieces = re.split(r"(<use [^>]*)/>", group, maxsplit=len(texts))
        # pieces: before, marker, before the next, marker, …, what follows the last
        for i, words in enumerate(texts[: len(pieces) // 2]):
            pieces[2 * i + 1] += f"><title>{escape(words)}</title></use>"
        parts.append(f'<g id="tips_{k}">' + "".join(pieces))
    return "".join(parts)


def write_picture(shown: Picture, folder: Path) -> None:
    """`<name>.svg`."""
    atomic_write(folder / f"{shown.name}.svg", shown.svg)


def solver_colour(name: str) -> str:
    """The colour a solver has in every picture."""
    others = [c for c in PALETTE if c not in SOLVER_COLOURS.values()]
    return SOLVER_COLOURS.get(name) or others[sum(name.encode()) % len(others)]


def solver_marker(name: str) -> str:
    """The marker a solver has in every picture."""
    known = list(SOLVER_COLOURS)
    return MARKERS[known.index(name)] if name in known else MARKERS[-1]


# --- histories and shapes ----------------------------------------------------------------------------------


def histories(
    axes: Axes,
    curves: Mapping[str, Curve],
    x_label: str,
    y_label: str,
    title: str = "",
    cut: Mapping[str, str] = NOTHING_CUT,
) -> None:
    """Curves over time, the last one thin and black: what the others should be.

    Parameters
    ----------
    axes : Axes
        Drawn on.
    curves : mapping of label to (x, y)
    x_label, y_label, title : str
        Texts.
    cut : mapping of label to str
        How a history ended that is not whole: its curve ends in a cross, and its label says so.
    """
    for i, (label, (x, y)) in enumerate(curves.items()):
        last = i == len(curves) - 1 and i > 0 and label not in cut
        colour = INK if last else PALETTE[i % len(PALETTE)]
        axes.plot(
            x, y, label=cut_label(label, cut), color=colour,
            linestyle="-" if last else DASHES[i % len(DASHES)],
            linewidth=0.9 if last else 1.9,
        )  # fmt: skip
        if label in cut:
            end_cross(axes, x, y, colour)
    axes.set(xlabel=x_label, ylabel=y_label, title=title)


def cut_label(label: str, cut: Mapping[str, str]) -> str:
    """A curve's label, with how it ended if it is not whole."""
    return f"{label} ✕ {cut[label]}" if label in cut else label


def end_cross(axes: Axes, x: Array, y: Array, colour: Any) -> None:
    """A cross where a history ends before its time."""
    axes.plot(x[-1:], y[-1:], "x", color=colour, markersize=8, markeredgewidth=2.2, zorder=6)


def endings(solutions: Mapping[str, Solution]) -> dict[str, str]:
    """How the solutions ended that are not whole, for labels."""
    return {
        label: f"{s.status.code} at {s.t[-1] if s.status.time is None else s.status.time:.3g} s"
        for label, s in solutions.items()
        if not s.status.ok
    }


def shapes(axes: Axes, curves: Iterable[tuple[str, Sequence[Curve], Any]], title: str = "") -> None:
    """Configurations in the plane: (label, body axes, colour) each."""
    for label, lines, colour in curves:
        for i, (x, y) in enumerate(lines):
            axes.plot(x, y, color=colour, label=label if i == 0 else "_", linewidth=1.8)
            axes.plot(x[[0, -1]], y[[0, -1]], "o", color=colour, markersize=2.6)
    axes.set(xlabel="x (m)", ylabel="y (m)", title=title)
    axes.set_aspect("equal", adjustable="datalim")


def sequence_colours(n: int) -> list[Any]:
    """`n` colours in an order the eye sees, legible on light and dark paper."""
    return [mpl.colormaps["viridis"](x) for x in np.linspace(0.2, 0.88, n)]


# --- errors ------------------------------------------------------------------------------------------------


def convergence(axes: Axes, lines: pd.DataFrame, x: str, x_label: str, order: float, title: str) -> None:
    """Error over a refinement, with a slope triangle and the reference's floor.

    Parameters
    ----------
    axes : Axes
        Drawn on.
    lines : DataFrame
        With columns `x`, "error", "reference_error", and "label", "colour", "marker", "dash", one line a label.
    x : str
        Column of the refinement.
    x_label, title : str
        Texts.
    order : float
        Slope of the triangle: positive if errors fall with x falling, negative if with x rising.
    """
    shown = lines[lines["error"] > 0.0].sort_values(x)
    told = "tip" in shown
    groups = list(shown.groupby("label", sort=False))
    for i, (label, line) in enumerate(groups):
        style = line.iloc[0]
        (drawn,) = axes.plot(
            line[x],
            line["error"],
            label=str(label),
            color=style["colour"],
            marker=style["marker"],
            linestyle=style["dash"],
            # lines that coincide: the later ones smaller and on top, so that all are seen
            markersize=max(8.5 - 1.3 * i, 3.5),
            linewidth=max(2.6 - 0.4 * i, 0.9),
            markerfacecolor="none" if i % 2 else style["colour"],
        )
        if told:
            tell(drawn, line["tip"])
    axes.set(xscale="log", yscale="log", xlabel=x_label, ylabel="relative error", title=title)
    if not groups:
        return
    lowest = min((line for _, line in groups), key=lambda line: line["error"].min())
    slope_triangle(axes, lowest[x].to_numpy(float), lowest["error"].to_numpy(float), order)
    floor(axes, shown["reference_error"], "left" if order < 0 else "right")
    log_ticks(axes.yaxis, *axes.get_ylim())
    sizes = sorted(shown[x].unique())
    if len(sizes) <= 8 and sizes[-1] <= 64 * sizes[0]:
        # ticks at the values that were run, not at powers of ten
        axes.set_xticks(list(sizes), [f"{s:g}" for s in sizes])
        axes.xaxis.set_minor_locator(NullLocator())


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
    """A line below which the reference itself is not known."""
    known = uncertainties[uncertainties > 0.0]
    if known.empty:
        return
    level = float(known.max())
    low, _ = axes.get_ylim()
    place = 0.99 if side == "right" else 0.01
    if level < low / 30.0:  # far below everything drawn: a line would only squeeze the curves
        words = f"reference known to {level:.0e}"
        axes.text(place, 0.015, words, transform=axes.transAxes, fontsize=7.5, color=INK, ha=side)
        return
    # down to the axis wherever that ends in the end: a plain artist does not move it, half the level's room does
    grey = Rectangle(
        (0.0, 1e-30), 1.0, level, transform=axes.get_yaxis_transform(), color="#7f7f87", alpha=0.15
    )
    grey.set_linewidth(0.0)
    axes.add_artist(grey)
    axes.update_datalim([(0.0, level / 2.0)], updatex=False)
    axes.autoscale_view(scalex=False)
    axes.axhline(level, color="#7f7f87", linewidth=1.0, linestyle=(0, (2, 2)))
    # a slope's name may stand at the line on the left: there the words stand at the bottom
    bottom = side == "left"
    axes.annotate(
        "reference's own uncertainty",
        (place, 0.015 if bottom else level),
        xycoords="axes fraction" if bottom else ("axes fraction", "data"),
        ha=side,
        va="bottom" if bottom else "top",
        fontsize=7.5,
        color=INK,
        xytext=(0, -2),
        textcoords="offset points",
    )


def slope_triangle(axes: Axes, x: Array, y: Array, order: float) -> None:
    """A small triangle of the given slope below the finest part of a curve."""
    keep = np.argsort(x) if order < 0 else np.argsort(x)[::-1]
    x, y = x[keep], y[keep]
    if x.size < 2:
        return
    # the middle half of the last refinement, a little below the curve
    coarse, fine = x[-2] ** 0.75 * x[-1] ** 0.25, x[-2] ** 0.25 * x[-1] ** 0.75
    foot = y[-2] ** 0.25 * y[-1] ** 0.75 * 0.5
    head = foot * (coarse / fine) ** order
    axes.fill([coarse, coarse, fine], [foot, head, foot], color=INK, alpha=0.25, linewidth=0)
    axes.annotate(
        f"slope {order:g}".replace("-", "−"),
        (np.sqrt(coarse * fine), foot),
        fontsize=7.5,
        color=INK,
        ha="center",
        va="top",
        xytext=(0, -2),
        textcoords="offset points",
    )
    axes.update_datalim([(fine, foot / 2.0)])  # room for the words
    axes.autoscale_view()


def work_precision(axes: Axes, points: pd.DataFrame, title: str = "", bounded: bool = True) -> None:
    """Error against CPU time, with the columns of `convergence`; down and left is better.

    With a column "tip" the markers have texts, with a column "alpha" they are more or less seen, least seen first.
    `bounded`: whether the reference's floor is drawn.
    """
    shown = points[(points["error"] > 0.0) & (points["cpu_s"] > 0.0)]
    size = 3.6 if len(shown) > 300 else 5.0
    if "alpha" not in shown:
        shown = shown.assign(alpha=0.9)
    shown = shown.sort_values("alpha", kind="stable")
    for (label, _), found in shown.groupby(["label", "alpha"], sort=False):
        style = found.iloc[0]
        (drawn,) = axes.plot(
            found["cpu_s"],
            found["error"],
            linestyle="none",
            marker=style["marker"],
            markersize=size,
            color=style["colour"],
            markerfacecolor="none" if style["hollow"] else style["colour"],
            label=str(label),
            alpha=style["alpha"],
        )
        if "tip" in found:
            tell(drawn, found["tip"])
    axes.set(xscale="log", yscale="log", xlabel="CPU time (s)", ylabel="relative error", title=title)
    if not shown.empty:
        if bounded:
            floor(axes, shown["reference_error"])
        log_ticks(axes.xaxis, *axes.get_xlim())
        log_ticks(axes.yaxis, *axes.get_ylim())


def front_line(axes: Axes, cpu_s: Iterable[float], error: Iterable[float]) -> None:
    """A staircase: the smallest error that each time buys."""
    axes.step(
        list(cpu_s),
        list(error),
        where="post",
        color=INK,
        linewidth=1.4,
        zorder=3,
        label="Pareto front, all elements",
    )


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int = 3) -> None:
    """One legend for several panels, outside of them."""
    entries: dict[str, Any] = {}
    for panel in axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    legend = figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside lower center",
        ncols=min(columns, max(len(entries), 1)),
    )
    for shown in legend.legend_handles:
        if shown is not None:
            shown.set_alpha(1.0)  # whatever is faded in the picture
