"""Parsing of options. An option that cannot be parsed is named with the allowed values."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from studies.command_line.ending import BadOption

if TYPE_CHECKING:
    from studies.engine.refinement import Setup
    from studies.engine.study import Options
    from studies.engine.trials import Mesh


def read_options(elements: str | None, dt: str | None, solvers: str | None, quick: bool) -> "Options":
    """Options from their texts.

    Raises
    ------
    BadOption
        Naming the option, its value and what is allowed.
    """
    from studies.engine.study import Options

    return Options(
        quick=quick,
        meshes=_list("--elements", elements, _mesh, "whole numbers from 1 on such as 2/8/2,4/16/4 or 8,16"),
        steps=_list("--dt", dt, _step, "positive numbers of seconds such as 1e-5,5e-6"),
        solvers=_list("--solvers", solvers, _solver, "; ".join(_solver_names())),
    )


def texts(option: str, text: str | None) -> tuple[str, ...]:
    """Items of a list as typed; none where the option is not given.

    Raises
    ------
    BadOption
        If it is given and holds nothing.
    """
    if text is None:
        return ()
    items = tuple(item for item in (t.strip() for t in text.split(",")) if item)
    if not items:
        raise BadOption(f"{option} is {text!r}; at least one item is needed, or no {option} at all")
    return items


def one(option: str, values: "tuple[Any, ...] | None") -> Any:
    """The one value of an option that takes a list elsewhere; None where it is not given.

    Raises
    ------
    BadOption
        If there are several.
    """
    if values is not None and len(values) > 1:
        raise BadOption(f"{option} has {len(values)} values; one is allowed here")
    return None if values is None else values[0]


def setup_of(solver: str, element: str | None, integrator: str | None) -> "Setup":
    """Solver, element and integrator; defaults of ANC–TMM where one is not given.

    Raises
    ------
    UnknownOptionError
        Naming the option that is not known.
    """
    from studies.engine.refinement import Setup

    ours = Setup(solver)
    return replace(
        ours,
        element=ours.element if element is None else element,
        integrator=ours.integrator if integrator is None else integrator,
    )


def path(text: str | Path) -> Path:
    """A path as typed; an empty one, as where a variable of the shell is not set, is refused."""
    if not str(text).strip() or "\0" in str(text):
        what = "a path with a null character" if str(text).strip() else "an empty path"
        raise typer.BadParameter(f"{what}; a file or a directory is needed")
    return Path(text)


def _list(option: str, text: str | None, read: Callable[[str], Any], allowed: str) -> tuple[Any, ...] | None:
    if text is None:
        return None
    values = []
    for item in text.split(","):
        try:
            values.append(read(item.strip()))
        except ValueError:
            raise BadOption(f"{option} has {item.strip()!r}; allowed are {allowed}") from None
    return tuple(dict.fromkeys(values))


def _mesh(item: str) -> "Mesh":
    mesh = tuple(int(n) for n in item.split("/"))
    if min(mesh) < 1:
        raise ValueError
    return mesh


def _step(item: str) -> float:
    dt = float(item)
    if not 0.0 < dt < float("inf"):
        raise ValueError
    return dt


def positive(option: str, text: str | None) -> float | None:
    if text is None:
        return None
    try:
        return _step(text)
    except ValueError:
        raise BadOption(f"{option} has {text!r}; allowed are positive numbers such as 1e-3") from None


def whole(option: str, text: str | None) -> int | None:
    """A whole number from 1 on."""
    if text is None:
        return None
    if not (text.isascii() and text.isdigit() and len(text) <= 4 and int(text)):
        raise BadOption(f"{option} has {text!r}; allowed are whole numbers from 1 to 9999")
    return int(text)


def duration(option: str, text: str | None) -> float | None:
    """Seconds of 0.5s, 20ms, 3us or 0.5."""
    if text is None:
        return None
    for unit, factor in (("us", 1e-6), ("ms", 1e-3), ("s", 1.0), ("", 1.0)):
        if text.endswith(unit):
            try:
                return factor * _step(text.removesuffix(unit))
            except ValueError:
                break
    raise BadOption(f"{option} has {text!r}; allowed are positive times such as 0.5s, 20ms or 0.5")


def _solver(item: str) -> str:
    if item not in _solver_names():
        raise ValueError
    return item


def _solver_names() -> list[str]:
    from anctmm.solvers import registry

    return registry.names()
