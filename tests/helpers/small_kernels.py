"""Kernels that call others, all small: for tests of compiling."""

import numpy as np
from numpy.typing import NDArray

from anctmm.jit.compiling import embedded, kernel, separate

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


@separate
def apart(x: Array, factor: float) -> float:
    """The same as `inner`."""
    total = 0.0
    for value in x:
        total += factor * value * value
    return total


@separate
def doubled(x: Array) -> None:
    """Double all."""
    for i in range(len(x)):
        x[i] *= 2.0


@embedded
def part(x):  # type: ignore[no-untyped-def]
    """What a caller embeds, which calls one that stands apart."""
    return apart(x, 1.0)


@kernel
def between(x: Array) -> float:
    """The same, kept."""
    doubled(x)
    return 2.0 * part(x)  # type: ignore[no-any-return]


@kernel
def caller(x: Array) -> float:
    """By two ways: 8 Σ x² + ½ Σ (2x)²."""
    return between(x) + apart(x, 0.5)  # type: ignore[no-any-return]


@separate
def wrong(x: Array) -> int:
    """What it returns is no whole number."""
    return x[0]  # type: ignore[return-value]
