"""Pictures of modes: their shapes, and their frequencies over a speed."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anctmm.results.export.pictures import LOOKS, draw_supports, frame, literal, points_of
from anctmm.results.export.shapes import shapes_of
from anctmm.results.export.tables import needed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

#: Panels of modes in a row.
COLUMNS = 4


def plot_shapes(motions: Sequence[Any], titles: Sequence[str], name: str) -> "Figure":
    """Periods of modes that begin at the largest displacement: both ends of the swing, and the middle in grey."""
    figures = needed("matplotlib.figure", "plot")
    columns = min(len(motions), COLUMNS)
    rows = -(-len(motions) // columns)
    figure = figures.Figure(figsize=(2.9 * columns + 0.6, 2.7 * rows + 0.5), layout="constrained")
    figure.suptitle(literal(f"{name}: modes"))
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(motions) :]:
        axes.set_axis_off()
    for axes, motion, title in zip(panels, motions, titles, strict=False):
        shapes = shapes_of(motion)
        n = len(motion.t) - 1
        for k, style in ((n // 4, {"color": "0.6"}), (n // 2, {"color": "C1"}), (0, {"color": "C0"})):
            for shape in shapes:
                if shape.name or k == 0:
                    axes.plot(*shape.points[k].T, **LOOKS[shape.kind] | style)
        frame(axes, points_of(shapes))
        draw_supports(axes, motion)
        axes.set_title(title, fontsize="medium")
        axes.set_xlabel("")
        axes.set_ylabel("")
        axes.tick_params(labelsize="small")
    return figure  # type: ignore[no-any-return]


def plot_campbell(
    speeds: Array, frequencies: Array, unstable: NDArray[np.bool_], orders: Sequence[int], name: str
) -> "Figure":
    """Frequencies, (n, count), Hz, over the speed, (n,), rad/s, with rays of its multiples; crosses where unstable."""
    figure = needed("matplotlib.figure", "plot").Figure(figsize=(7.2, 4.8), layout="constrained")
    axes = figure.subplots()
    for k, line in enumerate(frequencies.T):
        axes.plot(speeds, line, "o-", ms=3.5, lw=1.6, color=f"C{k % 10}", label=f"mode {k + 1}")
    if unstable.any():
        over = np.broadcast_to(speeds[:, None], frequencies.shape)
        axes.plot(
            over[unstable], frequencies[unstable], "x", color="0.1", ms=8, label="unstable", clip_on=False
        )
    top = 1.08 * float(np.nanmax(frequencies))
    for order in orders:
        ray = order * speeds / (2.0 * np.pi)
        inside = ray <= top
        axes.plot(speeds[inside], ray[inside], ":", color="0.5", lw=1.0)
        if inside.sum() > 1:
            axes.annotate(
                f"{order}×", (speeds[inside][-1], ray[inside][-1]), xytext=(3, 1), textcoords="offset points",
                fontsize="small", color="0.4",
            )  # fmt: skip
    axes.set(
        xlabel="speed (rad/s)", ylabel="frequency (Hz)", title=literal(f"{name}: frequencies over the speed")
    )
    axes.set_ylim(0.0, top)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.02, 1.0))
    return figure  # type: ignore[no-any-return]
