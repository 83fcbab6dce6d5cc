"""Locks for a machine: either several runs at the same time, or one that is timed, without other runs of ours."""

import hashlib
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from anctmm.jit.files import cache_dir as storage
from studies.engine.measuring.timing import pinned
from studies.engine.storage import provenance

try:
    import fcntl
except ImportError:  # a system without it: sessions do not know of each other
    fcntl = None  # type: ignore[assignment]


@dataclass
class Interval:
    """When something was at work: machine, process, and the machine's clock, s, when it began and ended."""

    machine: str
    process: int
    begin: float
    end: float = float("nan")


@contextmanager
def at_work() -> Iterator[Interval]:
    """The interval that the context takes; its end is known afterwards."""
    interval = Interval(provenance.name(), os.getpid(), time.time())
    try:
        yield interval
    finally:
        interval.end = time.time()


@dataclass
class Turns:
    """Two kinds of work on one machine, of all processes that use one store: together, or alone.

    A process that ends, in whatever way, gives its turn back.

    Parameters
    ----------
    name : str
        Of the store; without one other processes are not looked at.
    note : callable
        Told if no turns can be taken.
    """

    name: str = ""
    note: Callable[[str], None] = storage.note
    _depth: int = field(default=0, repr=False)

    @classmethod
    def of(cls, store: Path | None, note: Callable[[str], None]) -> "Turns":
        """Turns of all who use a store."""
        return cls(
            "" if store is None else hashlib.sha256(str(store.resolve()).encode()).hexdigest()[:16], note
        )

    @contextmanager
    def together(self) -> Iterator[None]:
        """Work that measures no time: others may do the same, none is timed meanwhile."""
        with self._turn(exclusive=False):
            yield

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Work that is timed: on one core, with no other of ours on this machine."""
        with self._turn(exclusive=True), pinned():
            yield

    @contextmanager
    def _turn(self, exclusive: bool) -> Iterator[None]:
        """Hold the turn; inside one that is held already there is nothing to wait for."""
        path = None if self._depth or not self.name or fcntl is None else self._path()
        self._depth += 1
        try:
            with _locked(path, exclusive):
                yield
        finally:
            self._depth -= 1

    def _path(self) -> Path | None:
        """The file that is locked: local to the machine, wherever the store lies."""
        owner = os.getuid() if hasattr(os, "getuid") else "user"
        place = Path(tempfile.gettempdir(), f"anctmm-turns-{owner}")
        reason = storage.why_not_own(place)
        if reason:
            self.note(f"other sessions may run beside what is timed: {place} cannot be used ({reason})")
            self.name = ""
            return None
        return place / f"{self.name}.turns"


@contextmanager
def _locked(path: Path | None, exclusive: bool) -> Iterator[None]:
    """Lock a file. Whoever waits to be alone stands at a gate, where all who come later wait as well."""
    if path is None:
        yield
        return
    lock: Any = fcntl
    with open(path.with_suffix(".gate"), "ab") as gate, open(path, "ab") as file:
        lock.flock(gate, lock.LOCK_EX)
        try:
            lock.flock(file, lock.LOCK_EX if exclusive else lock.LOCK_SH)
        finally:
            lock.flock(gate, lock.LOCK_UN)
        try:
            yield
        finally:
            # also for copies of this process that a run may have left behind
            lock.flock(file, lock.LOCK_UN)
