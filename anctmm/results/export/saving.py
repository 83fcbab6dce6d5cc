"""Solutions in files: NumPy arrays and a description in JSON, in one `.npz`. Reading runs no code from the file.

`numpy.load(path)` shows the arrays: "t", "energy.kinetic", "fields.beam.coordinates", … A file cannot contain the
user's functions: drives, loads and laws that are Python functions.
"""

import json
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from anctmm.errors import OutputError, ResultError, listed, reason, shown
from anctmm.results.export.plain_data import NotPlain, describe, rebuild

#: What marks a file as one of these, with the number of its layout.
FORMAT = "anctmm solution 1"
#: What readers raise of a file that is none of these.
UNREADABLE = (
    OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, zipfile.BadZipFile, zlib.error, NotPlain
)  # fmt: skip
#: Names in the file beside those of arrays.
ABOUT, TREE = "about", "description"


class NotSaved:
    """Represents a function that a file cannot contain.

    Parameters
    ----------
    name : str
    """

    def __init__(self, name: str) -> None:
        self.name = name

    def __call__(self, *_: object) -> Any:
        """Raises ResultError."""
        raise ResultError(
            f"function {self.name} was not saved with the solution; give the scene to `load` to have it"
        )

    def __repr__(self) -> str:
        return f"<{self.name}, not saved>"


def save(solution: Any, path: str | PathLike[str]) -> Path:
    """Write a solution to a file, atomically.

    Parameters
    ----------
    solution : Solution
    path : path
        ".npz" is added if it has no suffix.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    ResultError
        If the path has another suffix, or the scene contains objects that are no data.
    OutputError
        If the file cannot be written.
    """
    target = _npz(path)
    functions = list(_functions(solution.scene))
    try:
        tree, arrays = describe(solution, functions)
    except NotPlain as error:
        raise ResultError(f"solution of scene {solution.scene.name!r} cannot be saved: {error}") from error
    about = {
        "format": FORMAT,
        "scene": solution.scene.name,
        "solver": solution.solver,
        "status": str(solution.status),
        "functions": [_name(f) for f in functions],
    }
    part = target.with_name(f".{target.name}.part")
    try:
        with part.open("wb") as file:
            texts = {ABOUT: np.array(json.dumps(about)), TREE: np.array(tree)}
            np.savez_compressed(file, allow_pickle=False, **{**arrays, **texts})
        part.replace(target)
    except OSError as error:
        with suppress(OSError):
            part.unlink()
        raise OutputError(f"file {str(target)!r} cannot be written: {reason(error)}") from error
    return target


def load(path: str | PathLike[str], scene: Any = None) -> Any:
    """The solution that `save` wrote; parameters and errors as of `anctmm.load`."""
    target = _npz(path)
    try:
        with np.load(BytesIO(target.read_bytes()), allow_pickle=False) as file:
            held = {name: file[name] for name in file.files}
        about = json.loads(str(held[ABOUT]))
        if about["format"] != FORMAT:
            raise ResultError(
                f"file {str(target)!r} has format {shown(about['format'])}; {FORMAT!r} is needed"
            )
        wanted = about["functions"]
        functions = [NotSaved(name) for name in wanted] if scene is None else list(_functions(scene))
        if scene is not None and [_name(f) for f in functions] != wanted:
            raise ResultError(
                f"scene {scene.name!r} has the functions {listed(map(_name, functions))}; file {str(target)!r} needs "
                f"{listed(wanted)}"
            )
        found = rebuild(str(held[TREE]), held, functions)
    except ResultError:
        raise
    except UNREADABLE as error:
        raise ResultError(
            f"file {str(target)!r} is no saved solution that this version reads: {reason(error)}"
        ) from error
    if scene is not None and found.scene != scene:
        raise ResultError(f"file {str(target)!r} is of scene {found.scene.name!r}, not of the one given")
    return found


def _functions(thing: Any) -> Iterator[Callable[..., Any]]:
    """Functions inside a scene, each once, in the order in which they stand; not instances of dataclasses, such as
    `Quintic`, which are data.
    """
    found = {id(part): part for part in _inside(thing) if callable(part) and not is_dataclass(part)}
    yield from found.values()


def _name(function: Callable[..., Any]) -> str:
    return getattr(function, "__qualname__", type(function).__name__)


def _inside(thing: Any) -> Iterator[Any]:
    yield thing
    parts: list[Any] = []
    if isinstance(thing, Mapping):
        parts = list(thing.values())
    elif isinstance(thing, list | tuple):
        parts = list(thing)
    elif is_dataclass(thing) and not isinstance(thing, type):
        parts = [getattr(thing, f.name) for f in fields(thing)]
    for part in parts:
        yield from _inside(part)


def _npz(path: str | PathLike[str]) -> Path:
    try:
        target = Path(path)
    except TypeError as error:
        raise ResultError(f"path is {shown(path)}; the path of a file is needed") from error
    if target.suffix not in ("", ".npz"):
        raise ResultError(f"path is {str(target)!r}; a solution is kept in a file '.npz'")
    return target.with_suffix(".npz")
