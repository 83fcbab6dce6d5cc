"""Laws of connectors: compiled once, tried, refused by name; motors that feed back."""

import numpy as np
import pytest
from numba import njit

import anctmm as at
from anctmm.errors import PropertyError
from anctmm.forces.laws import address_of, call_law

SQUARE, SOFT = at.Rectangle(0.02, 0.02), at.Material(1e7, 1000.0)


def spring_law(elongation, rate, t):
    return 3.0 * elongation - 2.0 * rate + np.sin(t)


def play(elongation, rate, t):
    """A spring with a gap on both sides."""
    if elongation > 0.1:
        return 5.0 * (elongation - 0.1)
    if elongation < -0.1:
        return 5.0 * (elongation + 0.1)
    return 0.0


@pytest.mark.parametrize("law", [spring_law, play, njit(spring_law), lambda x, v, t: 2 * x])
def test_a_compiled_law_is_that_of_python(law):
    address = address_of("spring", law, 1.0)
    for at_ in ((0.3, 0.1, 2.0), (-0.4, 0.0, 0.0), (0.0, 1.0, 1.0)):
        assert call_law(address, *at_) == pytest.approx(law(*at_), rel=1e-14)


def test_a_law_is_compiled_once():
    assert address_of("spring", spring_law, 1.0) == address_of("another", spring_law, 0.1)


def test_a_law_that_raises_gives_no_number():
    def strict(elongation, rate, t):
        if elongation > 10.0:
            raise ValueError("too long")
        return elongation + rate + t

    address = address_of("spring", strict, 1.0)
    assert call_law(address, 1.0, 0.0, 0.0) == 1.0
    assert np.isnan(call_law(address, 11.0, 0.0, 0.0))


state = {"calls": 0}


def counts(elongation, rate, t):
    state["calls"] += 1
    return elongation


def differs(elongation, rate, t):
    return elongation if isinstance(elongation, np.float64) else 2.0 * elongation + rate


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


def test_a_law_whose_globals_have_changed_says_so():
    names = {}
    exec("K = 2.0\ndef law(elongation, rate, t):\n    return K * elongation", names)
    address_of("spring", names["law"], 1.0)
    names["K"] = 4.0
    with pytest.raises(PropertyError, match="has changed since it was compiled"):
        address_of("spring", names["law"], 1.0)


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
