"""Times at which loads and drives are asked and outputs are kept: those of the steps, the last one the end itself."""

from math import sin

import numpy as np
import pytest
from samples import bar

import anctmm as at
from reference import exudyn_cable, global_dae

#: Lengths of runs, s, and steps: in most, the length over the steps times the steps is another number.
RUNS = [(0.1, 11), (0.3, 37), (0.5, 8)]
ROADS = {
    "explicit": (at.solve, "zhai"),
    "implicit": (at.solve, "generalized-alpha"),
    "global DAE, explicit": (global_dae.solve, "zhai"),
    "global DAE, implicit": (global_dae.solve, "generalized-alpha"),
    "Exudyn": (exudyn_cable.solve, "generalized-alpha"),
}


class Measured:
    """A history that exists from 0 to `end` only, and keeps the times at which it is asked."""

    def __init__(self, end, value):
        self.end, self.value, self.asked = end, value, []

    def __call__(self, t):
        if not 0.0 <= t <= self.end:  # of an array: an error too, so that it is asked time by time
            raise ValueError(f"nothing is known at t = {t!r}")
        self.asked.append(float(t))
        return self.value(t)


def soft(joints=(), loads=()):
    """A bar so soft that a step of 0.06 s is stable in explicit runs."""
    return bar(joints, loads, gravity=(0.0, -1.0), material=at.Material(E=10.0, density=1000.0))


@pytest.mark.parametrize("road", ROADS)
@pytest.mark.parametrize(("end", "steps"), RUNS)
def test_loads_are_asked_at_the_times_of_the_steps_and_never_after_the_end(road, end, steps):
    solve, integrator = ROADS[road]
    load = Measured(end, lambda t: (0.0, 1e-3 * t))
    found = solve(
        soft([at.Pin("bar.start")], [at.Force("bar.end", load)]),
        mesh=1, integrator=integrator, dt=end / steps, t_end=end,
    )  # fmt: skip
    assert found.status.ok
    times = np.array(sorted(set(load.asked)))
    exact = np.array([step * end / steps for step in range(steps)] + [end])
    np.testing.assert_array_equal(times, exact)
    np.testing.assert_array_equal(found.t, exact)


@pytest.mark.parametrize("road", ROADS)
def test_drives_are_asked_at_the_times_of_the_steps_and_never_after_the_end(road):
    solve, integrator = ROADS[road]
    drive = Measured(0.3, lambda t: (1.0 - np.cos(t), sin(t), np.cos(t)))
    scene = soft([at.Clamp("bar.start", angle=drive)])
    found = solve(scene, mesh=1, integrator=integrator, dt=0.3 / 37, t_end=0.3)
    assert found.status.ok
    exact = {step * 0.3 / 37 for step in range(37)} | {0.3}
    asked = set(drive.asked)
    assert exact <= asked
    # after the run its derivatives are looked at, and whether it jumps, within the run
    assert 0 < len(asked - exact) < 200
    assert 0.0 <= min(asked) <= max(asked) == 0.3
