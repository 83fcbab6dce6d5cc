"""The line of a user's own file at which an error was raised, among the lines of libraries."""

import linecache
import os
import sys
import sysconfig
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from traceback import extract_tb

#: Characters of a line in a message.
LONGEST_LINE = 80
#: Folders of this program: for an error raised there, the calling line of the user is reported.
OURS = tuple(Path(__file__).resolve().parents[1] / name for name in ("anctmm", "reference", "studies"))


@dataclass(frozen=True)
class Line:
    """A line of a file.

    Parameters
    ----------
    file : str
        As Python knows it.
    number : int
    text : str
        Without the spaces around it; cut where it is long, empty where the file cannot be read.
    """

    file: str
    number: int
    text: str

    def __str__(self) -> str:
        return f"{self.file}, {self.within}"

    @property
    def within(self) -> str:
        """The same for who knows the file."""
        return f"line {self.number}" + (f", {self.text!r}" if self.text else "")


def line_of(error: BaseException) -> Line | None:
    """The innermost line of a user's file that an error passed, or that Python could not read.

    Parameters
    ----------
    error : exception

    Returns
    -------
    Line or None
        None if only this program and libraries were at work.
    """
    for raised in _causes(error):
        linecache.checkcache()  # files may have been changed
        passed = [(f.filename, f.lineno, f.line or "") for f in extract_tb(raised.__traceback__)]
        if isinstance(raised, SyntaxError) and raised.filename and raised.lineno:
            text = linecache.getline(raised.filename, raised.lineno).strip()
            passed.append((raised.filename, raised.lineno, text))
        for file, number, text in reversed(passed):
            if _is_users(file) and number is not None:
                return Line(file, number, _shortened(text))
    return None


def _shortened(text: str) -> str:
    """A line of a file as messages have it."""
    return text if len(text) <= LONGEST_LINE else f"{text[: LONGEST_LINE - 1]}…"


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """An error, and those it was raised from; each once, as one may be raised from itself."""
    seen: list[BaseException] = []
    while error is not None and not any(error is known for known in seen):
        yield error
        seen.append(error)
        error = error.__cause__


def _is_users(file: str) -> bool:
    """Whether a file is neither this program's nor a library's, nor none at all as text that is run."""
    if file.startswith("<"):
        return False
    path = Path(os.path.abspath(file))
    return not any(path.is_relative_to(folder) for folder in (*OURS, *_libraries()))


def _libraries() -> set[Path]:
    """Folders of Python's own library and of installed packages."""
    paths = sysconfig.get_paths()
    known = {paths[name] for name in ("stdlib", "platstdlib", "purelib", "platlib")}
    installed = {place for place in sys.path if place.endswith(("site-packages", "dist-packages"))}
    return {Path(place) for place in known | installed}
