"""Potential energy of connectors, for its minimisation in statics; of laws by quadrature."""

import numpy as np
from numpy.typing import NDArray

from anctmm.forces.connectors import Connectors, force_of, free_measure, measure, stored, time_of
from anctmm.jit.compiling import uncompiled

Array = NDArray[np.float64]

#: Gauss's rule on [0, 1] for the work of a law over a small change.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(8)
POINTS, WEIGHTS = 0.5 + 0.5 * _POINTS, 0.5 * _WEIGHTS


def potential_change(connectors: Connectors | None, q: Array, new: Array, values: Array) -> float:
    """Energy of connectors at rest at coordinates `new`, less that at q, (rows, nodes), J.

    Parameters
    ----------
    values : ndarray
        Values of what acts, as kernels have them.
    """
    if connectors is None:
        return 0.0
    change = 0.0
    for n in range(len(connectors.kinds)):
        free, _ = uncompiled(free_measure)(connectors, n, values)
        one, two = (uncompiled(measure)(connectors, n, at)[0] - free for at in (q, new))
        if connectors.kinds[n]:  # an angle: by less than half a turn at once
            two -= 2.0 * np.pi * np.round((two - one) / (2.0 * np.pi))
        if connectors.laws[n] == 0:
            change += uncompiled(stored)(connectors, n, two) - uncompiled(stored)(connectors, n, one)
        else:
            t = float(uncompiled(time_of)(values))
            forces = [uncompiled(force_of)(connectors, n, one + x * (two - one), 0.0, t) for x in POINTS]
            change += float(WEIGHTS @ np.array(forces)) * (two - one)
    return change
