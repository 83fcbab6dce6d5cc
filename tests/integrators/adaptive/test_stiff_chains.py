"""Chains of stiff beams that turn fast: what Newton's iteration leaves of stiff forces is in momenta, which stay."""

import pytest

import anctmm as at
from reference import global_dae

ROD = at.Circle(0.01)
PROBES = ["upper.end", "lower.end"]
RUN = {"mesh": 4, "t_end": 1.0, "output_dt": 0.05}


def pendulum(E, damping):
    """Two rods with a pin between them, which fall from about level."""
    material = at.Material(E=E, density=2000.0, damping=damping)
    rods = [
        at.Beam("upper", (0.0, 0.0), (0.5, 0.0), ROD, material),
        at.Beam("lower", (0.5, 0.0), (1.0, 0.2), ROD, material),
    ]
    joints = [at.Pin("upper.start"), at.Pin("upper.end", "lower.start")]
    return at.Scene("stiff pendulum", rods, joints, gravity=(0.0, -9.81))


def missed(scene, exact, probes, tolerance, integrator, run):
    """Error over the tolerance of a run whose status is ok."""
    found = at.solve(scene, tolerance=tolerance, integrator=integrator, **run)
    assert found.status.ok, found.status
    return at.compare(found, exact, probes).error / tolerance


@pytest.mark.exhaustive
def test_a_strongly_damped_pendulum_keeps_its_promise():
    """Errors were 17 and 59 tolerances, status ok."""
    scene = pendulum(2e9, 1.0)
    exact = global_dae.solve(scene, dt=5e-4, newton_tolerance=1e-9, **RUN)
    for tolerance in (1e-2, 1e-3):
        assert missed(scene, exact, PROBES, tolerance, "esdirk", RUN) < 0.5


@pytest.mark.exhaustive
@pytest.mark.parametrize("E", [2e7, 2e9, 2e11])
@pytest.mark.parametrize("damping", [0.0, 1e-4, 1e-3, 1e-2, 1e-1, 1.0])
def test_a_pendulum_of_any_stiffness_and_damping_keeps_its_promise(E, damping):
    """Errors were up to 50 tolerances, and some runs diverged. Without damping soft rods amplify errors."""
    scene = pendulum(E, damping)
    exact = at.solve(scene, dt=1e-4, newton_tolerance=1e-10, integrator="esdirk", **RUN)
    if (E, damping) == (2e9, 1e-2):
        dae = global_dae.solve(scene, dt=1e-4, newton_tolerance=1e-9, **RUN)
        assert at.compare(dae, exact, PROBES).error < 2e-5
    worst = [missed(scene, exact, PROBES, e, "esdirk", RUN) for e in (1e-2, 1e-3, 1e-4, 1e-5)]
    assert max(worst) <= 3.0, worst
