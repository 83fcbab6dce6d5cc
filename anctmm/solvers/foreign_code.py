"""Foreign code: a plug-in, a file of scenes, a law of a connector. Whatever it raises becomes an error with a name."""

from collections.abc import Iterator
from contextlib import contextmanager


class ProcessExit(Exception):
    """Code of others tried to end the program."""


@contextmanager
def contained() -> Iterator[None]:
    """Run code of others: an attempt to end the program is an exception like others.

    SystemExit, which would pass for a run that went well, and whatever else is no Exception, become ProcessExit; a
    KeyboardInterrupt of the user passes, also in the place of an error that compiled code made of it.
    """
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


def raise_interruption(error: BaseException) -> None:
    """Raise KeyboardInterrupt in the place of an error that compiled code made of one; return where there was none.

    A function in C that returns although Ctrl-C has raised KeyboardInterrupt ends with a SystemError, "returned a
    result with an exception set", that is caused by it.
    """
    found: BaseException | None = error
    while isinstance(found, Exception):
        found = found.__cause__ or (found.__context__ if isinstance(found, SystemError) else None)
    if isinstance(found, KeyboardInterrupt):
        raise KeyboardInterrupt from error
