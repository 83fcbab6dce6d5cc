"""The gallery's page and pictures: `python -m studies.gallery`."""

import runpy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import anctmm as at
from anctmm.errors import SolverError
from anctmm.results.export.pictures import LOOKS, MARKS
from anctmm.results.export.shapes import shapes_of, supports_of
from anctmm.results.solution import Solution

FOLDER = Path(__file__).parent
SCENES, PICTURES, PAGE = FOLDER / "scenes", FOLDER / "pictures", FOLDER / "README.md"
#: Outputs at which bodies are drawn.
SHOWN = 7
FADE = mpl.colors.LinearSegmentedColormap.from_list("fade", ["#d3e6f3", "#6fb0dc", "#0072b2", "#003a5c"])
HEAD = """# Gallery

Short scenes, each a file with its settings, its curves and a value that is known independently. The tests run them all.
Each file is a case: `anctmm run studies/gallery/scenes/bridge.py` runs it, and the studies accept it, too.
Drawn are some positions, the last one dark, and the path of a point.

`python -m studies.gallery` writes this page and its pictures. A new scene is a new file in `scenes/` with a docstring
("Title: text"), `CASES`, `RUN` (the settings), `known(solution)` and, if there is more to see, `curves(solution)`.
"""


def scenes() -> dict[str, Mapping[str, Any]]:
    """All files of the gallery, by name, with the names that each defines."""
    return {path.stem: runpy.run_path(str(path)) for path in sorted(SCENES.glob("*.py"))}


def solved(names: Mapping[str, Any]) -> Solution:
    """The solution of a file's case with its settings.

    Raises
    ------
    SolverError
        If it does not end well.
    """
    (case,) = names["CASES"]
    if case.static:
        found = at.solve_static(case.scene, **names["RUN"])
    else:
        found = at.solve(case.scene, t_end=case.duration, output_dt=case.interval, **names["RUN"])
    if not found.status.ok:
        raise SolverError(f"{case.name}: {found.status}")
    return found


def write() -> None:
    """Run all scenes; write the pictures and the page."""
    parts = [HEAD]
    for name, names in scenes().items():
        found = solved(names)
        with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": name, "path.simplify_threshold": 0.5}):
            picture(names, found).savefig(PICTURES / f"{name}.svg", metadata={"Date": None})
        parts.append(section(name, names, found))
    PAGE.write_text("\n".join(parts), encoding="utf-8")


def section(name: str, names: Mapping[str, Any], found: Solution) -> str:
    """Title, text, picture and the known value of a scene."""
    title, _, text = names["__doc__"].partition(": ")
    what, value, known, tolerance, unit, source = names["known"](found)
    digits = max(0, 1 - int(np.floor(np.log10(tolerance))))
    shown, exact = (f"{x:.{digits}f} {unit}".strip() for x in (value, known))
    return (
        f"## {title}\n\n{text[0].upper()}{text[1:]} ([`{name}.py`](scenes/{name}.py))\n\n"
        f"![{title}](pictures/{name}.svg)\n\n{what[0].upper()}{what[1:]}: {shown}; known: {exact} ({source}).\n"
    )


def picture(names: Mapping[str, Any], found: Solution) -> Figure:
    """Positions, and curves beside them."""
    curves = names.get("curves")
    figure = Figure(figsize=(6.4 if curves else 4.0, 2.8), layout="constrained")
    left, *others = figure.subplots(1, 2 if curves else 1, squeeze=False)[0]
    _positions(left, found, names["CASES"][0].probes[0])
    for axes in others:
        xlabel, x, ylabel, lines = names["curves"](found)
        for label, y in lines.items():
            axes.plot(x, y, "o" if isinstance(x, list) else "-", label=label, lw=1.2, ms=4)
        axes.set(xlabel=xlabel, ylabel=ylabel)
        if len(lines) > 1:
            axes.legend(fontsize=7)
    return figure


def _positions(axes: Axes, found: Solution, probe: Any) -> None:
    """Bodies at several outputs, supports, and the path of a probe."""
    outputs = np.unique(np.linspace(0, len(found.t) - 1, SHOWN).round().astype(int))
    for k, shade in zip(outputs, FADE(np.linspace(0.0, 1.0, len(outputs))), strict=True):
        for shape in shapes_of(found):
            axes.plot(*shape.points[k].T, **{"color": shade, **LOOKS[shape.kind]})
    for support in supports_of(found.scene):
        axes.plot(*support.position, MARKS[support.kind], color="#3a3a40", ms=5, zorder=4)
    axes.plot(*found.position(probe).T, color="#d55e00", lw=1.0, ls=(0, (4, 2)), zorder=3)
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_aspect("equal", adjustable="datalim")
