"""Orders in which the global solver eliminates its unknowns: large matrices try two of four."""

import numpy as np
import pytest

from reference import global_dae
from reference.global_dae import lu
from studies.benchmark.topology import CHAIN, JOINTS, LADDER, TREES, Framework


def matrices(monkeypatch, framework, integrator):
    """The matrices whose order a short run chooses."""
    seen, order = [], lu.order
    with monkeypatch.context() as patch:
        patch.setattr(lu, "order", lambda A: (seen.append(A), order(A))[1])
        assert framework.runner(global_dae.solve, integrator)(1).status.ok
    return seen


def fill(A):
    factors, _, _ = lu.order(A)
    return factors.L.nnz + factors.U.nnz


@pytest.mark.parametrize("kind", [CHAIN, TREES, LADDER])
@pytest.mark.parametrize("joints", JOINTS)
@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
def test_the_two_orders_of_large_matrices_have_the_least_fill(monkeypatch, kind, joints, integrator):
    found = matrices(monkeypatch, Framework(kind, joints, 30), integrator)
    assert max(A.shape[0] for A in found) > 100
    for A in found:
        of_four = fill(A)
        monkeypatch.setattr(lu, "LARGE", 0)
        assert fill(A) <= 1.05 * of_four
        monkeypatch.undo()


@pytest.mark.parametrize("large", [0, 10**9])
def test_factors_in_every_order_solve(monkeypatch, large):
    monkeypatch.setattr(lu, "LARGE", large)
    for A in matrices(monkeypatch, Framework(LADDER, "welded", 5), "generalized-alpha"):
        factors, rows, columns = lu.order(A)
        product = (factors.L @ factors.U).toarray()
        np.testing.assert_allclose(product, A.toarray()[np.ix_(rows, columns)], atol=1e-12 * abs(A).max())
