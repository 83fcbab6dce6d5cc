"""Solving with a low-rank change of a matrix, against numpy."""

from types import SimpleNamespace

import numpy as np
import pytest

from anctmm.jit.compiling import uncompiled
from anctmm.recursion.low_rank import _factor, weights_of


@pytest.mark.parametrize("size", [1, 2, 3, 5, 9])
def test_the_small_system_exchanges_rows_wherever_it_must(size):
    """Of matrices with zeros on the diagonal each column may need an exchange."""
    draw = np.random.default_rng(size)
    for kind in range(20):
        S = draw.standard_normal((size, size))
        if kind % 2 and size > 1:
            np.fill_diagonal(S, 0.0)
        b = draw.standard_normal(size)
        border = SimpleNamespace(
            S=S.copy(), z=np.zeros(size), c=np.ones(size), order=np.zeros(size, dtype=np.int64),
            start=np.arange(size + 1), right=np.tile([1.0, 0.0], (size, 1)),
            row=np.zeros(size, dtype=np.int64), node=np.arange(size),
        )  # fmt: skip
        uncompiled(_factor)(border.S, border.order)
        uncompiled(weights_of)(border, np.stack([b, np.zeros(size)]))
        np.testing.assert_allclose(S @ border.z, b, atol=1e-9 * np.linalg.cond(S))
