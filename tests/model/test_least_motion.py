"""Velocities that fit many joints: sparse equations give what dense ones do, redundant and contradictory ones too."""

import numpy as np
import pytest
import scipy
from random_mechanisms import random_mechanism

import anctmm as at
from anctmm.errors import JointGapError
from anctmm.model.initial_motion import rigid_start
from anctmm.model.initial_motion.least_norm import least_norm

RATE = 2.0


def turning(t):
    return RATE * t, RATE, 0.0


def faster(t):
    return 1.3 * RATE * t, 1.3 * RATE, 0.0


def parallelogram(cranks, driven=(turning,), coupler_mass=1.0):
    """Equal cranks between the ground and one coupler, of which all but two are redundant; the first are driven."""
    tops = {f"p{i}": (0.1 * i, 1.0) for i in range(cranks)}
    bodies = [at.RigidBody("coupler", coupler_mass, 0.1, (0.0, 1.0), tops)]
    joints = []
    for i in range(cranks):
        points = {"foot": (0.1 * i, 0.0), "top": (0.1 * i, 1.0)}
        bodies.append(at.RigidBody(f"c{i}", 1.0 + i % 3, 0.1, (0.1 * i, 0.5), points))
        joints.append(at.Pin(f"coupler.p{i}", f"c{i}.top"))
        joints.append(at.Clamp(f"c{i}.foot", angle=driven[i]) if i < len(driven) else at.Pin(f"c{i}.foot"))
    return {"name": "parallelogram", "bodies": bodies, "joints": joints}


def swinging(count):
    """Links one behind the other, bent at each joint; the first is driven."""
    x = y = 0.0
    bodies, joints = [], []
    for i in range(count):
        u, v = x + np.cos(0.7 * np.sin(1.3 * i)), y + np.sin(0.7 * np.sin(1.3 * i))
        center = (0.5 * (x + u), 0.5 * (y + v))
        bodies.append(at.RigidBody(f"b{i}", 1.0 + i % 7, 0.1, center, {"a": (x, y), "b": (u, v)}))
        joints.append(at.Pin(f"b{i - 1}.b", f"b{i}.a") if i else at.Clamp("b0.a", angle=turning))
        x, y = u, v
    return {"name": "swinging", "bodies": bodies, "joints": joints}


def refuse_dense(monkeypatch):
    """Dense decompositions raise."""

    def refused(*_, **__):
        raise AssertionError("dense")

    for name in ("lstsq", "pinv", "svd"):
        monkeypatch.setattr(np.linalg, name, refused)


def test_cranks_that_are_alike_turn_alike(monkeypatch):
    """58 of 120 pins say nothing new; the motion is known: all cranks turn as the first, the coupler does not turn."""
    refuse_dense(monkeypatch)
    scene = at.consistent_velocities(**parallelogram(60))
    for body in scene.bodies[1:]:
        assert body.spin == pytest.approx(RATE, rel=1e-12)
    coupler = scene.body("coupler")
    assert (*coupler.velocity, coupler.spin) == pytest.approx((-RATE, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("made", [parallelogram(30), swinging(60)], ids=["parallelogram", "swinging"])
def test_many_equations_give_what_a_dense_decomposition_does(made, monkeypatch):
    monkeypatch.setattr(rigid_start, "MANY", 10**9)
    dense = at.consistent_velocities(**made)
    monkeypatch.undo()
    refuse_dense(monkeypatch)
    sparse = at.consistent_velocities(**made)
    for one, two in zip(dense.bodies, sparse.bodies, strict=True):
        assert (*one.velocity, one.spin) == pytest.approx((*two.velocity, two.spin), abs=1e-12)


def test_what_no_velocities_fit_is_refused_in_the_same_words(monkeypatch):
    """Two cranks that are driven at different rates. Equations count as they are written, whatever the masses are."""
    made = parallelogram(30, driven=(turning, faster), coupler_mass=1e-3)
    messages = []
    for many in (10**9, 0):
        monkeypatch.setattr(rigid_start, "MANY", many)
        with pytest.raises(JointGapError, match="no velocities of rigid bodies that fit") as caught:
            at.consistent_velocities(**made)
        messages.append(str(caught.value))
    assert messages[0] == messages[1]


@pytest.mark.parametrize("seed", range(40))
def test_of_random_mechanisms_too(seed):
    """Rates that fit, and such that do not; in many of these mechanisms equations depend on each other."""
    scene = random_mechanism(seed, most=12, welds=seed % 2 == 0)
    rows, rates = rigid_start._rigid_constraints(scene)
    scale, rng = rigid_start._scales(scene), np.random.default_rng(seed)
    A = rigid_start._dense(rows, len(scale))
    for right in (A @ rng.normal(size=len(scale)), rng.normal(size=len(rates))):
        asked = np.linalg.lstsq(A / scale, right, rcond=None)[0] / scale
        missed = np.abs(A @ asked - right).max()
        motion, left = rigid_start._sparsely(rows, right, scale)
        assert left == pytest.approx(missed, rel=1e-4, abs=1e-12)
        if missed < 1e-9:
            assert motion == pytest.approx(asked, rel=0.0, abs=1e-12 * np.abs(asked).max())


def test_equations_that_nearly_contradict_are_left_to_a_dense_decomposition():
    """Two equations 1e-6 apart in direction: the least solution is large, and slow steps do not stand for it."""
    A = scipy.sparse.csr_array(np.array([[1.0, 0.0], [1.0, 1e-6]]))
    found = least_norm(scipy.sparse.csc_array(np.eye(2)), A, np.array([0.0, 1.0]))
    assert found is None or found.x == pytest.approx((0.0, 1e6), rel=1e-6)
