"""Independent rows of a Jacobian: a parallelogram with a third crank has redundant ones."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Part of the largest pivot below which a row follows from those chosen before.
VOID = 1e-9


def independent_rows(J: Array, unit: Array) -> Ints:
    """Numbers of rows that are independent and span all, ascending.

    Parameters
    ----------
    J : ndarray, shape (m, n)
    unit : ndarray, shape (n,)
        Size of each coordinate, by which columns are made comparable.
    """
    if not len(J):
        return np.zeros(0, dtype=np.int64)
    scaled = J * unit
    sizes = np.linalg.norm(scaled, axis=1)
    scaled = scaled / np.where(sizes > 0.0, sizes, 1.0)[:, None]
    R, order = qr(scaled.T, mode="r", pivoting=True)
    pivots = np.abs(np.diagonal(R))
    return np.sort(order[: int((pivots > VOID * pivots[0]).sum())]).astype(np.int64)
