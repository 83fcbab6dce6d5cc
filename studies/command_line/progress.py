"""Progress of a command on standard error: a bar on a terminal, lines elsewhere."""

import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

import typer

from studies.command_line.ending import Code

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from studies.engine.runner import Runner

#: Parts that take less are not logged, s; longest time between two lines of it, s.
BRIEF, SILENT = 2.0, 15.0
#: Part that must be done before the remaining time is shown: the first ones compile kernels, which takes longer.
FIRST = 0.1


@dataclass
class Log:
    """Lines for output that is no terminal, such as a file: one for each finished part, and some in between.

    Parameters
    ----------
    say : callable
        Writes a line.
    clock : callable
        Seconds since whenever.
    """

    say: Callable[[str], None]
    clock: Callable[[], float] = monotonic
    _began: float = field(init=False)
    _part_began: float = field(init=False)
    _said: float = field(init=False)

    def __post_init__(self) -> None:
        self._began = self._part_began = self._said = self.clock()

    @classmethod
    def on(cls, console: "Console") -> "Log":
        """One that writes to a console, or, where that is a terminal and has a bar, nowhere."""
        from studies.engine.console import say

        return cls(lambda text: None if console.is_terminal else say(console, f"anctmm: {text}"))

    def started(self, label: str, done: int, total: int) -> None:
        """Something begins: of a part its first is what its time is measured from."""
        now = self.clock()
        if done == 0:
            self._part_began = now
        if now - self._said >= SILENT:
            self._line(now, f"{label} is running, {done} of {total} done{self._left(now, done, total)}")

    def done(self, label: str, done: int, total: int) -> None:
        """Something has ended."""
        now = self.clock()
        if done == total and now - self._part_began >= BRIEF:
            self._line(now, f"{label}: done, {total} of {total} in {spoken(now - self._part_began)}")
        elif done < total and now - self._said >= SILENT:
            self._line(now, f"{label}: {done} of {total} done{self._left(now, done, total)}")

    def now(self, text: str) -> None:
        """Say something at once."""
        self._line(self.clock(), text)

    def _left(self, now: float, done: int, total: int) -> str:
        if not done or done < FIRST * total:
            return ""
        return f", {spoken((now - self._part_began) / done * (total - done))} left"

    def _line(self, now: float, text: str) -> None:
        self._said = now
        self.say(f"[{spoken(now - self._began)}] {text}")


def spoken(seconds: float) -> str:
    """A time in words."""
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5970.0 else f"{seconds / 3600.0:.1f} h"


@contextmanager
def sweeping(quick: bool, workers: int | None = None, cluster: str | None = None) -> "Iterator[Runner]":
    """A runner that shows its progress; on an interrupt it says what is kept and exits with 130.

    Parameters
    ----------
    quick : bool
    workers : int, optional
        Processes that compute solutions side by side.
    cluster : str, optional
        Address of a cluster that does.

    Raises
    ------
    SweepError
        If both are given, or the cluster cannot be used.
    """
    from rich.console import Console

    from anctmm.jit.files.cache_dir import kept_in
    from studies.engine.console import say
    from studies.engine.runner import Runner
    from studies.engine.running.ahead import helper
    from studies.engine.running.team import team
    from studies.engine.running.trial import Trial, label_of

    cache = kept_in("runs")
    console = Console(stderr=True)
    log = Log.on(console)
    with team(workers, cluster) as helpers, helper(helpers is None) as beside, bar(console) as progress:
        task = progress.add_task("starting", total=None)

        def on_start(label: str, done: int, total: int) -> None:
            told = f"{runner.heading}{label}"
            progress.update(task, description=shortened(told, console.width), completed=done, total=total)
            log.started(told, done, total)

        def on_job(label: str, done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)
            log.done(f"{runner.heading}{label}", done, total)

        def on_done(case: Trial, done: int, total: int) -> None:
            on_job(label_of(case), done, total)

        def note(text: str) -> None:
            say(console, f"anctmm: {text}", "yellow")

        runner = Runner(
            cache,
            repeats=1 if quick else 3,
            budget_s=1.0 if quick else 20.0,
            on_done=on_done,
            note=note,
            on_job=on_job,
            on_start=on_start,
            team=helpers,
            beside=beside,
        )
        try:
            yield runner
        except KeyboardInterrupt:
            progress.stop()
            say(console, f"Interrupted. {_stored(runner, cache)}")
            raise typer.Exit(Code.INTERRUPTED) from None


def _stored(runner: "Runner", cache: Path | None) -> str:
    """What an interrupted sweep has stored, and the command that continues it."""
    if cache is None:
        return "Nothing is stored, because no directory can be written to."
    again = shlex.join(["anctmm", *sys.argv[1:]])
    stored = (
        f"Finished runs ({runner.computed} of this session) are stored in {cache}; continue with: {again}"
    )
    if runner.forgotten:
        stored += f". {runner.forgotten} runs of scenes with your own functions or classes are not stored"
    return stored


def shortened(text: str, width: int) -> str:
    """A text that leaves room for a bar and times in a line."""
    room = max(width - 46, 20)
    return text if len(text) <= room else f"{text[: room - 1]}…"


def bar(console: "Console") -> "Progress":
    """A bar that disappears when it is done; none if the output is no terminal."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}", markup=False), BarColumn(bar_width=10), MofNCompleteColumn(),
        TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(),
    )  # fmt: skip
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
