"""First steps of runs with a tolerance: of bodies that spin when they start, however rare outputs are."""

from math import pi

import numpy as np
import pytest

import anctmm as at

SPIN = 40.0


def spinning_bar(pinned, damping):
    """A bar of 0.8 m that turns about its middle, or its start, and is free to turn on."""
    start, end, middle = (0.0, 0.0), (0.8, 0.1), (0.4, 0.05)
    motion = at.RigidVelocity(start, end, start if pinned else middle, SPIN)
    bar = at.Beam("bar", start, end, at.Circle(0.02), at.Material(2e9, 1100.0, damping=damping), motion)
    return at.Scene("bar", [bar], [at.Pin("bar.start")] if pinned else [])


@pytest.mark.parametrize("pinned", [False, True])
@pytest.mark.parametrize("damping", [0.0, pytest.param(1e-4, marks=pytest.mark.exhaustive)])  # other kernels
@pytest.mark.parametrize(
    ("integrator", "tolerance", "output_dt"),
    [("esdirk", 1e-3, 1.0), ("esdirk", 1e-2, 1.0), ("generalized-alpha", 1e-3, 0.25)],
)
def test_a_bar_that_spins_turns_on_however_rare_outputs_are(
    damping, pinned, integrator, tolerance, output_dt
):
    """The first step, a part of the time between outputs, was of some turns: a chord, by an estimate without error."""
    found = at.solve(
        spinning_bar(pinned, damping),
        mesh=2,
        t_end=1.0,
        output_dt=output_dt,
        integrator=integrator,
        tolerance=tolerance,
    )
    assert found.status.ok, found.status
    kinetic = found.energy.kinetic
    np.testing.assert_allclose(kinetic, kinetic[0], rtol=0.02)
    np.testing.assert_allclose(found.angle("bar.start")[-1], SPIN, atol=0.1 * pi)
