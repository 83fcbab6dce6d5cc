"""Solvers by name: every installed package may add its own through the entry-point group `anctmm.solvers`."""

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any

from anctmm.errors import UnknownSolverError

GROUP = "anctmm.solvers"


def names() -> list[str]:
    """Names of all registered solvers, sorted."""
    return sorted({e.name for e in entry_points(group=GROUP)})


def solver(name: str) -> Callable[..., Any]:
    """The solver of a name: (scene, discretisation) → Solution.

    Raises
    ------
    UnknownSolverError
        If no package registers that name.
    """
    found = [e for e in entry_points(group=GROUP) if e.name == name]
    if not found:
        raise UnknownSolverError(f"solver {name!r} is not registered; known are {', '.join(names())}")
    return found[0].load()  # type: ignore[no-any-return]
