"""What connectors hold in statics, and forces that follow."""

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import DiscretisationError

SQUARE, SOFT = at.Rectangle(0.02, 0.02), at.Material(1e7, 1000.0)
EI = SOFT.E * SQUARE.second_moment


def held(*connectors, loads=()):
    """A cantilever with connectors and loads."""
    beam = at.Beam("a", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT)
    return at.Scene("held", [beam], [at.Clamp("a.start")], loads, connectors=connectors)


def test_a_hundred_springs_at_hinges():
    """Without them the chain is a mechanism: with them it is stable, and its motion keeps its energy."""
    n = 100
    bodies = [at.Beam(f"b{i}", (0.1 * i, 0.0), (0.1 * (i + 1), 0.0), SQUARE, SOFT) for i in range(n)]
    joints = [at.Clamp("b0.start"), *(at.Pin(f"b{i}.end", f"b{i + 1}.start") for i in range(n - 1))]
    springs = [at.RotationalSpring(f"b{i}.end", f"b{i + 1}.start", stiffness=50.0) for i in range(n - 1)]
    scene = at.Scene("chain", bodies, joints, gravity=(0.0, -0.01), connectors=springs)
    rest = at.solve_static(scene, mesh=1)
    assert rest.status.ok, rest.status
    assert rest.stable[-1]
    found = at.solve(scene, mesh=1, dt=1e-2, t_end=0.2, spectral_radius=1.0)
    assert found.status.ok, found.status
    assert np.abs(found.energy.balance).max() < 1e-6 * np.abs(found.energy.potential).max()


def test_a_preloaded_spring_that_pushes_a_column_makes_it_unstable():
    """A spring along a cantilever's axis to a far point pushes as a dead load: unstable from Euler's load on."""
    euler = EI * np.pi**2 / 4.0
    for part, code in ((0.9, "ok"), (1.1, "unstable")):
        spring = at.Spring("a.end", (1000.0, 0.0), preload=-part * euler)
        assert at.solve_static(held(spring), mesh=8).status == code


def test_laws_in_statics_are_springs():
    """The same equilibrium as with the spring that the law says."""
    one = at.Spring("a.end", (1.0, 1.0), stiffness=3.0, length=0.5)
    two = at.Spring("a.end", (1.0, 1.0), law=lambda x, v, t: 3.0 * x, length=0.5)
    ends = [at.solve_static(held(c), mesh=3).position("a", 1.0)[-1] for c in (one, two)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
    assert np.abs(ends[0] - [1.0, 0.0]).max() > 1e-3


def test_followers_have_no_stable_branch():
    """A force that follows its end has no potential energy."""
    scene = held(loads=[at.Force("a.end", (-EI, 0.0), follower=True)])
    with pytest.raises(DiscretisationError, match="no potential energy"):
        at.solve_static(scene, mesh=1, branch="stable")
