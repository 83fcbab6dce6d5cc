"""Foreign code: a plug-in, a file of scenes, a law of a connector. Whatever it raises becomes an error with a name."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import RLock
from typing import Any, NoReturn


class ProcessExit(Exception):
    """Code of others tried to end the program."""


@dataclass(eq=False)
class _Before:
    """What a context has found: the working directory, None if it was removed, and the streams."""

    place: str | None
    streams: tuple[Any, Any]


class _Process:
    """What contexts keep as it is in this process, whose threads may run code of others at the same time."""

    def __init__(self) -> None:
        self._leave = os._exit
        self._begin()
        if hasattr(os, "register_at_fork"):  # where there is no fork, nothing is inherited
            os.register_at_fork(after_in_child=self._fork)

    def _begin(self) -> None:
        self._lock = RLock()
        #: Of the contexts that have not ended, in the order in which they began.
        self._open: list[_Before] = []

    def _fork(self) -> None:
        """A process that code of others has started ends as it likes."""
        if self._open:
            os._exit = self._leave
        self._begin()

    def _refuse(self, status: int) -> NoReturn:
        raise ProcessExit(f"it calls os._exit({status!r})")

    def enter(self) -> _Before:
        """Refuse `os._exit` from now on."""
        with self._lock:
            if not self._open:
                self._leave, os._exit = os._exit, self._refuse  # type: ignore[assignment]
            before = _Before(_directory(), (sys.stdout, sys.stderr))
            self._open.append(before)
        return before

    def leave(self, before: _Before) -> None:
        """Bring back what a context has found; the last one that ends allows `os._exit` again."""
        with self._lock:
            if before not in self._open:  # of the process that this one was forked from
                return
            later = self._open[self._open.index(before) + 1 :]
            self._open.remove(before)
            if later:  # another thread's: what it has found may be what this one's code has made
                later[0].place, later[0].streams = before.place, before.streams
            else:
                sys.stdout, sys.stderr = before.streams
                if before.place is not None and _directory() != before.place:
                    os.chdir(before.place)
            if not self._open:
                os._exit = self._leave


_process = _Process()


@contextmanager
def contained() -> Iterator[None]:
    """Run code of others: an attempt to end the program is an exception like others; directory and output stay.

    Threads may be in such contexts at the same time.

    Raises
    ------
    ProcessExit
        In the place of SystemExit and of `os._exit`, which would pass for a run that went well, and of whatever else
        is no Exception.
    KeyboardInterrupt
        The user's, which passes; in the place of an error that compiled code made of it, too.
    """
    before = _process.enter()
    try:
        yield
    except SystemExit as error:
        raise ProcessExit(f"it calls sys.exit({error.code!r})") from error
    except KeyboardInterrupt:
        raise
    except Exception as error:
        raise_interruption(error)
        raise
    except BaseException as error:
        raise ProcessExit(f"it raises {type(error).__name__}: {error}") from error
    finally:
        _process.leave(before)


def raise_interruption(error: BaseException) -> None:
    """Raise KeyboardInterrupt in the place of an error that compiled code made of one; return where there was none.

    A function in C that returns although Ctrl-C has raised KeyboardInterrupt ends with a SystemError, "returned a
    result with an exception set", that is caused by it.
    """
    while isinstance(error, Exception):
        before = error.__cause__
        if before is None and isinstance(error, SystemError):
            before = error.__context__
        if isinstance(before, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        if before is None:
            return
        error = before


def told(value: Any, length: int = 200) -> str:
    """A value in a message: one short line, whatever its own representation does."""
    try:
        with contained():
            text = " ".join(repr(value).split())
    except Exception as error:
        text = f"<{type(value).__name__}, whose repr raises {type(error).__name__}>"
    return text if len(text) <= length else f"{text[: length - 1]}…"


def _directory() -> str | None:
    """The working directory; None if it was removed."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return None
