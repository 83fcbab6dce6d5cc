"""A table on the page: values equal in all rows are shown once, and columns have readable names."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd
from pandas.api.types import is_numeric_dtype

from studies.engine.tables import Table, for_people, text

#: Columns whose name needs a unit or a symbol.
LABELS = {
    "cpu_s": "CPU time (s)",
    "cpu_ms": "CPU time (ms)",
    "build_s": "set-up (s)",
    "wall_s": "wall time (s)",
    "us_per_step": "µs per step",
    "dofs": "DOFs",
    "dt": "Δt (s)",
    "t": "t (s)",
    "t_end": "t end (s)",
    "stable_dt": "stable Δt (s)",
    "growth_rate": "growth rate (1/s)",
    "us_per_element_step": "µs per element and step",
    "target_error": "target error",
}
#: Told once above a table where they are the same in all of its rows.
COMMON = ("scene", "solver", "element", "quadrature", "integrator")
#: Numbers that were chosen, not found.
CHOSEN = {
    "elements", "all_elements", "dofs", "dt", "stable_dt", "t", "t_end", "target_error", "tolerance",
    "newton_tolerance", "repeats", "steps", "fraction", "psi", "phi",
}  # fmt: skip
#: Cells with more characters may be broken into lines.
LONG = 48
#: Tables with no more rows and columns are open.
SHORT, NARROW = 12, 10
#: A finding that begins with what it is about.
ABOUT = re.compile(r"([^:.]{1,40}): (.+)", re.DOTALL)


@dataclass(frozen=True)
class Column:
    """A column: its name for people, whether it holds numbers, and whether these were found in runs."""

    label: str
    numeric: bool
    found: bool


@dataclass(frozen=True)
class View:
    """What is shown of a table.

    Parameters
    ----------
    common : sequence of (str, str)
        What is the same in all rows, with its name.
    columns : sequence of Column
    rows : sequence of sequence of (str, str)
        Text of each cell, and its classes of CSS.
    """

    common: Sequence[tuple[str, str]]
    columns: Sequence[Column]
    rows: Sequence[Sequence[tuple[str, str]]]


def view(table: Table) -> View:
    """What is shown of a table."""
    frame = table.frame
    told = [c for c in COMMON if len(frame) > 1 and c in frame and frame[c].nunique(dropna=False) == 1]
    shown = frame.drop(columns=told + told_by_digits(frame))
    columns = [
        Column(label(str(n)), numeric(t), numeric(t) and str(n) not in CHOSEN)
        for n, t in shown.dtypes.items()
    ]
    names = [str(name) for name in shown.columns]
    told_as = for_people(frame)[list(shown.columns)]
    rows = [
        [_cell(text(value), name, column) for value, name, column in zip(record, names, columns, strict=True)]
        for record in told_as.itertuples(index=False, name=None)
    ]
    common = [(label(c), text(frame[c].iloc[0])) for c in told if c in COMMON]
    return View(common, columns, rows)


def told_by_digits(frame: pd.DataFrame) -> list[str]:
    """Columns of numbers that the column `digits` shows as one text, a value with its uncertainty and unit."""
    numbers = ["value", "uncertainty", "unit"]
    return numbers if {"digits", *numbers} <= set(frame.columns) else []


def numeric(kind: object) -> bool:
    """Whether a column of a kind holds numbers."""
    return bool(is_numeric_dtype(kind))  # type: ignore[arg-type]


def is_short(frame: pd.DataFrame) -> bool:
    """Whether a table is small enough to be open."""
    return frame.shape[0] <= SHORT and frame.shape[1] <= NARROW


def label(name: str) -> str:
    """A column's name for people."""
    return LABELS.get(name, name.replace("_", " "))


def by_subject(findings: Sequence[str]) -> list[tuple[str, str]]:
    """Findings that all begin with what they are about, in two columns; nothing where one does not."""
    found = [ABOUT.fullmatch(finding) for finding in findings]
    parts = [(match[1], match[2]) for match in found if match]
    return parts if len(parts) == len(findings) > 2 else []


def _cell(shown: str, name: str, column: Column) -> tuple[str, str]:
    classes = {
        "number": column.numeric,
        "found": (column.found and bool(shown)) or name == "digits",
        "long": not column.numeric and len(shown) > LONG,
        "bad": name == "status" and not shown.startswith("ok"),
    }
    return shown, " ".join(c for c, given in classes.items() if given)
