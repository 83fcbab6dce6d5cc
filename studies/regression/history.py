"""Stored histories: small CSV files with a header that describes them, readable in a diff."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from io import StringIO
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
    "displacement": "m", "angle": "rad", "kinetic energy": "J", "strain energy": "J", "potential energy": "J",
    "work": "J", "dissipated energy": "J", "reaction": "N", "reaction moment": "N m", "section force": "N",
    "section moment": "N m", "tension": "N", "spring moment": "N m", "frequency": "Hz", "growth rate": "1/s",
    "relative error": "1",
}  # fmt: skip
#: Digits stored below the tolerance.
SPARE_DIGITS = 2


def label(quantity: str, where: str = "") -> str:
    """Head of the column of a quantity at a place; that of a vector's component ends with x or y before the unit."""
    return f"{quantity} {where}".strip() + f" ({UNITS[quantity]})"


def quantity_of(column: Any) -> str:
    """The quantity of a column; ValueError if there is none."""
    for name, unit in UNITS.items():
        if column.startswith(f"{name} ") and column.endswith(f" ({unit})"):
            return name
    raise ValueError(f"column {column!r} is unknown")


class Tolerance(NamedTuple):
    """Allowed difference of a quantity from the stored one, and its reason."""

    value: float
    reason: str


@dataclass(frozen=True)
class History:
    """Few samples of few quantities, of one run.

    The frame has a column for each component of each quantity at each place, see `label`; its index is the time (s),
    the load factor or the number of the sample, and the name of the index says which.
    """

    frame: pd.DataFrame
    corrections: int = 0  # Newton's: a wrong tangent leaves the samples as they are, but takes more of them
    ending: str = ""  # status, step, body and element of a run that did not end well
    settings: str = ""  # the run in words
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)  # of a stored history, by quantity

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


def samples(axis: str, t: Any = (), columns: Iterable[tuple[str, Array]] = ()) -> pd.DataFrame:
    """The frame of a history."""
    return pd.DataFrame(dict(columns), index=pd.Index(t, name=axis, dtype=float), dtype=float)


def write_history(path: Path, task: Task, stored: History) -> None:
    """Write a history, whole or not at all; parts of its scene are shown, functions by their names."""
    scene, texts = task.scene, stored.frame.astype(object)
    for column in texts:
        decimals = max(0, ceil(-log10(stored.tolerances[quantity_of(column)].value))) + SPARE_DIGITS
        texts[column] = texts[column].map(f"{{:.{decimals}f}}".format)
    texts.index = pd.Index([f"{t:.9g}" for t in stored.t], name=stored.frame.index.name)
    parts = map(repr, (*scene.bodies, *scene.joints, *scene.loads, *scene.connectors))
    known = ((q, f"{t.value:.1e} {UNITS[q]}, {t.reason}") for q, t in stored.tolerances.items())
    head = [
        ("scene", scene.name),
        *(("physics", re.sub(r" at 0x\w+", "", " ".join(part.split()))) for part in parts),
        ("physics", f"gravity {scene.gravity}"), ("run", task.run_name), ("solver", task.solver),
        ("settings", stored.settings),
        ("made by (shown, not compared)", f"{provenance.machine()['system']}, {provenance.software()}"),
        *((f"tolerance of {quantity}", text) for quantity, text in known),
        ("Newton corrections", str(stored.corrections)), ("ending", stored.ending), ("rows", str(len(texts))),
    ]  # fmt: skip
    words = [FIRST, *(f"# {name}: {value}" for name, value in head if value)]
    atomic_write(path, "\n".join([*words, texts.to_csv(lineterminator="\n") + LAST, ""]))


def read_history(path: Path) -> History:
    """Read a stored history; CheckError if it is none of ours, or not whole."""
    lines = path.read_text(encoding="utf-8", errors="replace").split("\n")
    if lines[0] != FIRST:
        raise CheckError(f"{path} does not begin with {FIRST!r}: it is no history stored by anctmm check")
    head = dict(line[2:].partition(": ")[::2] for line in lines if line.startswith("# "))
    rows = [line for line in lines if line and not line.startswith("# ")]
    if lines[-2:] != [LAST, ""] or head.get("rows") != str(len(rows) - 1):
        raise CheckError(f"{path} is cut short or edited: {len(rows) - 1} rows; renew it with --update")
    try:
        frame = pd.read_csv(StringIO("\n".join(rows)), dtype=str).astype(float)
        frame = frame.set_index(frame.columns[0])
        tolerances = {q: _tolerance(head[f"tolerance of {q}"]) for q in map(quantity_of, frame)}
        corrections, ending = int(head["Newton corrections"]), head.get("ending", "")
        return History(frame, corrections, ending, head["settings"], tolerances)
    except (ValueError, KeyError) as error:
        raise CheckError(f"{path} cannot be read: {error}; renew it with --update") from None


def _tolerance(text: str) -> Tolerance:
    number, _, reason = text.partition(", ")
    value = float(number.split(" ")[0])
    if not (value > 0.0 and isfinite(value)):
        raise ValueError(f"a tolerance is {value}")
    return Tolerance(value, reason)
