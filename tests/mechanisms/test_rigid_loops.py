"""Rigid bodies in singular positions are refused; joints that only repeat each other are not."""

from itertools import pairwise

import numpy as np
import pytest
from samples import beam, refused

import anctmm as at
from anctmm.errors import DiscretisationError
from anctmm.model.scene import Pin, Scene, Weld
from anctmm.system.system import System

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


def chain(bodies, joints, element="rigid"):
    run = at.Discretisation(mesh=1, element=element, integrator="zhai", dt=1e-4, t_end=1e-2)
    return System(Scene("loop", bodies, joints), run)


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
