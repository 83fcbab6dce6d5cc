"""Python files of users: the lists that they define, and errors that name the file."""

import runpy
import sys
from pathlib import Path
from typing import TypeVar

from anctmm.errors import AnctmmError, shown
from anctmm.raised import line_of
from anctmm.solvers.foreign_code import contained

Kind = TypeVar("Kind")


def listed_in(
    path: Path, name: str, kind: type[Kind], error: type[AnctmmError], said: str
) -> tuple[Kind, ...]:
    """Things of a kind that a user's Python file lists under a name; the file may import its neighbours.

    `error`, naming the file as `said` ("--scenes"), if it is not there, does not run (then with the line and the
    exception), or lists no such things.
    """
    if not path.is_file():
        what = "no file" if path.exists() else "no such file"
        raise error(f"{said} {path}: {what}; a Python file that defines {name} is needed")
    places = list(sys.path)
    sys.path.insert(0, str(path.resolve().parent))
    try:
        with contained():
            found = runpy.run_path(str(path)).get(name)
    except Exception as raised:
        line = line_of(raised)
        text = raised.msg if isinstance(raised, SyntaxError) else raised
        own = line is not None and Path(line.file).resolve() == path.resolve()
        where = f", {line.within if own else line}," if line else ""
        raise error(f"{said} {path}{where} does not run: {type(raised).__name__}: {text}") from raised
    finally:
        sys.path[:] = places
    if not found or not isinstance(found, list | tuple) or not all(isinstance(one, kind) for one in found):
        what = f"no {name}" if found is None else f"{name} = {shown(found)}"
        raise error(f"{said} {path} defines {what}; a list of at least one {kind.__name__} is needed")
    return tuple(found)
