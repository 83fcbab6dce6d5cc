"""Energies of equilibria: work is that of the whole loads, as the potential is, or NaN where the path decides."""

from math import pi

import numpy as np
import pytest

import anctmm as at
from reference import exact

SECTION, MATERIAL = at.Rectangle(0.02, 0.01), at.Material(E=1e9, density=1000.0)
BEAM = at.Beam("b", (0.0, 0.0), (1.0, 0.0), SECTION, MATERIAL)
BENDING = MATERIAL.E * SECTION.second_moment


def clamped(loads=(), connectors=()):
    return at.Scene("s", [BEAM], [at.Clamp("b.start")], loads, connectors=connectors)


def test_a_moment_that_winds_up_a_beam_by_one_and_a_half_turns():
    moment = 3.0 * pi * BENDING
    scene = clamped([at.Torque("b.end", moment)])
    found, same = at.solve_static(scene, mesh=8, load_steps=8).energy, exact.solve_static(scene).energy
    assert found.work[0] == 0.0
    assert (np.diff(found.work) > 0.0).all()
    for name in ("strain", "potential", "work"):
        assert getattr(found, name)[-1] == pytest.approx(getattr(same, name)[-1], rel=0.03, abs=1e-12)


def test_the_energies_of_an_equilibrium_are_stationary_under_the_whole_loads():
    """A larger or smaller part of the loads leads to states that have more."""
    loads = [at.Force("b.end", (0.0, -1.0)), at.Torque("b.end", -0.3)]
    spring = [at.Spring("b.end", (1.0, 1.0), stiffness=1.0)]
    energy = at.solve_static(clamped(loads, spring), mesh=4, load_steps=10).energy
    total = energy.strain + energy.potential - energy.work
    assert (np.diff(total) < 0.0).all()
    assert abs(total[-1] - total[-2]) < 0.02 * abs(total[-1] - total[0])  # (1 − 0.9)² = 0.01 if it is linear


@pytest.mark.parametrize(
    "scene",
    [
        clamped([at.Force("b.end", (0.0, -0.1), follower=True)]),
        clamped(connectors=[at.Spring("b.end", (1.0, 1.0), law=lambda x, rate, t: 0.1 + x)]),
    ],
    ids=["follower", "law"],
)
def test_work_that_depends_on_the_path_is_not_told(scene):
    found = at.solve_static(scene, mesh=4)
    assert found.status.ok
    assert found.energy.work[0] == 0.0
    assert np.isnan(found.energy.work[1])
    assert np.isfinite(found.energy.strain).all()
