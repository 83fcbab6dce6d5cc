"""Stored histories: small CSV files with a header that describes them, readable in a diff."""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, isfinite, log10
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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


@dataclass(frozen=True)
class Column:
    """One quantity at one place; that of a vector's components ends with x or y, which follow each other."""

    quantity: str
    where: str = ""

    @property
    def label(self) -> str:
        """Head of the column, with its unit."""
        return f"{self.quantity} {self.where}".strip() + f" ({UNITS[self.quantity]})"

    @classmethod
    def of(cls, label: str) -> "Column":
        """The column of a label; ValueError if there is none."""
        for quantity in sorted(UNITS, key=len, reverse=True):
            column = cls(quantity, label.removeprefix(quantity).removesuffix(f"({UNITS[quantity]})").strip())
            if label.startswith(quantity) and column.label == label:
                return column
        raise ValueError(f"column {label!r} is unknown")


@dataclass(frozen=True)
class History:
    """Few samples of few quantities.

    Parameters
    ----------
    t : ndarray, shape (n,)
        s, or the load factor, or the number of the sample.
    axis : str
        Which of them, with its unit.
    columns : tuple of Column
    values : ndarray, shape (n, columns)
    corrections : int
        Newton corrections of the whole run: a wrong tangent leaves the history as it is, but takes more of them.
    ending : str
        How the run ended, where it did not end well: status, and step, body and element that it names.
    """

    t: Array
    axis: str
    columns: tuple[Column, ...]
    values: Array
    corrections: int = 0
    ending: str = ""

    def of_quantity(self, quantity: str) -> Array:
        """The columns of a quantity, (n, m)."""
        return self.values[:, [c.quantity == quantity for c in self.columns]]

    @property
    def quantities(self) -> list[str]:
        """Those it has, in order."""
        return list(dict.fromkeys(c.quantity for c in self.columns))


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
    physics: Sequence[str] = field(default=())
    file: str = ""


def physics_of(task: Task) -> list[str]:
    """The scene in words; functions by their names, whose addresses say nothing."""
    scene = task.scene
    parts = [*map(repr, (*scene.bodies, *scene.joints, *scene.loads, *scene.connectors))]
    return [
        re.sub(r" at 0x[0-9a-f]+", "", " ".join(part.split()))
        for part in [*parts, f"gravity {scene.gravity}"]
    ]


def write_baseline(path: Path, task: Task, stored: Baseline, made_by: str) -> None:
    """Write a baseline, whole or not at all."""
    history = stored.history
    decimals = [
        max(0, ceil(-log10(stored.tolerances[c.quantity].value))) + SPARE_DIGITS for c in history.columns
    ]
    lines = [
        FIRST,
        *([f"{FILE}{stored.file}"] if stored.file else []),
        f"# scene: {task.scene.name}",
        *(f"{PHYSICS}{part}" for part in stored.physics),
        f"# run: {task.run_name}",
        f"# solver: {task.solver}",
        f"# settings: {stored.settings}",
        f"# made by (shown, not compared): {made_by}",
        *(
            f"# tolerance of {name}: {t.value:.1e} {UNITS[name]}, {t.reason}"
            for name, t in stored.tolerances.items()
        ),
        f"# Newton corrections: {history.corrections}",
        *([f"# ending: {history.ending}"] if history.ending else []),
        f"# rows: {len(history.t)}",
        ",".join([history.axis, *(c.label for c in history.columns)]),
    ]
    for t, row in zip(history.t, history.values, strict=True):
        lines.append(",".join([f"{t:.9g}", *(f"{v:.{d}f}" for v, d in zip(row, decimals, strict=True))]))
    _replace(path, "\n".join([*lines, LAST, ""]))


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
    body = [line.split(",") for line in lines[1:] if line and not line.startswith("#")]
    rows = _after(head, "# rows: ")
    if lines[-2:] != [LAST, ""] or rows != str(len(body) - 1):
        raise CheckError(
            f"{path} is cut short or edited: {len(body) - 1} rows and {lines[-2] if len(lines) > 1 else ''!r} at "
            f"its end; {rows or 'a number of'} rows and {LAST!r} are needed; renew it with --update"
        )
    try:
        table = np.array(body[1:], dtype=float).reshape(len(body) - 1, len(body[0]))
        columns = tuple(map(Column.of, body[0][1:]))
        tolerances = dict(_tolerance(line) for line in head if line.startswith("# tolerance of "))
        if missing := {c.quantity for c in columns} - set(tolerances):
            raise ValueError(f"the tolerance of {', '.join(sorted(missing))} is missing")
        corrections = int(_after(head, "# Newton corrections: "))
    except (ValueError, KeyError) as error:
        raise CheckError(f"{path} cannot be read: {error}; renew it with --update") from None
    history = History(table[:, 0], body[0][0], columns, table[:, 1:], corrections, _after(head, "# ending: "))
    physics = tuple(line.removeprefix(PHYSICS) for line in head if line.startswith(PHYSICS))
    return Baseline(_after(head, "# settings: "), tolerances, history, physics, _after(head, FILE))


def is_ours(path: Path) -> bool:
    """Whether a file was written by `write_baseline`, whole or not."""
    try:
        with path.open("rb") as file:
            return file.read(len(FIRST)) == FIRST.encode()
    except OSError:
        return False


def note_file(path: Path, file: str) -> None:
    """Write into a stored history which file it belongs to; all else stays as it is."""
    first, *rest = path.read_text(encoding="utf-8").split("\n")
    _replace(path, "\n".join([first, f"{FILE}{file}", *(line for line in rest if not line.startswith(FILE))]))


def _replace(path: Path, content: str) -> None:
    """Write a file so that a reader sees the old one or the whole new one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.part")
    part.write_text(content, encoding="utf-8")
    os.replace(part, path)


def _after(head: Sequence[str], start: str) -> str:
    return next((line.removeprefix(start) for line in head if line.startswith(start)), "")


def _tolerance(line: str) -> tuple[str, Tolerance]:
    name, _, rest = line.removeprefix("# tolerance of ").partition(": ")
    value, _, reason = rest.partition(f" {UNITS[name]}, ")
    if not (float(value) > 0.0 and isfinite(float(value))):
        raise ValueError(f"tolerance of {name} is {value}")
    return name, Tolerance(float(value), reason)
