"""Explicit steps of scenes of rigid bodies: their stability limit, and what is said of steps beyond it."""

from math import sqrt

import pytest

import anctmm as at
from anctmm.discretise.discretisation import discretise
from anctmm.integrators.stability import highest_frequency, largest_step
from anctmm.system.system import System

LEVER = at.RigidBody("lever", 2.0, 0.3, (0.5, 0.0), points={"o": (0.0, 0.0), "e": (1.0, 0.0)})
TWIST = at.RotationalSpring("lever.o", stiffness=1000.0)
#: Of the lever about its hinge: sqrt(k / (I + m a²)).
FREQUENCY = sqrt(1000.0 / (0.3 + 2.0 * 0.25))


def lever(joint, *connectors):
    return at.Scene("lever", [LEVER], [joint] if joint else [], gravity=(0.0, -1.0), connectors=connectors)


def system_of(scene):
    return System(scene, discretise(None, {"integrator": "zhai"}))


def test_the_limit_is_that_of_the_spring():
    system = system_of(lever(at.Pin("lever.o"), TWIST))
    assert highest_frequency(system, system.mesh.reference) == pytest.approx(FREQUENCY, rel=1e-6)
    assert largest_step(system, system.mesh.reference) == pytest.approx(2.0 / FREQUENCY, rel=1e-6)


@pytest.mark.parametrize(
    ("joint", "connectors"),
    [
        (at.Pin("lever.o"), []),
        (at.Clamp("lever.o"), [TWIST]),
        (at.Clamp("lever.o"), [at.Spring("lever.e", (1.0, 1.0), stiffness=1e6, damping=1e3)]),
        (at.Pin("lever.o"), [at.Spring("lever.o", (1.0, 1.0), stiffness=1e6)]),
    ],
    ids=["no spring", "a twist that is held", "a spring that is held", "a spring at the hinge"],
)
def test_where_nothing_can_vibrate_steps_may_be_of_any_length(joint, connectors):
    """Springs between places that joints hold had the frequency of rounding: 1e-7 rad/s, a limit of some 1e7 s."""
    system = system_of(lever(joint, *connectors))
    assert largest_step(system, system.mesh.reference) > 1e3


@pytest.mark.parametrize("joint", [at.Pin("lever.o"), None], ids=["hinged", "free"])
def test_a_step_beyond_the_limit_is_told_as_one_and_not_as_a_lock(joint):
    """The lever turns so far in a step that its shape is lost: joints and drives have nothing to do with it."""
    spring = TWIST if joint else at.Spring("lever.o", (0.0, 1.0), stiffness=1e3)
    found = at.solve(
        lever(joint, spring), integrator="zhai", dt=0.2, t_end=20.0, check_stability=False, output_dt=0.2
    )
    assert found.status.code == "diverged"
    assert found.status.body == "lever"
    assert "largest stable step" in found.status.message
    assert "smaller dt than 0.2 s" in found.status.message
    assert not [word for word in ("place", "lock", "element") if word in found.status.message]


def test_a_body_that_turns_too_far_in_a_step_is_told_so():
    """Without a spring there is no limit, and no joint either."""
    spinning = at.RigidBody("top", 1.0, 0.1, (0.0, 0.0), spin=1000.0)
    found = at.solve(at.Scene("top", [spinning]), integrator="zhai", dt=0.02, t_end=1.0)
    assert not found.status.ok
    assert "smaller" in found.status.message
