"""Scenes that no equilibrium can balance are told at once, by name; those that have one are not."""

import pytest

import anctmm as at

WEIGHT, DAMPED = (0.0, -9.81), {"stiffness": 0.0, "damping": 1.0}
PUSH, TURN = at.Force("body.center", (1.0, 0.0)), at.Torque("body.center", 0.5)


def body(name="body", center=(0.0, 0.0), **points):
    return at.RigidBody(name, 2.0, 0.1, center, points=points)


def scene(bodies, joints=(), loads=(), connectors=(), gravity=(0.0, 0.0)):
    return at.Scene("scene", bodies, joints, loads, gravity, connectors=connectors)


def carriage(*loads, **options):
    """A body on a line, a pendulum at it that stands out, and what acts."""
    bodies = [body(p=(0.0, 0.0)), body("arm", (1.0, 0.0), p=(0.0, 0.0))]
    joints = [at.Prismatic("body.p"), at.Pin("body.p", "arm.p")]
    return scene(bodies, joints, loads, gravity=WEIGHT, **options)


RESTING = {
    "a pendulum that a moment turns": scene(
        [body(center=(1.0, 0.0), p=(0.0, 0.0))], [at.Pin("body.p")], [TURN], gravity=WEIGHT
    ),
    "across its line": scene([body(p=(0.0, 0.0))], [at.Prismatic("body.p")], gravity=WEIGHT),
    "with a pendulum that swings down": carriage(),
    "on two lines that cross": scene(
        [body(p=(0.0, 0.0), q=(1.0, 0.0))],
        [at.Slider("body.p"), at.Slider("body.q", (1.0, 1.0))], [PUSH],
    ),
    "held by a spring": scene(
        [body(p=(0.0, 0.0))], [at.Prismatic("body.p")], [PUSH],
        [at.Spring("body.p", (-1.0, 0.0), stiffness=20.0)], WEIGHT,
    ),
    "turned against a spring": scene(
        [body(p=(0.0, 0.0))], [at.Pin("body.p")], [TURN], [at.RotationalSpring("body.p", stiffness=2.0)]
    ),
    "in a guide of a body that turns until it hangs": scene(
        [body("rail", (0.5, 0.0), o=(0.0, 0.0), s=(0.6, 0.0)), body(center=(0.6, 0.0))],
        [at.Pin("rail.o"), at.Prismatic("body.center", body="rail")],
        connectors=[at.Spring("body.center", "rail.o", stiffness=200.0)], gravity=WEIGHT,
    ),
    "loads in balance": carriage(PUSH, at.Force("arm.center", (-1.0, 0.0))),
    "driven along its line": scene(
        [body(p=(0.0, 0.0))], [at.Prismatic("body.p", position=lambda t: (t * t, 2.0 * t, 2.0))], [PUSH]
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", RESTING)
def test_what_comes_to_rest_is_found(name):
    rest = at.solve_static(RESTING[name])
    assert rest.status.code in ("ok", "singular", "unstable"), rest.status
    assert rest.t.tolist() == [0.0, 1.0]
