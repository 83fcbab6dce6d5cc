"""Impacts: where a law bends or jumps, errors stay within what a tolerance asks; smooth laws have the same steps."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from scenes.impacts import (
    GRAVITY,
    between,
    bounce,
    collision,
    pair,
    pendulum,
    rms,
)

import anctmm as at

#: Marks of runs: their kernels take a minute to compile, in which Python takes some of them.
LONG, FEW_STEPS = pytest.mark.exhaustive, pytest.mark.interpreted
METHODS = ("esdirk", "generalized-alpha")
#: What `at.compare` may give, over the tolerance: 0.3 in the runs below with `esdirk`, 2.6 with `generalized-alpha`.
PROMISED = {"esdirk": 1.0, "generalized-alpha": 3.0}
#: Frequencies (rad/s) are those of contacts: an impact of 100 rad/s lasts 0.03 s.
SCENES = {
    **{f"bounce {w}, {n} impacts": (bounce, w, n) for w in (20.0, 100.0, 1000.0) for n in (1, 3, 10)},
    "bounce with a damper that jumps": (bounce, 200.0, 3, 10.0),
    "bounce on a preloaded floor": (bounce, 200.0, 3, 0.0, 100.0),
    "bounce on a soft preloaded floor": (bounce, 30.0, 3, 0.0, 10.0),
    "between two stops": (between, 50.0, 6),
    "between two stiff stops": (between, 500.0, 10),
    "pendulum, one swing": (pendulum, 50.0, 1),
    "pendulum, five swings": (pendulum, 50.0, 5),
    "pendulum, stiff stop": (pendulum, 500.0, 5),
    "two masses, one stop": (pair, 100.0, 1.5),
    "two masses, one stiff stop": (pair, 500.0, 0.7),
    "two masses collide": (collision, 50.0, 3.0),
    "two masses collide, stiff": (collision, 500.0, 3.0),
}
#: Those of a usual run; they missed by 3 to 50 times the tolerance.
SHORT = {
    ("bounce on a soft preloaded floor", "esdirk", 7e-3),
    ("bounce 100.0, 3 impacts", "esdirk", 1e-4),
    ("bounce 1000.0, 1 impacts", "generalized-alpha", 1e-2),
    ("bounce on a preloaded floor", "esdirk", 1e-3),
    ("two masses collide, stiff", "esdirk", 1e-2),
}
RUNS = [
    pytest.param(name, method, tolerance, marks=FEW_STEPS if (name, method, tolerance) in SHORT else LONG)
    for name in SCENES
    for method in METHODS
    for tolerance in (1e-2, 7e-3, 1e-3, 1e-4, 1e-5)
]


def stopped_pendulum(spin):
    """A pendulum between two stops whose dampers enter with the contact, so that their force jumps."""

    def stops(angle, rate, t):
        beyond = angle - 0.5 if angle > 0.5 else angle + 0.5 if angle < -0.5 else 0.0
        return 5e3 * beyond + 5.0 * rate if beyond else 0.0

    body = at.RigidBody("p", 0.5, 0.01, (0, -0.4), {"o": (0, 0)}, velocity=(0.4 * spin, 0), spin=spin)
    spring = at.RotationalSpring("p.o", law=stops)
    return at.Scene("stopped", [body], [at.Pin("p.o")], gravity=(0, -9.81), connectors=[spring])


@pytest.mark.parametrize("spin", [4.0, 5.5, 8.0])
def test_a_force_that_jumps_is_crossed_with_small_tolerances(spin):
    """Errors of rounding grew by the impacts to come, and no step across the jump was small enough: it diverged."""
    run = {"t_end": 0.4, "output_dt": 0.02, "integrator": "esdirk"}
    loose, tight = (at.solve(stopped_pendulum(spin), tolerance=e, **run) for e in (1e-6, 1e-7))
    assert loose.status.ok, loose.status
    assert tight.status.ok, tight.status
    assert at.compare(loose, tight, ["p.center"]).error < 3e-6


@pytest.mark.parametrize(("name", "integrator", "tolerance"), RUNS)
def test_impacts_have_the_error_asked_for(name, integrator, tolerance):
    make, *numbers = SCENES[name]
    impact = make(*numbers)
    options = {"t_end": impact.t_end, "output_dt": impact.t_end / 40, "tolerance": tolerance}
    found = at.solve(impact.scene, integrator=integrator, **options)
    assert found.status.ok, found.status
    assert rms(found, impact) <= PROMISED[integrator] * tolerance


def test_the_exact_motion_is_free_flight_and_half_a_sine():
    """Of the reference: until the end of the first impact."""
    frequency, impact = 100.0, bounce(100.0, 1)
    speed = sqrt(2.0 * GRAVITY)
    fall, rest = speed / GRAVITY, GRAVITY / frequency**2
    t = np.linspace(0.0, fall + 0.8 * pi / frequency, 200)
    flight = -0.5 * GRAVITY * t**2
    into = frequency * np.maximum(t - fall, 0.0)
    contact = [-1.0 - rest + rest * cos(x) - speed / frequency * sin(x) for x in into]
    assert np.abs(impact.exact(t)[:, 1] - np.where(t < fall, flight, contact)).max() < 1e-10
