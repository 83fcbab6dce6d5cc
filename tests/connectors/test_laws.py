"""Laws of connectors: compiled once, tried, refused by name; motors that feed back."""

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import PropertyError

state = {"calls": 0}


def counts(elongation, rate, t):
    state["calls"] += 1
    return elongation


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (counts, "cannot be compiled"),
        (lambda x, v, t: str(x), "gives '"),
        (lambda x, v, t: (x, v), "gives"),
        (lambda x, v: x, "raises TypeError"),
        (lambda x, v, t: float("nan"), "finite"),
        (lambda x, v, t: float("no number"), "raises ValueError"),
    ],
)
def test_bad_laws_are_refused_by_name_before_any_work(law, words):
    def run():
        scene = arm(at.RotationalSpring("arm.start", law=law))
        at.solve(scene, mesh=1, t_end=0.01, dt=0.001)

    with pytest.raises(PropertyError) as refused:
        run()
    for word in (words, "rotational spring from 'arm.start' to the ground", "law"):
        assert word in str(refused.value)


PINNED = (at.Pin("arm.start", grounded=True),)


def arm(*connectors, joints=PINNED, gravity=(0.0, -9.81)):
    beam = at.Beam("arm", (0.0, 0.0), (0.5, 0.0), at.Rectangle(0.01, 0.01), at.Material(2e9, 2000.0))
    return at.Scene("arm", [beam], joints, gravity=gravity, connectors=connectors)


def motor(elongation, rate, t):
    """Angle and rate are fed back; the wanted angle grows smoothly to 0.5."""
    s = min(t / 0.1, 1.0)
    wanted = 0.5 * s * s * (3.0 - 2.0 * s)
    return 20.0 * (elongation - wanted) + 0.4 * rate - 0.25


def test_a_motor_that_feeds_back_holds_a_flexible_arm():
    """Explicit and implicit steps agree; the arm ends near the wanted angle and is bent by its weight."""
    scene = arm(at.RotationalSpring("arm.start", law=motor))
    one = at.solve(scene, mesh=2, integrator="zhai", dt=1e-5, t_end=0.1, output_dt=0.01)
    two = at.solve(scene, mesh=2, spectral_radius=1.0, dt=2e-5, t_end=0.1, output_dt=0.01)
    assert one.status.ok, one.status
    assert two.status.ok, two.status
    assert np.abs(one.position("arm", 1.0) - two.position("arm", 1.0)).max() < 1e-6
    for found in (one, two):
        assert np.abs(found.energy.balance).max() < 1e-4 * np.abs(found.energy.work).max()
        assert np.abs(found.energy.work).max() > 0.1
    assert one.angle("arm", 0.0)[-1] == pytest.approx(0.45, abs=0.15)


@pytest.mark.parametrize("turns", [1.5, -2.5])
def test_rotational_springs_count_turns(turns):
    """A bar that is driven around: its spring's energy is that of all turns, and the next run starts anew."""
    angle = 2.0 * np.pi * turns
    hub = at.Clamp("arm.start", angle=at.Quintic(angle, 0.9))
    scene = arm(at.RotationalSpring("arm.start", stiffness=0.1), joints=(hub,), gravity=(0.0, 0.0))
    for options in ({"integrator": "zhai", "dt": 1e-4}, {"dt": 1e-3}, {"dt": 1e-3}):
        found = at.solve(scene, mesh=1, t_end=1.0, output_dt=0.1, **options)
        assert found.status.ok, found.status
        bent = found.energy.strain[-1] - 0.05 * angle**2
        assert abs(bent) < 1e-3 * 0.05 * angle**2
        assert found.energy.strain[0] == pytest.approx(0.0, abs=1e-12)
        assert abs(found.energy.balance[-1]) < 1e-3 * found.energy.work[-1]
