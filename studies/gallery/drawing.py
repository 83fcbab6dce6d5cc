"""What the pictures of the gallery share: bodies at several times, the later the darker, and paths of places."""

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from anctmm.results.export.pictures import LOOKS, MARKS
from anctmm.results.export.shapes import shapes_of, supports_of
from anctmm.results.solution import Solution
from studies.report.plots import INK, PALETTE

Array = NDArray[np.float64]

BLUE, RED, GREEN = PALETTE[0], PALETTE[1], PALETTE[2]
FAINT = "#8a8a92"
#: From pale to strong.
FADE = mpl.colors.LinearSegmentedColormap.from_list("fade", ["#d3e6f3", "#6fb0dc", BLUE, "#003a5c"])
#: Opaque, so that lines below do not cross letters.
BEHIND = {"facecolor": "#fffffe", "edgecolor": "none", "pad": 1.2}


def at_times(solution: Solution, times: Sequence[float] | Array) -> list[int]:
    """The outputs nearest to some times."""
    return [int(np.abs(solution.t - t).argmin()) for t in times]


def bodies(
    axes: Axes,
    solution: Solution,
    outputs: Sequence[int],
    colours: Sequence[Any] | None = None,
    names: Any = None,
) -> None:
    """Draw bodies at some outputs, later ones darker, and the supports; springs at the last output.

    Parameters
    ----------
    axes : Axes
    solution : Solution
    outputs : sequence of int
    colours : sequence of colour, optional
        One for each output.
    names : collection of str, optional
        Bodies that are drawn; all without it.
    """
    shades = colours or [FADE(x) for x in np.linspace(0.0, 1.0, len(outputs))]
    for number, (k, colour) in enumerate(zip(outputs, shades, strict=True)):
        last = number == len(outputs) - 1
        for shape in shapes_of(solution):
            if (not shape.name and not last) or (names is not None and shape.name not in names):
                continue
            look = {"color": colour, "zorder": 2 + 0.01 * number, **LOOKS[shape.kind]}
            axes.plot(*shape.points[k].T, **look)
            if shape.kind == "rigid":
                axes.fill(*shape.points[k].T, color=colour, alpha=0.25, lw=0)
    for support in supports_of(solution.scene):
        axes.plot(*support.position, MARKS[support.kind], color=INK, ms=7, zorder=4)


def plane(axes: Axes, title: str = "", margin: float = 0.06) -> None:
    """Equal scales, room around what is drawn, labels."""
    axes.set(xlabel="x (m)", ylabel="y (m)", title=title)
    axes.margins(margin)
    axes.set_aspect("equal", adjustable="datalim")


def path(axes: Axes, points: Array, **look: Any) -> None:
    """The way that a place takes."""
    axes.plot(*points.T, **{"color": RED, "lw": 1.1, "ls": (0, (4, 2)), "zorder": 3, **look})


def note(axes: Axes, x: float, y: float, text: str, **look: Any) -> None:
    """A text at a place, on opaque paper."""
    axes.text(x, y, text, **{"fontsize": 8.5, "bbox": BEHIND, "zorder": 6, **look})
