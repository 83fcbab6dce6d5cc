"""Windows of elements that kernels handle together: they hold all nodes once, and few elements beside full vectors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from anctmm.discretise.assembly import LANES, body_after, window_end
from anctmm.discretise.chain import Chain
from anctmm.elements.shear_kernel import BLOCK
from anctmm.jit.compiling import uncompiled
from studies.benchmark.additions import ELEMENTS, IMPLICIT_DT, scenes
from studies.engine.measuring.setting import implicit_run


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


@pytest.mark.parametrize("turned", [False, True])
def test_what_is_added_brings_no_element_beside_full_vectors(turned):
    """A tip mass, whose node stands before the beam's, had shifted the windows: 12 such elements in place of 4."""
    beside = {}
    for name, scene in scenes(turned).items():
        bodies = Chain(scene, implicit_run(scene, ELEMENTS, 1, IMPLICIT_DT)).bodies
        counts = [n for body in range(len(bodies.meshes)) for n in pieces(bodies.first, body)]
        beside[name] = sum(n % LANES for n in counts), len(windows(bodies.first))
    assert set(beside.values()) == {(ELEMENTS % LANES, 2)}
