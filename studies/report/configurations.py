"""A scene at a few times: its bodies by name, its springs, guides and supports."""

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from anctmm.results.export.pictures import LOOKS, MARKS, clearest, name_bodies
from anctmm.results.export.shapes import shapes_of, supports_of
from anctmm.results.solution import Solution
from studies.engine.files import file_name
from studies.engine.study import Picture
from studies.report.plots import INK, PAPER, legend_below, picture

#: Configurations that are drawn.
SHOWN = 5


def configurations(solution: Solution) -> Picture:
    """Draw all bodies of a solution with outputs at five times, earlier ones darker."""
    chosen = np.unique(np.linspace(0, len(solution.t) - 1, SHOWN).round().astype(int)).tolist()
    colours = mpl.colormaps["viridis"](np.linspace(0.2, 0.88, len(chosen)))
    shapes = shapes_of(solution)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, colour in zip(chosen, colours, strict=True):
            time = f"load × {solution.t[k]:.3g}" if solution.static else f"{solution.t[k]:.3g} s"
            for shape in (s for s in shapes if s.name or k == chosen[-1]):  # connectors at the end only
                x, y = shape.points[k].T
                axes.plot(x, y, **{"color": colour, "label": time, **LOOKS[shape.kind]})
                if shape.kind == "rigid":
                    axes.fill(x, y, color=colour, alpha=0.25, linewidth=0)
        for support in supports_of(solution.scene):
            axes.plot(*support.position, MARKS[support.kind], color=INK, markersize=8, zorder=5)
        axes.set(xlabel="x (m)", ylabel="y (m)", title="Configurations")
        axes.set_aspect("equal", adjustable="datalim")
        legend_below(figure, [axes], columns=5)
        figure.draw_without_rendering()  # the axes take their place: names know their room
        name_bodies(axes, shapes, clearest(shapes, chosen), ink=INK, paper=PAPER)

    caption = (
        f"{solution.scene.name}: configurations, with the names of the bodies where they are farthest apart. "
        "Squares: clamps; triangles: hinges on the ground; springs and guides at the last time."
    )
    return picture(f"configurations_{file_name(solution.scene.name)}", caption, draw, (7.2, 4.6))
