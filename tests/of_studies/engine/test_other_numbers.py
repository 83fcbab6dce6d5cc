"""A scene with other numbers: whatever a scene is made of goes there and comes back."""

from dataclasses import fields, is_dataclass

import numpy as np
import pytest

import anctmm as at
from studies.engine.other_numbers import Change

STEEL = at.Material(E=2e8, density=1500.0, poisson=0.2, damping=1e-3)
SECTION = at.Section(2e-4, 3e-9, 5e-14)
TIMES = np.array([0.0, 0.1, 0.25, 0.3])


def swing(t):
    return 0.3 * t**3, 0.9 * t**2, 1.8 * t


def everything():
    """A body, joint, load and connector of each kind, with all that each may have."""
    bodies = [
        at.Beam("arm", (0, 0), (1, 0), SECTION, STEEL, lambda s: (0.0, 0.0 * s)),
        at.Beam("tip", (1, 0), (2, 0), SECTION, STEEL),
        at.Beam("end", (2, 0), (3, 0), SECTION, STEEL),
        at.RigidBody("box", mass=2.0, inertia=0.5, center=(3, 0), points={"a": (3.5, 0.25)}, velocity=(0, 0)),
        at.PointMass("ball", mass=0.5, position=(4, 1)),
        at.PointMass("bead", mass=0.25, position=(5, 1), velocity=(0.5, 0.0)),
    ]
    joints = [
        at.Clamp("arm.start", angle=at.History(swing, breaks=[0.2]), stretch="free"),
        at.Weld("arm.end", "tip.start", stretch="free"),
        at.Weld("tip.end", "end.start", angle=swing),
        at.Pin("end.end", "box.center"),
        at.Slider("bead.center", (1, 0), position=lambda t: (0.5 * t, 0.5 + 0.0 * t, 0.0 * t)),
        at.Prismatic("box.a", (1, 0)),
    ]
    loads = [
        at.Force("arm.end", (1.0, -2.0), follower=True),
        at.Force("tip.end", at.History(lambda t: (2.0 * t, 0.0 * t), breaks=[0.25])),
        at.Torque("tip.end", 0.5),
        at.Torque("end.end", at.Pulse(2.0, 0.5)),
        at.LineLoad("tip", (0.0, -4.0)),
    ]
    connectors = [
        at.Spring("box.a", "ball.center", stiffness=8.0, damping=0.5, preload=2.0, length=lambda t: (1 + t, 1 + 0 * t)),
        at.Spring("ball.center", (6.0, 2.0), stiffness=4.0, length=0.5),
        at.RotationalSpring("box.a", stiffness=0.5, damping=0.25, preload=0.125, angle=lambda t: (t, 1.0 + 0.0 * t)),
    ]  # fmt: skip
    return at.Scene("everything", bodies, joints, loads, gravity=(0.5, -8.0), connectors=connectors)


def flat(thing, path=""):
    """All values in a thing, by where they are; of functions those at some times."""
    if is_dataclass(thing) and not callable(thing):
        for field in fields(thing):
            yield from flat(getattr(thing, field.name), f"{path}.{field.name}")
    elif callable(thing):
        fraction = "velocity" in path
        yield (
            path,
            np.array(
                [np.broadcast_to(v, TIMES.shape) for v in np.atleast_1d(thing(TIMES))]
                if not fraction
                else thing(0.5)
            ),
        )
        yield f"{path}.breaks", getattr(thing, "breaks", None) or ()
    elif isinstance(thing, dict):
        for key, value in thing.items():
            yield from flat(value, f"{path}[{key}]")
    elif isinstance(thing, tuple | list):
        for k, value in enumerate(thing):
            yield from flat(value, f"{path}[{k}]")
    else:
        yield path, thing


def assert_same(one, two, **within):
    first, second = dict(flat(one)), dict(flat(two))
    assert first.keys() == second.keys()
    for path, value in first.items():
        if isinstance(value, str | bool | None):
            assert second[path] == value, path
        else:
            np.testing.assert_allclose(
                np.asarray(second[path], float), np.asarray(value, float), err_msg=path, **within
            )


@pytest.mark.parametrize(
    ("there", "back"),
    [
        (Change(2.0, 4.0, 8.0), Change(0.5, 0.25, 0.125)),
        (Change(1e3, 1e-3, 10.0), Change(1e-3, 1e3, 0.1)),
        (Change(place=(3.0, -4.0)), Change(place=(-3.0, 4.0))),
        (Change(turn=0.7), Change(turn=-0.7)),
        (Change(2.0, turn=2.0), Change(0.5, turn=-2.0)),
    ],
)
def test_there_and_back(there, back):
    scene = everything()
    moved = there.scene(scene)
    bits = there.exact
    assert_same(scene, back.scene(moved), **({"rtol": 0.0} if bits else {"rtol": 1e-12, "atol": 1e-12}))
    changed = {p for (p, a), (_, b) in zip(flat(scene), flat(moved), strict=True) if not np.array_equal(a, b)}
    assert changed, "nothing has changed"


def test_each_number_has_its_unit():
    scene, moved = everything(), Change(10.0, 100.0, 1000.0).scene(everything())
    newton = 100.0 * 10.0 / 1000.0**2
    arm, box = moved.bodies[0], moved.body("box")
    assert (arm.section.area, arm.section.second_moment) == pytest.approx((2e-2, 3e-5))
    assert pytest.approx(2e8 * newton / 100.0) == arm.material.E
    assert (arm.material.density, arm.material.damping) == pytest.approx((1500.0 * 0.1, 1.0))
    assert (box.mass, box.inertia) == pytest.approx((200.0, 0.5 * 1e4))
    spring, turning = moved.connectors[0], moved.connectors[2]
    assert (spring.stiffness, spring.damping, spring.preload) == pytest.approx(
        (8.0 * newton / 10.0, 0.5 * newton * 1000.0 / 10.0, 2.0 * newton)
    )
    assert turning.damping == pytest.approx(0.25 * newton * 10.0 * 1000.0)
    assert moved.gravity == pytest.approx((0.5e-5, -8e-5))
    angle = moved.joints[0].angle
    assert angle(200.0)[1] == pytest.approx(swing(0.2)[1] / 1000.0)
    assert angle.breaks == pytest.approx((200.0,))
    assert moved.loads[3].value(250.0) == pytest.approx(scene.loads[3].value(0.25) * newton * 10.0)
