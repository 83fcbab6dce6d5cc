"""Tables that kernels get by their address: what they read and write there, and what is refused."""

import pickle
from typing import NamedTuple

import numpy as np
import pytest

from anctmm.kernels.by_address import by_address
from anctmm.kernels.options import kernel


@by_address
class Inner(NamedTuple):
    x: np.ndarray
    count: int


@by_address
class Outer(NamedTuple):
    inner: Inner
    y: np.ndarray


@kernel
def add_up(outer):
    """Add x to the first line of y, and give the sum of x times the count."""
    inner, total = outer.inner, 0.0
    for k in range(len(inner.x)):
        outer.y[0, k] += inner.x[k]
        total += inner.x[k]
    return total * inner.count


def test_kernels_read_and_write_nested_tables():
    outer = Outer(Inner(np.arange(3.0), 4), np.ones((2, 3)))
    assert add_up(outer) == 12.0
    assert outer.y.tolist() == [[1.0, 2.0, 3.0], [1.0, 1.0, 1.0]]
    copied = pickle.loads(pickle.dumps(outer))
    assert add_up(copied) == 12.0
    assert (outer.y[0, 2], copied.y[0, 2]) == (3.0, 5.0)


def test_arrays_that_are_not_contiguous_are_refused():
    with pytest.raises(TypeError, match="arrays of Inner must be contiguous"):
        add_up(Outer(Inner(np.arange(6.0)[::2], 4), np.ones((2, 3))))


def test_an_interruption_while_an_address_is_read_ends_the_call(monkeypatch):
    outer = Outer(Inner(np.arange(3.0), 4), np.ones((2, 3)))

    def interrupted(_):
        raise KeyboardInterrupt

    add_up(outer)
    monkeypatch.setattr(Outer, "address", property(interrupted))
    with pytest.raises(KeyboardInterrupt):
        add_up(outer)
