"""Python files of users: what they define, and errors that name the file."""

import re
import runpy
import sys
from inspect import signature
from pathlib import Path
from typing import Any

import anctmm
from anctmm.errors import AnctmmError
from anctmm.raised import line_of
from anctmm.solvers.foreign_code import contained


def defined_in(path: Path, name: str, error: type[AnctmmError], said: str) -> Any:
    """Value of a name that a user's Python file defines, None without it; the file may import its neighbours.

    Raises
    ------
    AnctmmError
        `error`, naming the file as `said` ("--scenes"), if it is not there or does not run; then also the line and the
        exception.
    """
    if not path.is_file():
        what = "no file" if path.exists() else "no such file"
        raise error(f"{said} {path}: {what}; a Python file that defines {name} is needed")
    places = list(sys.path)
    sys.path.insert(0, str(path.resolve().parent))
    try:
        with contained():
            return runpy.run_path(str(path)).get(name)
    except Exception as raised:
        line = line_of(raised)
        own = line is not None and Path(line.file).resolve() == path.resolve()
        where = f", {line.within if own else line}," if line else ""
        raise error(f"{said} {path}{where} does not run: {_what(raised)}") from raised
    finally:
        sys.path[:] = places


def _what(raised: Exception) -> str:
    """What was raised; of wrong arguments of a class of anctmm also what it takes."""
    text = raised.msg if isinstance(raised, SyntaxError) and raised.msg else str(raised)
    called = re.match(r"(\w+)(?:\.__init__)?\(\) ", text) if isinstance(raised, TypeError) else None
    thing = getattr(anctmm, called[1], None) if called else None
    takes = f"; {called[1]} takes {', '.join(signature(thing).parameters)}" if called and thing else ""
    return f"{type(raised).__name__}: {text}{takes}"
