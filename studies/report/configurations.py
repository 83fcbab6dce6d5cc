"""A scene at a few times: its bodies by name, its springs, guides and supports."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from anctmm.results.export.pictures import LOOKS, MARKS, clearest, name_bodies
from anctmm.results.export.shapes import Shape, shapes_of, supports_of
from anctmm.results.solution import Solution
from studies.report.plots import INK, PAPER, Picture, legend_below, picture, sequence_colours

#: Configurations where no times are given.
SHOWN = 5


def configurations(
    solution: Solution, name: str, times: Sequence[float] | None = None, caption: str = ""
) -> Picture:
    """Draw all bodies at some times, earlier ones darker.

    Parameters
    ----------
    solution : Solution
        With at least one output.
    name : str
        Of the picture.
    times : sequence of float, optional
        s, or load factors; the nearest outputs are drawn. Five over the whole run without it.
    caption : str
        In place of the usual one.
    """
    wanted = np.linspace(solution.t[0], solution.t[-1], SHOWN) if times is None else np.asarray(times, float)
    chosen = sorted({int(np.abs(solution.t - t).argmin()) for t in wanted})
    shapes, colours = shapes_of(solution), sequence_colours(len(chosen))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, colour in zip(chosen, colours, strict=True):
            label = f"load × {solution.t[k]:.3g}" if solution.static else f"{solution.t[k]:.3g} s"
            _draw(axes, [s for s in shapes if s.name or k == chosen[-1]], k, colour, label)
        for support in supports_of(solution.scene):
            axes.plot(*support.position, MARKS[support.kind], color=INK, markersize=8, zorder=5)
        axes.set(xlabel="x (m)", ylabel="y (m)", title="Configurations")
        axes.set_aspect("equal", adjustable="datalim")
        legend_below(figure, [axes], columns=5)
        figure.draw_without_rendering()  # the axes take their place: names know their room
        name_bodies(axes, shapes, clearest(shapes, chosen), ink=INK, paper=PAPER)

    usual = (
        f"{solution.scene.name}: configurations, with the names of the bodies where they are farthest apart. "
        "Squares: clamps; triangles: hinges on the ground; springs and guides at the last time."
    )
    return picture(name, caption or usual, draw, (7.2, 4.6))


def _draw(axes, shapes: Sequence[Shape], k: int, colour, label: str) -> None:  # type: ignore[no-untyped-def]
    for place, shape in enumerate(shapes):
        x, y = shape.points[k].T
        axes.plot(x, y, **{"color": colour, "label": label if place == 0 else "_", **LOOKS[shape.kind]})
        if shape.kind == "beam":
            axes.plot(x[[0, -1]], y[[0, -1]], "o", color=colour, markersize=2.6)
        if shape.kind == "rigid":
            axes.fill(x, y, color=colour, alpha=0.25, linewidth=0)
