"""Laws that give no number on the way: the run tells which, when and where."""

import numpy as np
import pytest

import anctmm as at

EVERY_INTEGRATOR = pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
STEPS = {"fixed": {"dt": 1e-2}, "by error": {"tolerance": 1e-3, "output_dt": 0.1}}


def ending(x, rate, t):
    """A law that has no number from 0.2 s on."""
    return 10.0 * x if t < 0.2 else np.nan


def pulled(law, velocity=(1.0, 0.0)):
    """A mass on a spring to the ground."""
    mass = at.PointMass("mass", 1.0, (1.0, 0.0), velocity=velocity)
    return at.Scene("pulled", [mass], connectors=[at.Spring("mass.center", (0.0, 0.0), law=law)])


def turned(law):
    """A wheel on a rotational spring to the ground."""
    wheel = at.RigidBody("wheel", 1.0, 1.0, (0.0, 0.0), spin=1.0)
    spring = at.RotationalSpring("wheel.center", law=law)
    return at.Scene("turned", [wheel], [at.Pin("wheel.center")], connectors=[spring])


@EVERY_INTEGRATOR
@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("scene", [pulled, turned])
def test_a_run_ends_where_a_law_ends(scene, steps, integrator):
    found = at.solve(scene(ending), t_end=1.0, integrator=integrator, **STEPS[steps])
    assert found.status.code == "diverged"
    assert found.status.time == pytest.approx(0.2, abs=0.1)
    assert found.t[-1] <= found.status.time
    if scene is pulled:
        words = "the law of the spring from 'mass.center' to the point (0.0, 0.0) gives nan near t = 0.2"
        assert words in found.status.message


@EVERY_INTEGRATOR
def test_a_law_that_has_numbers_wherever_the_motion_goes_ends_no_run(integrator):
    """The law ends at 0.6 rad, which a guess may pass and the motion does not."""
    scene = turned(lambda x, rate, t: 4.0 * x + 400.0 * x**3 if abs(x) < 0.6 else np.nan)
    found = at.solve(scene, t_end=2.0, integrator=integrator, tolerance=1e-2, output_dt=0.1)
    assert found.status.ok, found.status
    assert 0.2 < np.abs(found.angle("wheel")).max() < 0.3


def test_a_motion_that_blows_up_by_itself_blames_no_law():
    """The law has a number wherever there is a place."""
    found = at.solve(pulled(lambda x, rate, t: -1e6 * x**3 - 1.0, (0.0, 0.0)), t_end=1.0, dt=1e-2)
    assert found.status.code == "diverged"
    assert "law" not in found.status.message
