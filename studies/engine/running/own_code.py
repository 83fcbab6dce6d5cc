"""Modules of the user that a run needs: they are sent with the run to a worker that does not have them."""

import sys
from collections.abc import Iterable, Iterator
from functools import cache, partial
from importlib.machinery import PathFinder
from importlib.metadata import packages_distributions
from types import ModuleType
from typing import Any

from studies.engine.running.case_text import parts
from studies.engine.storage.sources import OURS


def own_modules(values: Iterable[Any]) -> list[str]:
    """Names of the loaded modules that values are made of and no other process finds.

    Those of their functions and classes, and whatever these, and their modules, have imported from such modules.

    Parameters
    ----------
    values : iterable
        Cases, functions: with all that they hold.
    """
    waiting = [part for value in values for part in parts(value)]
    spaces: set[int] = set()
    found: set[str] = set()
    while waiting:
        value = waiting.pop()
        for name, space in _homes(value):
            if id(space) in spaces:
                continue
            spaces.add(id(space))
            found |= {name} & sys.modules.keys()
            waiting += space.values()
    return sorted(found)


def _homes(value: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Modules of the user's in which a value is defined: their names, and what these are bound to there."""
    while isinstance(value, partial):
        value = value.func
    value = getattr(value, "__func__", value)  # of a method
    value = getattr(value, "py_func", value)  # of what numba compiles
    if isinstance(value, ModuleType):
        names = [value.__name__]
    else:
        names = [str(getattr(v, "__module__", None) or "") for v in (value, type(value))]
    for name in filter(None, names):
        if not findable(name):
            module = sys.modules.get(name)
            space = getattr(value, "__globals__", {}) if module is None else vars(module)
            yield name, space


@cache
def findable(module: str) -> bool:
    """Whether another process finds a module: it is ours, or belongs to a package that is installed."""
    top = module.partition(".")[0]
    if top in OURS or top in sys.stdlib_module_names or top in sys.builtin_module_names:
        return True
    return top in _installed() and PathFinder.find_spec(top) is not None


@cache
def _installed() -> frozenset[str]:
    return frozenset(packages_distributions())
