"""Stored histories: small CSV files with a header that describes them, readable in a diff."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, isfinite, log10
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from studies.engine.files import atomic_write
from studies.regression.scenes import CheckError, Task

Array = NDArray[np.float64]

FIRST, LAST, PHYSICS = "# anctmm history 1", "# end", "# physics: "
#: Before the name of the file whose scenes a history belongs to; histories of the package have no such line.
FILE = "# file: "
#: Of the quantities, each with one tolerance.
UNITS = {
    "displacement": "m",
    "angle": "rad",
    "kinetic energy": "J",
    "strain energy": "J",
    "potential energy": "J",
    "work": "J",
    "dissipated energy": "J",
    "load factor": "1",
    "reaction": "N",
    "reaction moment": "N m",
    "section force": "N",
    "section moment": "N m",
    "tension": "N",
    "spring moment": "N m",
    "frequency": "Hz",
    "growth rate": "1/s",
    "velocity": "m/s",
    "spin": "rad/s",
    "relative error": "1",
}
#: Digits stored below the tolerance.
SPARE_DIGITS = 2


def label(quantity: str, where: str = "") -> str:
    """Head of the column of a quantity at a place; that of a vector's component ends with x or y before the unit."""
    return f"{quantity} {where}".strip() + f" ({UNITS[quantity]})"


def quantity_of(column: Any) -> str:
    """The quantity of a column; ValueError if there is none."""
    for name in sorted(UNITS, key=len, reverse=True):
        if column.startswith((f"{name} ", f"{name} (")) and column.endswith(f" ({UNITS[name]})"):
            return name
    raise ValueError(f"column {column!r} is unknown")


def place_of(column: str) -> str:
    """The place of a column, or its quantity where that has none."""
    name = quantity_of(column)
    return column.removeprefix(name).removesuffix(f"({UNITS[name]})").strip() or name


@dataclass(frozen=True)
class History:
    """Few samples of few quantities.

    Parameters
    ----------
    frame : DataFrame
        A column for each component of each quantity at each place, see `label`; the index is the time (s), the load
        factor or the number of the sample, and its name says which.
    corrections : int
        Newton corrections of the whole run: a wrong tangent leaves the history as it is, but takes more of them.
    ending : str
        How the run ended, where it did not end well: status, and step, body and element that it names.
    """

    frame: pd.DataFrame
    corrections: int = 0
    ending: str = ""

    @classmethod
    def of(cls, t: Array, axis: str, columns: Mapping[str, Array], *more: object) -> "History":
        """A history by its columns."""
        return cls(pd.DataFrame(columns, index=pd.Index(t, name=axis, dtype=float), dtype=float), *more)  # type: ignore[arg-type]

    @property
    def t(self) -> Array:
        """Values of the index."""
        return self.frame.index.to_numpy(float)

    def of_quantity(self, *quantities: str) -> pd.DataFrame:
        """The columns of some quantities."""
        return self.frame[[c for c in self.frame if quantity_of(c) in quantities]]

    @property
    def quantities(self) -> list[str]:
        """Those it has, in order."""
        return list(dict.fromkeys(map(quantity_of, self.frame)))


@dataclass(frozen=True)
class Tolerance:
    """Allowed difference of a quantity from the stored one, and its reason."""

    value: float
    reason: str


@dataclass(frozen=True)
class Baseline:
    """A stored history with its settings, the tolerance of each quantity, the scene in words, and its file."""

    settings: str
    tolerances: Mapping[str, Tolerance]
    history: History
    physics: Sequence[str] = ()
    file: str = ""


def physics_of(task: Task) -> list[str]:
    """The scene in words; functions by their names, whose addresses say nothing."""
    scene = task.scene
    parts = [*map(repr, (*scene.bodies, *scene.joints, *scene.loads, *scene.connectors))]
    parts.append(f"gravity {scene.gravity}")
    return [re.sub(r" at 0x[0-9a-f]+", "", " ".join(part.split())) for part in parts]


