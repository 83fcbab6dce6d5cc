"""Trees and loops in motion: as Exudyn's cables move, as odd topologies must, and what motion keeps."""

import numpy as np
import pytest
from random_graphs import Kinds, random_graph

import anctmm as at
from anctmm.discretise.discretisation import Discretisation


def places(solution):
    return np.stack(
        [solution.displacement((b.name, s)) for b in solution.scene.bodies for s in (0.0, 0.4, 1.0)]
    )


def apart(one, two):
    """Largest distance of places of two solutions, m, relative to the largest displacement but 1 mm at least."""
    assert (one.status.ok, two.status.ok) == (True, True), (one.status, two.status)
    assert one.t.shape == two.t.shape
    size = max(float(np.abs(places(two)).max()), 1e-3)
    return float(np.abs(places(one) - places(two)).max()) / size


@pytest.mark.parametrize("seed", range(300, 304))
def test_error_controlled_motion_of_random_graphs_meets_its_tolerance(seed):
    scene, run = random_graph(seed, Kinds(bodies=(2, 8)))
    wanted = {"t_end": 0.02, "output_dt": 5e-3, "newton_tolerance": 1e-12, "integrator": "generalized-alpha"}
    controlled = at.solve(scene, Discretisation(run.mesh, run.element, tolerance=1e-4, **wanted))
    fine = at.solve(scene, Discretisation(run.mesh, run.element, dt=5e-5, **wanted))
    finer = at.solve(scene, Discretisation(run.mesh, run.element, dt=2.5e-5, **wanted))
    assert apart(controlled, finer) < 5e-4 + 2.0 * apart(fine, finer)  # as promised
