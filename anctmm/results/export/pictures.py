"""Pictures of solutions: configurations, energies, animations."""

import re
from collections.abc import Callable, Sequence
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import OutputError, ResultError, reason, shown
from anctmm.model.checks.parts import check_plane
from anctmm.results.export.shapes import Shape, box, shapes_of, supports_of
from anctmm.results.export.tables import needed
from anctmm.validation import reals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

#: Line styles distinguish energies without colour, too.
STYLES = {"kinetic": "-", "strain": "--", "potential": "-.", "work": ":"}
#: Line width, dashes and filling of what is drawn, by kind.
LOOKS: dict[str, dict[str, Any]] = {
    "beam": {"lw": 2.0, "solid_capstyle": "round"},
    "rigid": {"lw": 1.5},
    "mass": {"marker": "o", "ms": 8},
    "spring": {"lw": 1.5, "ls": ":"},
    "rotational spring": {"marker": "o", "ms": 12, "mfc": "none"},
    "guide": {"lw": 0.9, "ls": (0, (5, 3)), "color": "0.55"},
}
MARKS = {"clamp": "s", "pin": "^"}
BESIDE: dict[str, Any] = {"fontsize": "small", "loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
#: Signs of the buttons of matplotlib's player, whose own come from the network.
SIGNS = {
    "play fa-flip-horizontal": "◀", "fast-backward": "«", "fast-forward": "»", "step-backward": "‹",
    "step-forward": "›", "play": "▶", "pause": "‖", "minus": "−", "plus": "+",
}  # fmt: skip
PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
body {{ margin: 0; font-family: system-ui, sans-serif; text-align: center; }}
.animation img {{ max-width: 100%; height: auto; }}
.anim-buttons button {{ min-width: 2.2rem; min-height: 2.2rem; padding: 0; }}
</style>
</head>
<body>
{player}
</body>
</html>
"""


def plot(solution: Any, times: Sequence[float] | None = None) -> "Figure":
    """Configurations at several times, and energies over time.

    Parameters
    ----------
    solution : Solution
    times : sequence of float, optional
        s, or load factors; the nearest outputs are drawn. Default: seven over the whole run.

    Returns
    -------
    matplotlib.figure.Figure
        To show, or to save with `.savefig(path)`.

    Raises
    ------
    ResultError
        If matplotlib is not installed, the solution has no outputs, or times are no numbers.
    """
    check_plane(solution.scene, "pictures")
    figures = needed("matplotlib.figure", "plot")
    if not len(solution.t):
        raise ResultError(f"scene {solution.scene.name!r} has no outputs to draw: {solution.status}")
    wanted = np.linspace(solution.t[0], solution.t[-1], 7) if times is None else _numbers("times", times)
    chosen = sorted({int(np.abs(solution.t - t).argmin()) for t in wanted})
    figure = figures.Figure(figsize=(10.0, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.15, 1.0])
    figure.suptitle(literal(f"{solution.scene.name}: {solution.solver}, {solution.status.code}"))
    _configurations(left, solution, chosen)
    _energies(right, solution)
    return figure  # type: ignore[no-any-return]


def _numbers(name: str, values: object) -> Array:
    """Some numbers, also a single one."""
    try:
        found = np.atleast_1d(reals(values))
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.ndim != 1 or not found.size or not np.isfinite(found).all():
        raise ResultError(f"{name} is {shown(values)}; finite numbers are needed, such as [0.0, 0.5]")
    return found


def animate(solution: Any, path: str | PathLike[str], fps: float = 25.0) -> Path:
    """Write an animation: a page with a player (".html") or an animated picture (".gif").

    Parameters
    ----------
    solution : Solution
        Its outputs become frames, equally spaced in time; of more than 400 some are left out.
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
    check_plane(solution.scene, "animations")
    target, name = Path(path), solution.scene.name
    if target.suffix not in (".html", ".gif"):
        raise ResultError(f"path is {str(target)!r}; a file '.html' or '.gif' is needed")
    if not fps > 0.0 or not np.isfinite(fps):
        raise ResultError(f"fps is {shown(fps)}; a number > 0 is needed")
    if len(solution.t) < 2:
        raise ResultError(f"scene {name!r} has {len(solution.t)} outputs; 2 or more are needed")
    animation = needed("matplotlib.animation", "animate")
    figure = needed("matplotlib.figure", "animate").Figure(figsize=(6.4, 5.2), layout="constrained")
    move = _drawing(figure.subplots(), solution)
    move(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # it is the same in all frames
    frames = np.unique(np.linspace(0, len(solution.t) - 1, 400).round().astype(int)).tolist()
    moving = animation.FuncAnimation(figure, move, frames=frames, interval=1e3 / fps, blit=False)
    try:
        if target.suffix == ".html":
            page = _alone(moving.to_jshtml(fps=fps), f"{name}: {solution.solver}")
            target.write_text(page, encoding="utf-8")
        else:
            moving.save(target, writer="pillow", fps=fps)
    except OSError as error:
        raise OutputError(f"file {str(target)!r} cannot be written: {reason(error)}") from error
    return target


def _alone(player: str, title: str) -> str:
    """Matplotlib's player as a page that needs no network and fits a phone."""
    player = re.sub(r"<link\b[^>]*>", "", player)
    for icon, sign in SIGNS.items():
        player = player.replace(f'<i class="fa fa-{icon}"></i>', sign)
    return PAGE.format(title=escape(title), player=player)


def _drawing(axes: "Axes", solution: Any) -> Callable[[int], Any]:
    """Lines of all that moves, in axes that hold the whole motion; returned is what shows an output."""
    shapes = shapes_of(solution)
    _frame(axes, solution, shapes)
    lines = []
    for number, shape in enumerate(shapes):
        color = f"C{number % 10}" if shape.name else "0.45"
        lines += _draw(axes, [shape], 0, color=color, label=literal(shape.name) or None)
    if len(shapes) > 1:
        axes.legend(**BESIDE)

    def move(k: int) -> Any:
        for line, shape in zip(lines, shapes, strict=True):
            line.set_data(*shape.points[k].T)
        t = solution.t[k]
        axes.set_title(f"load factor {t:.3g}" if solution.static else f"t = {t:.3f} s")
        return lines

    return move


def _draw(axes: "Axes", shapes: Sequence[Shape], k: int, **look: Any) -> list[Any]:
    """Shapes at an output, as lines; a label is that of the first."""
    lines = []
    for shape in shapes:
        lines += axes.plot(*shape.points[k].T, **look | LOOKS[shape.kind])
        look.pop("label", None)
    return lines


def _configurations(axes: "Axes", solution: Any, chosen: Sequence[int]) -> None:
    """Bodies at some outputs, later ones darker; springs and names at the last."""
    shapes, last = shapes_of(solution), chosen[-1]
    named, unit = [shape for shape in shapes if shape.name], "" if solution.static else " s"
    for k, shade in zip(chosen, np.linspace(0.25, 1.0, len(chosen)), strict=True):
        label = f"{solution.t[k]:.3g}{unit}"
        _draw(axes, shapes if k == last else named, k, color=(0.1, 0.25, 0.6, shade), label=label)
    for shape in named if len(shapes) > 1 else []:
        middle = shape.points[last, shape.points.shape[1] // 2]
        axes.annotate(literal(shape.name), middle, fontsize="small")
    _frame(axes, solution, shapes, list(chosen))
    axes.legend(title="load factor" if solution.static else "t", **BESIDE)


def literal(name: str) -> str:
    """A text that holds names, for matplotlib: what stands between two dollar signs is no formula."""
    return name.replace("$", r"\$")


def _energies(axes: "Axes", solution: Any) -> None:
    for name, style in STYLES.items():
        series = getattr(solution.energy, name)
        if np.isfinite(series).any():
            axes.plot(solution.t, series, style, label=name)
    axes.set(xlabel="load factor" if solution.static else "t (s)", ylabel="energy (J)")
    _grid(axes)
    if axes.lines:
        axes.legend(fontsize="small")


def _frame(axes: "Axes", solution: Any, shapes: Sequence[Shape], outputs: Any = slice(None)) -> None:
    """Equal scales, with room for shapes at some outputs or all; and what the ground holds."""
    low, high = box(np.concatenate([shape.points[outputs].reshape(-1, 2) for shape in shapes]))
    middle, half = 0.5 * (low + high), 0.55 * max(float((high - low).max()), 1e-12)
    for kind, position in supports_of(solution.scene):
        axes.plot(*position, MARKS[kind], ms=9, color="0.35", zorder=1)
    axes.set(xlim=middle[0] + half * np.array([-1.0, 1.0]), ylim=middle[1] + half * np.array([-1.0, 1.0]))
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    _grid(axes)


def _grid(axes: "Axes") -> None:
    """A grid, and numbers of small and large scenes by a power of ten: written out they run into each other."""
    axes.grid(alpha=0.3)
    axes.ticklabel_format(scilimits=(-2, 4), useMathText=True)


def plot_shapes(motions: Sequence[Any], titles: Sequence[str], name: str) -> "Figure":
    """Periods of modes that begin at the largest displacement: both ends of the swing, and the middle in grey."""
    figures = needed("matplotlib.figure", "plot")
    columns = min(len(motions), 4)
    rows = -(-len(motions) // columns)
    figure = figures.Figure(figsize=(2.9 * columns + 0.6, 2.7 * rows + 0.5), layout="constrained")
    figure.suptitle(literal(f"{name}: modes"))
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(motions) :]:
        axes.set_axis_off()
    for axes, motion, title in zip(panels, motions, titles, strict=False):
        shapes, period = shapes_of(motion), len(motion.t) - 1
        named = [shape for shape in shapes if shape.name]
        for k, color in ((period // 4, "0.6"), (period // 2, "C1")):
            _draw(axes, named, k, color=color)
        _draw(axes, shapes, 0, color="C0")
        _frame(axes, motion, shapes)
        axes.set_title(title, fontsize="medium")
        axes.set(xlabel="", ylabel="")
        axes.tick_params(labelsize="small")
    return figure  # type: ignore[no-any-return]


def plot_campbell(
    speeds: Array, frequencies: Array, unstable: NDArray[np.bool_], orders: Sequence[int], name: str
) -> "Figure":
    """Frequencies, (n, count), Hz, over the speed, (n,), rad/s, with rays of its multiples; crosses where unstable."""
    figure = needed("matplotlib.figure", "plot").Figure(figsize=(7.2, 4.8), layout="constrained")
    axes = figure.subplots()
    names = [f"mode {k + 1}" for k in range(frequencies.shape[1])]
    axes.plot(speeds, frequencies, "o-", ms=3.5, lw=1.6, label=names)
    if unstable.any():
        over = np.broadcast_to(speeds[:, None], frequencies.shape)[unstable]
        axes.plot(over, frequencies[unstable], "x", color="0.1", ms=8, label="unstable", clip_on=False)
    top = 1.08 * float(np.nanmax(frequencies))
    for slope in np.array(orders) / (2.0 * np.pi):
        axes.axline((0.0, 0.0), slope=slope, ls=":", color="0.5", lw=1.0)
        end = min(float(speeds.max()), top / slope)
        axes.annotate(f"{2.0 * np.pi * slope:.0f}×", (end, slope * end), fontsize="small", color="0.4")
    axes.set(xlabel="speed (rad/s)", ylabel="frequency (Hz)", ylim=(0.0, top))
    axes.set_title(literal(f"{name}: frequencies over the speed"))
    axes.grid(alpha=0.3)
    axes.legend(**BESIDE)
    return figure  # type: ignore[no-any-return]
