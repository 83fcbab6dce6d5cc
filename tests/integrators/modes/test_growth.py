"""Motions that grow about unstable equilibria: rates and frequencies against exact ones, and what the user sees."""

from math import pi

import numpy as np
import pytest
from scipy.optimize import root

import anctmm as at

G, THIN = 9.81, at.Rectangle(2e-4, 2e-4)
E, DENSITY = 2e11, 7800.0
EI, MASS = E * THIN.second_moment, DENSITY * THIN.area
EULER = pi**2 * EI  # of a bar of 1 m, N


def rates(found):
    """λ of the modes, 1/s."""
    return found.growth_rates + 2j * pi * found.frequencies


def about_equilibrium(scene, count=None, **cut):
    """Modes about the equilibrium under the whole load, and whether that was called stable."""
    rest = at.solve_static(scene, **cut)
    return at.modes(scene, count=count, about=rest, **cut), rest.status.ok


def column(ratio, damping=0.0):
    """Pinned at both ends and pressed with so many times Euler's load."""
    bar = at.Beam("bar", (0, 0), (0, 1), THIN, at.Material(E, DENSITY, damping=damping))
    ends = [at.Pin("bar.start"), at.Slider("bar.end", (0, 1))]
    return at.Scene("column", [bar], ends, [at.Force("bar.end", (0, -ratio * EULER))])


def rates_of_column(ratio, damping, waves=12):
    """Roots of λ² + τ w λ + w (1 − ratio/n²) = 0, w = (nπ)⁴ EI/ρA; λ with Im λ ≥ 0."""
    w = (np.arange(1, waves + 1) * pi) ** 4 * EI / MASS
    stiffness = w - ratio * EULER * (np.arange(1, waves + 1) * pi) ** 2 / MASS
    both = np.concatenate([np.roots([1.0, damping * a, b]) for a, b in zip(w, stiffness, strict=True)])
    found = both[(both.imag > 0.0) | ((both.imag == 0.0) & ((both.real > 0.0) | (damping > 0.0)))]
    kind = np.where(found.imag != 0.0, 1, np.where(found.real > 0.0, 0, 2))  # grow, swing, decay
    return found[np.lexsort((np.where(kind == 0, -1.0, 1.0) * np.abs(found), kind))]


@pytest.mark.parametrize("damping", [0.0, 1e-4])
@pytest.mark.parametrize(("ratio", "leaving"), [(0.9, 0), (1.2, 1), (4.1, 2), (9.3, 3)])
def test_a_column_beyond_its_critical_load_diverges_at_the_exact_rate(ratio, leaving, damping):
    """In so many modes, the fastest first: not the first of all, and slow ones are not taken for rounding."""
    found, stable = about_equilibrium(column(ratio, damping), 4, mesh=8, element="quintic")
    exact = rates_of_column(ratio, damping)[:4]
    np.testing.assert_allclose(rates(found), exact, rtol=2e-5, atol=1e-9)
    assert list(found.unstable) == [True] * leaving + [False] * (4 - leaving)
    assert stable == (leaving == 0)
    np.testing.assert_allclose(found.damping, -exact.real / np.abs(exact), rtol=2e-5, atol=1e-9)
    assert repr(found).count("unstable (divergence)") == leaving
    if leaving:
        assert f"{found.growth_rates[0]:11.4g} 1/s  unstable (divergence)" in repr(found)


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_an_upright_pendulum_leaves_at_the_exact_rate(damping):
    body = at.RigidBody("bob", mass=2.0, inertia=0.05, center=(0.0, 0.4), points={"pin": (0.0, 0.0)})
    turn = [at.RotationalSpring("bob.pin", stiffness=0.0, damping=damping)] if damping else []
    scene = at.Scene("pendulum", [body], [at.Pin("bob.pin")], gravity=(0, -G), connectors=turn)
    inertia = 0.05 + 2.0 * 0.4**2
    found, stable = about_equilibrium(scene)
    grows = max(np.roots([inertia, damping, -2.0 * G * 0.4]))
    assert found.growth_rates[0] == pytest.approx(grows, rel=1e-9)
    assert (found.frequencies[0], found.damping[0], stable) == (0.0, -1.0, False)
    assert "growth rate" in repr(found)
    assert found.motion(1).t[-1] == 1.0


