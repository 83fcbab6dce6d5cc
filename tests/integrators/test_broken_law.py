"""Laws that give no number on the way: the run tells which, when and where."""

import numpy as np
import pytest

import anctmm as at


def ending(x, rate, t):
    """A law that has no number from 0.2 s on."""
    return 10.0 * x if t < 0.2 else np.nan


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
@pytest.mark.parametrize(
    "steps",
    [{"dt": 1e-2}, {"tolerance": 1e-3, "output_dt": 0.1}],
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
        "1.1",
    ):
        assert word in found.status.message
    assert found.status.time == pytest.approx(0.2, abs=1e-6)
    assert found.t[-1] <= found.status.time


FIXED, BY_ERROR = {"dt": 1e-2}, {"tolerance": 1e-3, "output_dt": 0.1}
UNNAMED = pytest.mark.xfail(strict=True, reason="a rotational spring's law that ends is not named")


@pytest.mark.parametrize(
    ("integrator", "steps"),
    [
        ("generalized-alpha", FIXED),
        pytest.param("generalized-alpha", BY_ERROR, marks=UNNAMED),
        pytest.param("esdirk", FIXED, marks=UNNAMED),
        pytest.param("esdirk", BY_ERROR, marks=UNNAMED),
    ],
)
def test_a_rotational_spring_whose_law_ends_is_named(steps, integrator):
    """A step or a guess beyond the law's end left no numbers, from which no shorter step went on."""
    wheel = at.RigidBody("wheel", 1.0, 1.0, (0.0, 0.0), spin=1.0)
    spring = at.RotationalSpring("wheel.center", law=ending)
    scene = at.Scene("turned", [wheel], [at.Pin("wheel.center")], connectors=[spring])
    found = at.solve(scene, t_end=1.0, integrator=integrator, **steps)
    assert (
        "rotational spring from 'wheel.center' to the ground gives nan near t = 0.2" in found.status.message
    )
    assert "0.1" in found.status.message
    assert found.status.time == pytest.approx(0.2, abs=0.1)


def raising(x, rate, t):
    """A law that raises from 0.2 s on."""
    if t > 0.2:
        raise ValueError("out of oil")
    return 10.0 * x


@pytest.mark.xfail(strict=True, reason="what a law raises is not told")
@pytest.mark.parametrize("steps", [FIXED, BY_ERROR])
def test_what_a_law_raises_is_told(steps):
    """Its compiled form gives no number, and nothing more."""
    mass = at.PointMass("mass", 1.0, (1.0, 0.0), velocity=(1.0, 0.0))
    scene = at.Scene("pulled", [mass], connectors=[at.Spring("mass.center", (0.0, 0.0), law=raising)])
    found = at.solve(scene, t_end=1.0, **steps)
    assert found.status.code == "diverged"
    for word in (
        "gives nan near t = 0.2",
        "where it raises ValueError: out of oil",
        "test_broken_law.py, line",
    ):
        assert word in found.status.message


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
def test_a_law_that_has_numbers_wherever_the_motion_goes_ends_no_run(integrator):
    """The guess of how far the motion goes passes the angle of 0.6 rad, where the law ends; the motion does not."""
    wheel = at.RigidBody("wheel", 1.0, 1.0, (0.0, 0.0), spin=1.0)
    spring = at.RotationalSpring(
        "wheel.center", law=lambda x, rate, t: 4.0 * x + 400.0 * x**3 if abs(x) < 0.6 else np.nan
    )
    scene = at.Scene("turned", [wheel], [at.Pin("wheel.center")], connectors=[spring])
    found = at.solve(scene, t_end=2.0, integrator=integrator, tolerance=1e-2, output_dt=0.1)
    assert found.status.ok, found.status
    assert 0.2 < np.abs(found.angle("wheel")).max() < 0.3


def test_a_motion_that_blows_up_by_itself_blames_no_law():
    """The law has a number wherever there is a place."""
    mass = at.PointMass("mass", 1.0, (1.0, 0.0))
    spring = at.Spring("mass.center", (0.0, 0.0), law=lambda x, rate, t: -1e6 * x**3 - 1.0)
    found = at.solve(at.Scene("pushed", [mass], connectors=[spring]), t_end=1.0, dt=1e-2)
    assert found.status.code == "diverged"
    assert "law" not in found.status.message
