"""Rigid bodies alone have no vibration that numerical dissipation may take: what vanishes is their motion."""

import numpy as np
import pytest

import anctmm as at
from reference import global_dae


def pendulum():
    bar = at.RigidBody("bar", 1.0, 1.0 / 12.0, (0.5, 0.0), points={"a": (0.0, 0.0)})
    return at.Scene("pendulum", [bar], [at.Pin("bar.a")], gravity=(0.0, -9.81))


@pytest.mark.parametrize("road", [at.solve, global_dae.solve], ids=["anctmm", "global-dae"])
@pytest.mark.parametrize(("radius", "dt"), [(0.0, 0.05), (0.5, 0.1)])
def test_a_pendulum_that_loses_its_swing_is_inaccurate(road, radius, dt):
    """It lost up to 2.9 J of the 4.9 J that its weight gives, status ok: half of what is exchanged was forgiven."""
    found = road(pendulum(), dt=dt, t_end=4.0, spectral_radius=radius, output_dt=0.1)
    assert found.energy.balance.min() < -1.0
    assert found.status == "inaccurate"
    assert "vanished" in str(found.status)


def test_one_that_keeps_it_is_ok():
    found = at.solve(pendulum(), dt=0.02, t_end=4.0, spectral_radius=0.5, output_dt=0.1)
    assert found.status.ok
    assert np.abs(found.energy.balance).max() < 0.1
