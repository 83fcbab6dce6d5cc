"""Velocities and angles of a solution."""

from math import pi

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import ResultError, UnknownNameError
from anctmm.results.fields import LagrangeField
from reference import exudyn_cable, exudyn_reissner, global_dae

ROD, RUBBER = at.Rectangle(0.02, 0.02), at.Material(E=5e6, density=1100.0)
SPIN = 9.0


def free_bar():
    """A bar that flies and spins without a load: it moves almost as a rigid one."""
    bar = at.Beam("bar", (0, 0), (0.5, 0.2), ROD, at.Material(E=5e9, density=1100.0), velocity=spinning)
    return at.Scene("free", [bar])


def spinning(fraction):
    return 1.0 - SPIN * 0.2 * (fraction - 0.5), SPIN * 0.5 * (fraction - 0.5)


def driven(element):
    """A soft beam turned by a motor, twice around."""
    beam = at.Beam("beam", (0, 0), (0.3, 0), ROD, RUBBER)
    motor = at.Clamp("beam.start", angle=at.Quintic(turn=4.0 * pi, duration=1.0))
    run = at.Discretisation(mesh=2, element=element, dt=2e-3, t_end=1.0, output_dt=0.1)
    return at.Scene("driven", [beam], [motor]), run


@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("solve", [at.solve, global_dae.solve])
def test_a_driven_section_has_the_angle_and_rate_of_its_drive(solve, element):
    scene, run = driven(element)
    found = solve(scene, run)
    wanted = np.array([scene.joints[0].angle(t)[0] for t in found.t])
    assert wanted[-1] == pytest.approx(4.0 * pi)
    np.testing.assert_allclose(found.angle("beam.start"), wanted, atol=1e-12)
    assert abs(found.angle("beam.end")[-1] - 4.0 * pi) < pi
    np.testing.assert_allclose(found.velocity("beam.start"), 0.0, atol=1e-12)


def test_both_roads_have_the_same_velocities():
    scene, run = driven("shear")
    ours, dae = at.solve(scene, run), global_dae.solve(scene, run)
    fractions = [0.0, 0.3, 1.0]
    assert ours.velocity("beam", fractions).shape == (len(ours.t), 3, 2)
    np.testing.assert_allclose(ours.velocity("beam", fractions), dae.velocity("beam", fractions), atol=1e-6)
    np.testing.assert_allclose(ours.angle("beam", fractions), dae.angle("beam", fractions), atol=1e-8)


@pytest.mark.parametrize("solve", [at.solve, exudyn_cable.solve, exudyn_reissner.solve])
def test_a_spinning_bar_moves_as_a_rigid_one(solve):
    output = (
        0.4 if solve is at.solve else 0.1
    )  # more than half a turn apart, where turns are counted at each step
    found = solve(free_bar(), at.Discretisation(mesh=2, dt=1e-3, t_end=1.0, output_dt=output))
    angle = found.angle("bar", 0.5)
    np.testing.assert_allclose(angle, SPIN * found.t, rtol=1e-3)
    turned = np.exp(1j * angle) * (0.25 + 0.1j)
    wanted = [1.0, 0.0] + SPIN * np.stack([-turned.imag, turned.real], axis=1)
    np.testing.assert_allclose(found.velocity("bar.end"), wanted, atol=2e-2)


def test_what_a_solution_has_not_is_said():
    scene, _ = driven("cable")
    rest = at.solve_static(
        at.Scene("held", scene.bodies, [at.Clamp("beam.start")], gravity=(0, -9.81)), mesh=2
    )
    with pytest.raises(ResultError, match="velocities are not part of this solution"):
        rest.velocity("beam.end")
    assert rest.angle("beam.end")[-1] < -0.01
    with pytest.raises(ResultError, match="angles are not part"):
        LagrangeField(np.zeros((1, 3, 2))).angle(0.5, np.zeros(1))
    with pytest.raises(UnknownNameError, match="'bar'"):
        rest.angle("bar.end")
