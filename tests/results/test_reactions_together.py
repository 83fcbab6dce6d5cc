"""Reactions of many joints that hang together: found at once, by sparse matrices where there are many."""

import numpy as np
import pytest
import scipy.sparse

import anctmm as at
from anctmm.errors import ResultError
from anctmm.results.internal_forces import reaction_equations, reactions

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
def test_a_chain_bears_what_hangs_from_it(count, ratio, redundant, monkeypatch):
    """Another road: from the free end on, forces sum up."""
    scene = hanging(count, ratio, redundant)
    if count >= 40:
        monkeypatch.setattr(reaction_equations, "_dense", None)
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


def guided():
    """A crank, a rod and a slider, a plate that slides on the rod, and a hammer welded to it."""
    parts = {
        "crank": ((0.0, 0.0), (0.3, 0.0)),
        "rod": ((0.3, 0.0), (1.0, 0.2)),
        "arm": ((0.6, 0.1), (0.6, 0.5)),
    }
    bodies = [
        at.RigidBody(name, 1.0, 0.02, tuple(np.mean(ends, axis=0)), points={"a": ends[0], "b": ends[1]})
        for name, ends in parts.items()
    ]
    bodies.append(at.RigidBody("head", 40.0, 0.5, (0.6, 0.6), points={"a": (0.6, 0.5)}))
    bodies.append(at.PointMass("bob", 1e-3, (1.0, 0.2)))
    joints = [
        at.Pin("crank.a"),
        at.Pin("crank.b", "rod.a"),
        at.Pin("rod.b", "bob.center"),
        at.Slider("bob.center", direction=(1.0, 0.1)),
        at.Prismatic("arm.a", body="rod", direction=(1.0, 0.0)),
        at.Weld("arm.b", "head.a"),
    ]
    return at.Scene("guided", bodies, joints, gravity=G)


def test_sparse_and_dense_matrices_give_the_same(monkeypatch):
    scene = guided()
    found = {}
    for many in (0, 1000):
        monkeypatch.setattr(reaction_equations, "MANY", many)
        solution = at.solve(scene, dt=1e-3, t_end=0.02, output_dt=2e-3)
        assert solution.status.ok
        found[many] = np.array([solution.reaction(joint) for joint in scene.joints])
    assert np.abs(found[0] - found[1000]).max() < 1e-10 * np.abs(found[0]).max()
    assert np.abs(found[0]).max() > 10.0


def test_joints_that_hang_together_are_solved_once(monkeypatch):
    scene, solved = hanging(5), []
    inner = reactions.joint_forces
    monkeypatch.setattr(reactions, "joint_forces", lambda *told: solved.append(told[2]) or inner(*told))
    found = at.solve(scene, dt=1e-3, t_end=2e-3)
    for joint in scene.joints:
        found.reaction(joint)[:] = np.nan  # what a user does to his answer is his own affair
        assert np.isfinite(found.reaction(joint)).all()
    assert solved == [list(range(5))]


@pytest.mark.parametrize("many", [0, 1000])
def test_many_redundant_joints_are_refused_but_not_those_beside_them(many, monkeypatch):
    """Rigid cranks all alike hold one beam: a third one and any more repeat what two do.

    Of 400 they took 1.5 s for each output: no dense matrix is needed.
    """
    monkeypatch.setattr(reaction_equations, "MANY", many)
    if not many:
        monkeypatch.setattr(reaction_equations, "_dense", None)
    cranks = [
        at.RigidBody(f"c{k}", 0.1, 1e-4, (0.1 * k, 0.05), points={"a": (0.1 * k, 0.0), "b": (0.1 * k, 0.1)})
        for k in range(20)
    ]
    tops = {f"t{k}": (0.1 * k, 0.1) for k in range(20)}
    bar = at.RigidBody("bar", 1.0, 0.3, (0.95, 0.1), points={**tops, "tip": (2.0, 0.1)})
    bob = at.RigidBody("bob", 0.2, 1e-4, (2.0, 0.05), points={"a": (2.0, 0.1)})
    joints = [
        *(at.Pin(f"c{k}.a") for k in range(20)),
        *(at.Pin(f"c{k}.b", f"bar.t{k}") for k in range(20)),
        at.Pin("bar.tip", "bob.a"),
    ]
    scene = at.Scene("comb", [*cranks, bar, bob], joints, gravity=G)
    found = at.solve(scene, dt=1e-3, t_end=5e-3)
    assert found.status.ok
    with pytest.raises(ResultError, match="redundant"):
        found.reaction(joints[0])
    needed = bob.mass * (found.fields["bob"].accelerations[:, 0] - G)
    assert np.abs(found.reaction(joints[-1])[:, :2] + needed).max() < 1e-6 * np.abs(needed).max()


def alike(small):
    """Equations with two unknowns that they see alike, but for a `small` part of them; their scales and right side."""
    rng = np.random.default_rng(1)
    A = rng.normal(size=(30, 20))
    A[:, 1] = A[:, 0] + small * A[:, 1]
    right, scale = A @ rng.normal(size=20), 10.0 ** rng.uniform(-2.0, 2.0, 30)
    return scipy.sparse.csr_array(A), scale, right


def test_sparse_factors_leave_what_is_nearly_redundant():
    assert reaction_equations._redundant(*alike(1e-9)) is None


@pytest.mark.parametrize("small", [0.0, 1e-15, 1e-6])
def test_sparse_factors_tell_what_is_determined(small):
    A, scale, right = alike(small)
    x, free = reaction_equations._redundant(A, scale, right)
    wanted, not_determined = reaction_equations._dense(A, scale, right)
    assert np.abs(x - wanted)[2:].max() < 1e-8
    assert (np.abs(free).max() > 1e-6) == (len(not_determined) > 0) == (small < 1e-10)
    assert np.abs(free[:, 2:]).max() < 1e-6
    assert np.abs(free @ A.T).max() < 1e-8
