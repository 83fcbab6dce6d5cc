"""Stored histories: small CSV files with a header that describes them, readable in a diff."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, isfinite, log10
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from studies.engine import provenance
from studies.engine.files import atomic_write
from studies.regression.scenes import CheckError, Task

Array = NDArray[np.float64]

FIRST, LAST = "# anctmm history 1", "# end"
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


class Tolerance(NamedTuple):
    """Allowed difference of a quantity from the stored one, and its reason."""

    value: float
    reason: str


@dataclass(frozen=True)
class Baseline:
    """A stored history with its settings, the tolerance of each quantity, and the name of the file it belongs to."""

    settings: str
    tolerances: Mapping[str, Tolerance]
    history: History
    file: str = ""


def write_baseline(path: Path, task: Task, stored: Baseline) -> None:
    """Write a baseline, whole or not at all; parts of its scene are shown, functions by their names."""
    history, frame, scene = stored.history, stored.history.frame, task.scene
    sizes = [stored.tolerances[quantity_of(column)].value for column in frame]
    decimals = [max(0, ceil(-log10(size))) + SPARE_DIGITS for size in sizes]
    machine = provenance.machine()
    physics = [*map(repr, (*scene.bodies, *scene.joints, *scene.loads, *scene.connectors))]
    head = [
        ("file", stored.file),
        ("scene", scene.name),
        *(("physics", re.sub(r" at 0x\w+", "", " ".join(part.split()))) for part in physics),
        ("physics", f"gravity {scene.gravity}"),
        ("run", task.run_name),
        ("solver", task.solver),
        ("settings", stored.settings),
        (
            "made by (shown, not compared)",
            f"{machine['cores']} cores, {machine['system']}, {provenance.software()}",
        ),
        *(
            (f"tolerance of {q}", f"{t.value:.1e} {UNITS[q]}, {t.reason}")
            for q, t in stored.tolerances.items()
        ),
        ("Newton corrections", str(history.corrections)),
        ("ending", history.ending),
        ("rows", str(len(frame))),
    ]
    rows = [
        ",".join([f"{t:.9g}", *(f"{v:.{d}f}" for v, d in zip(row, decimals, strict=True))])
        for t, *row in frame.itertuples(name=None)
    ]
    names = ",".join([str(frame.index.name), *frame])
    words = [f"# {name}: {value}" for name, value in head if value]
    atomic_write(path, "\n".join([FIRST, *words, names, *rows, LAST, ""]))


def read_baseline(path: Path) -> Baseline:
    """Read a baseline; CheckError if it is none of ours, or not whole."""
    lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    if lines[0] != FIRST:
        raise CheckError(f"{path} does not begin with {FIRST!r}: it is no history stored by anctmm check")
    head = dict(line[2:].partition(": ")[::2] for line in lines[1:] if line.startswith("# "))
    columns, *body = [line.split(",") for line in lines if line and not line.startswith("#")] or [[""]]
    if lines[-2:] != [LAST, ""] or head.get("rows") != str(len(body)):
        raise CheckError(f"{path} is cut short or edited: {len(body)} rows; renew it with --update")
    try:
        tolerances = {q: _tolerance(head[f"tolerance of {q}"]) for q in map(quantity_of, columns[1:])}
        table = np.array(body, dtype=float).reshape(len(body), len(columns))
        values = dict(zip(columns[1:], table.T[1:], strict=True))
        corrections, ending = int(head["Newton corrections"]), head.get("ending", "")
        history = History.of(table[:, 0], columns[0], values, corrections, ending)
        return Baseline(head["settings"], tolerances, history, head.get("file", ""))
    except (ValueError, KeyError) as error:
        raise CheckError(f"{path} cannot be read: {error}; renew it with --update") from None


def is_ours(path: Path) -> bool:
    """Whether a file was written by `write_baseline`, whole or not."""
    return path.read_bytes().startswith(FIRST.encode())


def _tolerance(text: str) -> Tolerance:
    number, _, reason = text.partition(", ")
    value = float(number.split(" ")[0])
    if not (value > 0.0 and isfinite(value)):
        raise ValueError(f"a tolerance is {value}")
    return Tolerance(value, reason)
