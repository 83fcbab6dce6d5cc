"""The gallery's page and pictures: `python -m studies.gallery`."""

import runpy
from collections.abc import Mapping
from math import floor, log10
from pathlib import Path
from typing import Any

import matplotlib as mpl

import anctmm as at
from anctmm.errors import SolverError
from anctmm.results.solution import Solution

FOLDER = Path(__file__).parent
SCENES, PICTURES, PAGE = FOLDER / "scenes", FOLDER / "pictures", FOLDER / "README.md"


def scenes() -> dict[str, Mapping[str, Any]]:
    """All files of the gallery, by name, with the names that each defines."""
    return {path.stem: runpy.run_path(str(path)) for path in sorted(SCENES.glob("*.py"))}


def solved(names: Mapping[str, Any]) -> Solution:
    """The solution of a file's case with its settings; SolverError if it does not end well."""
    (case,) = names["CASES"]
    times = {} if case.static else {"t_end": case.duration, "output_dt": case.interval}
    found = (at.solve_static if case.static else at.solve)(case.scene, **times, **names["RUN"])
    if not found.status.ok:
        raise SolverError(f"{case.name}: {found.status}")
    return found


def write() -> None:
    """Run all scenes; write the pictures, and the page below its introduction."""
    parts = [PAGE.read_text(encoding="utf-8").partition("\n## ")[0]]
    for name, names in scenes().items():
        found = solved(names)
        with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": name, "path.simplify_threshold": 0.5}):
            found.plot().savefig(PICTURES / f"{name}.svg", metadata={"Date": None})
        parts.append(section(name, names, found))
    PAGE.write_text("\n".join(parts), encoding="utf-8")


def section(name: str, names: Mapping[str, Any], found: Solution) -> str:
    """Title, text, picture and the known value of a scene."""
    title, _, text = names["__doc__"].partition(": ")
    what, value, known, tolerance, unit, source = names["known"](found)
    digits = max(0, 1 - floor(log10(tolerance)))
    shown, exact = (f"{x:.{digits}f} {unit}".strip() for x in (value, known))
    return (
        f"## {title}\n\n{text[0].upper()}{text[1:]} ([`{name}.py`](scenes/{name}.py))\n\n"
        f"![{title}](pictures/{name}.svg)\n\n{what[0].upper()}{what[1:]}: {shown}; known: {exact} ({source}).\n"
    )


if __name__ == "__main__":
    write()
