"""What no frame of an animation changes, drawn once."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from anctmm.results.export.tables import needed

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes


def draw_background(axes: "Axes", moving: Iterable["Artist"]) -> None:
    """Replace all that no frame changes by a picture of it, and keep the layout that it has.

    To find the layout and to write the numbers of the axes in each frame took three quarters of an animation's time.

    Parameters
    ----------
    axes : Axes
        The only ones of their figure.
    moving : iterable of Artist
        What frames change, with its first positions.
    """
    figure: Any = axes.figure
    moving = list(moving)
    still = [part for part in axes.get_children() if part not in moving]
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    pixels = _picture_without(figure, moving)
    axes.set_axis_off()
    for part in still:
        part.set_visible(False)

    class Background(needed("matplotlib.artist", "animate").Artist):  # type: ignore[misc]
        def draw(self, renderer: Any) -> None:
            renderer.draw_image(renderer.new_gc(), 0, 0, pixels)

    figure.add_artist(Background())


def _picture_without(figure: Any, parts: list["Artist"]) -> Any:
    """Pixels of a figure without some parts, from its lowest row up, (height, width, 4)."""
    canvas = needed("matplotlib.backends.backend_agg", "animate").FigureCanvasAgg(figure)
    for part in parts:
        part.set_visible(False)
    canvas.draw()
    for part in parts:
        part.set_visible(True)
    return np.array(canvas.buffer_rgba())[::-1]