def drawn_in(x, v, t):
    """A spring that pushes away, and a damper that feeds energy."""
    return -50.0 * x - 3.0 * v


def fed(x, v, t):
    """A spring with a damper that feeds energy."""
    return 50.0 * x - 3.0 * v


@pytest.mark.parametrize(("law", "stiffness"), [(drawn_in, -50.0), (fed, 50.0)])
def test_what_a_law_feeds_grows(law, stiffness):
    """Of two rates the one that grows is first, though it is the larger one; an oscillation that grows is flutter."""
    mass = at.PointMass("mass", mass=0.5, position=(1.0, 0.0))
    spring = at.Spring("mass.center", (0, 0), law=law)
    scene = at.Scene("fed", [mass], [at.Slider("mass.center", (1, 0))], connectors=[spring])
    found = at.modes(scene)
    exact = max(np.roots([0.5, -3.0, stiffness]), key=lambda x: (x.real, x.imag))
    np.testing.assert_allclose(rates(found)[0], exact, rtol=1e-6)
    assert ("flutter" if stiffness > 0.0 else "divergence") in repr(found)


def beck(load, damping=0.0):
    """Beck's column: clamped, under a force that turns with its tip, in EI/L²."""
    bar = at.Beam("bar", (0, 0), (0.6, 0.8), THIN, at.Material(E, DENSITY, damping=damping))
    force = at.Force("bar.end", (-0.6 * load * EI, -0.8 * load * EI), follower=True)
    return at.Scene("Beck", [bar], [at.Clamp("bar.start")], [force])


def beck_rate(near, load, damping):
    """The root λ near another of Beck's equation (Bolotin 1963): p² + 2ω²(1 + cosh a cos b) + p ω sinh a sin b = 0.

    Kelvin-Voigt damping makes EI one of EI (1 + τλ).
    """

    def equation(x):
        rate = x[0] + 1j * x[1]
        loss = 1.0 + damping * rate
        p, w = load / loss, np.sqrt(-(rate**2) * MASS / (EI * loss) + 0j)
        r = np.sqrt(p**2 / 4.0 + w**2)
        a, b = np.sqrt(r - p / 2.0), np.sqrt(r + p / 2.0)
        left = p**2 + 2.0 * w**2 * (1.0 + np.cosh(a) * np.cos(b)) + p * w * np.sinh(a) * np.sin(b)
        return left.real, left.imag

    found = root(equation, (near.real, near.imag), tol=1e-13)
    return complex(*found.x)


@pytest.mark.parametrize("damping", [0.0, 2e-4])
@pytest.mark.parametrize("load", [8.0, 15.0, 20.0, 20.1, 25.0])
@pytest.mark.parametrize(("mesh", "element"), [(6, "quintic"), (18, "cable")])
def test_frequencies_and_flutter_of_becks_column(load, damping, mesh, element):
    """Without damping it flutters beyond p = 20.05; a little damping makes it flutter earlier (Ziegler 1952)."""
    found, stable = about_equilibrium(beck(load, damping), 3, mesh=mesh, element=element)
    exact = [beck_rate(rate, load, damping) for rate in rates(found)]
    assert np.abs(np.diff(exact)).min() > 0.1  # three roots, not one twice
    np.testing.assert_allclose(rates(found), exact, rtol=2e-3 if abs(load - 20.05) < 0.1 else 1e-4, atol=1e-6)
    assert found.unstable.any() == (load > (11.0 if damping else 20.05))
    assert repr(found).count("unstable (flutter)") == found.unstable.sum() <= 1
    if not damping:
        assert stable == (load < 20.05)
