"""Windows of elements that kernels handle together: they hold all nodes once, and few elements beside full vectors."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from anctmm.discretise.assembly import LANES, body_after, window_end
from anctmm.elements.shear_kernel import BLOCK
from anctmm.jit.compiling import uncompiled


def windows(first):
    """(start, end) of all windows of bodies that begin at nodes `first`."""
    found, start, body, nodes = [], 0, 0, int(first[-1])
    while start < nodes:
        end = uncompiled(window_end)(start, nodes, body, first)
        found.append((start, end))
        body = uncompiled(body_after)(end, body, first)
        start = end
    return found


def pieces(first, body):
    """Numbers of elements of a body that the windows handle together."""
    one, last = int(first[body]), int(first[body + 1]) - 1
    counts = [min(last, end) - max(one, start) for start, end in windows(first)]
    return [n for n in counts if n > 0]


@given(st.lists(st.integers(1, 3 * BLOCK), min_size=1, max_size=12))
def test_windows_hold_all_nodes_once_and_cut_bodies_into_full_vectors(sizes):
    first = np.concatenate([[0], np.cumsum(sizes)])
    found = windows(first)
    assert [start for start, _ in found] == [0, *(end for _, end in found[:-1])]
    assert found[-1][1] == first[-1]
    assert all(0 < end - start <= BLOCK for start, end in found)
    for body, nodes in enumerate(sizes):
        assert sum(pieces(first, body)) == nodes - 1
        assert all(n % LANES == 0 for n in pieces(first, body)[:-1])
