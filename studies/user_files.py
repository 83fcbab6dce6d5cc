"""Python files of users: what they define, and errors that name the file."""

import runpy
import sys
from pathlib import Path
from typing import Any

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
        text = raised.msg if isinstance(raised, SyntaxError) else raised
        own = line is not None and Path(line.file).resolve() == path.resolve()
        where = f", {line.within if own else line}," if line else ""
        raise error(f"{said} {path}{where} does not run: {type(raised).__name__}: {text}") from raised
    finally:
        sys.path[:] = places
