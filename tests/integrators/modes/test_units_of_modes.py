"""Modes are those of any unit of length, mass and time: none is lost, none is there twice, none grows by rounding.

Positions and gradients stand side by side in the unknowns, displacements and rates in the quadratic problem: sums of
their squares depend on the units. Bars of 128 elements have more unknowns than are solved as a whole.
"""

from math import pi

import numpy as np
import pytest

import anctmm as at

#: Units of length, mass and time, in m, kg and s.
UNITS = [
    (1.0, 1.0, 1.0), (1e-2, 1e-6, 1e-2), (1e-4, 1e-12, 1e-4), (3e-5, 2.7e-14, 3e-5), (1e-5, 1e-15, 1e-5),
    (1e-6, 1e-18, 1e-6), (1.0, 1.0, 1e-7), (1.0, 1.0, 1e5), (1e-5, 1.0, 1.0), (1e3, 1e-9, 60.0),
]  # fmt: skip
E, DENSITY, SIDE, TAU = 2e9, 1000.0, 0.02, 1e-4
#: Roots of 1 − cos x cosh x and of 1 + cos x cosh x.
FREE = (4.730040744862704, 7.853204624095838, 10.995607838001671)
CLAMPED = (1.875104068711961, 4.694091132974174, 7.854757438237613)


def bar(length, mass, time, tau=TAU):
    """A bar of 1 unit of length, of a square section."""
    material = at.Material(
        E * mass / (length * time**2), density=DENSITY * mass / length**3, damping=tau * time
    )
    return at.Beam("bar", (0, 0), (length, 0), at.Rectangle(SIDE * length, SIDE * length), material)


def rates_of(roots, tau=TAU):
    """Exact rates of bending in units of time, λ² + τ ω² λ + ω² = 0."""
    w = np.array(roots) ** 4 * (E / DENSITY * SIDE**2 / 12.0)
    return -0.5 * tau * w + 1j * np.sqrt(w - (0.5 * tau * w) ** 2)


@pytest.mark.slow  # kernels of damped cables
@pytest.mark.parametrize("units", UNITS, ids=str)
@pytest.mark.parametrize(("still", "roots", "joints"), [(3, FREE, []), (0, CLAMPED, [at.Clamp("bar.start")])])
def test_a_damped_bar_of_many_elements(still, roots, joints, units):
    found = at.modes(at.Scene("bar", [bar(*units)], joints), mesh=128, count=still + 3)
    rates = (found.growth_rates + 2j * pi * found.frequencies) * units[2]
    np.testing.assert_allclose(rates[:still], 0.0, atol=1e-3)
    np.testing.assert_allclose(rates[still:], rates_of(roots), rtol=2e-4)
    assert not found.unstable.any()


@pytest.mark.slow  # kernels of guides and forces that follow
@pytest.mark.parametrize("units", UNITS, ids=str)
def test_a_bar_on_a_guide_with_a_force_that_follows(units):
    """It can slide and turn; the force, which is nearly 0, only makes the stiffness unsymmetric."""
    length, mass, _ = units
    beam = bar(*units, tau=0.0)
    own = DENSITY * SIDE**2 * mass
    body = at.RigidBody("body", own, 0.2 * own * length**2, (length, 0))
    thrust = 1e-9 * beam.material.E * beam.section.area
    scene = at.Scene(
        "guided", [beam, body], [at.Slider("bar.start", (1, 1)), at.Weld("bar.end", "body.center")],
        [at.Force("bar.end", (thrust, 0.0), follower=True)],
    )  # fmt: skip
    swings = 2 * pi * at.modes(scene, mesh=8, count=4).frequencies * units[2]
    assert (swings[:2] < 1e-3).all()
    assert (swings[2:] > 10.0).all()
