"""Strain energy of all elements, for Python."""

import numpy as np
from numpy.typing import NDArray

from anctmm.kernels.options import kernel
from anctmm.system.elastic import strain_energy
from anctmm.system.system import Tables

Array = NDArray[np.float64]


@kernel
def elastic_energy(tables: Tables, q: Array) -> float:
    """Strain energy of all elements, J."""
    return strain_energy(tables.elements, q)
