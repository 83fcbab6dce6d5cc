"""Solutions in files: NumPy arrays and a description in JSON, in one `.npz`. Reading runs no code from the file.

`numpy.load(path)` shows the arrays: "t", "energy.kinetic", "fields.beam.coordinates", … Possible are numbers, texts,
containers, NumPy arrays, and instances of dataclasses, whose fields are set without a call. Classes are looked up among
those that this process has already loaded: nothing is imported. Of functions of the user, as drives, loads and laws,
only the name is written, of a joint of a kind of the user's own the name, places and numbers.
"""

import json
import sys
import zipfile
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from anctmm.errors import OutputError, ResultError, reason, shown
from anctmm.model.joints import JOINTS, Joint

#: What marks a file as one of these, with the number of its layout.
FORMAT = "anctmm solution 2"
#: Kinds of numbers that an array may hold: numbers, truth values and texts; no objects.
KINDS = "biufcSU"
Arrays = dict[str, np.ndarray]


class NotPlain(Exception):
    """A result that is more than data, or data that are no result."""


class NotSaved:
    """Represents a function that a file cannot contain, by its name."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __call__(self, *_: object) -> Any:
        """Raises ResultError."""
        raise ResultError(
            f"function {self.name} was not saved with the solution; `load` takes it from a scene"
        )

    def __repr__(self) -> str:
        return f"<{self.name}, not saved>"


class NotSavedJoint(Joint):
    """Represents a joint of a user's own kind, whose equations a file cannot contain; `values` are its attributes."""

    def __init__(self, kind: str, values: Mapping[str, Any]) -> None:
        vars(self).update(values, kind=kind)

    def equations(self, *_: object) -> Any:
        """Raises ResultError."""
        name = f"{vars(self)['kind']} of {shown(self.ends)}"
        raise ResultError(f"{name} was not saved with its equations; `load` takes them from a scene")


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
        tree, arrays = _described(solution)
    except (
        NotPlain,
        RecursionError,
        ValueError,
    ) as error:  # it holds itself, or a number of thousands of digits
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
        found = _value(json.loads(str(held["description"])), held)
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
    (text, arrays), (wanted, others) = _described(one), _described(other)
    return text == wanted and all(np.array_equal(array, others[name]) for name, array in arrays.items())


def _described(value: Any) -> tuple[str, Arrays]:
    """A value as a text in JSON and its arrays, by their places in it; NotPlain where something is no data."""
    arrays: Arrays = {}
    return json.dumps(_plain(value, arrays, ())), arrays


def _plain(value: Any, arrays: Arrays, path: tuple[str, ...]) -> Any:
    """What JSON can hold of a value: itself, or a dictionary with one key, which says what it is."""
    if value is None or type(value) in (bool, int, float, str):
        return value

    def inside(part: Any, *names: Any) -> Any:
        return _plain(part, arrays, (*path, *map(str, names)))

    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in KINDS:
        name = ".".join(path) or "value"
        while name in arrays:
            name += "_"
        arrays[name] = np.ascontiguousarray(value).reshape(value.shape)
        return {"array" if isinstance(value, np.ndarray) else "scalar": name}
    if isinstance(value, dict):
        pairs = [[inside(key, key, "key"), inside(v, key)] for key, v in value.items()]
        return {"dict": pairs} if type(value) is dict else {"mapping": [_name(value), pairs]}
    if type(value) in (list, tuple):
        parts = [inside(v, k) for k, v in enumerate(value)]
        return parts if type(value) is list else {"tuple": parts}
    if isinstance(value, Joint) and type(value) not in JOINTS:
        values = dict(vars(value))
        return {"joint": [values.pop("kind", type(value).__name__), inside(values, "joint")]}
    if is_dataclass(value) and not isinstance(value, type):
        names = [f.name for f in fields(value)]
        return {"dataclass": [_name(value), names, [inside(getattr(value, name), name) for name in names]]}
    if isinstance(value, float):
        return {"number": [_name(value), float(value)]}
    if isinstance(value, NotSaved):
        return {"function": value.name}
    if callable(value) and not isinstance(value, type):
        return {"function": getattr(value, "__qualname__", type(value).__name__)}
    raise NotPlain(f"{type(value).__name__} {getattr(value, '__qualname__', '')!r} is no data")


def _value(plain: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """The value of which `_plain` made this."""
    if isinstance(plain, list):
        return [_value(part, arrays) for part in plain]
    if not isinstance(plain, dict):
        return plain
    ((kind, content),) = plain.items()
    match kind:
        case "array":
            return arrays[content].copy()
        case "scalar":
            return arrays[content][()]
        case "tuple" | "dict":
            return {"tuple": tuple, "dict": dict}[kind](_value(content, arrays))
        case "mapping":
            made = dict.__new__(_class(content[0], dict))
            dict.update(made, _value(content[1], arrays))
            return made
        case "number":
            return float.__new__(_class(content[0], float), content[1])
        case "function":
            return NotSaved(str(content))
        case "joint":
            return NotSavedJoint(content[0], _value(content[1], arrays))
        case "dataclass":
            return _instance(content[0], content[1], _value(content[2], arrays))
    raise NotPlain(f"{kind!r} is no kind of data")


def _instance(name: str, names: list[str], values: list[Any]) -> Any:
    """An instance of a dataclass with the fields it had."""
    kind = _class(name, object)
    if not is_dataclass(kind) or [f.name for f in fields(kind)] != names:
        raise NotPlain(f"{name} has other fields now")
    made = object.__new__(kind)
    for known, value in zip(names, values, strict=True):
        object.__setattr__(made, known, value)
    return made


def _name(value: Any) -> str:
    kind = type(value)
    if _class(name := f"{kind.__module__}:{kind.__qualname__}", object) is not kind:
        raise NotPlain(f"{name} cannot be found by its name")
    return name


def _class(name: str, base: type) -> type[Any]:
    """A class that is loaded, and derived from a base."""
    module, _, path = name.partition(":")
    found: Any = sys.modules.get(module)
    for part in path.split("."):
        found = getattr(found, part, None)
    if not (isinstance(found, type) and issubclass(found, base)):
        raise NotPlain(f"class {name} is not loaded")
    return found


def _npz(path: str | PathLike[str]) -> Path:
    try:
        target = Path(path)
    except TypeError as error:
        raise ResultError(f"path is {shown(path)}; the path of a file is needed") from error
    if target.suffix not in ("", ".npz"):
        raise ResultError(f"path is {str(target)!r}; a solution is kept in a file '.npz'")
    return target.with_suffix(".npz")
