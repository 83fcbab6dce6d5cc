"""Progress of a command on standard error: rich's bar on a terminal, lines elsewhere."""

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import TYPE_CHECKING

import typer

from studies.command_line.ending import Code

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from studies.engine.runner import Runner

#: s between two lines where the output is no terminal.
SILENT = 15.0


@contextmanager
def sweeping(quick: bool, workers: int | None = None, cluster: str | None = None) -> "Iterator[Runner]":
    """A runner that shows its progress; on an interrupt it says what is stored and exits with 130.

    Raises
    ------
    SweepError
        If both are given, or the cluster cannot be used.
    """
    from rich.console import Console

    from studies.engine.files import store_directory
    from studies.engine.runner import Runner
    from studies.engine.tables import say

    console, store = Console(stderr=True), store_directory()
    said = monotonic()
    with bar(console) as progress:
        task = progress.add_task("starting", total=None)

        def show(label: str, done: int, total: int) -> None:
            nonlocal said
            progress.update(task, description=label, completed=done, total=total)
            if not console.is_terminal and monotonic() - said >= SILENT:
                said = monotonic()
                say(console, f"anctmm: {label}: {done} of {total}")

        runner = Runner(store, quick, workers or 1, cluster or "", show=show)
        try:
            yield runner
        except KeyboardInterrupt:
            progress.stop()
            again = shlex.join(["anctmm", *sys.argv[1:]])
            stored = f"Finished runs ({runner.computed} of this session) are stored in {store}; continue with: {again}"
            nowhere = "Nothing is stored: no directory can be written."
            say(console, f"Interrupted. {stored if store else nowhere}")
            raise typer.Exit(Code.INTERRUPTED) from None


def bar(console: "Console") -> "Progress":
    """A bar that disappears when it is done; none if the output is no terminal."""
    from rich.progress import MofNCompleteColumn, Progress

    columns = (*Progress.get_default_columns(), MofNCompleteColumn())
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
