"""Scenes, drives and discretisations as values; what is refused is in `test_failures.py`."""

import pickle
from dataclasses import FrozenInstanceError, replace
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from samples import refused, run_of, scene_of

from anctmm import errors
from anctmm.model.drives import History, Pulse, Quintic, breaks_of, tabulate
from anctmm.model.scene import Clamp, Force, Torque
from studies.scenes import CASES

# --- drives ------------------------------------------------------------------------------------------------


def complex_free_derivative(f, t, h=1e-5):
    return (f(t - 2 * h) - 8 * f(t - h) + 8 * f(t + h) - f(t + 2 * h)) / (12 * h)


def test_quintic_turns_from_rest_to_rest():
    drive = Quintic(turn=3.0, duration=2.0)
    t = np.array([-1.0, 0.0, 1.0, 2.0, 3.0])
    angle, rate, acceleration = drive(t)
    assert angle == pytest.approx([0.0, 0.0, 1.5, 3.0, 3.0], abs=1e-15)
    assert rate == pytest.approx([0.0, 0.0, 3.0 * 1.875 / 2.0, 0.0, 0.0], abs=1e-15)
    assert acceleration == pytest.approx(np.zeros(5), abs=1e-15)


@given(st.floats(0.1, 1.9))
def test_rates_of_the_quintic_are_its_derivatives(t):
    drive = Quintic(turn=3.0, duration=2.0)
    for k in (0, 1):
        slope = complex_free_derivative(lambda x, k=k: drive(x)[k], t)
        assert drive(t)[k + 1] == pytest.approx(slope, abs=1e-8)


def test_pulse_rises_and_falls():
    pulse = Pulse(2.0, 4.0)
    assert pulse(np.array([-1.0, 0.0, 1.0, 2.0, 4.0, 9.0])) == pytest.approx([0, 0, 1, 2, 0, 0], abs=1e-15)


def test_histories_say_where_they_break():
    assert Quintic(turn=3.0, duration=2.0).breaks == Pulse(2.0, 2.0).breaks == (0.0, 2.0)
    kick = History(scalar_only, breaks=[0.5, 0.25, 0.5])
    assert kick.breaks == (0.25, 0.5)
    assert kick(0.7) == scalar_only(0.7)
    assert kick == History(scalar_only, (0.25, 0.5))
    assert hash(kick) == hash(History(scalar_only, (0.25, 0.5)))
    assert breaks_of("load", scalar_only) is None
    assert breaks_of("load", History(scalar_only)) == ()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: History(3.0), ["function", "3.0", "callable"]),
        (lambda: History(abs, 0.5), ["breaks", "0.5", "sequence"]),
        (lambda: History(abs, ["soon"]), ["break (s)", "'soon'", "finite"]),
        (lambda: History(abs, [nan]), ["break (s)", "nan", "finite"]),
        (lambda: Force("a.end", Broken()), ["force on 'a.end'", "'often'", "sequence"]),
        (lambda: Torque("a.end", Broken()), ["torque on 'a.end'", "'often'", "sequence"]),
        (lambda: scene_of(Clamp("a.start", Broken())), ["clamp 'a.start' angle", "'often'", "sequence"]),
    ],
)
def test_breaks_that_are_no_times_are_refused(make, words):
    with refused(errors.PropertyError, words):
        make()


class Broken:
    """A history whose breaks are no times."""

    breaks = "often"

    def __call__(self, t):
        return 0.0, 0.0, 0.0


def scalar_only(t):
    return (1.0, t) if t > 0.5 else (0.0, -t)


@pytest.mark.parametrize(
    ("history", "words"),
    [
        (lambda t: (1.0, 2.0, 3.0), ["hub", "2 finite", "t = 0.0"]),
        (
            lambda t: (1.0 / (0.5 - t), 0.0) if t != 0.5 else (inf, 0.0),
            ["hub", "inf", "t = 0.5 s", "finite"],
        ),
        (lambda t: 1 / 0, ["hub", "division by zero"]),
    ],
)
def test_histories_that_fail_say_where(history, words):
    with refused(errors.PropertyError, words):
        tabulate("hub", history, np.linspace(0.0, 1.0, 5), 2)


# --- frozen values -----------------------------------------------------------------------------------------


def test_scenes_and_runs_are_values():
    for case in CASES:
        assert pickle.loads(pickle.dumps(case.scene)) == case.scene
        assert hash(pickle.loads(pickle.dumps(case.scene))) == hash(case.scene)
    one, two = (run_of(mesh={"a": 2, "b": 3}, element={"a": "cable", "b": "shear"}) for _ in range(2))
    assert one == two
    assert hash(one) == hash(two)
    with pytest.raises(FrozenInstanceError):
        one.dt = 1.0
    assert replace(one, dt=0.5).steps == 2


def test_probes():
    s = scene_of()
    assert s.probe("b.end") == ("b", 1.0)
    assert s.probe("b.start") == ("b", 0.0)
    assert s.probe(("a", 0.25)) == ("a", 0.25)


@pytest.mark.parametrize(
    ("options", "kept"),
    [
        ({"dt": 0.1, "t_end": 0.5}, [0, 1, 2, 3, 4, 5]),
        ({"dt": 0.1, "t_end": 0.5, "output_dt": 0.2}, [0, 2, 4, 5]),
        ({"dt": 0.1, "t_end": 0.4, "output_dt": 0.2}, [0, 2, 4]),
        ({"dt": 0.1, "t_end": 0.3, "output_dt": 5.0}, [0, 3]),
        ({"dt": 1e-6, "t_end": 1.0, "output_dt": 0.5}, [0, 500_000, 1_000_000]),
    ],
)
def test_outputs_hold_both_ends(options, kept):
    r = run_of(**options)
    assert r.output_steps.tolist() == kept
    t = r.times(r.output_steps)
    assert t[0] == 0.0
    assert t[-1] == options["t_end"]
