"""Stability limits of explicit steps with connectors, what connectors hold in statics, forces that follow."""

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import DiscretisationError

SQUARE, SOFT = at.Rectangle(0.02, 0.02), at.Material(1e7, 1000.0)


CLAMPED = (at.Clamp("a.start"),)


def held(*connectors, loads=(), joints=CLAMPED, gravity=(0.0, 0.0)):
    return at.Scene(
        "held",
        [at.Beam("a", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT)],
        joints,
        loads,
        gravity,
        connectors=connectors,
    )


def test_springs_between_hinged_bars_hold_a_chain():
    """Every hinge of a chain has a rotational spring: without them it is a mechanism; stable and found at once."""
    n = 5
    bodies = [at.Beam(f"b{i}", (0.2 * i, 0.0), (0.2 * (i + 1), 0.0), SQUARE, SOFT) for i in range(n)]
    joints = [at.Clamp("b0.start"), *(at.Pin(f"b{i}.end", f"b{i + 1}.start") for i in range(n - 1))]
    springs = [at.RotationalSpring(f"b{i}.end", f"b{i + 1}.start", stiffness=50.0) for i in range(n - 1)]
    rest = at.solve_static(
        at.Scene("chain", bodies, joints, gravity=(0.0, -9.81), connectors=springs), mesh=2
    )
    assert rest.status.ok, rest.status
    assert rest.status.message == ""
    assert rest.stable[-1]
    free = at.solve_static(at.Scene("chain", bodies, joints, gravity=(0.0, -9.81)), mesh=2)
    assert "stabilised path" in free.status.message


def test_a_hundred_springs_at_hinges():
    """All couple distant nodes, a border of a hundred rows: the run keeps its energy, and statics its count."""
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
    assert found.cost.newton_iterations <= 4 * found.cost.steps


def test_a_preloaded_spring_that_pushes_a_column_makes_it_unstable():
    """A spring along a cantilever's axis to a far point pushes as a dead load: unstable from Euler's load on."""
    euler = SOFT.E * SQUARE.second_moment * np.pi**2 / 4.0
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


EI = SOFT.E * SQUARE.second_moment


def beck(load):
    """A cantilever under a force that follows its end, along its axis (Beck 1952)."""
    return held(loads=[at.Force("a.end", (-load * EI, 0.0), follower=True)])


def test_a_follower_along_a_column_makes_it_flutter_at_becks_load():
    """20.05 EI/L², by the dynamic criterion; no static one says so."""
    for load, code in ((19.8, "ok"), (20.3, "unstable")):
        found = at.solve_static(beck(load), mesh=8, load_steps=4)
        assert found.status == code, found.status
    assert "flutter" in found.status.message


def test_followers_have_no_stable_branch():
    with pytest.raises(
        DiscretisationError, match=r"turns with its place in scene 'held'.*no potential energy"
    ):
        at.solve_static(beck(1.0), mesh=1, branch="stable")
