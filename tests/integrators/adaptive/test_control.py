"""Runs with a tolerance and `verify`: errors beside exact solutions, histories, kinks."""

import numpy as np
import pytest

import anctmm as at

MASS, STIFFNESS = 2.0, 200.0
RATE = np.sqrt(STIFFNESS / MASS)
INTEGRATORS = ("esdirk", "generalized-alpha")


def mass_on_spring(force=None, **options):
    """A mass at (1, 0) on a spring along x, with a force (N) along x, and its run."""
    spring = at.Spring("mass.center", (0.0, 0.0), stiffness=STIFFNESS)
    loads = [] if force is None else [at.Force("mass.center", force)]
    scene = at.Scene("oscillator", [at.PointMass("mass", MASS, (1.0, 0.0))], [], loads, connectors=[spring])
    return at.solve(scene, **options)


def displacement(solution):
    return solution.displacement("mass.center")[:, 0]


def rms(error, exact):
    return np.sqrt(np.mean((error) ** 2)) / np.abs(exact).max()


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_errors_are_in_proportion_to_the_tolerance(integrator):
    def force(t):
        return (10.0 * np.sin(6.0 * t), 0.0 * t)

    errors = []
    for tolerance in (1e-2, 1e-3, 1e-4):
        s = mass_on_spring(
            at.History(force, []), tolerance=tolerance, t_end=2.0, output_dt=0.25, integrator=integrator
        )
        exact = 10.0 / MASS / (RATE**2 - 36.0) * (np.sin(6.0 * s.t) - 6.0 / RATE * np.sin(RATE * s.t))
        assert s.status.ok
        errors.append(rms(displacement(s) - exact, exact))
        assert errors[-1] <= 10.0 * tolerance
    assert errors[-1] < 0.1 * errors[0]


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("breaks", [None, (0.7, 0.72)])
def test_a_pulse_at_rest_is_not_stepped_over(integrator, breaks):
    """It lasts a hundredth of the run, and no output lies within it."""

    def force(t):
        return (100.0 if 0.7 <= t < 0.72 else 0.0, 0.0)

    history = force if breaks is None else at.History(force, breaks)
    s = mass_on_spring(history, tolerance=1e-3, t_end=2.0, output_dt=0.5, integrator=integrator)
    late = s.t > 0.72
    since = RATE * (s.t[late] - 0.72)
    exact = 100.0 / STIFFNESS * (np.cos(since) - np.cos(since + RATE * 0.02))
    assert rms(displacement(s)[late] - exact, exact) < (1e-2 if breaks else 5e-2)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_steps_end_where_a_law_has_a_kink(integrator):
    """A mass that flies against a stop, and back: half a vibration in contact."""

    def stop(elongation, rate, t):
        return 1e6 * elongation if elongation > 0.0 else 0.0

    stop.kinks = (0.0,)
    spring = at.Spring("mass.center", (0.0, 0.0), length=1.5, law=stop)
    mass = at.PointMass("mass", MASS, (1.0, 0.0), velocity=(1.0, 0.0))
    scene = at.Scene("stop", [mass], connectors=[spring])
    s = at.solve(scene, tolerance=1e-4, t_end=1.0, output_dt=0.1, integrator=integrator)
    contact = np.pi / np.sqrt(1e6 / MASS)
    exact = np.where(s.t <= 0.5, s.t, 0.5 - (s.t - 0.5 - contact))
    assert s.status.ok
    assert rms(displacement(s) - exact, exact) < 1e-3


def falling(**options):
    """A cantilever that falls, and what to run it with."""
    beam = at.Beam("arm", (0.0, 0.0), (1.0, 0.0), at.Circle(0.01), at.Material(E=2e7, density=1000.0))
    scene = at.Scene("falling", [beam], [at.Clamp("arm.start")], gravity=(0.0, -9.81))
    return scene, {"mesh": 3, "t_end": 0.5, **options}


@pytest.mark.parametrize(
    "steps",
    [
        {"dt": 0.01},
        {"dt": 0.01, "integrator": "esdirk"},
        {"tolerance": 1e-3, "output_dt": 0.01},
    ],
)
def test_verify_gives_the_error_of_time_stepping_within_a_factor_of_three(steps, tmp_path):
    scene, options = falling(**steps)
    s = at.solve(scene, verify=True, **options)
    exact = at.solve(scene, mesh=3, t_end=0.5, dt=5e-4, output_dt=0.01, integrator="esdirk")
    error = at.compare(s, exact, ["arm.end"]).error
    assert error / 3.0 < s.error_estimate < 3.0 * error
    assert f"{s.error_estimate:.2g}" in repr(s)
    assert at.load(s.save(tmp_path / "s.npz")).error_estimate == s.error_estimate
    assert at.solve(scene, **options).error_estimate is None
