"""A scene at another place or turned: it moves as before, and goes back to what it was."""

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import UnknownKindError
from studies.engine.other_numbers import Change

STEEL = at.Material(E=2e8, density=1500.0, damping=1e-3)
ROD = at.Rectangle(0.02, 0.02)


def swing(t):
    return 0.3 * t**3, 0.9 * t**2, 1.8 * t


def everything():
    """Bodies, joints, loads and connectors of all kinds that have a place or a direction."""
    bodies = [
        at.Beam("arm", (0, 0), (1, 0), ROD, STEEL, lambda s: (0.0, (s - s * s) ** 2)),
        at.RigidBody("box", mass=2.0, inertia=0.5, center=(1, 0), points={"a": (1.5, 0.25)}),
        at.PointMass("bead", mass=0.25, position=(5, 1), velocity=(0.5, 0.0)),
    ]
    joints = [
        at.Clamp("arm.start", angle=at.History(swing, breaks=[0.2])),
        at.Weld("arm.end", "box.center"),
        at.Slider("bead.center", (1, 0)),
    ]
    loads = [
        at.Force("arm.end", (1.0, -2.0), follower=True),
        at.Force("box.a", at.History(lambda t: (2.0 * t, 0.0 * t), breaks=[0.25])),
        at.Torque("arm.end", 0.5),
        at.LineLoad("arm", (0.0, -4.0)),
    ]
    connectors = [
        at.Spring("box.a", "bead.center", stiffness=8.0, damping=0.5),
        at.Spring("bead.center", (6.0, 2.0), stiffness=4.0),
        at.RotationalSpring("box.a", stiffness=0.5),
    ]
    return at.Scene("everything", bodies, joints, loads, gravity=(0.5, -8.0), connectors=connectors)


def places(scene):
    found = at.solve(scene, mesh=2, dt=0.005, t_end=0.3, output_dt=0.05)
    assert found.status.ok
    return np.stack([found.position(p) for p in ("arm.end", "box.a", "bead.center")])


@pytest.mark.parametrize("change", [Change((3.0, -4.0)), Change(turn=0.7), Change((1.0, 2.0), -2.0)])
def test_the_scene_moves_as_before(change):
    c, s = np.cos(change.turn), np.sin(change.turn)
    expected = (places(everything()) + change.place) @ np.array([[c, s], [-s, c]])
    np.testing.assert_allclose(places(change.scene(everything())), expected, atol=1e-9)


def test_breaks_stay_and_parts_of_a_users_own_kind_are_refused():
    turned = Change(turn=0.7).scene(everything())
    assert turned.joints[0].angle.breaks == (0.2,)
    assert turned.loads[1].value.breaks == (0.25,)

    class Own(at.Joint):
        def equations(self, a):
            return [a.position - a.position.start]

    with pytest.raises(UnknownKindError, match="known kinds"):
        Change(turn=1.0).scene(at.Scene("own", [at.PointMass("m", 1.0, (0, 0))], [Own("m.center")]))
