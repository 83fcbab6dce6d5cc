"""Slow growth and decay of motions that dampers hold, beside parts of high frequency."""

import numpy as np
import pytest

import anctmm as at

E, AREA = 2e11, 2e-4
STEEL = at.Material(E=E, density=7800.0)
THICK = at.Rectangle(0.02, 0.01)
#: Of a bar of 1 m about its end: mass times half the length, kg m, and inertia, kg m².
FIRST, SECOND = 7800.0 * AREA / 2.0, 7800.0 * AREA / 3.0


def on_pin(damping, stiffness, **options):
    """A steel bar that stands on a pin with a rotational spring and damper."""
    bar = at.Beam("bar", (0, 0), (0, 1), THICK, STEEL)
    spring = at.RotationalSpring("bar.start", stiffness=stiffness, damping=damping)
    return at.Scene("bar", [bar], [at.Pin("bar.start")], connectors=[spring], **options)


def slowest(stiffness, damping):
    """Rate of a rigid bar."""
    roots = np.roots([SECOND, damping, stiffness])
    return roots[np.argmin(np.abs(roots))].real


@pytest.mark.parametrize("damping", [100.0, 1e4, 1e6])
@pytest.mark.parametrize("mesh", [8, 90])
def test_an_upright_bar_falls_slowly_however_much_a_damper_holds_it(damping, mesh):
    scene = on_pin(damping, 1.0, gravity=(0.0, -9.81))
    rest = at.solve_static(scene, mesh=mesh)
    found = at.modes(scene, mesh=mesh, about=rest, count=3)
    assert found.growth_rates[0] == pytest.approx(slowest(1.0 - 9.81 * FIRST, damping), rel=1e-2)
    np.testing.assert_array_equal(found.unstable, [True, False, False])
    assert rest.stable[-1] == np.False_


@pytest.mark.parametrize("damping", [1e4, 1e6])
def test_a_door_with_a_closer_decays_slowly(damping):
    found = at.modes(on_pin(damping, 10.0), mesh=8, count=35)
    rates = found.growth_rates[found.frequencies == 0.0]
    assert np.abs(rates).min() == pytest.approx(10.0 / damping, rel=1e-2)
    assert not found.unstable.any()


def test_soft_beams_keep_their_frequency_beside_a_damped_stiff_one():
    """Their frequency is 1e-7 of the largest one of the stiff beam."""
    soft = [at.Beam(f"s{i}", (0, i + 1), (5, i + 1), at.Rectangle(0.02, 0.001), STEEL) for i in range(3)]
    bodies = [*soft, at.Beam("b", (0, 0), (0.2, 0), THICK, STEEL)]
    damper = at.Spring("b.end", (0.2, -1.0), damping=1.0)
    scene = at.Scene("soft", bodies, [at.Clamp(f"{b.name}.start") for b in bodies], connectors=[damper])
    found = at.modes(scene, mesh=4, count=4).frequencies
    np.testing.assert_allclose(found, [0.03272067] * 3 + [0.20528914], rtol=1e-5)
