"""Joints and lengths that a history does not keep: its status says which, by how much and when."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from samples import beam

import anctmm as at
from anctmm.errors import shown
from anctmm.results.checks.divergence import checked
from reference import exudyn_cable, global_dae

BODIES = [beam("a{0}"), beam("b", (1.0, 0.0), (1.5, 0.5)), beam("c", (1.5, 0.5), (2.0, 0.5))]
JOINTS = [
    at.Clamp("a{0}.start", angle=at.Quintic(turn=0.5 * pi, duration=0.4)),
    at.Pin("a{0}.end", "b.start"),
    at.Weld("b.end", "c.start"),
    at.Pin("c.end"),
]
SCENE = at.Scene("arch", BODIES, JOINTS, gravity=(0.0, -1.0))
RUN = at.Discretisation(mesh=2, dt=5e-3, t_end=0.1, output_dt=0.02)


@pytest.fixture(scope="module")
def whole():
    return at.solve(SCENE, RUN)


def changed(solution, body, change):
    """The solution with other coordinates, (n, nodes, vectors, 2), of a body from the fourth output on."""
    field = solution.fields[body]
    q = field.coordinates.copy()
    q[3:] = change(q[3:])
    return replace(solution, fields={**solution.fields, body: replace(field, coordinates=q)})


def lifted(node, size):
    def change(q):
        q[:, node, 0, 1] += size
        return q

    return change


def turned(node, angle):
    def change(q):
        c, s = np.cos(angle), np.sin(angle)
        q[:, node, 1:] = q[:, node, 1:] @ np.array([[c, s], [-s, c]])
        return q

    return change


#: Body, what is changed by 1e-3, node, and the joint that the status must name.
BROKEN = {
    "support": ("c", lifted, -1, JOINTS[3]),
    "clamp's place": ("a{0}", lifted, 0, JOINTS[0]),
    "clamp's angle": ("a{0}", turned, 0, JOINTS[0]),
    "pin": ("b", lifted, 0, JOINTS[1]),
    "weld's place": ("b", lifted, -1, JOINTS[2]),
    "weld's angle": ("b", turned, -1, JOINTS[2]),
}


@pytest.mark.parametrize("what", BROKEN)
def test_the_history_is_cut_where_a_joint_is_not_kept(whole, what):
    body, change, node, joint = BROKEN[what]
    found = checked(changed(whole, body, change(node, 1e-3)))
    assert found.status == "failed"
    assert shown(joint) in found.status.message
    assert f"by 0.001 {'m' if change is lifted else 'rad'} at t = 0.06 s" in found.status.message
    assert (found.status.step, len(found.t)) == (12, 3)
    assert checked(changed(whole, body, change(node, 1e-5))).status.ok  # more than Newton's iteration leaves


def test_a_rigid_body_that_is_longer_is_told():
    kinds = {"a{0}": "rigid", "b": "cable", "c": "cable"}
    rigid = at.solve(SCENE, mesh=1, element=kinds, integrator="zhai", dt=5e-4, t_end=0.1, output_dt=0.02)
    assert rigid.status.ok, rigid.status

    def stretch(q):
        return q[:, :1] + (q - q[:, :1]) * 1.00005

    found = checked(changed(rigid, "a{0}", stretch))
    assert found.status == "failed"
    assert "rigid body 'a{0}' has changed its length by 5e-05 of itself at t = 0.06 s" in found.status.message


@pytest.mark.parametrize("solve", [at.solve, global_dae.solve, exudyn_cable.solve])
def test_every_road_keeps_them(solve):
    found = solve(SCENE, RUN)
    assert found.status.ok, found.status
