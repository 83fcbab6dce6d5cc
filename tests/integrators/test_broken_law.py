"""Laws that give no number on the way: the run tells which, when and where."""

import numpy as np
import pytest

import anctmm as at

BY_PYTHON = pytest.mark.interpreted


def ending(x, rate, t):
    """A law that has no number from 0.2 s on."""
    return 10.0 * x if t < 0.2 else np.nan


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
@pytest.mark.parametrize(
    "steps",
    [pytest.param({"dt": 1e-2}, marks=BY_PYTHON), {"tolerance": 1e-3, "output_dt": 0.1}],
    ids=["fixed", "by error"],
)
def test_a_spring_whose_law_ends_is_named(steps, integrator):
    mass = at.PointMass("mass", 1.0, (1.0, 0.0), velocity=(1.0, 0.0))
    spring = at.Spring("mass.center", (0.0, 0.0), law=ending)
    found = at.solve(
        at.Scene("pulled", [mass], connectors=[spring]), t_end=1.0, integrator=integrator, **steps
    )
    assert found.status.code == "diverged"
    for word in (
        "the law of the spring from 'mass.center' to the point (0.0, 0.0) gives nan near t = 0.2",
        "a length of 1.1",
    ):
        assert word in found.status.message
    assert found.status.time == pytest.approx(0.2, abs=1e-6)
    assert found.t[-1] <= found.status.time


@BY_PYTHON
def test_a_rotational_spring_whose_law_ends_is_named():
    wheel = at.RigidBody("wheel", 1.0, 1.0, (0.0, 0.0), spin=1.0)
    spring = at.RotationalSpring("wheel.center", law=ending)
    scene = at.Scene("turned", [wheel], [at.Pin("wheel.center")], connectors=[spring])
    found = at.solve(scene, t_end=1.0, dt=1e-2)
    assert "rotational spring from 'wheel.center' to the ground gives nan" in found.status.message
    assert "an angle of 0.1" in found.status.message


@BY_PYTHON
def test_a_motion_that_blows_up_by_itself_blames_no_law():
    """The law has a number wherever there is a place."""
    mass = at.PointMass("mass", 1.0, (1.0, 0.0))
    spring = at.Spring("mass.center", (0.0, 0.0), law=lambda x, rate, t: -1e6 * x**3 - 1.0)
    found = at.solve(at.Scene("pushed", [mass], connectors=[spring]), t_end=1.0, dt=1e-2)
    assert found.status.code == "diverged"
    assert "law" not in found.status.message
