"""Runs with a tolerance in long series: stiff damped chains, springs wound by whole turns."""

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

ROD = at.Circle(0.01)
PROBES = ["upper.end", "lower.end"]
RUN = {"mesh": 4, "t_end": 1.0, "output_dt": 0.05}
INERTIA, STIFFNESS = 0.02, 0.05
FREQUENCY = np.sqrt(STIFFNESS / INERTIA)


def pendulum(E, damping):
    """Two rods with a pin between them, which fall from about level."""
    material = at.Material(E=E, density=2000.0, damping=damping)
    rods = [
        at.Beam("upper", (0.0, 0.0), (0.5, 0.0), ROD, material),
        at.Beam("lower", (0.5, 0.0), (1.0, 0.2), ROD, material),
    ]
    joints = [at.Pin("upper.start"), at.Pin("upper.end", "lower.start")]
    return at.Scene("stiff pendulum", rods, joints, gravity=(0.0, -9.81))


@pytest.mark.parametrize("E", [2e7, 2e9, 2e11])
@pytest.mark.parametrize("damping", [0.0, 1e-4, 1e-2, 1.0])
def test_a_pendulum_of_any_stiffness_and_damping_keeps_its_promise(E, damping):
    """What Newton's iteration leaves of stiff forces is in momenta, which stay."""
    scene = pendulum(E, damping)
    exact = at.solve(scene, dt=1e-4, newton_tolerance=1e-10, integrator="esdirk", **RUN)
    if (E, damping) == (2e9, 1e-2):
        dae = global_dae.solve(scene, dt=1e-4, newton_tolerance=1e-9, **RUN)
        assert at.compare(dae, exact, PROBES).error < 2e-5
    for tolerance in (1e-2, 1e-3, 1e-4):
        found = at.solve(scene, tolerance=tolerance, integrator="esdirk", **RUN)
        assert found.status.ok, found.status
        assert at.compare(found, exact, PROBES).error <= 10.0 * tolerance


def flywheel(spin, torques=()):
    """A wheel on a rotational spring."""
    wheel = at.RigidBody("wheel", 1.0, INERTIA, (0.0, 0.0), {"rim": (0.2, 0.0)}, spin=spin)
    spring = at.RotationalSpring("wheel.center", stiffness=STIFFNESS)
    return at.Scene("flywheel", [wheel], [at.Pin("wheel.center")], torques, connectors=[spring])


def error_of(run, exact):
    """Rms of the rim's error, relative to its largest displacement, of an angle that is known."""
    place = 0.2 * np.stack([np.cos(exact), np.sin(exact)], axis=1)
    off = np.linalg.norm(run.position("wheel.rim") - place, axis=1)
    return np.sqrt(np.mean(off**2)) / np.linalg.norm(place - place[0], axis=1).max()


#: Two periods, and half a one.
RUNS = {"esdirk": {"t_end": 8.0, "tolerance": 1e-3}, "generalized-alpha": {"t_end": 2.0, "tolerance": 1e-2}}


@pytest.mark.parametrize("turns", [0.8, pytest.param(4.0, marks=pytest.mark.exhaustive)])
@pytest.mark.parametrize("at_rest", [False, True])
@pytest.mark.parametrize("integrator", RUNS)
def test_a_flywheel_on_a_spring_swings_by_whole_turns(integrator, at_rest, turns):
    """It starts with a spin, or is let go where a torque held it: its angle is a sine or a cosine."""
    angle = 2.0 * np.pi * turns
    held = at.solve_static(flywheel(0.0, [at.Torque("wheel.center", STIFFNESS * angle)])) if at_rest else None
    scene = flywheel(0.0 if at_rest else angle * FREQUENCY)
    run = at.solve(scene, start=held, integrator=integrator, output_dt=0.1, **RUNS[integrator])
    exact = angle * (np.cos if at_rest else np.sin)(FREQUENCY * run.t)
    assert run.status.ok
    assert error_of(run, exact) < 5.0 * RUNS[integrator]["tolerance"]
    off = run.tension(scene.connectors[0]) - STIFFNESS * exact
    assert np.abs(off).max() < 2e-2 * STIFFNESS * angle
