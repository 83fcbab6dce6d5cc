"""Orders in which the global solver eliminates its unknowns."""

import numpy as np
import pytest

from anctmm.discretise.discretisation import Discretisation
from reference import global_dae
from reference.global_dae import lu
from studies.benchmark.scenes import scenes

#: Scenes of some thirty beams by name.
SCENES = {name: made() for name, made in scenes(30).items()}


def matrices(monkeypatch, name, integrator):
    """The matrices whose order a short run chooses."""
    seen, order = [], lu.order
    with monkeypatch.context() as patch:
        patch.setattr(lu, "order", lambda A: (seen.append(A), order(A))[1])
        run = {"integrator": integrator, "dt": 1e-5, "t_end": 1e-5, "output_dt": 1e-5}
        assert global_dae.solve(SCENES[name], Discretisation(2, **run)).status.ok
    return seen


@pytest.mark.parametrize("name", ["hinged chain", "welded tree", "hinged ladder"])
@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
def test_factors_solve(monkeypatch, name, integrator):
    found = matrices(monkeypatch, name, integrator)
    assert max(A.shape[0] for A in found) > 100
    for A in found:
        factors, rows, columns = lu.order(A)
        product = (factors.L @ factors.U).toarray()
        np.testing.assert_allclose(product, A.toarray()[np.ix_(rows, columns)], atol=1e-12 * abs(A).max())
