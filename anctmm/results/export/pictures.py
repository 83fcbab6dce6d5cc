"""Pictures of solutions: configurations, energies, animations."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import OutputError, ResultError, reason, shown
from anctmm.results.export.tables import needed
from anctmm.results.fields import RigidField

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

#: Points along a beam.
POINTS = 41
#: Configurations in a picture, and frames of an animation at most.
SHOWN, FRAMES = 7, 400
#: Line styles tell energies apart without colour, too.
STYLES = {"kinetic": "-", "strain": "--", "potential": "-.", "work": ":"}
#: File types of animations, and what writes them.
WRITERS = {".html": "html", ".gif": "pillow"}


def plot(solution: Any, times: Sequence[float] | None = None) -> "Figure":
    """Configurations at several times, and energies over time.

    Parameters
    ----------
    solution : Solution
    times : sequence of float, optional
        s, or load factors; the nearest outputs are drawn. Seven over the whole run without it.

    Returns
    -------
    matplotlib.figure.Figure
        To show, or to save with `.savefig(path)`.

    Raises
    ------
    ResultError
        If matplotlib is not installed, or the solution has no outputs.
    """
    figures = needed("matplotlib.figure", "plot")
    if not len(solution.t):
        raise ResultError(f"scene {solution.scene.name!r} has no outputs to draw: {solution.status}")
    wanted = np.linspace(solution.t[0], solution.t[-1], SHOWN) if times is None else np.asarray(times, float)
    chosen = sorted({int(np.abs(solution.t - t).argmin()) for t in wanted})
    figure = figures.Figure(figsize=(10.0, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.15, 1.0])
    figure.suptitle(f"{solution.scene.name}: {solution.solver}, {solution.status.code}")
    _configurations(left, solution, chosen)
    _energies(right, solution)
    return figure  # type: ignore[no-any-return]


def animate(solution: Any, path: str | PathLike[str], fps: float = 25.0) -> Path:
    """Write an animation: a page with a player (".html") or a picture that moves (".gif").

    Parameters
    ----------
    solution : Solution
        Its outputs become frames, in equal parts of time; of more than 400 some are left out.
    path : path
    fps : float
        Frames per second, > 0.

    Returns
    -------
    Path

    Raises
    ------
    ResultError
        If matplotlib is not installed, the file type is another, or there are fewer than two outputs.
    OutputError
        If the file cannot be written.
    """
    target = Path(path)
    if target.suffix not in WRITERS:
        raise ResultError(f"path is {str(target)!r}; a file {' or '.join(map(repr, WRITERS))} is needed")
    if not fps > 0.0 or not np.isfinite(fps):
        raise ResultError(f"fps is {shown(fps)}; a number > 0 is needed")
    if len(solution.t) < 2:
        raise ResultError(
            f"scene {solution.scene.name!r} has {len(solution.t)} outputs; 2 or more are needed"
        )
    animation = needed("matplotlib.animation", "animate")
    figure = needed("matplotlib.figure", "animate").Figure(figsize=(6.4, 5.2), layout="constrained")
    axes = figure.subplots()
    drawing = _Drawing(axes, solution)
    frames = np.unique(np.linspace(0, len(solution.t) - 1, FRAMES).round().astype(int))
    moving = animation.FuncAnimation(
        figure, drawing.move, frames=frames.tolist(), interval=1e3 / fps, blit=False
    )
    try:
        if target.suffix == ".html":
            target.write_text(moving.to_jshtml(fps=fps), encoding="utf-8")
        else:
            moving.save(target, writer=WRITERS[target.suffix], fps=fps)
    except OSError as error:
        raise OutputError(f"file {str(target)!r} cannot be written: {reason(error)}") from error
    return target


class _Drawing:
    """Lines of all bodies in axes that hold the whole motion."""

    def __init__(self, axes: "Axes", solution: Any) -> None:
        self.paths = _paths(solution)
        self.t, self.axes, self.static = solution.t, axes, solution.static
        every = np.concatenate([path.reshape(-1, 2) for path in self.paths.values()])
        _frame(axes, every)
        self.lines = [axes.plot([], [], lw=2.0, color=f"C{k % 10}")[0] for k in range(len(self.paths))]

    def move(self, k: int) -> Any:
        """Show output k."""
        for line, path in zip(self.lines, self.paths.values(), strict=True):
            line.set_data(path[k, :, 0], path[k, :, 1])
        label = f"load factor {self.t[k]:.3g}" if self.static else f"t = {self.t[k]:.3f} s"
        self.axes.set_title(label)
        return self.lines


def _configurations(axes: "Axes", solution: Any, chosen: Sequence[int]) -> None:
    """All bodies at some outputs: the first in grey, later ones darker."""
    paths = _paths(solution)
    shades = np.linspace(0.25, 1.0, len(chosen))
    for number, (k, shade) in enumerate(zip(chosen, shades, strict=True)):
        color = "0.6" if number == 0 and len(chosen) > 1 else (0.1, 0.25, 0.6, float(shade))
        unit = "" if solution.static else " s"
        for line, path in enumerate(paths.values()):
            label = f"{solution.t[k]:.3g}{unit}" if line == 0 else None
            axes.plot(path[k, :, 0], path[k, :, 1], color=color, lw=1.8, label=label, solid_capstyle="round")
    _frame(axes, np.concatenate([path[list(chosen)].reshape(-1, 2) for path in paths.values()]))
    axes.legend(
        title="load factor" if solution.static else "t",
        fontsize="small",
        loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
    )


def _energies(axes: "Axes", solution: Any) -> None:
    for name, style in STYLES.items():
        series = getattr(solution.energy, name)
        if np.isfinite(series).any():
            axes.plot(solution.t, series, style, label=name)
    axes.set_xlabel("load factor" if solution.static else "t (s)")
    axes.set_ylabel("energy (J)")
    axes.grid(alpha=0.3)
    if axes.lines:
        axes.legend(fontsize="small")


def _paths(solution: Any) -> dict[str, Array]:
    """Points that draw each body, (n, k, 2), m."""
    fractions = np.linspace(0.0, 1.0, POINTS)
    return {
        name: _outline(field) if isinstance(field, RigidField) else solution.position(name, fractions)
        for name, field in solution.fields.items()
    }


def _outline(field: RigidField) -> Array:
    """From the centre of mass to each point and back."""
    center = field.position("center")
    stops = [p for point in field.points if point != "center" for p in (field.position(point), center)]
    return np.stack([center, *stops], axis=1)


def _frame(axes: "Axes", points: Array) -> None:
    """Equal scales, and room for all points that are finite."""
    points = points[np.isfinite(points).all(axis=1)]
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = 0.5 * (low + high), 0.55 * max(float((high - low).max()), 1e-12)
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.grid(alpha=0.3)
