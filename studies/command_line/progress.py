"""Progress of a command on standard error: rich's bar on a terminal, lines elsewhere."""

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic

import typer
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress

from studies.command_line.ending import Code
from studies.engine import files
from studies.engine.runner import Runner

#: s between two lines where the output is no terminal.
SILENT = 15.0


@contextmanager
def sweeping(quick: bool, workers: int | None = None, cluster: str | None = None) -> Iterator[Runner]:
    """A runner that shows its progress; on an interrupt it says what is stored and exits with 130.

    StudyError if both are given, or the cluster cannot be used.
    """
    store, said = files.store_directory(), monotonic()
    with bar() as progress:
        task = progress.add_task("starting", total=None)

        def show(label: str, done: int, total: int) -> None:
            nonlocal said
            progress.update(task, description=label, completed=done, total=total)
            if progress.disable and monotonic() - said >= SILENT:
                said = monotonic()
                print(f"anctmm: {label}: {done} of {total}", file=sys.stderr)

        runner = Runner(store, quick, workers or 1, cluster or "", show=show)
        try:
            yield runner
        except KeyboardInterrupt:
            progress.stop()
            again = shlex.join(["anctmm", *sys.argv[1:]])
            stored = f"Finished runs ({runner.computed} of this session) are stored in {store}"
            stored = stored if store else "Nothing is stored: no directory can be written"
            print(f"Interrupted. {stored}; continue with: {again}", file=sys.stderr)
            raise typer.Exit(Code.INTERRUPTED) from None


def bar() -> Progress:
    """A bar that disappears when it is done; none if standard error is no terminal."""
    console = Console(stderr=True)
    columns = (*Progress.get_default_columns(), MofNCompleteColumn())
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
