"""Scenes that no equilibrium can balance are told at once, by name; those that have one are not."""

import pytest

import anctmm as at

WEIGHT, DAMPED = (0.0, -9.81), {"stiffness": 0.0, "damping": 1.0}
PUSH, TURN = at.Force("body.center", (1.0, 0.0)), at.Torque("body.center", 0.5)


def body(name="body", center=(0.0, 0.0), **points):
    return at.RigidBody(name, 2.0, 0.1, center, points=points)


def beam():
    return at.Beam("beam", (0.0, 0.0), (1.0, 0.0), at.Rectangle(0.02, 0.02), at.Material(2e9, 7800.0))


def scene(bodies, joints=(), loads=(), connectors=(), gravity=(0.0, 0.0)):
    return at.Scene("scene", bodies, joints, loads, gravity, connectors=connectors)


def carriage(*loads, **options):
    """A body on a line, a pendulum at it that stands out, and what acts."""
    bodies = [body(p=(0.0, 0.0)), body("arm", (1.0, 0.0), p=(0.0, 0.0))]
    joints = [at.Prismatic("body.p"), at.Pin("body.p", "arm.p")]
    return scene(bodies, joints, loads, gravity=WEIGHT, **options)


FALLING = {
    "on a line": (scene([body(p=(0.0, 0.3))], [at.Slider("body.p")], [PUSH], gravity=WEIGHT), "(1, 0)", "1 N"),
    "on a slope": (
        scene([body(p=(0.0, 0.0))], [at.Prismatic("body.p", (1.0, 1.0))], gravity=WEIGHT),
        "(-0.7071, -0.7071)", "13.87 N",
    ),
    "on two parallel lines": (
        scene([beam()], [at.Slider("beam.start"), at.Slider("beam.end")], [at.LineLoad("beam", (3.0, -1.0))]),
        "(1, 0)", "3 N",
    ),
    "a beam": (scene([beam()], loads=[at.Force("beam.end", (0.0, 1.0))]), "(0, 1)", "1 N"),
    "with a pendulum": (carriage(PUSH), "(1, 0)", "1 N"),
    "on a spring between them": (
        scene(
            [body(), body("other", (1.0, 0.0))],
            connectors=[at.Spring("body.center", "other.center", stiffness=5.0)],
            loads=[at.Force("other.center", (0.0, 2.0))],
        ),
        "(0, 1)", "2 N",
    ),
    "with a damper to the ground": (
        scene([body()], connectors=[at.Spring("body.center", (1.0, 1.0), **DAMPED)], gravity=WEIGHT),
        "(0, -1)", "19.62 N",
    ),
}  # fmt: skip

RESTING = {
    "a pendulum that a moment turns": scene(
        [body(center=(1.0, 0.0), p=(0.0, 0.0))], [at.Pin("body.p")], [TURN], gravity=WEIGHT
    ),
    "with a pendulum that swings down": carriage(),
    "on two lines that cross": scene(
        [body(p=(0.0, 0.0), q=(1.0, 0.0))],
        [at.Slider("body.p"), at.Slider("body.q", (1.0, 1.0))], [PUSH],
    ),
    "held by a spring": scene(
        [body(p=(0.0, 0.0))], [at.Prismatic("body.p")], [PUSH],
        [at.Spring("body.p", (-1.0, 0.0), stiffness=20.0)], WEIGHT,
    ),
    "in a guide of a body that turns until it hangs": scene(
        [body("rail", (0.5, 0.0), o=(0.0, 0.0), s=(0.6, 0.0)), body(center=(0.6, 0.0))],
        [at.Pin("rail.o"), at.Prismatic("body.center", body="rail")],
        connectors=[at.Spring("body.center", "rail.o", stiffness=200.0)], gravity=WEIGHT,
    ),
    "driven along its line": scene(
        [body(p=(0.0, 0.0))], [at.Prismatic("body.p", position=lambda t: (t * t, 2.0 * t, 2.0))], [PUSH]
    ),
}  # fmt: skip


@pytest.mark.parametrize("options", [{}, {"branch": "stable"}, {"path": "arclength"}], ids=str)
@pytest.mark.parametrize("name", FALLING)
def test_what_moves_without_end_is_told(name, options):
    what, *said = FALLING[name]
    rest = at.solve_static(what, **{"mesh": 2} if what.beams else {}, **options)
    assert (rest.status.code, rest.status.body) == ("diverged", what.bodies[0].name)
    assert rest.t.tolist() == [0.0]
    for text in ("without end", *said, *(f"'{one.name}'" for one in what.bodies)):
        assert text in rest.status.message


@pytest.mark.parametrize("name", RESTING)
def test_what_comes_to_rest_is_found(name):
    rest = at.solve_static(RESTING[name])
    assert rest.status.code in ("ok", "singular", "unstable"), rest.status
    assert rest.t.tolist() == [0.0, 1.0]
