"""Output of `anctmm recommend`."""

from rich.console import Console
from rich.markup import escape
from rich.syntax import Syntax
from rich.table import Table

from studies.engine.console import say, show_table
from studies.engine.tables import milliseconds
from studies.trade.recommend import Choice, Rerun
from studies.trade.tables import parts_text, setting_of


def show(choice: Choice, origin: str, warning: str, console: Console) -> None:
    """Print the setting, its cost and error, a warning if there is one, and the runners-up."""
    line = choice.line
    for remark in choice.remarks:
        say(console, f"{'Note' if choice.reached else 'Not reached'}: {remark}.", "yellow")
    head = "Recommended" if choice.reached else "Nearest"
    say(console, f"{head}: {setting_of(line)}", "bold")
    say(
        console,
        f"expected {milliseconds(line['cpu_s'])} of CPU time; error bound {line['error_bound']:.2g} "
        f"({parts_text(line)}); from {origin}",
    )
    if warning:
        say(console, f"Note: {warning}.", "dim")
    if len(choice.runners_up):
        shown = Table(
            title="Runners-up, the cheapest of each kind",
            title_justify="left",
            box=None,
            padding=(0, 2, 0, 0),
        )
        for name, right in (("setting", False), ("CPU time", True), ("ratio", True), ("error bound", True)):
            shown.add_column(name, justify="right" if right else "left", header_style="dim")
        for other in choice.runners_up.to_dict("records"):
            cost = milliseconds(other["cpu_s"])
            shown.add_row(
                escape(setting_of(other)), cost, f"{other['ratio']:.3g}", f"{other['error_bound']:.2g}"
            )
        show_table(console, shown)
    console.print()


def show_script(script: str, console: Console) -> None:
    """Print the script; if the output is no terminal, exactly as it can be run, without line breaks and colours."""
    if console.file.isatty():
        console.print(Syntax(script, "python", background_color="default"))
    else:
        print(script)


def show_rerun(again: Rerun, choice: Choice, target: float | None, console: Console) -> None:
    """Print the result of the script."""
    goal = (
        f"the target error {target:g}"
        if target is not None and choice.reached
        else f"the table's {choice.line['error']:.2g}"
    )
    verdict = "meets" if again.met else "MISSES"
    say(
        console,
        f"Rerun of this script: {again.status}, error {again.error:.3g} {verdict} {goal}; "
        f"{milliseconds(again.cpu_s)} of CPU time.",
        "green" if again.met else "red",
    )
