"""Piecewise polynomials of histories: they agree with the callables, and jumps are found where they are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import chebyshev

from anctmm.forces.histories import SUP, TERMS, Calendar, represent
from anctmm.forces.timeline import timeline
from anctmm.model.drives import History, Pulse, Quintic, tabulate
from anctmm.model.loads import Torque

T_END = 10.0
OUTPUTS = np.linspace(0.0, T_END, 201)


def followed(history, width=1):
    return represent("load", history, width, Calendar(T_END, OUTPUTS))


def values(found, t):
    """Of the polynomials."""
    piece = np.clip(np.searchsorted(found.edges, t, side="right") - 1, 0, len(found.terms) - 1)
    start, end = found.edges[piece], found.edges[piece + 1]
    x = (2.0 * t - start - end) / (end - start)
    return np.einsum("sk,swk->sw", chebyshev.chebvander(x, TERMS - 1), found.terms[piece])


SMOOTH = {
    "quintic": (Quintic(6.0, 2.0), 3),
    "pulse": (Pulse(2.0, 0.3), 1),
    "slow": (lambda t: np.sin(0.3 * t), 1),
    "fast": (lambda t: np.sin(2.0 * np.pi * 409.6 * t), 1),
    "period of the samples": (lambda t: np.sin(2.0 * np.pi * 3276.8 * t), 1),
    "kink": (lambda t: abs(t - np.pi), 1),
    "root": (np.sqrt, 1),
    "front": (lambda t: np.tanh(1e3 * (t - 5.0)), 1),
    "force": (lambda t: (np.cos(t), 1e-3 * t), 2),
    "scalars only": (lambda t: max(t, 1.0), 1),
    "bump of 1e-4 of the run": (lambda t: np.exp(-(((t - 3.3) / 3e-4) ** 2)), 1),
}


@pytest.mark.parametrize("name", SMOOTH)
def test_polynomials_agree_with_the_history(name):
    history, width = SMOOTH[name]
    found = followed(history, width)
    t = np.random.default_rng(1).uniform(0.0, T_END, 20_001)
    exact = tabulate("load", history, t, width)
    assert np.abs(values(found, t) - exact).max() <= 300 * SUP * np.abs(exact).max()


@given(st.floats(0.01, 9.0), st.floats(1e-3, 0.9), st.booleans(), st.booleans())
def test_jumps_are_found_where_they_are(t0, width, vectorised, force):
    """A rectangle on a smooth ground; its edges are stated nowhere."""

    def rectangle(t):
        if not vectorised and np.ndim(t):
            raise TypeError
        size = np.sin(t) + 2.0 * ((t >= t0) & (t < t0 + width))
        return (size, 0.0) if force else size

    found = followed(rectangle, 2 if force else 1)
    assert found.breaks == pytest.approx([t0, t0 + width], abs=2e-9 * T_END)
    assert (found.jumps()[:, 0] > 0.1).all()
    t = np.linspace(0.0, T_END, 997)
    t = t[np.abs(t[:, None] - [t0, t0 + width]).min(axis=1) > 1e-7]
    exact = np.sin(t) + 2.0 * ((t >= t0) & (t < t0 + width))
    assert np.abs(values(found, t)[:, 0] - exact).max() < 1e-7


@pytest.mark.parametrize("off", [-1e-6, -1e-9, 0.0, 1e-9, 1e-6])
def test_jumps_beside_the_end_of_a_piece_are_found(off):
    t0 = 5.0 / 64.0 * T_END + off
    assert followed(lambda t: np.where(t < t0, 0.0, 1.0)).breaks == pytest.approx([t0], abs=2e-9 * T_END)


def test_breaks_that_mean_an_output_are_that_output():
    """0.1 + 0.2 is no multiple of 0.05, and a step that ended there beside one would be too short."""
    found = followed(History(lambda t: 1.0 if t >= 0.3 else 0.0, [0.1 + 0.2]))
    assert found.breaks.tolist() == [OUTPUTS[6]]
    assert values(found, np.array([0.2999, 0.3001])).ravel() == pytest.approx([0.0, 1.0], abs=1e-9)


def test_data_between_which_straight_lines_run_is_followed():
    rng = np.random.default_rng(3)
    places, sizes = np.linspace(0.0, T_END, 501), rng.standard_normal(501)
    found = followed(History(lambda t: np.interp(t, places, sizes), places))
    t = rng.uniform(0.0, T_END, 5001)
    assert np.abs(values(found, t)[:, 0] - np.interp(t, places, sizes)).max() < 1e-8
    unsaid = followed(lambda t: np.interp(t, places, sizes))
    assert np.abs(values(unsaid, t)[:, 0] - np.interp(t, places, sizes)).mean() < 1e-6


def test_steps_end_at_kinks_that_are_outputs():
    """Steps of fourth order pass outputs; across a kink they would be no better than steps of second order."""
    kinks, jump = Pulse(2.0, 2.0), History(lambda t: np.where(t < 3.0, 0.0, 1.0), [3.0])
    found = timeline([], [Torque("a.end", kinks), Torque("b.end", jump)], [], T_END, OUTPUTS)
    assert OUTPUTS[40] == 2.0
    assert found.stops.tolist() == [2.0, 3.0, np.inf]
    assert found.anew.tolist() == [False, True, False]
