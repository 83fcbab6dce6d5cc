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
    """Value of a name that a user's Python file defines; the file may import its neighbours.

    Parameters
    ----------
    path : Path
    name : str
        Of the value.
    error : type of AnctmmError
        Raised where the file cannot be used.
    said : str
        Name of the file in messages: "--scenes".

    Returns
    -------
    object
        None if the file does not define it.

    Raises
    ------
    AnctmmError
        `error`, naming the file, if it is not there or does not run; then also the line and the exception.
    """
    if not path.is_file():
        what = "no file" if path.exists() else "no such file"
        raise error(f"{said} {path}: {what}; a Python file that defines {name} is needed")
    places = list(sys.path)
    sys.path.insert(0, str(path.resolve().parent))
    try:
        with contained():
            defined = runpy.run_path(str(path))
    except Exception as raised:
        raise error(f"{said} {path}{_where(raised, path)} does not run: {_what(raised)}") from raised
    finally:
        sys.path[:] = places
    return defined.get(name)


def _where(raised: Exception, path: Path) -> str:
    """The line of the file, or of one that it imports, for a message; nothing if none is known."""
    line = line_of(raised)
    if line is None:
        return ""
    own = Path(line.file).resolve() == path.resolve()
    return f", {line.within}," if own else f", {line},"


def _what(raised: Exception) -> str:
    """What was raised; of a syntax error without the line, which is reported already."""
    text = raised.msg if isinstance(raised, SyntaxError) and raised.msg else str(raised)
    taken = _taken(text) if isinstance(raised, TypeError) else ""
    return f"{type(raised).__name__}: {text}{taken}"


def _taken(text: str) -> str:
    """What a class or a function of anctmm takes, if the message is about its arguments."""
    called = re.match(r"(\w+)(?:\.__init__)?\(\) ", text)
    thing = getattr(anctmm, called[1], None) if called else None
    return (
        f"; {called[1]} takes {', '.join(signature(thing).parameters)}" if called and callable(thing) else ""
    )
