"""The line of a user's own file at which an error was raised, among the lines of libraries."""

import os
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from traceback import extract_tb
from typing import NamedTuple

#: Characters of a line in a message.
LONGEST_LINE = 80
#: Folders of this program: for an error raised there, the calling line of the user is reported.
OURS = tuple(Path(__file__).resolve().parents[1] / name for name in ("anctmm", "reference", "studies"))


class Line(NamedTuple):
    """A line of a file, with the spaces around it left out; its text is empty where the file cannot be read."""

    file: str
    number: int
    text: str

    def __str__(self) -> str:
        return f"{self.file}, {self.within}"

    @property
    def within(self) -> str:
        """The same without the file."""
        cut = self.text if len(self.text) <= LONGEST_LINE else f"{self.text[: LONGEST_LINE - 1]}…"
        return f"line {self.number}" + (f", {cut!r}" if cut else "")


def line_of(error: BaseException) -> Line | None:
    """The innermost line of a user's file that an error passed, or that Python could not read.

    Returns
    -------
    Line or None
        None if only this program and libraries were at work.
    """
    for raised in _causes(error):
        lines = [Line(f.filename, f.lineno or 0, f.line or "") for f in extract_tb(raised.__traceback__)]
        if isinstance(raised, SyntaxError) and raised.filename and raised.lineno:
            lines.append(Line(raised.filename, raised.lineno, (raised.text or "").strip()))
        if found := next((line for line in reversed(lines) if _is_users(line.file)), None):
            return found
    return None


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """An error, and those it was raised from; each once, as one may be raised from itself."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        yield error
        seen.add(id(error))
        error = error.__cause__


def _is_users(file: str) -> bool:
    """Whether a file is neither this program's nor a library's, nor text that is run."""
    paths = sysconfig.get_paths()
    libraries = [paths[name] for name in ("stdlib", "platstdlib", "purelib", "platlib")]
    libraries += [place for place in sys.path if place.endswith(("site-packages", "dist-packages"))]
    path = Path(os.path.abspath(file))
    return not file.startswith("<") and not any(
        path.is_relative_to(folder) for folder in [*map(str, OURS), *libraries]
    )
