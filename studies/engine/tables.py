"""Tables: tidy frames as CSV, Markdown and on a terminal, and cells for people."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import Any

import pandas as pd
from pandas.api.types import is_numeric_dtype
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable
from rich.text import Text

from studies.engine import provenance
from studies.engine.files import atomic_write

BUILD = "build_s: CPU time of a call beside its steps; whole_s: steps and that. Compilation is excluded."
#: Longer tables are for programs: in their CSV file only.
MOST_ROWS = 500
#: Columns that only files have; and those that a setting in words, in the same table, already has.
HIDDEN = {"case", "asked", "own", "kind", "repeats", "cpu_spread", "in_turn", "excess"}
IN_SETTING = {
    "element", "quadrature", "integrator", "elements", "dt", "tolerance", "newton_tolerance", "build_s", "steps",
    "newton_iterations",
}  # fmt: skip
#: Names of columns that need a unit or a symbol.
LABELS = {
    "cpu_s": "CPU time of steps (s)", "whole_s": "whole call (s)", "build_s": "set-up (s)", "dofs": "coordinates",
    "dt": "Δt (s)", "t": "t (s)", "t_end": "t end (s)", "stable_dt": "stable Δt (s)",
    "us_per_element_step": "µs per element and step",
}  # fmt: skip


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


def milliseconds(cpu_s: float) -> str:
    """A time in words."""
    return f"{1e3 * cpu_s:.2g} ms" if cpu_s < 0.0995 else f"{cpu_s:.2g} s"


def label(column: object) -> str:
    """Head of a column."""
    return LABELS.get(str(column), str(column).replace("_", " "))


def cell(value: Any, form: str = ".3g") -> str:
    """A value to be read: three digits of a float, a whole one with all of them, nothing for a NaN."""
    if not isinstance(value, float):
        return str(value)
    if isnan(value):
        return ""
    return f"{value:.0f}" if value.is_integer() and abs(value) < 1e6 else f"{value:{form}}"


def readable(frame: pd.DataFrame, hidden: Iterable[str] = ()) -> pd.DataFrame:
    """The columns of a frame that people read, those without a value left out."""
    without = {*HIDDEN, *hidden, *(IN_SETTING if "setting" in frame else ())}
    return frame.drop(columns=list(without), errors="ignore").dropna(axis="columns", how="all")


def markdown(table: Table) -> str:
    """The table with its title, its notes, the commit and the machine."""
    cells = table.frame.map(lambda value: cell(value, ".5g").replace("|", "\\|"))
    rule = ["---:" if is_numeric_dtype(t) else "---" for t in table.frame.dtypes]
    rows = [list(map(str, cells.columns)), rule, *cells.to_numpy().tolist()]
    notes = "".join(f"- {note}\n" for note in table.notes)
    head = f"# {table.title}\n\nComputed by {provenance.stamp()}.\n\n{notes}\n"
    return head + "".join(f"| {' | '.join(row)} |\n" for row in rows)


def write_table(table: Table, folder: Path, for_people: bool = True) -> None:
    """`<name>.csv`, and `<name>.md` if it is for people and has no more rows than they may want to read."""
    atomic_write(folder / f"{table.name}.csv", table.frame.to_csv(index=False, float_format="%.9g"))
    if for_people and table.place == "page" and len(table.frame) <= MOST_ROWS:
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


def say_counts(console: Console, verdicts: Iterable[str]) -> None:
    """Print how often each verdict occurs, in the order in which they appear."""
    counts = pd.Series(list(verdicts)).value_counts(sort=False)
    say(console, ", ".join(f"{count} {verdict}" for verdict, count in counts.items()))


def show_frame(console: Console, title: str, frame: pd.DataFrame) -> None:
    """Print a table, numbers on the right; in a pipe or a file with all of its columns, however wide."""
    shown = RichTable(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)
    for name in frame:
        right = is_numeric_dtype(frame[name])
        shown.add_column(label(name), justify="right" if right else "left", header_style="dim")
    for row in frame.itertuples(index=False, name=None):
        shown.add_row(*(escape(cell(value)) for value in row))
    if not console.is_terminal:
        console.width = max(console.width, 200)
    console.print(shown)
