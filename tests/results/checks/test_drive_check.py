"""Drives whose derivatives are none: the status of every solver says so."""

from math import pi

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

RUBBER = at.Material(E=5e6, density=1100.0)
ARM = at.Beam("arm", (0.0, 0.0), (0.3, 0.0), at.Circle(0.02), RUBBER)
MASS = at.PointMass("mass", 1.0, (1.0, 0.0))
END = 0.2


def clamped(angle):
    return at.Scene("clamped", [ARM], [at.Clamp("arm.start", angle=angle)])


def guided(position):
    return at.Scene("guided", [MASS], [at.Slider("mass.center", position=position)])


def pulled(length):
    return at.Scene(
        "pulled", [MASS], connectors=[at.Spring("mass.center", (0, 0), stiffness=1.0, length=length)]
    )


def run(scene, solve=at.solve, **options):
    return solve(scene, **{"mesh": 1, "dt": 2e-3, "t_end": END} | options).status


#: Scenes and what their statuses name.
WRONG = {
    "rate": (lambda: clamped(lambda t: (t**2, 0.5 * t, 2.0)), "clamp 'arm.start' angle: its rate"),
    "acceleration": (lambda: clamped(lambda t: (t**2, 2.0 * t, 0.0 * t)), "its acceleration is 0 rad/s²"),
    "degrees": (lambda: clamped(lambda t: (np.radians(90 * t**2), 180.0 * t, 180.0)), "its rate"),
    "place": (lambda: guided(lambda t: (np.sin(t) - t, 0.0 * t, -np.sin(t))), "slider 'mass.center' position"),
    "jump": (lambda: clamped(lambda t: (np.where(t < 0.1003, 0.0, 0.3), 0.0 * t, 0.0 * t)), "jumps by 0.3 rad"),
    "jump of a moving place": (
        lambda: guided(lambda t: (50.0 * t**2 + 0.2 * (t > 0.05), 100.0 * t, 100.0 + 0.0 * t)), "jumps by 0.2 m"
    ),
    "length": (lambda: pulled(lambda t: (1.0 + t, 5.0)), "length: its rate is 5 m/s"),
}  # fmt: skip


def known_at_steps(t):
    """A table without anything between its times."""
    if abs(t / 2e-3 - round(t / 2e-3)) > 1e-6:
        raise KeyError(t)
    return t**2, 2.0 * t, 2.0


def sudden(t):
    """A turn by 0.2 rad in 10 µs."""
    x = np.clip((t - 0.1003) / 1e-5, 0.0, 1.0)
    y = x * (1.0 - x)
    return 0.2 * x**3 * (10.0 - 15.0 * x + 6.0 * x**2), 6e5 * y**2, 1.2e11 * y * (1.0 - 2.0 * x)


#: What is right, be it fast, rough or noisy.
TIMES = np.linspace(0.0, END, 21)
TABLE = 0.1 * TIMES**2 * np.cos(30.0 * TIMES)
RATES = np.gradient(TABLE, TIMES)
RIGHT = {
    "fast": lambda: clamped(lambda t: (1e-6 * (1.0 - np.cos(2e4 * pi * t)), 0.02 * pi * np.sin(2e4 * pi * t),
                                       400.0 * pi**2 * np.cos(2e4 * pi * t))),
    "rest": lambda: clamped(lambda t: (0.0 * t, 0.0 * t, 0.0 * t)),
    "late": lambda: clamped(lambda t: (np.maximum(t - 0.15, 0.0) ** 3, 3.0 * np.maximum(t - 0.15, 0.0) ** 2,
                                       6.0 * np.maximum(t - 0.15, 0.0))),
    "quintic": lambda: clamped(at.Quintic(turn=1.0, duration=0.1)),
    "ramp": lambda: guided(lambda t: (np.where(t < 0.1, 0.0, t - 0.1), np.where(t < 0.1, 0.0, 1.0), 0.0 * t)),
    "sudden": lambda: clamped(sudden),
    "length that jumps": lambda: pulled(lambda t: (np.where(t < 0.1, 1.0, 1.1), 0.0 * t)),
    "far": lambda: pulled(lambda t: (1e3 + 1e-3 * t, 1e-3)),
    "steps": lambda: clamped(known_at_steps),
    "table": lambda: pulled(lambda t: (1.0 + np.interp(t, TIMES, TABLE), np.interp(t, TIMES, RATES))),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_derivatives_that_are_none_are_told(what):
    make, words = WRONG[what]
    status = run(make(), global_dae.solve if what == "rate" else at.solve)
    assert not status.ok
    assert words in status.message


@pytest.mark.parametrize("what", RIGHT)
def test_derivatives_that_are_right_are_not(what):
    message = run(RIGHT[what](), check_stability=False).message
    assert "by differences" not in message
    assert "jumps" not in message


def test_a_free_length_that_breaks_within_a_step_is_told():
    def kicked(t):
        x = np.clip((np.asarray(t) - 0.1005) / 1e-3, 0.0, 1.0)
        return 0.5 + 0.05 * np.sin(pi * x) ** 2, 50.0 * pi * np.sin(2.0 * pi * x)

    status = run(pulled(at.History(kicked, breaks=[0.1005, 0.1015])))
    assert status.code == "inaccurate"
    assert "length: it breaks within the step" in status.message
