"""Velocities that fit many joints, redundant and contradictory ones too."""

import pytest

import anctmm as at
from anctmm.errors import JointGapError

RATE = 2.0


def turning(t):
    return RATE * t, RATE, 0.0


def faster(t):
    return 1.3 * RATE * t, 1.3 * RATE, 0.0


def parallelogram(cranks, driven=(turning,), coupler_mass=1.0):
    """Equal cranks between the ground and one coupler, of which all but two are redundant; the first are driven."""
    tops = {f"p{i}": (0.1 * i, 1.0) for i in range(cranks)}
    bodies = [at.RigidBody("coupler", coupler_mass, 0.1, (0.0, 1.0), tops)]
    joints = []
    for i in range(cranks):
        points = {"foot": (0.1 * i, 0.0), "top": (0.1 * i, 1.0)}
        bodies.append(at.RigidBody(f"c{i}", 1.0 + i % 3, 0.1, (0.1 * i, 0.5), points))
        joints.append(at.Pin(f"coupler.p{i}", f"c{i}.top"))
        joints.append(at.Clamp(f"c{i}.foot", angle=driven[i]) if i < len(driven) else at.Pin(f"c{i}.foot"))
    return {"name": "parallelogram", "bodies": bodies, "joints": joints}


def test_cranks_that_are_alike_turn_alike():
    """58 of 120 pins say nothing new; the motion is known: all cranks turn as the first, the coupler does not turn."""
    scene = at.consistent_velocities(**parallelogram(60))
    for body in scene.bodies[1:]:
        assert body.spin == pytest.approx(RATE, rel=1e-12)
    coupler = scene.body("coupler")
    assert (*coupler.velocity, coupler.spin) == pytest.approx((-RATE, 0.0, 0.0), abs=1e-12)


def test_what_no_velocities_fit_is_refused():
    """Two cranks that are driven at different rates."""
    with pytest.raises(JointGapError, match="no velocities of rigid bodies that fit"):
        at.consistent_velocities(**parallelogram(30, driven=(turning, faster), coupler_mass=1e-3))
