"""Rows of a matrix in single precision, read in double, four numbers by one instruction.

Numba's own conversion takes one number at a time, which costs more than the memory that single precision saves.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.jit.deferred import compiled_in

Array = NDArray[np.float64]

#: Numbers converted at once: rows in single precision must have a multiple of it.
WIDTH = 4


def in_double(array: NDArray[Any], row: int, wide: Array, place: int) -> tuple[Array, int]:
    """A C-ordered matrix in double precision, and its row with the numbers that `array` has in its row `row`.

    Parameters
    ----------
    array : ndarray of float64 or float32, shape (rows, n)
        n a multiple of WIDTH if of float32.
    row : int
    wide : ndarray, shape (places, ≥ n)
        Scratch, written if numbers must be converted.
    place : int
        Row of the scratch.
    """
    if array.dtype == np.float64:
        return array, row
    wide[place, : array.shape[1]] = array[row]
    return wide, place


compiled_in("anctmm.jit.mixed_precision_code")
