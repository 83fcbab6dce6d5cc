"""Output of a study on the terminal: its tables, the reasons of failures, and its findings."""

from pandas.api.types import is_numeric_dtype
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from studies.engine.console import say, show_table
from studies.engine.study import Result
from studies.engine.tables import Table, failed, for_people
from studies.report.page import HIDDEN, IN_SETTING, LABELS

#: Columns that stand in the title where they are the same in all rows.
ABOUT = ("scene", "solver", "element", "integrator")
#: Numbers that the column `digits` shows as one text.
IN_DIGITS = {"value", "uncertainty", "unit"}


def glance(result: Result, console: Console) -> None:
    """Print the tables of a study for people, why runs failed, and the findings."""
    for name in result.shown:
        _show(result.table(name), console)
    for finding in result.findings:
        say(console, f"• {finding}")
    if result.left_out:
        say(console, f"• This quick run leaves out {result.left_out}")


def _show(table: Table, console: Console) -> None:
    """A table; columns with one text in all rows stand in its title."""
    frame = (
        for_people(table.frame)
        .drop(columns=list(HIDDEN & set(table.frame.columns)))
        .dropna(axis=1, how="all")
    )
    if frame.empty:
        return
    hidden = (
        {"status"}
        | (IN_SETTING if "setting" in frame else set())
        | (IN_DIGITS if "digits" in frame else set())
    )
    frame = frame.drop(columns=list(hidden & set(frame.columns)))
    constant = [c for c in ABOUT if len(frame) > 1 and c in frame and frame[c].nunique() == 1]
    title = ", ".join([table.title, *(str(frame[c].iloc[0]) for c in constant)])
    shown = RichTable(title=title, title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))
    names = [c for c in frame if c not in constant]
    for name in names:
        side = "right" if is_numeric_dtype(frame[name]) else "left"
        shown.add_column(LABELS.get(str(name), str(name).replace("_", " ")), justify=side, header_style="dim")  # type: ignore[arg-type]
    for cells in frame[names].itertuples(index=False, name=None):
        shown.add_row(*map(_cell, cells))
    show_table(console, shown)
    if "status" in table.frame:
        for status, bad in failed(table.frame).groupby("status", sort=False):
            say(console, f"{len(bad)} of {len(table.frame)}: {status}", "yellow")
    console.print()


def _cell(value: object) -> str:
    """Three digits of a number; a whole one with all of them."""
    if isinstance(value, float):
        if value != value:
            return ""
        return f"{value:.0f}" if value.is_integer() and abs(value) < 1e6 else f"{value:.3g}"
    return escape(str(value))
