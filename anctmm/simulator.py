"""Repeated runs of one scene, which share its equations."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation, discretise
from anctmm.integrators.integrate import integrate
from anctmm.model.scene import Scene
from anctmm.results.accounting import accounted
from anctmm.results.metrics import verified
from anctmm.results.solution import Solution
from anctmm.solve import solve, system_of
from anctmm.validation import flag


class Simulator:
    """A scene and its discretisation, made ready once for many runs.

    Between runs may change where the motion starts (`start`), and what functions of the user's own return: histories
    of loads, drives and free lengths are called anew in each run. All else belongs to the scene and to `run`. Each
    solution equals that of `solve`, bit by bit.

    Parameters
    ----------
    scene : Scene
    run : Discretisation, optional
        Or its fields as keywords.

    Raises
    ------
    DiscretisationError
        Or one of its kinds, as of `anctmm.solve`.

    Examples
    --------
    >>> import anctmm as at
    >>> beam = at.Beam("arm", (0, 0), (1, 0), at.Circle(0.02), at.Material(E=2e7, density=1000))
    >>> scene = at.Scene("arm", [beam], [at.Clamp("arm.start")], gravity=(0.0, -9.81))
    >>> simulator = at.Simulator(scene, mesh=2, t_end=0.1, dt=0.01)
    >>> one, other = simulator.solve(), simulator.solve()
    >>> bool((one.position("arm.end") == other.position("arm.end")).all())
    True
    """

    def __init__(self, scene: Scene, run: Discretisation | None = None, **options: Any) -> None:
        self.system = system_of(scene, discretise(run, options, fixed_step=False))
        self._before = [(x, x.copy()) for x in _arrays(self.system.tables)]

    def solve(self, start: Solution | None = None, *, verify: bool = False) -> Solution:
        """Run the scene; parameters, answer and errors as of `anctmm.solve`."""
        found = self._solved(start)
        if flag("verify", verify):
            return verified(lambda finer: solve(self.system.scene, finer, start=start), found)
        return found

    @accounted
    def _solved(self, start: Solution | None) -> Solution:
        for x, before in self._before:
            x[...] = before
        return integrate(self.system, start)


def _arrays(tables: tuple[Any, ...]) -> Iterator[NDArray[np.float64]]:
    """All arrays of floats in tables, into which runs write."""
    for x in tables:
        if isinstance(x, tuple):
            yield from _arrays(x)
        elif isinstance(x, np.ndarray) and x.dtype == np.float64:
            yield x
