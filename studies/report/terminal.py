"""Output of a study on the terminal: its tables, the reasons of failures, and its findings."""

from pandas.api.types import is_numeric_dtype
from rich.console import Console
from rich.markup import escape

from studies.engine.study import Result
from studies.engine.tables import Table, cell, for_people, rich_table, say, show_table
from studies.report.page import HIDDEN, IN_SETTING, label

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
    """A table; columns with one text in all rows stand in its title, statuses below it."""
    frame = for_people(table.frame).dropna(axis=1, how="all")
    if frame.empty:
        return
    constant = [c for c in ABOUT if len(frame) > 1 and c in frame and frame[c].nunique() == 1]
    hidden = HIDDEN | {"status", *constant}
    hidden |= IN_SETTING if "setting" in frame else set()
    hidden |= IN_DIGITS if "digits" in frame else set()
    title = ", ".join([table.title, *(str(frame[c].iloc[0]) for c in constant)])
    frame = frame[[c for c in frame if c not in hidden]]
    shown = rich_table(title, {label(str(c)): is_numeric_dtype(frame[c]) for c in frame})
    for row in frame.itertuples(index=False, name=None):
        shown.add_row(*(escape(cell(value)) for value in row))
    show_table(console, shown)
    if "status" in table.frame:
        status = table.frame["status"]
        for why, count in status[~status.str.startswith("ok")].value_counts(sort=False).items():
            say(console, f"{count} of {len(status)}: {why}", "yellow")
