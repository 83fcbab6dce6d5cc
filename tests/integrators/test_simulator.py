"""Repeated runs of one scene: each is the run of `solve`, bit by bit."""

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import MeshError

ROD = at.Beam("arm", (0.0, 0.0), (1.0, 0.0), at.Circle(0.02), at.Material(E=2e7, density=1000.0))
SPRING = at.Spring("arm.end", (1.0, 1.0), stiffness=5.0, damping=0.2)


@pytest.mark.parametrize(
    "options",
    [{"integrator": "zhai", "dt": 1e-4}, {"integrator": "esdirk", "dt": 5e-3}, {"tolerance": 1e-3}],
    ids=["explicit", "esdirk", "tolerance"],
)
def test_each_run_is_that_of_solve(options):
    size = [1.0]
    force = at.Force("arm.end", lambda t: (0.0, size[0] * np.sin(10.0 * t)))
    scene = at.Scene("s", [ROD], [at.Clamp("arm.start")], [force], (0.0, -9.81), [SPRING])
    run = at.Discretisation(mesh=2, t_end=0.2, output_dt=0.05, **options)
    simulator = at.Simulator(scene, run)
    for value in (1.0, -2.0, 1.0):
        size[0] = value
        one, other = simulator.solve(), at.solve(scene, run)
        assert (one.position("arm.end") == other.position("arm.end")).all()
        assert (one.energy.work == other.energy.work).all()


def test_it_starts_from_an_equilibrium_and_verifies():
    scene = at.Scene("s", [ROD], [at.Clamp("arm.start")], gravity=(0.0, -9.81))
    simulator = at.Simulator(scene, mesh=2, t_end=0.1, dt=0.01)
    rest = at.solve_static(scene, mesh=2)
    found = simulator.solve(rest, verify=True)
    assert np.abs(found.displacement("arm.end")).max() < 1e-6
    assert found.error_estimate is not None


def test_bad_input_is_refused_before_any_run():
    with pytest.raises(MeshError, match="mesh"):
        at.Simulator(at.Scene("s", [ROD]), mesh=0, t_end=0.1)
