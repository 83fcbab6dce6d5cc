"""What a command shows while it works, on standard error."""

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

from studies.command_line.ending import Code

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from studies.engine.runner import Runner, Trial


@contextmanager
def sweeping(quick: bool) -> "Iterator[Runner]":
    """A runner that shows its progress; on an interrupt it says what is kept and exits with 130."""
    from rich.console import Console

    from anctmm.jit.cache_dir import kept_in
    from studies.engine.runner import Runner

    cache = kept_in("runs")
    console = Console(stderr=True)
    with bar(console) as progress:
        task = progress.add_task("starting", total=None)

        def on_done(case: "Trial", done: int, total: int) -> None:
            what = f"{case.scene.name} · {case.solver} {case.element} {case.integrator}"
            on_job(what, done, total)

        def on_job(label: str, done: int, total: int) -> None:
            progress.update(task, description=f"{runner.heading}{label}", completed=done, total=total)

        def note(text: str) -> None:
            console.print(f"anctmm: {text}", style="yellow", markup=False, highlight=False, soft_wrap=True)

        runner = Runner(
            cache,
            repeats=1 if quick else 3,
            budget_s=1.0 if quick else 20.0,
            on_done=on_done,
            note=note,
            on_job=on_job,
        )
        try:
            yield runner
        except KeyboardInterrupt:
            progress.stop()
            again = shlex.join(["anctmm", *sys.argv[1:]])
            kept = (
                f"Finished runs ({runner.computed} of this session) are kept in {cache}; go on with: {again}"
            )
            if cache is None:
                kept = "Nothing is kept, for no directory could be written."
            console.print(f"Interrupted. {kept}", soft_wrap=True, markup=False, highlight=False)
            raise typer.Exit(Code.INTERRUPTED) from None


def bar(console: "Console") -> "Progress":
    """A bar that goes away when it is done; none where nobody looks."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("left"), TimeRemainingColumn(),
    )  # fmt: skip
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
