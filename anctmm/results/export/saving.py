"""Solutions in files: NumPy arrays and a description in JSON, in one `.npz`. Reading runs no code from the file.

`numpy.load(path)` shows the arrays: "t", "energy.kinetic", "fields.beam.coordinates", … A file cannot contain the
user's functions: drives, loads and laws that are Python functions.
"""

import json
import zipfile
import zlib
from contextlib import suppress
from dataclasses import replace
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from anctmm.errors import OutputError, ResultError, reason, shown
from anctmm.results.export.plain_data import NotPlain, describe, rebuild

#: What marks a file as one of these, with the number of its layout.
FORMAT = "anctmm solution 2"
#: What readers raise of a file that is none of these.
UNREADABLE = (
    OSError, EOFError, LookupError, ValueError, TypeError, AttributeError, zipfile.BadZipFile, zlib.error, NotPlain
)  # fmt: skip


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
    target, scene = _npz(path), solution.scene
    try:
        tree, arrays = describe(solution)
    except NotPlain as error:
        raise ResultError(f"solution of scene {scene.name!r} cannot be saved: {error}") from error
    about = {"format": FORMAT, "scene": scene.name, "solver": solution.solver, "status": str(solution.status)}
    texts = {"about": np.array(json.dumps(about)), "description": np.array(tree)}
    part = target.with_name(f".{target.name}.part")
    try:
        with part.open("wb") as file:
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
        layout = json.loads(str(held["about"]))["format"]
        if layout != FORMAT:
            raise ResultError(f"file {str(target)!r} has format {shown(layout)}; {FORMAT!r} is needed")
        found = rebuild(str(held["description"]), held)
        matches = scene is None or _same(found.scene, scene)
    except ResultError:
        raise
    except UNREADABLE as error:
        raise ResultError(
            f"file {str(target)!r} is no saved solution that this version reads: {reason(error)}"
        ) from error
    if not matches:
        raise ResultError(f"file {str(target)!r} is of scene {found.scene.name!r}, not of the one given")
    return found if scene is None else replace(found, scene=scene)


def _same(one: Any, other: Any) -> bool:
    """Whether two scenes are the same; functions are compared by their names."""
    (text, arrays), (wanted, others) = describe(one), describe(other)
    return text == wanted and all(np.array_equal(array, others[name]) for name, array in arrays.items())


def _npz(path: str | PathLike[str]) -> Path:
    try:
        target = Path(path)
    except TypeError as error:
        raise ResultError(f"path is {shown(path)}; the path of a file is needed") from error
    if target.suffix not in ("", ".npz"):
        raise ResultError(f"path is {str(target)!r}; a solution is kept in a file '.npz'")
    return target.with_suffix(".npz")
