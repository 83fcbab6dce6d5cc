"""Ctrl-C stops a run between two calls of its kernel, and what was computed is kept."""

import os
import signal
import threading

import numpy as np
import pytest
from samples import bar

import anctmm as at
from anctmm.equilibria import statics
from anctmm.model.scene import Clamp, Force
from anctmm.solve import solve
from reference import global_dae

ROADS = [solve, global_dae.solve]
KINDS = {
    "explicit": {"integrator": "zhai", "dt": 1e-5},
    "implicit": {"integrator": "generalized-alpha", "dt": 1e-5},
}


def assert_begins(found, whole):
    """What was kept of a run is how the whole run begins, to the last bit."""
    n = found.t.size
    assert np.array_equal(found.t, whole.t[:n])
    assert np.array_equal(found.position("bar", 1.0), whole.position("bar", 1.0)[:n])


@pytest.fixture
def scene_that_is_interrupted():
    """A scene and what arms it: Ctrl-C is then pressed soon after its load was asked for a later time than 0."""
    # where tests run in the background the signal is ignored otherwise
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    armed = threading.Event()

    def load(t):
        if armed.is_set() and np.max(t) > 0.0:
            armed.clear()
            timer.start()
        return 0.1 + 0.0 * t, 0.0 * t

    yield bar([Clamp("bar.start")], [Force("bar.end", load)], gravity=(0.0, -9.81)), armed.set
    timer.cancel()
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("road", ROADS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_run_of_hours_ends_soon_and_keeps_its_history(road, kind, scene_that_is_interrupted):
    scene, arm = scene_that_is_interrupted
    dt, stride = 2.0**-17, 2**12
    options = {"mesh": 2, **KINDS[kind], "dt": dt, "output_dt": stride * dt, "newton_tolerance": 1e-10}
    some = road(scene, **options, t_end=4 * stride * dt)
    arm()
    with pytest.raises(at.Interrupted) as caught:
        road(scene, **options, t_end=2.0**12)
    assert isinstance(caught.value, KeyboardInterrupt)  # scripts end as they are used to
    found = caught.value.solution
    assert found.status == "interrupted"
    assert found.cost.steps > 0
    steps = found.cost.steps  # the last one need not have been finished
    assert found.t.size - 1 in ((steps - 1) // stride, steps // stride)
    both = min(found.t.size, 5)
    assert np.array_equal(some.position("bar", 1.0)[:both], found.position("bar", 1.0)[:both])


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
def test_a_run_with_a_tolerance_ends_soon_and_keeps_its_history(integrator, scene_that_is_interrupted):
    scene, arm = scene_that_is_interrupted
    options = {"mesh": 8, "tolerance": 1e-6, "output_dt": 0.2, "integrator": integrator}
    solve(scene, mesh=2, tolerance=1e-2, t_end=1e-3, output_dt=1e-3, integrator=integrator)
    arm()
    with pytest.raises(at.Interrupted) as caught:
        solve(scene, **options, t_end=20.0)
    found = caught.value.solution
    assert found.status == "interrupted"
    assert found.t.size >= 1
    assert found.status.time >= found.t[-1]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("when", [0.0, 2.4e-3])
def test_the_history_kept_is_that_of_the_whole_run(kind, when, monkeypatch):
    """Ctrl-C pressed while a function of the user's is evaluated, at a known time."""
    monkeypatch.setattr("anctmm.kernels.pacing.FIRST", 1e-3)
    monkeypatch.setattr("anctmm.kernels.pacing.GROWTH", 1)
    pressed = []

    def load(t):
        if pressed and np.max(t) > when:
            raise KeyboardInterrupt
        return np.sin(t), 0.0 * np.asarray(t)

    scene = bar([Clamp("bar.start")], [Force("bar.end", load)])
    options = {"mesh": 2, **KINDS[kind], "t_end": 1e-2, "output_dt": 3e-4}
    whole = solve(scene, **options)
    pressed.append(True)
    with pytest.raises(at.Interrupted) as caught:
        solve(scene, **options)
    found = caught.value.solution
    n = found.t.size
    assert (found.status.time - 1e-5) / 3e-4 <= n <= 1 + when / 3e-4
    assert_begins(found, whole)
    for name, series in vars(found.energy).items():
        assert np.array_equal(series, getattr(whole.energy, name)[:n])


@pytest.mark.parametrize("road", ROADS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("driven", [False, True])
def test_a_history_that_fails_keeps_what_was_computed_until_then(road, kind, driven):
    broken, when = [], 2.4e-3

    def history(t):
        if broken and np.max(t) > when:
            raise ZeroDivisionError("no value there")
        return (np.sin(t) - t, np.cos(t) - 1.0, -np.sin(t)) if driven else (np.sin(t), 0.0 * np.asarray(t))

    clamp = Clamp("bar.start", history if driven else None)
    scene = bar([clamp], [] if driven else [Force("bar.end", history)], gravity=(0.0, -9.81))
    options = {"mesh": 2, **KINDS[kind], "t_end": 1e-2, "output_dt": 2e-5}
    whole = road(scene, **options)
    broken.append(True)
    with pytest.raises(at.HistoryError, match="no value there") as caught:
        road(scene, **options)
    found = caught.value.solution
    assert found.status == "failed"
    assert when - 5e-5 <= found.t[-1] <= when
    assert_begins(found, whole)


@pytest.mark.parametrize("road", ROADS, ids=lambda road: road.__module__)
def test_a_broken_history_is_told_at_the_first_time_at_which_it_breaks(road):
    """Not at the end of the steps for which its values are looked up together."""
    force = Force("m.center", lambda t: (1.0 / 0.0 if t > 0.5 else 1.0, 0.0))
    scene = at.Scene("mass", [at.PointMass("m", 1.0, (0.0, 0.0))], loads=[force])
    with pytest.raises(at.HistoryError, match=r"at t = 0.51 s raises ZeroDivisionError"):
        road(scene, dt=1e-2, t_end=1.0, output_dt=0.1)


@pytest.mark.parametrize("options", [{}, {"branch": "stable"}])
def test_equilibria_found_before_ctrl_c_are_kept(options, monkeypatch):
    scene = bar([Clamp("bar.start")], [Force("bar.end", (0.02, -0.05))])
    options = {"mesh": 2, "load_steps": 6, **options}
    whole = at.solve_static(scene, **options)
    looked, look = [], statics.doubt_of

    def interrupted(*arguments):
        looked.append(1)
        if len(looked) == 4:
            raise KeyboardInterrupt
        return look(*arguments)

    monkeypatch.setattr(statics, "doubt_of", interrupted)
    with pytest.raises(at.Interrupted) as caught:
        at.solve_static(scene, **options)
    found = caught.value.solution
    assert 2 <= found.t.size < 7
    assert found.status == "interrupted"
    assert f"beyond {found.t[-1]:.6g} of the load" in found.status.message
    assert_begins(found, whole)
