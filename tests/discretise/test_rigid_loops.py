"""Rigid bodies in singular positions are refused; joints that only repeat each other are not."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse
from samples import beam, refused

import anctmm as at
from anctmm.discretise.chain import Chain
from anctmm.discretise.singular_positions import dependence
from anctmm.discretise.singular_positions.dependence import blocking_stress, independent
from anctmm.errors import DiscretisationError
from anctmm.model.drives import Quintic
from anctmm.model.scene import Clamp, Pin, Scene, Weld

O = (0.0, 0.0)  # noqa: E741


def line(*corners, name="abcdefgh"):
    """Bodies from corner to corner."""
    return [beam(n, p, q) for n, p, q in zip(name, corners, corners[1:], strict=False)]


def row(bodies, kind=Pin):
    """Each body joined to the next."""
    names = [b.name for b in bodies]
    return [kind(f"{one}.end", f"{two}.start") for one, two in pairwise(names)]


def held(bodies):
    """A row of bodies between two hinges at the ground."""
    return bodies, [Pin(f"{bodies[0].name}.start"), *row(bodies), Pin(f"{bodies[-1].name}.end")]


def ring(kind, corners):
    bodies = line(*corners, corners[0])
    return bodies, [*row(bodies, kind), kind(f"{bodies[-1].name}.end", f"{bodies[0].name}.start")]


def cranks(third):
    """A parallelogram with three cranks; the last one may have another length."""
    bodies = [
        beam("a", O, (0.0, 0.5)),
        beam("b", (0.0, 0.5), (1.0, 0.5)),
        beam("c", (1.0, 0.5), (1.0, 0.0)),
        beam("d", (1.0, 0.5), (2.0, 0.5)),
        beam("e", (2.0, 0.5), (2.0, third)),
    ]
    joints = [Pin("a.start"), Pin("a.end", "b.start"), Weld("b.end", "d.start"), Pin("b.end", "c.start")]
    return bodies, [*joints, Pin("c.end"), Pin("d.end", "e.start"), Pin("e.end")]


def far(bodies, joints):
    """The same, elsewhere and a thousand times as large."""

    def place(p):
        return 1e3 * p[0] + 5e3, 1e3 * p[1] - 2e3

    return [beam(b.name, place(b.start), place(b.end)) for b in bodies], joints


STRAIGHT = line(O, (1.0, 0.0), (2.0, 0.0))
SINGULAR = {
    "two taut": (held(STRAIGHT), ["'a'", "'b'"]),
    "three taut at an angle": (held(line(O, (0.5, 0.25), (1.0, 0.5), (2.0, 1.0))), ["'a'", "'b'", "'c'"]),
    "two folded": (held(line(O, (1.0, 0.0), (0.5, 0.0))), ["'a'", "'b'"]),
    "a folded parallelogram": (held(line(O, (1.0, 0.0), (3.0, 0.0), (2.0, 0.0))), ["'a'", "'b'", "'c'"]),
    "a flat ring": (ring(Pin, [O, (1.0, 0.0), (2.0, 0.0)]), ["'a'", "'b'", "'c'"]),
    "three cranks of two lengths": (cranks(-0.3), ["'a'", "'c'", "'e'"]),
    "large and far": (far(*held(line(O, (1.0, 0.5), (2.0, 1.0)))), ["'a'", "'b'"]),
}
SOUND = {
    "taut between a clamp and a hinge": (STRAIGHT, [Clamp("a.start"), Pin("a.end", "b.start"), Pin("b.end")]),
    "one between two hinges": held(line(O, (1.0, 0.0))),
    "one clamped and hinged": (line(O, (1.0, 0.0)), [Clamp("a.start"), Pin("a.end")]),
    "one clamped at both ends": (line(O, (1.0, 0.0)), [Clamp("a.start"), Clamp("a.end")]),
    "two that hold each other": held(line(O, (0.5, 0.8), (1.0, 0.0))),
    "a four-bar": held(line(O, (0.0, 0.5), (1.0, 0.7), (1.0, 0.0))),
    "a driven four-bar": (
        line(O, (0.0, 0.5), (1.0, 0.7), (1.0, 0.0)),
        [Clamp("a.start", Quintic(1.0, 1.0)), *held(line(O, (0.0, 0.5), (1.0, 0.7), (1.0, 0.0)))[1][1:]],
    ),
    "a triangle of hinges": ring(Pin, [O, (1.0, 0.0), (0.5, 0.8)]),
    "a welded triangle": ring(Weld, [O, (1.0, 0.0), (0.5, 0.8)]),
    "a square of hinges": ring(Pin, [O, (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]),
    "a parallelogram of three cranks": cranks(0.0),
    "a straight pendulum": (STRAIGHT, [Pin("a.start"), Pin("a.end", "b.start")]),
    "a straight row welded and held": (STRAIGHT, [Pin("a.start"), Weld("a.end", "b.start"), Pin("b.end")]),
    "large and far": far(*cranks(0.0)),
}


def chain(bodies, joints, element="rigid"):
    run = at.Discretisation(mesh=1, element=element, integrator="zhai", dt=1e-4, t_end=1e-2)
    return Chain(Scene("loop", bodies, joints), run)


@pytest.fixture(params=["decomposition", "factors"])
def decided(request, monkeypatch):
    """What decides: a dense decomposition, or sparse factors."""
    monkeypatch.setattr(dependence, "FEW", np.inf if request.param == "decomposition" else 0)


@pytest.mark.parametrize("name", SINGULAR)
def test_singular_positions_are_refused(name, decided):
    (bodies, joints), names = SINGULAR[name]
    words = [*names, "rigid", "taut or folded", "another position", "'cable' or 'shear'"]
    with refused(DiscretisationError, words):
        chain(bodies, joints)


@pytest.mark.parametrize("name", SOUND)
def test_joints_that_repeat_each_other_are_not(name, decided):
    bodies, joints = SOUND[name]
    assert chain(bodies, joints).dofs == 4 * len(bodies)


def test_one_body_that_bends_makes_a_taut_row_sound():
    bodies, joints = SINGULAR["two taut"][0]
    assert chain(bodies, joints, {"a": "rigid", "b": "cable"}).dofs == 12


def test_a_position_near_a_singular_one_is_sound():
    bodies, joints = held(line(O, (1.0, 1e-4), (2.0, 0.0)))
    assert chain(bodies, joints).dofs == 8


@pytest.mark.parametrize("taut", [False, True])
def test_many_loops_need_no_dense_matrix(monkeypatch, taut):
    """Set-up of a row of 300 four-bars took minutes: a singular value decomposition of all its equations."""
    corners = [(float(k), 1.0 + 0.3 * (k % 2)) for k in range(61)]
    bars = line(*corners, name=[f"bar{k}" for k in range(60)])
    cranks = [beam(f"crank{k}", (p[0], 0.0), p) for k, p in enumerate(corners)]
    joints = [Pin(f"{crank.name}.start") for crank in cranks]
    for k, crank in enumerate(cranks):
        ends = [f"{bar.name}.{end}" for bar, end in ((bars[k - 1], "end"),) if k]
        joints.append(Pin(f"{crank.name}.end", *ends, *([f"bar{k}.start"] if k < 60 else [])))
    bodies = [*bars, *cranks]
    if taut:
        bodies += line((70.0, 0.0), (71.0, 0.0), (72.0, 0.0), name="ab")
        joints += [Pin("a.start"), Pin("a.end", "b.start"), Pin("b.end")]
    sizes = []
    svd = np.linalg.svd
    monkeypatch.setattr(np.linalg, "svd", lambda J, **options: sizes.append(len(J)) or svd(J, **options))
    if taut:
        with refused(DiscretisationError, ["'a'", "'b'", "taut or folded"]):
            chain(bodies, joints)
    else:
        chain(bodies, joints)
    assert max(sizes, default=0) <= 6


def side_by_side(count, last=0.0):
    """Cranks on the ground that carry one coupler, of which all but two are redundant; the last is shorter."""
    tops = {f"p{k}": (0.1 * k, 1.0) for k in range(count)}
    bodies, joints = [at.RigidBody("coupler", 1.0, 0.1, (0.0, 1.0), points=tops)], []
    for k, (x, y) in enumerate(tops.values()):
        foot = (x, last if k == count - 1 else 0.0)
        bodies.append(at.RigidBody(f"crank{k}", 1.0, 0.1, (x, 0.5), points={"a": foot, "b": (x, y)}))
        joints += [Pin(f"crank{k}.a"), Pin(f"crank{k}.b", f"coupler.p{k}")]
    return bodies, joints


def refuse_dense(monkeypatch):
    """Dense decompositions raise."""

    def refuse(J, **options):
        raise AssertionError("dense")

    monkeypatch.setattr(np.linalg, "svd", refuse)


def test_many_redundant_joints_need_no_dense_matrix(monkeypatch):
    """650 cranks side by side took 18 s to be accepted, 2,000 five minutes; now 0.4 s and 1 s."""
    bodies, joints = side_by_side(200)
    short = side_by_side(200, 0.2)
    refuse_dense(monkeypatch)
    chain(bodies, joints)
    with refused(DiscretisationError, ["'coupler'", "'crank0'", "taut or folded"]):
        chain(*short)


def test_redundant_joints_that_block_nothing_are_not_named(monkeypatch, decided):
    """Beside three cranks of two lengths, and joined to them: a triangle of hinges with a bar too much, welded."""
    bodies, joints = cranks(-0.3)
    corners = [(1.0, 0.5), (1.5, 1.0), (0.5, 1.0)]
    bodies += line(*corners, corners[0], name="xyz")
    joints[3] = Pin("b.end", "c.start", "x.start")
    joints += [Weld("x.start", "z.end"), Weld("x.end", "y.start"), Weld("y.end", "z.start")]
    with pytest.raises(DiscretisationError) as told:
        chain(bodies, joints)
    assert [name for name in "abcdexyz" if f"'{name}'" in str(told.value)] == ["a", "b", "c", "d", "e"]


@pytest.mark.parametrize("small", [0.0, 1e-15, 1e-10, 1e-8, 1e-6, 1e-4])
def test_sparse_factors_decide_as_a_decomposition_or_leave_it(monkeypatch, small):
    """Forty equations, the last one like the first but for `small` of an unknown x of its own, and J'(u, u) = x² in it.

    If that is none, x is free to first order, and both equations strain each other.
    """
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.normal(size=(60, 60)))[0]
    J = np.zeros((40, 60))
    J[:, 20:] = np.diag(rng.uniform(1.0, 3.0, 40))
    J[-1] = J[0]
    J[-1, 0] = small
    J = scipy.sparse.csr_array(J @ turn)
    curved = lambda u: np.concatenate([np.zeros((39, u.shape[1])), (turn[:1] @ u) ** 2])  # noqa: E731
    wanted = np.zeros(40)
    wanted[[0, -1]] = np.sqrt(0.5), -np.sqrt(0.5)
    for few in (np.inf, 0):
        monkeypatch.setattr(dependence, "FEW", few)
        stress = blocking_stress(J, curved)
        assert (stress is None) == (small > 1e-9)
        if stress is not None:
            assert np.abs(stress * np.sign(stress[0]) - wanted).max() < 1e-6
    near = small in (1e-10, 1e-8)  # to the bound
    assert (dependence._by_factors(J, np.eye(60), curved) is None) == near
    if near:  # of more equations than a decomposition may take, nothing is known
        assert blocking_stress(J, curved, most=39) is None


def test_equations_that_hardly_depend_on_each_other_are_looked_at_in_full():
    J = scipy.sparse.csr_array(np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 1e-4]]))
    assert independent(J)
    assert not independent(scipy.sparse.csr_array(np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 1e-8]])))
    assert not independent(scipy.sparse.csr_array(np.array([[1.0, 1.0], [2.0, 2.0]])))
    assert not independent(scipy.sparse.csr_array(np.ones((3, 2))))


def test_joints_that_repeat_each_other_leave_the_motion_as_it_is():
    """The third crank changes nothing: a parallelogram of rigid bars falls as it does with two."""
    bodies, joints = cranks(0.0)
    run = {"mesh": 1, "element": "rigid", "integrator": "zhai", "dt": 1e-4, "t_end": 0.05}
    found = at.solve(Scene("three", bodies, joints, gravity=(3.0, -9.81)), **run)
    assert found.status.ok
    assert np.abs(found.displacement("b.end")).max() > 1e-3
    a, c, e = (found.displacement(end) for end in ("a.end", "c.start", "e.start"))
    assert np.abs(a - c).max() < 1e-10
    assert np.abs(e - c).max() < 1e-10
