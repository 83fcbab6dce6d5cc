"""Accelerations of outputs that constraints and drives allow, whatever the spectral radius: by other roads."""

from math import pi

import numpy as np
import pytest
from driven_bead import bead, force_on_bead

import anctmm as at
from anctmm.integrators.implicit import balanced, run

ROD = at.Rectangle(0.02, 0.02)
RUBBER = at.Material(E=5e6, density=1100.0, damping=2e-4)


@pytest.mark.parametrize("radius", [0.5, 0.9, 1.0])
def test_forces_of_a_driven_guide_are_those_of_the_motion(radius):
    """They were wrong by 5 % with 0.9, and by 180 % with 1, whatever the step; now by the error of the motion."""
    scene = bead()
    found = at.solve(scene, dt=2e-3, t_end=0.5, spectral_radius=radius)
    assert found.status.ok
    wanted = force_on_bead(found.t)
    off = np.abs(found.reaction(scene.joints[1])[:, :2] - wanted).max()
    assert off < 3e-3 * np.abs(wanted).max()
    assert off > 1e-7  # it is a measure


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
def test_they_are_with_steps_that_an_error_drives(tolerance):
    """They were wrong by 43 % and 10 % of the largest; the counts are those of the motion."""
    scene = bead()
    found = at.solve(scene, tolerance=tolerance, t_end=0.5, output_dt=0.01, integrator="generalized-alpha")
    assert found.status.ok
    assert found.cost.factorizations < found.cost.steps
    wanted = force_on_bead(found.t)
    assert np.abs(found.reaction(scene.joints[1])[:, :2] - wanted).max() < tolerance * np.abs(wanted).max()


def crank():
    """A damped arm that turns by more than once, and a plate on a pin and rotational springs."""
    arm = at.Beam("arm", (0, 0), (0.2, 0), ROD, RUBBER)
    plate = at.RigidBody("plate", 0.1, 1e-4, (0.25, 0.02), points={"a": (0.2, 0)})
    joints = [at.Clamp("arm.start", angle=at.Quintic(3 * pi, 1.0)), at.Pin("arm.end", "plate.a")]
    springs = [
        at.RotationalSpring("plate.a", stiffness=2e-2, damping=1e-3),
        at.RotationalSpring("arm.end", "plate.a", stiffness=0.5, damping=0.01),
    ]
    return at.Scene("crank", [arm, plate], joints, gravity=(0, -1.0), connectors=springs)


def test_reactions_of_a_driven_clamp_are_those_of_explicit_steps():
    scene = crank()
    options = {"mesh": 1, "t_end": 0.6, "output_dt": 0.05}
    explicit = at.solve(scene, integrator="zhai", dt=5e-4, **options)
    assert explicit.status.ok
    for radius in (0.9, 1.0):
        found = at.solve(scene, dt=2e-3, spectral_radius=radius, **options)
        assert found.status.ok
        for joint in scene.joints:
            wanted, got = explicit.reaction(joint), found.reaction(joint)
            assert (np.abs(got - wanted).max(axis=0) <= 0.02 * np.abs(wanted).max(axis=0) + 1e-6).all()


def test_what_reactions_do_not_notice_costs_nothing(monkeypatch):
    """The accelerations of a driven beam's end gradient: none is found anew, and its reactions are right."""
    anew = []
    monkeypatch.setattr(balanced, "balanced", lambda *told: anew.append(told))
    arm = at.Beam("arm", (0, 0), (0.2, 0), ROD, RUBBER)
    scene = at.Scene("arm", [arm], [at.Clamp("arm.start", angle=at.Quintic(pi, 0.5))])
    options = {"mesh": 3, "t_end": 0.2, "output_dt": 0.01}
    explicit = at.solve(scene, integrator="zhai", dt=5e-5, **options).reaction(scene.joints[0])
    found = at.solve(scene, dt=1e-3, **options).reaction(scene.joints[0])
    assert not anew
    assert (np.abs(found - explicit).max(axis=0) <= 0.02 * np.abs(explicit).max(axis=0)).all()


def faster_and_faster(t):
    phase, rate = 200.0 * t**3, 600.0 * t**2
    return (
        0.3 * np.sin(phase),
        0.3 * rate * np.cos(phase),
        0.3 * (1200.0 * t * np.cos(phase) - rate**2 * np.sin(phase)),
    )


def test_a_run_that_fails_says_what_it_says_without(monkeypatch):
    """It told the gap in the state of the last output that was looked at: 2.8e5 for 1e-6."""
    options = {"dt": 0.02, "t_end": 2.0, "newton_tolerance": 1e-6}
    found = at.solve(bead(faster_and_faster), **options)
    assert found.status == "failed"
    monkeypatch.setattr(run, "settle", lambda *told: None)
    assert str(at.solve(bead(faster_and_faster), **options).status) == str(found.status)
