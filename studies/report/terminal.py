"""Output of a study on the terminal: a narrow table of its runs, the reasons of failures, and its findings."""

from collections.abc import Sequence

import pandas as pd
from pandas.api.types import is_numeric_dtype
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from studies.engine.console import say, show_table
from studies.engine.running.trial import NO_BEAMS
from studies.engine.study import Result
from studies.engine.tables import Table, error_text, failed, for_people, text
from studies.report.table_view import label, told_by_digits

#: Below it whole numbers are written out.
MOST_WHOLE = 1e6
SHORT = {"generalized-alpha": "gen-alpha"}
#: Heads and whether they hold numbers.
HEADS = (
    ("solver", False), ("element", False), ("integrator", False), ("elements", False), ("dt", True),
    ("error", True), ("cpu (s)", True),
)  # fmt: skip
#: Columns that identify a run in its table.
TELLING = ("elements", "dt")


def glance(result: Result, console: Console) -> None:
    """Print the runs of each scene, why some failed, and the findings."""
    if any(t.name == "accuracy" for t in result.tables):
        _accuracy(result.table("accuracy").frame, console)
    for name in result.shown:
        _shown(result.table(name), console)
    for finding in result.findings:
        say(console, f"• {finding}")
    if result.left_out:
        say(console, f"• This quick run leaves out {result.left_out}")


def _shown(table: Table, console: Console) -> None:
    """A table, part by part; columns that hold one value alone stand in the title of a part."""
    if table.frame.empty:
        return
    about = [c for c in ("scene", "solver", "element", "integrator") if c in table.frame.columns]
    for values, rows in table.frame.groupby(about, sort=False):
        hidden = {*about, "status", *told_by_digits(table.frame)}
        columns = [c for c in table.frame.columns if c not in hidden]
        columns = [c for c in columns if not (rows[c] == NO_BEAMS).all()]
        constant = [c for c in columns if len(rows) > 1 and _is_one_text(rows[c])]
        columns = [c for c in columns if c not in constant and rows[c].notna().any()]
        told = ", ".join(str(value) for value in values if value != NO_BEAMS)
        say(console, f"{table.title}: {told}", "bold")
        shown = RichTable(box=None, padding=(0, 2, 0, 0))
        for column in columns:
            numeric = is_numeric_dtype(rows[column])
            shown.add_column(label(str(column)), justify="right" if numeric else "left", header_style="dim")
        for cells in for_people(rows)[columns].itertuples(index=False, name=None):
            shown.add_row(*map(_cell, cells))
        show_table(console, shown)
        for column in constant:
            say(console, f"{label(str(column))}: {rows[column].iloc[0]}", "dim")
        for status, bad in failed(rows).groupby("status", sort=False) if "status" in rows else ():
            say(console, f"{_where(bad, columns)}{status}", "yellow")
        console.print()


def _where(rows: pd.DataFrame, columns: Sequence[str]) -> str:
    """Meshes and steps of rows, as far as they differ from others of their table."""
    told = [
        f"{label(name)} {', '.join(dict.fromkeys(map(_cell, rows[name])))}"
        for name in TELLING
        if name in columns
    ]
    return f"{'; '.join(told)}: " if told else ""


def _cell(value: object) -> str:
    """Three digits of a number; a whole one, also where a column has gaps, with all of them."""
    if isinstance(value, float) and value == value:
        return f"{value:.0f}" if value.is_integer() and abs(value) < MOST_WHOLE else f"{value:.3g}"
    return escape(text(value))


def _is_one_text(cells: pd.Series) -> bool:
    """Whether a column has the same text in all rows, which is shown once."""
    return not is_numeric_dtype(cells) and cells.nunique(dropna=False) == 1 and isinstance(cells.iloc[0], str)


def _accuracy(frame: pd.DataFrame, console: Console) -> None:
    for scene, runs in frame.groupby("scene", sort=False):
        show_table(console, _runs(str(scene), runs))
        for reference, known in runs.drop_duplicates("reference")[
            ["reference", "reference_error"]
        ].itertuples(index=False):
            about = f"reference: {reference}, known to {known:.1g}"
            say(console, about, "dim")
        console.print()
    for status, runs in failed(frame).groupby("status", sort=False):
        solvers = ", ".join(dict.fromkeys(runs["solver"]))
        say(console, f"{len(runs)} of {solvers}: {status}", "yellow")


def _runs(scene: str, runs: pd.DataFrame) -> RichTable:
    shown = RichTable(title=scene, title_justify="left", title_style="bold", box=None, padding=(0, 1, 0, 0))
    for head, numeric in HEADS:
        shown.add_column(head, justify="right" if numeric else "left", header_style="dim", no_wrap=True)
    for run in runs.to_dict("records"):
        rule = "" if run["quadrature"] in ("full", "-") else f" {run['quadrature']}"
        integrator = SHORT.get(run["integrator"], run["integrator"])
        whole = run["status"].split(":")[0] == "ok"
        # a failed run shows what became of it where its error would stand
        error = error_text(run, form=".3g") if whole else run["status"].split(":")[0]
        shown.add_row(
            run["solver"], run["element"] + rule, integrator, run["elements"], text(run["dt"]), error,
            f"{run['cpu_s']:.3g}" if whole else "",
        )  # fmt: skip
    return shown
