"""Code of others: a plug-in, a file of scenes, a load's law. Whatever it raises is an error its caller can name."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NoReturn


class ProcessExit(Exception):
    """Code of others tried to end the program."""


@contextmanager
def contained() -> Iterator[None]:
    """Run code of others: an attempt to end the program is an exception like others; directory and output stay.

    Raises
    ------
    ProcessExit
        In the place of SystemExit and of `os._exit`, which would pass for a run that went well, and of whatever else
        is no Exception. KeyboardInterrupt is the user's and passes.
    """
    place, leave, mine = _directory(), os._exit, os.getpid()
    streams = sys.stdout, sys.stderr

    def refuse(status: int) -> NoReturn:
        if os.getpid() != mine:  # a process that it started ends as it likes
            leave(status)
        raise ProcessExit(f"it calls os._exit({status!r})")

    os._exit = refuse  # type: ignore[assignment]
    try:
        yield
    except SystemExit as error:
        raise ProcessExit(f"it calls sys.exit({error.code!r})") from error
    except (Exception, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise ProcessExit(f"it raises {type(error).__name__}: {error}") from error
    finally:
        os._exit = leave
        sys.stdout, sys.stderr = streams
        if place is not None and _directory() != place:
            os.chdir(place)


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
