"""The N-four-bar of 40 loops for 10 s (IFToMM benchmark A02): rigid bars in 40 loops that pass singular places.

Where all bars lie level, the linkage has 41 freedoms for a moment. The bars must stay together, upright ones parallel,
and the energy must be kept.
"""

import numpy as np
import pytest

import anctmm as at

LOOPS, SPEED = 40, -1.0


def n_four_bar(loops):
    """Bars of 1 m and 1 kg; the upright ones turn about the ground, the first joint has 1 m/s."""
    inertia = 1.0 / 12.0
    uprights = [
        at.RigidBody(
            f"p{i}", 1.0, inertia, (i, 0.5), {"a": (i, 0.0), "b": (i, 1.0)}, (0.5 * SPEED, 0.0), -SPEED
        )
        for i in range(loops + 1)
    ]
    levels = [
        at.RigidBody(f"g{i}", 1.0, inertia, (i + 0.5, 1.0), {"a": (i, 1.0), "b": (i + 1, 1.0)}, (SPEED, 0.0))
        for i in range(loops)
    ]
    joints = [at.Pin(f"p{i}.a") for i in range(loops + 1)]
    for i in range(loops + 1):
        meeting = [f"g{i - 1}.b"] * (i > 0) + [f"g{i}.a"] * (i < loops)
        joints.append(at.Pin(f"p{i}.b", *meeting))
    return at.Scene("n-four-bar", [*uprights, *levels], joints, gravity=(0.0, -9.81))


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "how",
    [{"dt": 2e-3, "spectral_radius": 0.8}, {"integrator": "zhai", "dt": 1e-3}],
    ids=["implicit", "explicit"],
)
def test_forty_loops_do_not_drift(how):
    s = at.solve(n_four_bar(LOOPS), t_end=10.0, output_dt=0.1, **how)
    assert s.status.ok, s.status
    assert np.ptp(s.position("p0.b")[:, 1]) > 1.99  # it goes round, past both level places
    first = s.position("p0.b")
    for i in range(LOOPS + 1):
        x, foot = s.position(f"p{i}.b") - [i, 0.0], s.position(f"p{i}.a") - [i, 0.0]
        assert np.abs(foot).max() < 1e-11
        assert np.abs(x - first).max() < 1e-9
    for i in range(LOOPS):
        assert np.abs(s.position(f"g{i}.a") - s.position(f"p{i}.b")).max() < 1e-11
        assert np.abs(s.position(f"g{i}.b") - s.position(f"p{i + 1}.b")).max() < 1e-11
    fallen = 9.81 * (LOOPS + 1) * 1.0 + 9.81 * LOOPS * 2.0  # from the top to the bottom, J
    assert np.abs(s.energy.balance).max() < 2e-4 * fallen
