"""Reactions of many joints that hang together, and of joints that repeat each other."""

import numpy as np
import pytest

import anctmm as at

G = (0.3, -9.81)


def hanging(count, ratio=1.0, redundant=False):
    """Plates in a row that swing, each `ratio` times as heavy as the one before; from a body that three pins hold."""
    plates = [
        at.RigidBody(
            f"p{k}", 0.1 * ratio**k, 1e-4 * ratio**k, (0.1 * k + 0.05, 0.02),
            points={"a": (0.1 * k, 0.0), "b": (0.1 * k + 0.1, 0.0)},
        )
        for k in range(count)
    ]  # fmt: skip
    joints = [at.Pin("p0.a"), *(at.Pin(f"p{k}.b", f"p{k + 1}.a") for k in range(count - 1))]
    if redundant:
        points = {"a": (0.0, 0.0), "b": (0.1, 0.1), "c": (-0.1, 0.1), "d": (0.2, 0.3)}
        plates.append(at.RigidBody("ceiling", 10.0, 0.1, (0.0, 0.1), points=points))
        joints[0] = at.Pin("p0.a", "ceiling.a")
        joints += [at.Pin(f"ceiling.{point}") for point in "bcd"]
    return at.Scene("hanging", plates, joints, gravity=G)


@pytest.mark.parametrize("redundant", [False, True])
@pytest.mark.parametrize(("count", "ratio"), [(8, 1.0), (8, 0.1), (60, 1.0), (40, 0.7)])
def test_a_chain_bears_what_hangs_from_it(count, ratio, redundant):
    """By sums of forces from the free end on."""
    scene = hanging(count, ratio, redundant)
    found = at.solve(scene, dt=1e-3, t_end=5e-3, output_dt=1e-3)
    assert found.status.ok
    bodies = scene.bodies[:count]
    needed = [body.mass * (found.fields[body.name].accelerations[:, 0] - G) for body in bodies]
    beyond = np.cumsum(needed[::-1], axis=0)[::-1]
    beyond[1:] *= -1.0  # at a joint of two bodies the first one gets the opposite
    for joint, wanted in zip(scene.joints[:count], beyond, strict=True):
        got = found.reaction(joint)
        assert np.abs(got[:, 2]).max() < 1e-12 * np.abs(beyond).max()
        assert np.abs(got[:, :2] - wanted).max() < 1e-4 * np.abs(wanted).max()


def test_redundant_joints_have_finite_reactions_with_the_right_sum():
    """Rigid cranks all of one shape hold one beam: a third one and any more repeat what two do."""
    cranks = [
        at.RigidBody(f"c{k}", 0.1, 1e-4, (0.1 * k, 0.05), points={"a": (0.1 * k, 0.0), "b": (0.1 * k, 0.1)})
        for k in range(20)
    ]
    tops = {f"t{k}": (0.1 * k, 0.1) for k in range(20)}
    bar = at.RigidBody("bar", 1.0, 0.3, (0.95, 0.1), points={**tops, "tip": (2.0, 0.1)})
    bob = at.RigidBody("bob", 0.2, 1e-4, (2.0, 0.05), points={"a": (2.0, 0.1)})
    feet = [at.Pin(f"c{k}.a") for k in range(20)]
    hinges = [at.Pin(f"c{k}.b", f"bar.t{k}") for k in range(20)]
    scene = at.Scene("comb", [*cranks, bar, bob], [*feet, *hinges, at.Pin("bar.tip", "bob.a")], gravity=G)
    found = at.solve(scene, dt=1e-3, t_end=5e-3)
    assert found.status.ok
    needed = {b.name: b.mass * (found.fields[b.name].accelerations[:, 0] - G) for b in scene.bodies}
    on_bob = -found.reaction(scene.joints[-1])[:, :2]
    assert np.abs(on_bob - needed["bob"]).max() < 1e-6 * np.abs(needed["bob"]).max()
    held, whole = sum(found.reaction(joint)[:, :2] for joint in feet), sum(needed.values())
    assert np.abs(held - whole).max() < 1e-6 * np.abs(whole).max()
    sizes = [np.abs(found.reaction(joint)).max() for joint in [*feet, *hinges]]
    assert max(sizes) < 10.0 * np.abs(whole).max()
