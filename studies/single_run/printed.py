"""Output of `anctmm run`."""

from functools import partial
from math import isfinite

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from studies.engine.console import say, show_table
from studies.single_run.study import SingleRun


def show(run: SingleRun, console: Console) -> None:
    """Print the setting, what is known of its error, and the values at the probes."""
    line = partial(say, console)

    line(f"{run.case.name}: {run.setting}", "bold")
    if run.case.note:
        line(run.case.note, "dim")
    line(f"{run.solution.status}", "green" if run.solution.status.ok else "red")
    line(run.error, "" if run.good else "yellow")
    line(run.effort)
    if run.values:
        show_table(console, _values(run))
    for other in run.others:
        cost = other.solution.cost.cpu_s
        time = f"; {cost:.2g} s" if isfinite(cost) else ""
        line(
            f"{other.solver} on the same mesh and by the same step: {other.told}{time}",
            "yellow" if other.missed else "",
        )


def _values(run: SingleRun) -> Table:
    shown = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for head in ("probe", "quantity", "value"):
        shown.add_column(head)
    for value in run.values:
        shown.add_row(*map(escape, (value.probe, value.quantity, value.text)))
    return shown