def write_baseline(path: Path, task: Task, stored: Baseline, made_by: str) -> None:
    """Write a baseline, whole or not at all."""
    history, frame = stored.history, stored.history.frame
    sizes = [stored.tolerances[quantity_of(column)].value for column in frame]
    decimals = [max(0, ceil(-log10(size))) + SPARE_DIGITS for size in sizes]
    lines = [
        FIRST,
        *([f"{FILE}{stored.file}"] if stored.file else []),
        f"# scene: {task.scene.name}",
        *(f"{PHYSICS}{part}" for part in stored.physics),
        f"# run: {task.run_name}",
        f"# solver: {task.solver}",
        f"# settings: {stored.settings}",
        f"# made by (shown, not compared): {made_by}",
        *(f"# tolerance of {q}: {t.value:.1e} {UNITS[q]}, {t.reason}" for q, t in stored.tolerances.items()),
        f"# Newton corrections: {history.corrections}",
        *([f"# ending: {history.ending}"] if history.ending else []),
        f"# rows: {len(frame)}",
        ",".join([str(frame.index.name), *frame]),
    ]
    for t, *row in frame.itertuples(name=None):
        lines.append(",".join([f"{t:.9g}", *(f"{v:.{d}f}" for v, d in zip(row, decimals, strict=True))]))
    atomic_write(path, "\n".join([*lines, LAST, ""]))


def read_baseline(path: Path) -> Baseline:
    """Read a baseline.

    Raises
    ------
    FileNotFoundError
    CheckError
        If it is none of ours, or not whole, naming the line.
    """
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    except FileNotFoundError:
        raise
    except OSError as error:
        raise CheckError(f"{path} cannot be read: {error.strerror}; a file is needed") from None
    if lines[0] != FIRST:
        raise CheckError(f"{path} does not begin with {FIRST!r}: it is no history stored by anctmm check")
    head = [line for line in lines if line.startswith("# ")]
    columns, *body = [line.split(",") for line in lines[1:] if line and not line.startswith("#")] or [[""]]
    if lines[-2:] != [LAST, ""] or _after(head, "# rows: ") != str(len(body)):
        raise CheckError(
            f"{path} is cut short or edited: {len(body)} rows, and at its end {lines[-2:]}; the rows that its head "
            f"says and {LAST!r} are needed; renew it with --update"
        )
    try:
        tolerances = dict(_tolerance(line) for line in head if line.startswith("# tolerance of "))
        if missing := {quantity_of(c) for c in columns[1:]} - set(tolerances):
            raise ValueError(f"the tolerance of {', '.join(sorted(missing))} is missing")
        table = np.array(body, dtype=float).reshape(len(body), len(columns))
        corrections = int(_after(head, "# Newton corrections: "))
    except (ValueError, KeyError) as error:
        raise CheckError(f"{path} cannot be read: {error}; renew it with --update") from None
    values = dict(zip(columns[1:], table.T[1:], strict=True))
    history = History.of(table[:, 0], columns[0], values, corrections, _after(head, "# ending: "))
    physics = [line.removeprefix(PHYSICS) for line in head if line.startswith(PHYSICS)]
    return Baseline(_after(head, "# settings: "), tolerances, history, physics, _after(head, FILE))


def is_ours(path: Path) -> bool:
    """Whether a file was written by `write_baseline`, whole or not."""
    return path.is_file() and path.read_bytes().startswith(FIRST.encode())


def note_file(path: Path, file: str) -> None:
    """Write into a stored history which file it belongs to; all else stays as it is."""
    first, *rest = path.read_text(encoding="utf-8").split("\n")
    atomic_write(
        path, "\n".join([first, f"{FILE}{file}", *(line for line in rest if not line.startswith(FILE))])
    )


def _after(head: Sequence[str], start: str) -> str:
    return next((line.removeprefix(start) for line in head if line.startswith(start)), "")


def _tolerance(line: str) -> tuple[str, Tolerance]:
    name, _, rest = line.removeprefix("# tolerance of ").partition(": ")
    value, _, reason = rest.partition(f" {UNITS[name]}, ")
    if not (float(value) > 0.0 and isfinite(float(value))):
        raise ValueError(f"tolerance of {name} is {value}")
    return name, Tolerance(float(value), reason)
