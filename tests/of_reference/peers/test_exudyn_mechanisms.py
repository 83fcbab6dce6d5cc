"""All that mechanisms have: Exudyn beside the global solver, in motion and at rest, and what it refuses.

Beams and masses have equal coordinates in both: equal steps give equal motions. Exudyn's rigid bodies have the angle as
a coordinate and ours a unit vector, so their steps differ; their limits, by Richardson's rule from three steps, do not.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import anctmm as at
from anctmm.model.needs import MECHANISMS, needs
from reference import exudyn_cable, exudyn_reissner, global_dae

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


def pushed(t):
    return 0.5 * np.sin(30.0 * t), 0.2


TURN, SHIFT = at.Quintic(0.3, 0.2), at.Quintic(0.05, 0.2)
SECOND = at.Beam("b", (1, 0), (1.3, 0.4), ROD, RUBBER)


def probe(body):
    """A place of a body that moves."""
    points = getattr(body, "points", ())
    return (
        f"{body.name}.end"
        if isinstance(body, at.Beam)
        else f"{body.name}.{[*points, 'center'][-2 if points else 0]}"
    )


EQUAL = {
    "a tip mass": hanging(bodies=(BEAM, TIP), joints=[at.Pin("a.end", "m.center")]),
    "a slider": hanging(joints=[at.Slider("a.end", (0.3, 1.0))]),
    "a level slider": hanging(bodies=(BEAM, TIP), joints=[at.Pin("a.end", "m.center"), at.Slider("m.center", (0, 2))]),
    "a spring": hanging(at.Spring("a.end", (1, -1), stiffness=20, damping=0.3, length=0.8, preload=0.2)),
    "a mass on a spring": hanging(at.Spring("a.end", "m.center", stiffness=20, damping=0.3), bodies=(BEAM, HUNG)),
    "a law": hanging(at.Spring("a.end", (1, -1), law=law)),
    "a driven length": hanging(at.Spring("a.end", (1, -1), stiffness=20, damping=0.1, length=length)),
    "a prismatic joint": hanging(joints=[at.Prismatic("a.end", (0.3, 1.0))]),
    "a driven slider": hanging(joints=[at.Slider("a.end", (0.3, 1.0), position=SHIFT)]),
    "a driven prismatic joint": hanging(joints=[at.Prismatic("a.end", (0, 1), position=SHIFT)]),
    "a driven weld": hanging(bodies=(BEAM, SECOND), joints=[at.Weld("a.end", "b.start", angle=TURN)]),
    "a hinge that springs turn": hanging(
        at.RotationalSpring("a.end", "b.start", stiffness=0.5, damping=0.01, angle=angle, preload=0.1),
        at.RotationalSpring("b.end", law=law), bodies=(BEAM, SECOND), joints=[at.Pin("a.end", "b.start")]),
    "a rotational spring": hanging(at.RotationalSpring("a.end", stiffness=0.5, damping=0.01, preload=0.1)),
    "a rotational spring inside": hanging(at.RotationalSpring(("a", 0.3), stiffness=0.5, damping=0.01, angle=0.1)),
    "a spring inside": hanging(at.Spring(("a", 0.7), (1, -1), stiffness=20, damping=0.1)),
    "loads inside": hanging(loads=[at.Force(("a", 0.3), (0.2, 0.5)), at.Torque(("a", 0.8), 0.1)]),
    "followers": hanging(
        bodies=(BEAM, SECOND), joints=[at.Weld("a.end", "b.start")],
        loads=[at.Force("b.end", (0.1, 0.3), follower=True), at.Force(("b", 0.3), pushed, follower=True)]),
    "line loads": hanging(loads=[at.LineLoad("a", (0.2, 0.5)), at.LineLoad("a", pushed)]),
    "a support inside": hanging(joints=[at.Pin(("a", 0.5))]),
    "a guide inside": hanging(joints=[at.Slider(("a", 0.5), (1, 2))]),
    "a branch inside": hanging(
        bodies=(BEAM, at.Beam("b", (0.5, 0), (0.8, 0.4), ROD, RUBBER)), joints=[at.Weld(("a", 0.5), "b.start")]),
    "a driven branch inside": hanging(
        bodies=(BEAM, at.Beam("b", (0.5, 0), (0.8, 0.4), ROD, RUBBER)),
        joints=[at.Weld(("a", 0.5), "b.start", angle=TURN)]),
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
    "a plate welded to a beam": hanging(bodies=(BEAM, PLATE), joints=[at.Weld("a.end", "p.a")]),
    "a plate turned against a beam": hanging(bodies=(BEAM, PLATE), joints=[at.Weld("p.a", "a.end", angle=TURN)]),
    "a plate turned against a plate": hanging(
        bodies=(BEAM, PLATE, CRANK), joints=[at.Pin("a.end", "p.a"), at.Weld("p.b", "c.b", angle=TURN)]),
    "a driven crank": at.Scene(
        "crank", [PLATE, CRANK], [at.Clamp("p.a", TURN), at.Pin("p.b", "c.b")], (), GRAVITY),
    "a plate in a driven guide": hanging(
        bodies=(BEAM, PLATE), joints=[at.Pin("a.end", "p.a"), at.Slider("p.b", (1, 2), position=SHIFT)]),
    "a plate that slides and does not turn": at.Scene(
        "press", [PLATE], [at.Prismatic("p.a", (1, 2))], [at.Force("p.b", (0.5, 0.2))], GRAVITY),
    "a beam in a plate's guide": hanging(
        bodies=(BEAM, PLATE), joints=[at.Slider("a.end", (1, 2), "p"), at.Pin("p.b")]),
    "a plate in a plate's guide": at.Scene(
        "guide", [PLATE, CRANK], [at.Pin("p.a"), at.Slider("c.b", (1, 2), "p")], (), GRAVITY),
    "a plate driven in a plate": at.Scene(
        "robot", [PLATE, CRANK], [at.Pin("p.a"), at.Prismatic("c.b", (1, 2), "p", SHIFT)], (), GRAVITY),
    "a spring between beam and plate": hanging(
        at.RotationalSpring("a.end", "p.a", stiffness=3, damping=0.1, angle=angle), bodies=(BEAM, PLATE),
        joints=[at.Pin("a.end", "p.a")], loads=[at.Force("p.b", (0.5, 0.2), follower=True)]),
    "welded plates": hanging(bodies=(BEAM, PLATE, CRANK), joints=[at.Pin("a.end", "p.a"), at.Weld("p.b", "c.b")]),
}  # fmt: skip


REFUSED = {
    "a beam in a plate's guide, not turning": hanging(
        bodies=(BEAM, PLATE), joints=[at.Prismatic("a.end", (1, 2), "p", SHIFT), at.Pin("p.b")]),
    "a mass in a plate's guide": at.Scene(
        "collar", [TIP, PLATE], [at.Slider("m.center", (1, 2), "p"), at.Pin("p.b")], (), GRAVITY),
}  # fmt: skip


#: Of which every run of the tests looks at the limits; at the others the exhaustive ones do.
USUAL = {
    "a plate with a spring", "a plate welded to a beam", "a plate turned against a beam", "a driven crank",
    "a beam in a plate's guide", "welded plates",
}  # fmt: skip


def usual(names, chosen):
    """Names as parameters, those that are not chosen for exhaustive runs."""
    return [pytest.param(n, marks=() if n in chosen else pytest.mark.exhaustive) for n in sorted(names)]


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
    assert at.compare(exudyn, dae, [probe(body) for body in scene.bodies]).error < 1e-8


@pytest.mark.parametrize("name", usual(TENDING, USUAL))
def test_rigid_bodies_tend_to_one_motion(name):
    scene = TENDING[name]
    pairs = [both(scene, steps) for steps in (30, 60, 120)]
    for body in scene.bodies:
        apart = [e.position(probe(body)) - d.position(probe(body)) for e, d in pairs]
        sizes = [np.abs(x).max() for x in apart]
        assert sizes[0] < 1e-4
        while len(apart) > 1:
            factor = 4.0 ** (4 - len(apart))
            apart = [(factor * b - a) / (factor - 1.0) for a, b in pairwise(apart)]
        assert np.abs(apart[0]).max() < 1e-6


INSIDE = {name for name, scene in EQUAL.items() if "interior-loads" in dict(needs(scene))}


@pytest.mark.parametrize(
    "name", usual((EQUAL | TENDING).keys() - INSIDE, USUAL | {"a slider", "a spring", "followers"})
)
def test_shear_flexible_beams_move_nearly_as_cables(name):
    """Slender beams: another element at the same places, so that wrong directions or places would show."""
    scene, run = (EQUAL | TENDING)[name], {"mesh": 8, "dt": 2e-3, "t_end": 0.2, "output_dt": 0.02}
    found = [solve(scene, **run) for solve in (exudyn_cable.solve, exudyn_reissner.solve)]
    assert all(s.status.ok for s in found), [str(s.status) for s in found]
    for body in scene.bodies:
        cable, reissner = (s.displacement(probe(body)) for s in found)
        assert np.abs(cable - reissner).max() < 0.05 * max(np.abs(cable).max(), 1e-3)


def at_rest(scene):
    """Loads and connectors as they are at t = 0, without followers, whose equilibria need not be stable."""
    loads = [load for load in scene.loads if not getattr(load, "follower", False)]
    return replace(scene, loads=loads, gravity=(0.0, -0.3))


#: Without stiffness at the start of the load, or where the curvature of constraints counts: Exudyn's tangent has none.
NOT_FOUND = {
    "a mass on a line",
    "a mass on a spring", "a plate that hangs", "two plates with springs", "a motor's law", "a plate on a slider",
    "a plate turned against a plate", "a driven crank", "a plate that slides and does not turn",
    "a plate in a plate's guide", "a plate driven in a plate", "welded plates",
}  # fmt: skip


@pytest.mark.parametrize("name", sorted((EQUAL | TENDING).keys() - NOT_FOUND))
def test_equilibria_are_those_of_the_global_solver(name):
    """Under a half and the whole load."""
    scene = at_rest((EQUAL | TENDING)[name])
    dae = global_dae.solve_static(scene, mesh=2, load_steps=10, newton_tolerance=1e-13)
    exudyn = exudyn_cable.solve_static(scene, mesh=2, load_steps=10)
    assert exudyn.status.ok, exudyn.status
    assert dae.status.ok, dae.status
    for factor in (0.5, 1.0):
        rows = [int(np.abs(s.t - factor).argmin()) for s in (exudyn, dae)]
        if factor < 1.0 and abs(exudyn.t[rows[0]] - factor) > 1e-9:
            continue  # Exudyn chose other steps of the load
        for body in scene.bodies:
            ours, theirs = (s.position(probe(body))[r] for s, r in zip((exudyn, dae), rows, strict=True))
            assert np.abs(ours - theirs).max() < (1e-8 if name in EQUAL else 1e-7)


@pytest.mark.parametrize("name", ["a plate that hangs", "a driven crank"])
def test_equilibria_that_exudyn_does_not_find_are_failures(name):
    status = exudyn_cable.solve_static(at_rest(TENDING[name]), mesh=2).status
    assert status.code == "failed"
    assert "found no equilibrium beyond load factor" in status.message


@pytest.mark.parametrize("name", REFUSED)
def test_guides_that_exudyn_does_not_have_are_refused_by_name(name):
    status = exudyn_cable.solve(REFUSED[name], mesh=2, dt=1e-3, t_end=1e-3).status
    assert status.code == "unsupported"
    assert "on a moving body; Exudyn has no joint for that" in status.message


@pytest.mark.parametrize("name", sorted(INSIDE))
def test_shear_flexible_beams_have_no_places_between_nodes(name):
    """Exudyn's beams do not tell their turning there."""
    status = exudyn_reissner.solve(EQUAL[name], mesh=2, dt=1e-3, t_end=1e-3).status
    assert status.code == "unsupported"
    assert MECHANISMS["interior-loads"] in status.message
