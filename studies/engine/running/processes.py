"""Independent jobs in several processes, for work that is not timed: parallel jobs disturb each other."""

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_all_start_methods, get_context
from multiprocessing.connection import Connection, wait
from typing import Any

from anctmm.jit.announcing import compiling

#: Children are copies of this process, with its scenes and solvers, which need not be picklable.
FORK = "fork"


class JobError(RuntimeError):
    """A job raised an exception in another process."""


@dataclass(frozen=True)
class Lost:
    """In place of the result of a job whose process ended before it was done.

    Parameters
    ----------
    exitcode : int
        Negative: the number of the signal that ended it.
    """

    exitcode: int

    def __str__(self) -> str:
        if self.exitcode < 0:
            return f"its process was ended by signal {-self.exitcode} ({signal.strsignal(-self.exitcode)})"
        return f"its process ended with exit code {self.exitcode}"


def processors() -> int:
    """Processors that this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def side_by_side(jobs: Sequence[Callable[[], Any]], workers: int) -> Iterator[tuple[int, Any]]:
    """Results of jobs as they come, begun in the order given.

    Where there is one worker, or processes cannot be copied, the jobs are done here, one after another.

    Parameters
    ----------
    jobs : sequence of callables
        Without arguments; results must be picklable.
    workers : int
        Processes at once.

    Returns
    -------
    iterator of (int, result)
        Number of a job and what it returned, or `Lost`. The processes are begun at once, before any thread that shows
        progress: copies of a process with threads may hang.

    Raises
    ------
    JobError
        If a job raises an exception.
    """
    workers = min(workers, len(jobs))
    if workers < 2 or FORK not in get_all_start_methods():
        return ((k, job()) for k, job in enumerate(jobs))
    team = _Workers(jobs)
    for k in range(workers):
        team.begin(k)
    return _results(team, range(workers, len(jobs)))


def _results(team: "_Workers", waiting: Iterable[int]) -> Iterator[tuple[int, Any]]:
    """Results as they come; who has done a job begins one of those that wait."""
    following = iter(waiting)
    with team:
        while team.busy:
            done = team.next_done()
            for k in islice(following, 1):
                team.begin(k)
            yield done


class _Workers:
    """Processes that wait for the number of a job, do it and send what it returned."""

    def __init__(self, jobs: Sequence[Callable[[], Any]]) -> None:
        compiling.together()
        self._jobs = jobs
        self._context: Any = get_context(FORK)
        self._processes: dict[Connection, Any] = {}
        self._idle: list[Connection] = []
        self.busy: dict[Connection, int] = {}

    def __enter__(self) -> "_Workers":
        return self

    def __exit__(self, *_: object) -> None:
        for pipe, process in self._processes.items():
            pipe.close()
            process.terminate()
            process.join()

    def begin(self, k: int) -> None:
        """Have a job done by a process that has nothing to do, or a new one."""
        pipe = self._idle.pop() if self._idle else self._hired()
        pipe.send(k)
        self.busy[pipe] = k

    def next_done(self) -> tuple[int, Any]:
        """Wait for a job: its number and its result."""
        pipe = next(p for p in wait(list(self.busy)) if isinstance(p, Connection))
        k = self.busy.pop(pipe)
        try:
            raised, found = pipe.recv()
        except EOFError:
            process = self._processes.pop(pipe)
            process.join()
            return k, Lost(process.exitcode)
        self._idle.append(pipe)
        if raised:
            raise JobError(found)
        return k, found

    def _hired(self) -> Connection:
        here, there = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(self._jobs, there, here), daemon=True)
        process.start()
        there.close()
        self._processes[here] = process
        return here


def _serve(jobs: Sequence[Callable[[], Any]], pipe: Connection, other: Connection) -> None:
    """Do jobs until there are no more."""
    other.close()  # so that the end of the other process is the end of the pipe
    # Ctrl-C is for the process that began this one, which ends it
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError):
        while True:
            job = jobs[pipe.recv()]
            try:
                answer: tuple[bool, Any] = False, job()
            except Exception as error:
                answer = True, f"{type(error).__name__}: {error}"
            pipe.send(answer)
