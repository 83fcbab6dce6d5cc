"""Solvers by name: every installed package may add its own by the entry-point group `anctmm.solvers`.

A package that cannot be loaded, or returns an invalid solution, causes an error that names it; the others continue.
"""

import sys
from collections.abc import Callable
from functools import lru_cache, wraps
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import numpy as np

from anctmm.errors import PluginError, UnknownSolverError, shown
from anctmm.model.rigid_bodies import CENTER
from anctmm.model.scene import Beam, Scene
from anctmm.results.accounting import accounted
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers.capabilities import Offer
from anctmm.solvers.foreign_code import contained

GROUP = "anctmm.solvers"
#: The package whose names nobody else can take.
OWN = "anctmm"

Solver = Callable[..., Solution]


@lru_cache(maxsize=1)
def _read(path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Entry points of all solvers on a path; reading takes some 15 ms, and studies ask for each run."""
    return tuple(entry_points(group=GROUP))


def _registered() -> tuple[EntryPoint, ...]:
    return _read(tuple(sys.path))


def names() -> list[str]:
    """Names of all registered solvers, sorted."""
    return sorted({e.name for e in _registered()})


def origins() -> list[tuple[str, str]]:
    """Names of the registered solvers with the package and function each comes from; both, if two have one name."""
    return sorted((e.name, f"{_package(e)}: {e.value}") for e in _registered())


def solver(name: str) -> Solver:
    """The solver of a name: (scene, discretisation) → Solution. Its answers are checked to be solutions.

    UnknownSolverError if no package registers that name. PluginError if it cannot be loaded, or two packages register
    that name; when called, if it returns an invalid solution.
    """
    return checked(name, load(name))


def load(name: str) -> Solver:
    """The solver of a name as registered, with unchecked answers; errors as for `solver`."""
    found = [e for e in _registered() if e.name == name]
    if not found:
        raise UnknownSolverError(f"solver {name!r} is not registered; known are {', '.join(names())}")
    entry = next((e for e in found if _package(e) == OWN), found[0])
    if len(found) > 1 and _package(entry) != OWN:
        raise PluginError(
            f"solver {name!r} is registered by {' and '.join(map(_package, found))}; one of them must go"
        )
    what = f"solver {name!r} of package {_package(entry)} ({entry.value})"
    try:
        with contained():
            loaded = entry.load()
    except Exception as error:  # whatever another's module does when imported
        raise PluginError(f"{what} cannot be loaded: {type(error).__name__}: {error}") from error
    if not callable(loaded):
        raise PluginError(f"{what} is {shown(loaded)}; a function (scene, run) is needed")
    return loaded  # type: ignore[no-any-return]


def static_of(name: str, solver: Solver) -> Solver:
    """The `solve_static` in the module of a solver, whose answers are checked, too; PluginError if there is none."""
    return checked(name, load_static(name, solver))


def load_static(name: str, solver: Solver) -> Solver:
    """The same as `static_of`, with unchecked answers."""
    static = getattr(import_module(solver.__module__), "solve_static", None)
    if static is None:
        raise PluginError(f"solver {name!r} has no solve_static beside it; it runs dynamic scenes only")
    return static  # type: ignore[no-any-return]


def offer_of(solver: Solver) -> Offer:
    """The `OFFER` in the module of a solver; without one it claims everything. PluginError if it is no Offer."""
    module = import_module(solver.__module__)
    found = getattr(module, "OFFER", Offer())
    if not isinstance(found, Offer):
        raise PluginError(
            f"OFFER of module {module.__name__!r} is {shown(found)}; an anctmm.solvers.capabilities.Offer is needed"
        )
    return found


def checked(name: str, solve: Solver) -> Solver:
    """The same solver, whose answers are solutions of the scene or a PluginError that names it; see `accounted`."""
    counted = accounted(solve)

    @wraps(solve)
    def solver(scene: Scene, *arguments: Any, **options: Any) -> Solution:
        answer = counted(scene, *arguments, **options)
        # along the arc length of a path of equilibria load factors fall, too
        if reason := flaw(scene, answer, growing=options.get("path") != "arclength"):
            raise PluginError(f"solver {name!r} answers scene {scene.name!r} with {reason}")
        return answer

    return solver


def flaw(scene: Scene, answer: object, *, growing: bool = True) -> str:
    """Why an answer is no valid solution of a scene; empty if it is valid. Its accuracy is not checked.

    `growing`: whether its times must grow.
    """
    if not isinstance(answer, Solution):
        return f"a {type(answer).__name__}; an anctmm.Solution is needed"
    if not isinstance(answer.status, Status):
        return f"the status {answer.status!r}; an anctmm.Status is needed"
    t = np.asarray(answer.t)
    if t.ndim != 1 or t.dtype.kind not in "iuf" or not np.isfinite(t).all():
        return f"times of shape {t.shape} and type {t.dtype}; finite numbers (n,) are needed"
    if not len(t):
        return "no times and the status ok; a reason is needed" if answer.status.ok else ""
    if growing and (np.diff(t) <= 0.0).any():
        return "times that do not increase"
    for body in scene.bodies:
        if body.name not in answer.fields:
            return f"no field of body {body.name!r}; one for every body is needed"
        place = 1.0 if isinstance(body, Beam) else CENTER
        found, needed = np.asarray(answer.fields[body.name].position(place)), (len(t), scene.dim)
        if found.shape != needed:
            return f"positions of body {body.name!r} of shape {found.shape}; {needed} is needed"
        if not np.isfinite(found).all():
            return f"positions of body {body.name!r} that are not finite; a history is kept up to its failure"
    return ""


def _package(entry: EntryPoint) -> str:
    return entry.dist.name if entry.dist else "?"
