"""Work of the loads at equilibria, where it follows from these alone."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from anctmm.model.loads import Force, Load, Torque, tabulated, varies
from anctmm.results.solution import Solution

Array = NDArray[np.float64]


def with_load_work(found: Solution) -> Solution:
    """Equilibria of any solver with the work of what acts beside constant forces, whose potential they have.

    It is that of the whole loads, as `energy.potential` is: moments times angles, forces that vary in time times
    displacements. Forces that turn with their place, and laws, have a work that depends on the way: it is NaN at all
    but the first.
    """
    scene, work = found.scene, np.zeros(len(found.t))
    follows = any(isinstance(load, Force) and load.follower for load in scene.loads)
    if follows or any(c.law is not None for c in scene.connectors):
        work[1:] = np.nan
    else:
        for load in filter(varies, scene.loads):
            work += _work(found, load, tabulated([load], np.zeros(1), scene.dim)[0, 0])
    return replace(found, energy=replace(found.energy, work=work))


def _work(found: Any, load: Load, value: Array) -> Array:
    """Work of a load that varies, J, (outputs,)."""
    if isinstance(load, Torque):
        return np.asarray(value[0] * found.angle(load.end))
    if isinstance(load, Force):
        return np.asarray(found.displacement(load.end) @ value)
    elements = found.run.of(found.scene)[load.body][0]
    points, weights = np.polynomial.legendre.leggauss(4)  # exact for every kind of element
    fractions = (np.arange(elements)[:, None] + 0.5 * (points + 1.0)) / elements
    path = cast(Array, found.position(load.body, fractions.ravel()))
    length = found.scene.beam(load.body).length / (2.0 * elements)
    return np.asarray(length * np.tile(weights, elements) @ ((path - path[:1]) @ value).T)
