"""Tables: tidy frames as CSV, Markdown and on a terminal, and cells for people."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan, nan
from pathlib import Path
from typing import Any

import pandas as pd
from pandas.api.types import is_numeric_dtype
from rich import box
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from studies.engine import provenance
from studies.engine.files import atomic_write

BUILD = (
    "build_s: CPU time of a call beside its steps: building the system before them, the answer and its checks after "
    "them; whole_s: steps and that. Compilation is excluded."
)
#: Longer tables are for programs: in their CSV file only.
MOST_ROWS = 500
#: Errors, and the columns with the uncertainty of their reference.
KNOWN_TO = {
    "error": "reference_error",
    "error_bound": "reference_error",
    "mesh_error": "reference_error",
    "step_error": "step_reference_error",
}
BELOW = "An error below the uncertainty of its reference is shown as below that: < 0.0002. CSV files have the number."


@dataclass(frozen=True)
class Table:
    """A named table."""

    name: str  # of its files
    title: str
    frame: pd.DataFrame
    notes: tuple[str, ...] = ()  # meaning of the columns
    place: str = "page"  # where it is: or "files" (not on the page), or "study" (not in a report at all)


def records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Rows of a frame."""
    return [{str(k): v for k, v in row.items()} for row in frame.to_dict("records")]


def times(ratio: float) -> str:
    """A ratio in a sentence: two digits, and no power of ten."""
    return f"{ratio:.2g}" if ratio < 99.5 else f"{ratio:.0f}"


def milliseconds(cpu_s: float) -> str:
    """A time in words."""
    return f"{1e3 * cpu_s:.2g} ms" if cpu_s < 0.0995 else f"{cpu_s:.2g} s"


def error_text(line: Mapping[Any, Any], name: str = "error", form: str = ".2g") -> str:
    """An error of a row in words; where it is below the uncertainty of its reference, that it is below that."""
    error, known = line[name], line.get(KNOWN_TO[name], nan)
    return f"< {known:{form}}" if 0.0 < error < known else f"{error:{form}}"


def cell(value: Any, form: str = ".3g") -> str:
    """A value to be read: three digits of a float, a whole one with all of them, nothing for a NaN."""
    if not isinstance(value, float):
        return str(value)
    if isnan(value):
        return ""
    return f"{value:.0f}" if value.is_integer() and abs(value) < 1e6 else f"{value:{form}}"


def for_people(frame: pd.DataFrame) -> pd.DataFrame:
    """A frame whose errors are shown as below the uncertainty of their reference, where they are."""
    for name, known in KNOWN_TO.items():
        if {name, known} <= set(frame.columns):
            below = (frame[name] > 0.0) & (frame[name] < frame[known])
            words = frame[known].map("< {:.2g}".format)
            if below.any():
                frame = frame.assign(**{name: frame[name].astype(object).mask(below, words)})
    return frame


def markdown(table: Table) -> str:
    """The table with its title, its notes, the commit and the machine."""
    cells = for_people(table.frame).map(lambda value: cell(value, ".5g").replace("|", "\\|"))
    rule = ["---:" if is_numeric_dtype(t) else "---" for t in table.frame.dtypes]
    rows = [list(map(str, cells.columns)), rule, *cells.to_numpy().tolist()]
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    notes = [f"- {note}" for note in table.notes]
    head = [f"# {table.title}", "", f"Computed by {provenance.stamp()}.", "", *notes, ""]
    return "\n".join([*head, *lines, ""])


def write_table(table: Table, folder: Path, readable: bool = True) -> None:
    """`<name>.csv`, and `<name>.md` if it is for people and has no more rows than they may want to read."""
    atomic_write(folder / f"{table.name}.csv", table.frame.to_csv(index=False, float_format="%.9g"))
    if readable and table.place == "page" and len(table.frame) <= MOST_ROWS:
        atomic_write(folder / f"{table.name}.md", markdown(table))


def write_machine(folder: Path) -> None:
    """Commit, machine and versions beside the CSV files, which have no room for them."""
    facts = {
        "commit": provenance.commit(),
        "machine": provenance.machine(),
        "versions": provenance.versions(),
    }
    atomic_write(folder / "machine.json", json.dumps(facts, indent=2) + "\n")


def say(console: Console, text: str, style: str = "") -> None:
    """Print a sentence as it is: brackets mean nothing; in a pipe or a file it is one line."""
    console.print(Text(text, style), highlight=False, soft_wrap=not console.is_terminal)


def rich_table(title: str, columns: Mapping[str, bool]) -> RichTable:
    """An empty table for a terminal, of columns by name and whether they are on the right."""
    shown = RichTable(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)
    for name, right in columns.items():
        shown.add_column(name, justify="right" if right else "left", header_style="dim")
    return shown


def show_table(console: Console, table: RichTable) -> None:
    """Print a table; in a pipe or a file with all of its columns, however wide."""
    if not console.is_terminal:
        console.width = max(console.width, 200)
    console.print(table)
