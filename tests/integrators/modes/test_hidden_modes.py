"""Motions that others could hide: behind slow decay, behind softer parts, behind constraints that repeat each other."""

from math import pi

import numpy as np
import pytest

import anctmm as at

SECTION, E, DENSITY = at.Rectangle(0.02, 0.01), 2e9, 1500.0
EI = E * SECTION.second_moment


def on_springs(*springs, y=0.0):
    """Masses of 1 kg on lines along x, each with a spring to the ground: stiffness (N/m) and damping (N s/m)."""
    masses = [at.PointMass(f"m{n}", 1.0, (0.0, y + n)) for n in range(len(springs))]
    joints = [at.Slider(f"m{n}.center") for n in range(len(springs))]
    connectors = [
        at.Spring(f"m{n}.center", (1.0, y + n), stiffness=k, damping=c) for n, (k, c) in enumerate(springs)
    ]
    return masses, joints, connectors


def test_an_overdamped_motion_hides_no_vibration_and_has_both_its_rates():
    masses, joints, connectors = on_springs((100.0, 50.0), (1e4, 0.0))
    scene = at.Scene("two", masses, joints, connectors=connectors)
    found = at.modes(scene)
    assert found.frequencies[0] == pytest.approx(100.0 / (2.0 * pi), rel=1e-9)
    every = at.modes(scene, count=3)
    roots = np.sort(np.roots([1.0, 50.0, 100.0]))[::-1]
    np.testing.assert_allclose(every.growth_rates, [0.0, *roots], rtol=1e-9, atol=1e-9)
    with pytest.raises(at.errors.DiscretisationError, match="2 free motions: at most 3 modes are allowed"):
        at.modes(scene, count=4)


@pytest.mark.parametrize("mesh", [16, pytest.param(80, marks=pytest.mark.exhaustive)])
def test_creep_hides_no_vibration(mesh):
    """Kelvin-Voigt damping of 5 ms keeps all motions but three from swinging; each of them decays near 1/τ."""
    tau = 5e-3
    beam = at.Beam("beam", (0, 0), (1, 0), SECTION, at.Material(E, DENSITY, damping=tau))
    found = at.modes(at.Scene("beam", [beam], [at.Clamp("beam.start")]), mesh=mesh)
    waves = np.array([1.875104068711961, 4.694091132974174, 7.854757438237613])
    w = waves**4 * EI / (DENSITY * SECTION.area)
    exact = -0.5 * tau * w + 1j * np.sqrt(w - (0.5 * tau * w) ** 2)
    rates = found.growth_rates + 2j * pi * found.frequencies
    np.testing.assert_allclose(rates[:3], exact, rtol=2e-3)
    assert (found.frequencies[3:] == 0.0).all()


def beck(load, damping, rope):
    """Beck's column beside a rope of so many elements, both clamped, and a soft spring between them."""
    material = at.Material(E, DENSITY, damping=damping)
    column = at.Beam("column", (0, 0), (1, 0), SECTION, material)
    soft = at.Beam("rope", (0, -1), (30, -1), at.Circle(0.01), material)
    spring = at.Spring(("column", 0.5), ("rope", 1 / 32), stiffness=1e-3)
    force = at.Force("column.end", (-load * EI, 0.0), follower=True)
    clamps = [at.Clamp("column.start"), at.Clamp("rope.start")]
    scene = at.Scene("beside", [column, soft], clamps, [force], connectors=[spring])
    return scene, {"column": 16, "rope": rope}


@pytest.mark.parametrize("rope", [32, pytest.param(80, marks=pytest.mark.exhaustive)])
@pytest.mark.parametrize(
    ("load", "damping", "growth"),
    [
        (25.0, 0.0, 16.3848),
        pytest.param(25.0, 1e-3, 15.0665, marks=pytest.mark.slow),
        pytest.param(5.0, 1e-3, 0.0, marks=pytest.mark.slow),
    ],
)
def test_a_rope_beside_it_does_not_hide_the_flutter_of_a_column(load, damping, growth, rope):
    """The rope has dozens of modes that are softer. The rates are those of the column alone."""
    scene, mesh = beck(load, damping, rope)
    alone = at.Scene("alone", scene.bodies[:1], scene.joints[:1], scene.loads)
    rest = at.solve_static(scene, mesh=mesh)
    assert rest.stable[-1] == (growth == 0.0)
    found = at.modes(scene, mesh=mesh, about=rest)
    assert found.unstable.any() == (growth > 0.0)
    if growth:
        assert found.unstable[0]
        own = at.modes(alone, mesh=16, about=at.solve_static(alone, mesh=16))
        assert found.growth_rates[0] == pytest.approx(own.growth_rates[0], rel=1e-5)
        assert found.growth_rates[0] == pytest.approx(growth, rel=1e-4)
