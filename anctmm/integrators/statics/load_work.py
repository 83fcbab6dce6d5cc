"""Work of the loads at equilibria, where it follows from these alone."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.junctions.as_written import as_written
from anctmm.discretise.maps import vector_at
from anctmm.discretise.mesh import varying_loads
from anctmm.forces.loads import DEAD
from anctmm.integrators.statics.static_system import StaticSystem
from anctmm.jit.compiling import uncompiled
from anctmm.model.loads import Torque
from anctmm.results.solution import Solution

Array = NDArray[np.float64]


def with_work(found: Solution, system: StaticSystem, q: Array) -> Solution:
    """Equilibria with the work of what acts beside constant forces, whose potential they have.

    Parameters
    ----------
    found : Solution
    system : StaticSystem
    q : ndarray, shape (n, rows, nodes)
        Coordinates of the equilibria.

    Returns
    -------
    Solution
        Its `energy.work` is that of the whole loads, as its `energy.potential` is: moments times angles, forces that
        vary in time times displacements. Forces that turn with their place, and laws, have no work that the equilibrium
        alone tells: it is NaN at all but the first.
    """
    work = np.zeros(len(found.t))
    if not system.conservative or any(c.law is not None for c in found.scene.connectors):
        work[1:] = np.nan
    else:
        for n, load in enumerate(varying_loads(system.chain.parts)):
            work += _work(found, system, n, as_written(system.chain.parts, load), q[: len(work)])
    return replace(found, energy=replace(found.energy, work=work))


def _work(found: Solution, system: StaticSystem, n: int, load: object, q: Array) -> Array:
    """Work of the n-th load that varies, J, (outputs,)."""
    value, targets = system.values[n], system.loads.targets
    if isinstance(load, Torque):
        return np.asarray(value[0] * found.angle(load.end))
    assert system.loads.kinds[n] == DEAD  # no other load has a potential
    start = np.array(uncompiled(vector_at)(targets, n, system.reference))
    return np.array([value @ (np.array(uncompiled(vector_at)(targets, n, at)) - start) for at in q])
