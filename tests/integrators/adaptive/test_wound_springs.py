"""Runs that an error drives are made again: springs that are wound by whole turns start each of them as placed."""

import numpy as np
import pytest

import anctmm as at

INERTIA, STIFFNESS = 0.02, 0.05
FREQUENCY = np.sqrt(STIFFNESS / INERTIA)
#: Half a period, and two.
HALF, TWO = {"t_end": 2.0, "tolerance": 1e-2}, {"t_end": 8.0, "tolerance": 1e-3}


def wheel(spin):
    return at.RigidBody("wheel", 1.0, INERTIA, (0.0, 0.0), {"rim": (0.2, 0.0)}, spin=spin)


def flywheel(spin, torques=(), **spring):
    connector = at.RotationalSpring("wheel.center", **(spring or {"stiffness": STIFFNESS}))
    return at.Scene("flywheel", [wheel(spin)], [at.Pin("wheel.center")], torques, connectors=[connector])


def linear(x, rate, t):
    return STIFFNESS * x


def error_of(run, exact):
    """Rms of the rim's error, relative to its largest displacement, of an angle that is known."""
    place = 0.2 * np.stack([np.cos(exact), np.sin(exact)], axis=1)
    off = np.linalg.norm(run.position("wheel.rim") - place, axis=1)
    return np.sqrt(np.mean(off**2)) / np.linalg.norm(place - place[0], axis=1).max()


@pytest.mark.exhaustive
@pytest.mark.parametrize("spring", [{"stiffness": STIFFNESS}, {"law": linear}], ids=["linear", "law"])
@pytest.mark.parametrize("steps", [HALF, TWO], ids=["half", "two"])
@pytest.mark.parametrize(
    ("turns", "integrator"),
    [
        (0.8, "esdirk"),
        (4.0, "esdirk"),
        (0.8, "generalized-alpha"),
        (4.0, "generalized-alpha"),
    ],
)
def test_a_flywheel_on_a_spring_swings_by_whole_turns(steps, integrator, turns, spring):
    """Its angle is a sine, however far it goes: started a turn off, it swings about another angle."""
    spin = 2.0 * np.pi * turns * FREQUENCY
    scene = flywheel(spin, **spring)
    run = at.solve(scene, **steps, integrator=integrator, output_dt=0.1)
    exact = spin / FREQUENCY * np.sin(FREQUENCY * run.t)
    assert run.status.ok
    assert error_of(run, exact) < 5.0 * steps["tolerance"]
    off = run.tension(scene.connectors[0]) - STIFFNESS * exact
    assert np.abs(off).max() < 2e-2 * STIFFNESS * spin / FREQUENCY


@pytest.mark.exhaustive
@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
@pytest.mark.parametrize("steps", [HALF, TWO], ids=["half", "two"])
def test_a_spring_wound_at_rest_is_let_go_from_there(steps, integrator):
    """From 2.6 turns that a torque holds, by a cosine of that amplitude."""
    angle = 2.0 * np.pi * 2.6
    rest = at.solve_static(flywheel(0.0, [at.Torque("wheel.center", STIFFNESS * angle)]))
    run = at.solve(flywheel(0.0), start=rest, **steps, integrator=integrator, output_dt=0.1)
    assert run.status.ok
    assert error_of(run, angle * np.cos(FREQUENCY * run.t)) < 5.0 * steps["tolerance"]
