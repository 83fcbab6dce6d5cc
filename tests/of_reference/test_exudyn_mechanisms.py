"""Masses, sliders, springs, dampers, laws and rigid bodies: Exudyn beside the global solver, and what it refuses.

Beams and masses have equal coordinates in both: equal steps give equal motions. Exudyn's rigid bodies have the angle as
a coordinate and ours a unit vector, so their steps differ; their limits, by Richardson's rule from three steps, do not.
"""

from itertools import pairwise

import numpy as np
import pytest

import anctmm as at
from reference import exudyn_cable, global_dae

pytest.importorskip("exudyn")

ROD, RUBBER = at.Circle(0.02), at.Material(E=5e6, density=1100.0)
BEAM, CLAMP = at.Beam("a", (0, 0), (1, 0), ROD, RUBBER), at.Clamp("a.start")
TIP, HUNG = at.PointMass("m", 0.2, (1, 0)), at.PointMass("m", 0.2, (1, -0.5))
PLATE = at.RigidBody("p", 1.0, 0.05, (1.2, 0.1), {"a": (1, 0), "b": (1.5, 0)})
CRANK = at.RigidBody("c", 0.5, 0.02, (1.75, 0.1), {"b": (1.5, 0), "d": (2.0, 0.0)})
GRAVITY = (0.0, -9.81)


def hanging(*connectors, bodies=(BEAM,), joints=(), loads=()):
    return at.Scene("hanging", bodies, (CLAMP, *joints), loads, GRAVITY, connectors)


def law(elongation, rate, t):
    return 30.0 * elongation + 8.0 * elongation**3 + 0.5 * rate + 0.1 * np.sin(20.0 * t)


def length(t):
    return 1.0 - 0.2 * t, -0.2


def angle(t):
    return 0.3 * t, 0.3


PROBES = {BEAM: "a.end", TIP: "m.center", HUNG: "m.center", PLATE: "p.b", CRANK: "c.d"}
EQUAL = {
    "a tip mass": hanging(bodies=(BEAM, TIP), joints=[at.Pin("a.end", "m.center")]),
    "a slider": hanging(joints=[at.Slider("a.end", (0.3, 1.0))]),
    "a level slider": hanging(bodies=(BEAM, TIP), joints=[at.Pin("a.end", "m.center"), at.Slider("m.center", (0, 2))]),
    "a spring": hanging(at.Spring("a.end", (1, -1), stiffness=20, damping=0.3, length=0.8, preload=0.2)),
    "a mass on a spring": hanging(at.Spring("a.end", "m.center", stiffness=20, damping=0.3), bodies=(BEAM, HUNG)),
    "a law": hanging(at.Spring("a.end", (1, -1), law=law)),
    "a driven length": hanging(at.Spring("a.end", (1, -1), stiffness=20, damping=0.1, length=length)),
    "a mass on a line": at.Scene(
        "line", [at.PointMass("m", 0.2, (1, -0.5), (0.1, 0.2))], [at.Slider("m.center", (1, 2))], (), GRAVITY,
        [at.Spring("m.center", (0, 0), stiffness=20)]),
}  # fmt: skip
TENDING = {
    "a plate that hangs": hanging(bodies=(BEAM, PLATE), joints=[at.Pin("a.end", "p.a")]),
    "a plate with a spring": hanging(
        at.RotationalSpring("p.a", stiffness=3, damping=0.1, angle=0.2, preload=0.3), bodies=(BEAM, PLATE),
        joints=[at.Pin("a.end", "p.a")]),
    "two plates with springs": hanging(
        at.RotationalSpring("p.b", "c.b", stiffness=3, damping=0.1, angle=angle), at.Spring("c.d", "a.end", law=law),
        bodies=(BEAM, PLATE, CRANK), joints=[at.Pin("a.end", "p.a"), at.Pin("p.b", "c.b")],
        loads=[at.Torque("c.b", 0.1), at.Force("c.d", (0.3, 0.2))]),
    "a motor's law": hanging(
        at.RotationalSpring("p.b", "c.b", law=law), bodies=(BEAM, PLATE, CRANK),
        joints=[at.Pin("a.end", "p.a"), at.Pin("p.b", "c.b")]),
    "a plate on a slider": hanging(bodies=(BEAM, PLATE), joints=[at.Pin("a.end", "p.a"), at.Slider("p.b")]),
    "welded plates": hanging(bodies=(BEAM, PLATE, CRANK), joints=[at.Pin("a.end", "p.a"), at.Weld("p.b", "c.b")]),
}  # fmt: skip


def both(scene, steps):
    run = {"mesh": 2, "dt": 0.2 / steps, "t_end": 0.2, "output_dt": 0.02, "spectral_radius": 1.0}
    found = (
        exudyn_cable.solve(scene, tolerances=(1e-11, 1e-11), **run),
        global_dae.solve(scene, newton_tolerance=1e-13, **run),
    )
    assert all(s.status.ok for s in found), [str(s.status) for s in found]
    return found


@pytest.mark.parametrize("name", EQUAL)
def test_equal_steps_give_equal_motions(name):
    scene = EQUAL[name]
    exudyn, dae = both(scene, 100)
    probes = [PROBES.get(body, f"{body.name}.center") for body in scene.bodies]
    assert at.compare(exudyn, dae, probes).error < 1e-8


@pytest.mark.parametrize("name", TENDING)
def test_rigid_bodies_tend_to_one_motion(name):
    scene = TENDING[name]
    pairs = [both(scene, steps) for steps in (100, 200, 400)]
    for body in scene.bodies:
        apart = [e.position(PROBES[body]) - d.position(PROBES[body]) for e, d in pairs]
        sizes = [np.abs(x).max() for x in apart]
        assert sizes[0] < 1e-5
        while len(apart) > 1:
            factor = 4.0 ** (4 - len(apart))
            apart = [(factor * b - a) / (factor - 1.0) for a, b in pairwise(apart)]
        assert np.abs(apart[0]).max() < 1e-8


REFUSED = {
    "a weld of a beam to a plate": hanging(bodies=(BEAM, PLATE), joints=[at.Weld("a.end", "p.a")]),
    "a driven plate": at.Scene("driven", [PLATE], [at.Clamp("p.a", at.Quintic(0.1, 1.0))]),
    "a rotational spring of a beam": hanging(at.RotationalSpring("a.end", stiffness=1)),
    "a prismatic joint": hanging(joints=[at.Prismatic("a.end")]),
    "a line load": hanging(loads=[at.LineLoad("a", (0, 1))]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_exudyn_lacks_is_refused_by_name(name):
    scene = REFUSED[name]
    things = (*scene.connectors, *scene.loads, *reversed(scene.joints))
    status = exudyn_cable.solve(scene, mesh=2, dt=1e-3, t_end=1e-3).status
    assert status.code == "unsupported"
    assert at.errors.shown(things[0]) in status.message
    assert (
        exudyn_cable.solve(EQUAL["a spring"], mesh=2, integrator="zhai", dt=1e-5, t_end=1e-5).status.code
        == "unsupported"
    )
    assert exudyn_cable.solve_static(EQUAL["a spring"], mesh=2).status.code == "unsupported"
