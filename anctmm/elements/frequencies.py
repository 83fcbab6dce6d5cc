"""The highest frequency of a free element."""

from math import sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]


def highest_of(tangent: Array, mass: Array) -> float:
    """Largest ω of K x = ω² (m ⊗ I₂) x, rad/s.

    Parameters
    ----------
    tangent : ndarray, shape (n, 2, n, 2)
        K, N/m.
    mass : ndarray, shape (n, n)
        Scalar mass matrix m, kg.
    """
    n = 2 * len(mass)
    values = scipy.linalg.eigh(tangent.reshape(n, n), np.kron(mass, np.eye(2)), eigvals_only=True)
    return sqrt(max(float(values[-1]), 0.0))
