"""Generalized-α: its coefficients, order, energy, dissipation, and how a run ends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from samples import KINDS, bar

import anctmm as at
from anctmm.discretise.methods import GeneralizedAlpha
from anctmm.model.scene import Clamp, Force, Pin
from anctmm.solve import solve, solve_static

GRAVITY = (0.0, -9.81)
every_kind = pytest.mark.parametrize("kind", KINDS)


def run(scene, dt, t_end, **options):
    return solve(scene, **{"mesh": 2, "dt": dt, "t_end": t_end, "newton_tolerance": 1e-13, **options})


# --- coefficients ------------------------------------------------------------------------------------------


@given(st.floats(0.0, 1.0))
def test_coefficients_fulfil_their_identities(rho):
    """Second order, and the most dissipation at high frequencies (Chung & Hulbert 1993, eqs. 17, 20, 25)."""
    c = GeneralizedAlpha(rho)
    assert c.gamma == pytest.approx(0.5 - c.alpha_m + c.alpha_f, abs=1e-15)
    assert c.beta == pytest.approx(0.25 * (1.0 - c.alpha_m + c.alpha_f) ** 2, abs=1e-15)
    assert c.alpha_m <= c.alpha_f <= 0.5


def amplification(rho, frequency):
    """Matrix of a step of size 1 of q'' = −ω² q in (q, v, a), w = −ω² q."""
    c, s = GeneralizedAlpha(rho), frequency**2
    am, af, b, g = c.alpha_m, c.alpha_f, c.beta, c.gamma
    new = np.array([[1, 0, -b], [0, 1, -g], [(1 - af) * s, 0, 1 - am]])
    old = np.array([[1, 1, 0.5 - b], [0, 1, 1 - g], [-af * s, 0, -am]])
    return np.linalg.solve(new, old)


@given(st.floats(0.0, 1.0), st.floats(-3.0, 6.0))
def test_stable_at_every_frequency(rho, exponent):
    values = np.abs(np.linalg.eigvals(amplification(rho, 10.0**exponent)))
    assert values.max() < 1.0 + 1e-6


@pytest.mark.parametrize("rho", [0.0, 0.7])
def test_small_vibration_follows_the_amplification_matrix(rho):
    """A mass on a spring: the recursion of a scalar oscillator, for 200 steps."""
    frequency, h, start = 30.0, 2e-2, 1e-3
    mass = at.PointMass("m", 1.0, (1.0 + start, 0.0))
    spring = at.Spring("m.center", (0.0, 0.0), stiffness=frequency**2, length=1.0)
    scene = at.Scene("oscillator", [mass], connectors=[spring])
    found = at.solve(scene, dt=h, t_end=200 * h, spectral_radius=rho, newton_tolerance=1e-13)
    state, A = start * np.array([1.0, 0.0, -((frequency * h) ** 2)]), amplification(rho, frequency * h)
    history = [start] + [(state := A @ state)[0] for _ in range(200)]
    assert found.position("m.center")[:, 0] - 1.0 == pytest.approx(history, abs=1e-7 * start)


# --- order and energy --------------------------------------------------------------------------------------


@every_kind
def test_energy_is_kept_to_the_order_of_the_step(kind):
    """ρ∞ = 1: a stretched, bent and swinging bar; less than 1 takes energy and gives none."""
    scene = bar([Pin("bar.start")], [Force("bar.end", (0.3, 0.0))], gravity=GRAVITY)
    sizes = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        motion = run(scene, dt, 0.5, element=kind, spectral_radius=1.0)
        sizes.append(np.abs(motion.energy.balance).max() / motion.energy.kinetic.max())
    assert sizes[1] / sizes[2] == pytest.approx(4.0, rel=0.3)
    assert sizes[2] < 2e-4
    damped = run(scene, 1e-3, 0.5, element=kind, spectral_radius=0.0)
    assert damped.energy.balance[-1] < -3.0 * sizes[0] * damped.energy.kinetic.max()


@every_kind
def test_damping_annihilates_what_is_far_above_the_step(kind):
    """ρ∞ = 0 with half an axial period a step: soon the axial vibration is gone."""
    scene = bar([Clamp("bar.start")], [Force("bar.end", (6e-4, 8e-4))])
    rest = solve_static(scene, mesh=2, element=kind).displacement("bar.end")[-1] @ [0.6, 0.8]
    ends = [
        run(scene, 0.02, 2.0, element=kind, spectral_radius=rho).displacement("bar.end") @ [0.6, 0.8]
        for rho in (0.0, 1.0)
    ]
    assert rest == pytest.approx(1e-3 / (1e7 * 4e-4), rel=0.1)  # the clamp holds the stretch of its end
    assert np.abs(ends[0][-5:] - rest).max() < 1e-3 * rest
    assert np.abs(ends[1][-5:] - rest).max() > 0.5 * rest
