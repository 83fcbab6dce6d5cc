"""Pictures of solutions: configurations, energies, animations."""

import re
from collections.abc import Sequence
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import OutputError, ResultError, reason, shown
from anctmm.model.checks.space import check_plane
from anctmm.results.export.shapes import Shape, box, shapes_of, supports_of
from anctmm.results.export.tables import needed
from anctmm.validation import reals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

#: Configurations in a picture, and frames of an animation at most.
SHOWN, FRAMES = 7, 400
#: Line styles distinguish energies without colour, too.
STYLES = {"kinetic": "-", "strain": "--", "potential": "-.", "work": ":"}
#: Line width, dashes and filling of what is drawn, by kind.
LOOKS: dict[str, dict[str, Any]] = {
    "beam": {"lw": 2.0, "solid_capstyle": "round"},
    "rigid": {"lw": 1.5},
    "mass": {"marker": "o", "ms": 8},
    "spring": {"lw": 0.9},
    "guide": {"lw": 0.9, "ls": (0, (5, 3)), "color": "0.55"},
}
MARKS = {"clamp": "s", "pin": "^"}
BESIDE: dict[str, Any] = {"fontsize": "small", "loc": "upper left", "bbox_to_anchor": (1.0, 1.0)}
#: Bodies that are named in a picture at most.
NAMED = 12
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
#: File types of animations, and what writes them.
WRITERS = {".html": "html", ".gif": "pillow"}


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
    wanted = np.linspace(solution.t[0], solution.t[-1], SHOWN) if times is None else _numbers("times", times)
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
    if target.suffix not in WRITERS:
        raise ResultError(f"path is {str(target)!r}; a file {' or '.join(map(repr, WRITERS))} is needed")
    if not fps > 0.0 or not np.isfinite(fps):
        raise ResultError(f"fps is {shown(fps)}; a number > 0 is needed")
    if len(solution.t) < 2:
        raise ResultError(f"scene {name!r} has {len(solution.t)} outputs; 2 or more are needed")
    animation = needed("matplotlib.animation", "animate")
    figure = needed("matplotlib.figure", "animate").Figure(figsize=(6.4, 5.2), layout="constrained")
    drawing = _Drawing(figure.subplots(), solution)
    drawing.move(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # it is the same in all frames
    frames = np.unique(np.linspace(0, len(solution.t) - 1, FRAMES).round().astype(int)).tolist()
    moving = animation.FuncAnimation(figure, drawing.move, frames=frames, interval=1e3 / fps, blit=False)
    try:
        if target.suffix == ".html":
            page = _alone(moving.to_jshtml(fps=fps), f"{name}: {solution.solver}")
            target.write_text(page, encoding="utf-8")
        else:
            moving.save(target, writer=WRITERS[target.suffix], fps=fps)
    except OSError as error:
        raise OutputError(f"file {str(target)!r} cannot be written: {reason(error)}") from error
    return target


def _alone(player: str, title: str) -> str:
    """Matplotlib's player as a page that needs no network and fits a phone."""
    player = re.sub(r"<link\b[^>]*>", "", player)
    for icon, sign in SIGNS.items():
        player = player.replace(f'<i class="fa fa-{icon}"></i>', sign)
    return PAGE.format(title=escape(title), player=player)


class _Drawing:
    """Lines of all that moves, in axes that hold the whole motion."""

    def __init__(self, axes: "Axes", solution: Any) -> None:
        self.shapes = shapes_of(solution)
        self.t, self.axes, self.static = solution.t, axes, solution.static
        frame(axes, points_of(self.shapes))
        draw_supports(axes, solution)
        self.lines, self.fills, names = [], [], {}
        for number, shape in enumerate(self.shapes):
            look = {"color": f"C{number % 10}" if shape.name else "0.45", **LOOKS[shape.kind]}
            self.lines += axes.plot([], [], **look)
            if shape.kind == "rigid":
                self.fills.append((shape, axes.fill([], [], color=look["color"], alpha=0.25, lw=0)[0]))
            if shape.name and number < NAMED:
                names[literal(shape.name)] = self.lines[-1]
        if len(self.shapes) > 1:
            # with their lines: a label of a line that begins with _ is left out
            axes.legend(names.values(), names, **BESIDE)

    def move(self, k: int) -> Any:
        """Show output k."""
        for line, shape in zip(self.lines, self.shapes, strict=True):
            line.set_data(*shape.points[k].T)
        for shape, fill in self.fills:
            fill.set_xy(shape.points[k])
        self.axes.set_title(f"load factor {self.t[k]:.3g}" if self.static else f"t = {self.t[k]:.3f} s")
        return self.lines


def _configurations(axes: "Axes", solution: Any, chosen: Sequence[int]) -> None:
    """Bodies at some outputs, the first in grey, later ones darker; springs at the last; names."""
    shapes = shapes_of(solution)
    unit = "" if solution.static else " s"
    for number, (k, shade) in enumerate(zip(chosen, np.linspace(0.25, 1.0, len(chosen)), strict=True)):
        first = number == 0 and len(chosen) > 1
        color = (0.6, 0.6, 0.6, 1.0) if first else (0.1, 0.25, 0.6, float(shade))
        for place, shape in enumerate(shapes):
            if shape.name or k == chosen[-1]:
                x, y = shape.points[k].T
                label = f"{solution.t[k]:.3g}{unit}" if place == 0 else None
                axes.plot(x, y, label=label, **{"color": color, **LOOKS[shape.kind]})
                if shape.kind == "rigid":
                    axes.fill(x, y, color=color[:3], alpha=0.25 * color[3], lw=0)
    frame(axes, points_of(shapes, chosen))
    draw_supports(axes, solution)
    name_bodies(axes, shapes, clearest(shapes, chosen))
    axes.legend(title="load factor" if solution.static else "t", **BESIDE)


def literal(name: str) -> str:
    """A text that holds names, for matplotlib: what stands between two dollar signs is no formula."""
    return name.replace("$", r"\$")


def clearest(shapes: Sequence[Shape], chosen: Sequence[int]) -> int:
    """The output at which the middles of the bodies are the farthest from each other."""
    middles = np.stack(
        [shape.points[:, shape.points.shape[1] // 2] for shape in shapes if shape.name], axis=1
    )

    def nearest(k: int) -> float:
        apart = np.linalg.norm(middles[k, :, None] - middles[k, None], axis=2)
        return float(np.where(np.eye(len(apart), dtype=bool), np.inf, apart).min())

    return max(chosen, key=nearest)


def name_bodies(
    axes: "Axes", shapes: Sequence[Shape], k: int, size: float = 8.0, ink: Any = "0.1", paper: Any = "white"
) -> None:
    """Write the names of bodies at their middles at output k: one that would touch another moves up.

    The axes have their limits, and equal scales; letters have a size, pt, in ink on paper.
    """
    named = [shape for shape in shapes if shape.name]
    if not 1 < len(named) <= NAMED:
        return
    figure: Any = axes.figure
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    wide, tall = figure.get_size_inches() * 72.0 * axes.get_position().size
    unit = max((right - left) / wide, (high - low) / tall)  # m a point
    line, taken = 1.35 * size * unit, list[tuple[float, float, float]]()
    middles = [(*shape.points[k][len(shape.points[k]) // 2].tolist(), shape.name) for shape in named]
    for x, y, name in sorted(middles, key=lambda middle: middle[1]):
        if np.isfinite([x, y]).all():
            width = 0.68 * size * unit * len(name)
            x = min(max(x, left + 0.6 * width), right - 0.6 * width)
            for u, v, w in sorted(taken, key=lambda one: one[1]):
                if abs(x - u) < 0.55 * (width + w) and abs(y - v) < line:
                    y = v + line
            taken.append((x, y, width))
            behind = {"facecolor": paper, "alpha": 0.75, "edgecolor": "none", "pad": 0.6}
            place = {"fontsize": size, "ha": "center", "va": "center", "color": ink, "zorder": 6}
            axes.text(x, y, literal(name), bbox=behind, **place)


def draw_supports(axes: "Axes", solution: Any) -> None:
    """Draw what the ground holds: clamps, grounded hinges, and fixed ends of springs."""
    for support in supports_of(solution.scene):
        axes.plot(*support.position, MARKS[support.kind], ms=9, color="0.35", zorder=1)


def _energies(axes: "Axes", solution: Any) -> None:
    for name, style in STYLES.items():
        series = getattr(solution.energy, name)
        if np.isfinite(series).any():
            axes.plot(solution.t, series, style, label=name)
    axes.set(xlabel="load factor" if solution.static else "t (s)", ylabel="energy (J)")
    _grid(axes)
    if axes.lines:
        axes.legend(fontsize="small")


def points_of(shapes: Sequence[Shape], chosen: Sequence[int] | None = None) -> Array:
    """All points of shapes, at some outputs or at all, (k, 2), m."""
    outputs: Any = slice(None) if chosen is None else list(chosen)
    return np.concatenate([shape.points[outputs].reshape(-1, 2) for shape in shapes])


def frame(axes: "Axes", points: Array) -> None:
    """Equal scales, and room for all points that are finite."""
    low, high = box(points)
    middle, half = 0.5 * (low + high), 0.55 * max(float((high - low).max()), 1e-12)
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    _grid(axes)


def _grid(axes: "Axes") -> None:
    """A grid, and numbers of small and large scenes by a power of ten: written out they run into each other."""
    axes.grid(alpha=0.3)
    axes.ticklabel_format(scilimits=(-2, 4), useMathText=True)
