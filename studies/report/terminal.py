"""Output of a study on the terminal: its tables, the reasons of failures, and its findings."""

from rich.console import Console

from studies.engine.study import Result
from studies.engine.tables import Table, readable, say, show_frame

#: Columns that stand in the title where they are the same in all rows.
ABOUT = ("scene", "solver", "element", "integrator")
#: Numbers that the column `digits` shows as one text.
IN_DIGITS = ("value", "uncertainty", "unit")


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
    frame = table.frame
    if frame.empty:
        return
    constant = [c for c in ABOUT if len(frame) > 1 and c in frame and frame[c].nunique() == 1]
    title = ", ".join([table.title, *(str(frame[c].iloc[0]) for c in constant)])
    show_frame(
        console, title, readable(frame, ["status", *constant, *(IN_DIGITS if "digits" in frame else ())])
    )
    if "status" in frame:
        bad = frame["status"][~frame["status"].str.startswith("ok")]
        for why, count in bad.value_counts(sort=False).items():
            say(console, f"{count} of {len(frame)}: {why}", "yellow")
