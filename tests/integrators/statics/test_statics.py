"""Equilibria: exact elastica and arcs, load steps, what cannot stand."""

from math import pi

import numpy as np
import pytest
from samples import KINDS, SOFT, SQUARE, bar

from anctmm.model.drives import Pulse
from anctmm.model.scene import Clamp, Force, Torque
from anctmm.model.sections import Rectangle
from anctmm.solve import solve_static
from reference import exact
from studies.scenes import END_MOMENT, LENGTH, MATERIAL, SECTION, cantilever_end_moment, cantilever_tip_force

EI = MATERIAL.E * SECTION.second_moment
THICK = Rectangle(0.1, 0.1)
every_kind = pytest.mark.parametrize("kind", KINDS)


def tip_errors(scene, shape, meshes, **options):
    """Errors of the tip of `beam`, relative to its length."""
    ends = [solve_static(scene, mesh=m, newton_tolerance=1e-12, **options) for m in meshes]
    assert all(s.status.ok for s in ends)
    return (
        np.array([np.linalg.norm(s.position("beam", 1.0)[-1] - shape.position(1.0)) for s in ends]) / LENGTH
    )


def orders(errors):
    return np.log2(errors[:-1] / errors[1:])


@pytest.mark.parametrize("quadrature", ["full", "reduced", "lobatto"])
def test_cables_converge_to_the_extensible_elastica(quadrature):
    """Fourth order with Lobatto's points, better with Gauss's; 128 elements are below 1e-8 of the length."""
    scene = cantilever_tip_force(10.0).scene
    shape = exact.cantilever_static(scene, "elastica")
    errors = tip_errors(scene, shape, (32, 64, 128), quadrature=quadrature)
    assert shape.uncertainty < 1e-12
    assert orders(errors).min() > (3.9 if quadrature == "lobatto" else 4.5)
    assert errors[-1] < 1e-8


def test_shear_elements_converge_to_their_own_limit():
    """The continuum of the element, at h/L = 1/20; Reissner's beam, with its other strain, is 0.1 % away."""
    scene = cantilever_tip_force(3.0, section=THICK).scene
    shape = exact.cantilever_static(scene, "director")
    errors = tip_errors(scene, shape, (16, 32, 64), element="shear")
    other = exact.cantilever_static(scene, "reissner")
    assert orders(errors) == pytest.approx([2.0, 2.0], abs=0.25)
    assert errors[-1] < 1e-4
    gap = np.linalg.norm(shape.position(1.0) - other.position(1.0)) / LENGTH
    assert gap == pytest.approx(1.05e-3, rel=0.02)
    assert tip_errors(scene, other, (128,), element="shear")[0] == pytest.approx(gap, rel=0.05)


@pytest.mark.parametrize(("moment", "level"), [(END_MOMENT, 1e-7), (4 * pi, 1e-5)])
def test_end_moment_rolls_cables_up(moment, level):
    """Half a turn and two turns in one load step, at fourth order; the strain energy is that of pure bending."""
    scene = cantilever_end_moment(moment).scene
    shape = exact.cantilever_static(scene, "elastica")
    arc = exact.moment_arc(LENGTH, EI, moment * EI / LENGTH, 1.0)
    assert np.abs(shape.position(1.0) - arc).max() < 1e-12
    errors = tip_errors(scene, shape, (32, 64))
    assert orders(errors)[0] == pytest.approx(4.0, abs=0.15)
    assert errors[1] < level
    rest = solve_static(scene, mesh=64)
    assert rest.energy.strain[-1] == pytest.approx(0.5 * moment**2 * EI / LENGTH, rel=1.5e-5)


@every_kind
def test_equilibrium_does_not_depend_on_the_load_steps(kind):
    scene = cantilever_tip_force(10.0).scene
    one, four = (solve_static(scene, mesh=8, element=kind, load_steps=n) for n in (1, 4))
    assert one.t.tolist() == [0.0, 1.0]
    assert four.t.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    for fraction in (0.3, 1.0):
        ends = [s.position("beam", fraction)[-1] for s in (one, four)]
        assert np.abs(ends[0] - ends[1]).max() < 1e-9
    half = solve_static(cantilever_tip_force(5.0).scene, mesh=8, element=kind)
    assert np.abs(half.position("beam", 1.0)[-1] - four.position("beam", 1.0)[2]).max() < 1e-9


def test_drives_and_loads_are_those_of_the_beginning():
    loads = [Force("bar.end", lambda t: (0.1 * (1 - t), 0.0)), Torque("bar.end", Pulse(1.0, 1.0))]
    one = solve_static(bar([Clamp("bar.start")], loads), mesh=4)
    two = solve_static(bar([Clamp("bar.start")], [Force("bar.end", (0.1, 0.0))]), mesh=4)
    assert np.abs(one.position("bar", 1.0)[-1] - two.position("bar", 1.0)[-1]).max() < 1e-10


def test_load_steps_before_the_failure_are_kept():
    """A load that pulls beyond all reach at the end: the first part of it has an equilibrium."""
    strong = SOFT.E * SQUARE.area * 1e6
    scene = bar([Clamp("bar.start")], [Torque("bar.end", strong)])
    rest = solve_static(scene, mesh=2, load_steps=4)
    assert not rest.status.ok
    assert rest.t.tolist() == [0.0]
    assert 0.0 < rest.status.time < 0.25
