"""Damping of small motions about a configuration: Kelvin–Voigt damping and dampers."""

import numpy as np
import scipy
from numpy.typing import NDArray

from anctmm.discretise.assembly import damping_forces
from anctmm.discretise.maps import push
from anctmm.forces.connectors import free_measure, measure, slopes, time_of
from anctmm.integrators.statics.static_system import StaticSystem
from anctmm.jit.compiling import uncompiled

Array = NDArray[np.float64]


class Damping:
    """C of M ü + C u̇ + K_T u = 0, as a product.

    Parameters
    ----------
    system : StaticSystem
    q : ndarray, shape (rows, nodes)
        The configuration.
    factor : float
        Part of the loads.
    """

    def __init__(self, system: StaticSystem, q: Array, factor: float) -> None:
        self.system, self.q = system, q
        #: Of the material of each element; None where none is damped.
        self.material = system.chain.bodies.damping
        self.dampers = dampers_of(system, q, factor)

    @property
    def there(self) -> bool:
        """Whether anything damps."""
        return self.material is not None or self.dampers is not None

    @property
    def feeds(self) -> bool:
        """Whether a law gives energy to a motion, as a force that grows with the rate."""
        return self.dampers is not None and bool((self.dampers[0] < 0.0).any())

    @property
    def fed(self) -> list[Array]:
        """Generalized forces, (rows, nodes), of a unit of each law that gives energy to a motion."""
        if self.dampers is None:
            return []
        rates, forces = self.dampers
        return [forces[[int(k)]].toarray().reshape(self.q.shape) for k in np.flatnonzero(rates < 0.0)]

    def forces(self, u: Array) -> Array:
        """C u of velocities u, (rows, nodes)."""
        total = np.zeros_like(u)
        if self.material is not None:
            lost = np.zeros_like(u)  # damping forces, linear in the velocities
            t = self.system.tables
            damping_forces(
                t.formulations, self.q, u, t.first, t.kinds, t.constants, self.material, t.buffer, lost
            )
            total -= lost
        if self.dampers is not None:
            rates, forces = self.dampers
            total += (forces.T @ (rates * (forces @ u.reshape(-1)))).reshape(u.shape)
        return total


def dampers_of(
    system: StaticSystem, q: Array, factor: float
) -> "tuple[Array, scipy.sparse.csr_matrix] | None":
    """Dampers at coordinates q, (rows, nodes), under a part of the loads: N by the rate of each, and its force.

    They are those of the configuration: laws are evaluated at its elongation, turns and time.

    Returns
    -------
    (ndarray, csr_matrix) or None
        (n,) and (n, rows · nodes): the generalized force of a unit of each connector. None where nothing damps.
    """
    c, values = system.loads.connectors, system.values_at(factor)
    if c is None:
        return None
    rates, forces = [], []
    for n in map(int, np.flatnonzero(c.lossy)):
        m, ax, ay, bx, by = uncompiled(measure)(c, n, q)
        free, faster = uncompiled(free_measure)(c, n, values)
        _, rate = uncompiled(slopes)(c, n, m - free, -faster, float(uncompiled(time_of)(values)))
        if rate != 0.0:
            force = np.zeros_like(q)
            uncompiled(push)(c.first, n, ax, ay, force)
            uncompiled(push)(c.second, n, bx, by, force)
            rates.append(float(rate))
            forces.append(scipy.sparse.csr_matrix(force.reshape(1, -1)))
    return (np.array(rates), scipy.sparse.vstack(forces, format="csr")) if rates else None
