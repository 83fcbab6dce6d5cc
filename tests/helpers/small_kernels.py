"""A kernel that calls another one, both small: for tests of compiling."""

import numpy as np
from numpy.typing import NDArray

from anctmm.jit.compiling import kernel

Array = NDArray[np.float64]


@kernel
def inner(x: Array, factor: float) -> float:
    """Sum of squares, times a factor."""
    total = 0.0
    for value in x:
        total += factor * value * value
    return total


@kernel
def outer(x: Array) -> float:
    """Twice the same."""
    return 2.0 * inner(x, 0.5) + inner(x, 1.0)  # type: ignore[no-any-return]
