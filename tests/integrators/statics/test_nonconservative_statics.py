"""Equilibria that Newton's iteration alone does not find, also with forces that have no potential energy."""

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

SECTION, SOFT = at.Rectangle(0.02, 0.02), at.Material(1e7, 1000.0)


def hung(follower):
    """A plate on a clamped beam, a mass on a spring that is level at first, and a force that turns with the plate."""
    bodies = [
        at.Beam("v", (0.0, 0.0), (1.0, 0.0), SECTION, SOFT),
        at.RigidBody("plate", 0.5, 3e-3, center=(1.1, 0.1), points={"p": (1.0, 0.0), "q": (1.2, 0.2)}),
        at.PointMass("load", 0.2, position=(1.5, 0.0)),
    ]
    joints = [at.Clamp("v.start"), at.Weld("v.end", "plate.p")]
    springs = [at.Spring("v.end", "load.center", stiffness=20.0)]
    return at.Scene(
        "hung", bodies, joints, [at.Force("plate.q", (0.0, 0.5), follower)], (0.0, -9.81), springs
    )


@pytest.mark.parametrize("follower", [False, True])
def test_a_mass_that_hangs_by_a_slack_spring_is_found(follower):
    ours, theirs = (
        solve(hung(follower), mesh=2, newton_tolerance=1e-12)
        for solve in (at.solve_static, global_dae.solve_static)
    )
    assert theirs.status.ok, theirs.status
    assert ours.status.ok, ours.status
    assert "a stabilised path leads" in ours.status.message
    for place in ("v.end", "plate.q", "load.center"):
        assert np.abs(ours.position(place)[-1] - theirs.position(place)[-1]).max() < 1e-9
    below = ours.position("load.center")[-1] - ours.position("v.end")[-1]
    assert below == pytest.approx([0.0, -(0.5 + 0.2 * 9.81 / 20.0)], abs=1e-9)
