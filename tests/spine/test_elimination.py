"""The block-sparse elimination beside dense solutions."""

import numpy as np
import pytest

from anctmm.elimination.factor import factorize, solve
from anctmm.elimination.order import minimum_degree, numbers_of, plan_of


def random_matrix(blocks: int, size: int, edges: list[tuple[int, int]], negative: set[int]) -> np.ndarray:
    """A symmetric matrix with dominant diagonal blocks, negative ones where it is said."""
    rng = np.random.default_rng(blocks + size)
    A = np.zeros((blocks, size, blocks, size))
    for i in range(blocks):
        block = rng.normal(size=(size, size))
        sign = -1.0 if i in negative else 1.0
        A[i, :, i] = sign * (block @ block.T + 8.0 * size * np.eye(size))
    for i, j in edges:
        A[i, :, j] = rng.normal(size=(size, size))
        A[j, :, i] = A[i, :, j].T
    return A


@pytest.mark.parametrize("size", [4, 6])
@pytest.mark.parametrize("graph", ["chain", "tree", "loops"])
def test_solution_and_inertia(size: int, graph: str) -> None:
    blocks = 31
    edges = [(i, i + 1) for i in range(blocks - 1)]
    if graph == "tree":
        edges = [((i - 1) // 2, i) for i in range(1, blocks)]
    if graph == "loops":
        edges += [(0, blocks - 1), (5, 20), (7, 15)]
    late = {3, 9}
    A = random_matrix(blocks, size, edges, late)
    near: list[set[int]] = [set() for _ in range(blocks)]
    for i, j in edges:
        near[i].add(j)
        near[j].add(i)
    plan, position = plan_of(*minimum_degree(near, late))
    values = np.zeros((blocks + len(plan.row), size, size))
    values[position] = A[np.arange(blocks), :, np.arange(blocks)]
    for i, j in edges:
        a, b = (i, j) if position[i] > position[j] else (j, i)
        values[numbers_of(plan, position[[a]], position[[b]])] = A[a, :, b]
    x, load = np.zeros((blocks, size)), np.random.default_rng(0).normal(size=(blocks, size))
    x[position] = load
    negative = factorize((0,) * size, plan, values)
    solve((0,) * size, plan, values, x)
    dense = A.reshape(blocks * size, -1)
    assert np.abs(dense @ x[position].ravel() - load.ravel()).max() < 1e-12
    assert negative == (np.linalg.eigvalsh(dense) < 0.0).sum()


def test_a_chain_is_eliminated_along_it() -> None:
    near: list[set[int]] = [set() for _ in range(6)]
    for i in range(5):
        near[i].add(i + 1)
        near[i + 1].add(i)
    order, columns = minimum_degree(near)
    assert order == [0, 1, 2, 3, 4, 5]
    assert all(len(column) <= 1 for column in columns)
