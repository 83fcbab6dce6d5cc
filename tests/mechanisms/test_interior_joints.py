"""Joints at nodes between the ends of beams: beside the global DAE, beams in parts, exact answers, bad meshes."""

from itertools import pairwise

import numpy as np
import pytest
from random_mechanisms import shift, turn

import anctmm as at
from reference import global_dae

SECTION, MATERIAL = at.Rectangle(0.02, 0.01), at.Material(E=1e8, density=1000.0)
G = (0.0, -9.81)
STEPS = {
    "explicit": ({"integrator": "zhai", "dt": 1e-5, "t_end": 4e-4}, 1e-9),
    "implicit": ({"dt": 1e-3, "t_end": 8e-3, "newton_tolerance": 1e-13}, 1e-8),
}
FRACTIONS = (0.0, 0.3, 0.5, 0.75, 1.0)


def beam(name, start, end, velocity=None):
    return at.Beam(name, start, end, SECTION, MATERIAL, velocity)


def apart(one, two):
    """Largest distance of places of two solutions, of the largest way."""
    assert one.status.ok, one.status
    assert two.status.ok, two.status
    worst = way = 0.0
    for body in one.scene.bodies:
        for key in FRACTIONS if isinstance(body, at.Beam) else body.keys:
            path, other = one.position(body.name, key), two.position(body.name, key)
            worst, way = max(worst, np.abs(path - other).max()), max(way, np.abs(path - path[0]).max())
    return worst / max(way, 1e-5)


B, X = beam("b", (0.0, 0.0), (1.0, 0.0)), beam("x", (0.5, 0.0), (0.5, 0.4))
FAR = beam("far", (0.0, 0.5), (1.0, 0.5))
STRUTS = [beam("s", (0.25, 0.0), (0.25, 0.5)), beam("t", (0.75, 0.0), (0.75, 0.5))]
PLATE = at.RigidBody("plate", 0.5, 3e-3, (0.6, 0.1), {"a": (0.5, 0.0), "c": (0.75, 0.0)})
MIDDLE, QUARTER = ("b", 0.5), ("b", 0.25)
#: One of each kind: bodies and joints.
SCENES = {
    "supports": ([B], [at.Clamp("b.start"), at.Pin(QUARTER), at.Pin(("b", 0.75)), at.Pin("b.end")]),
    "pin": ([B, X], [at.Pin("b.start"), at.Pin(MIDDLE, "x.start")]),
    "weld": ([B, X], [at.Pin("b.start"), at.Weld(MIDDLE, "x.start")]),
    "two insides": ([B, beam("y", (0.3, -0.2), (0.7, 0.2))], [at.Clamp("b.start"), at.Pin(MIDDLE, ("y", 0.5))]),
    "welded insides": ([B, beam("y", (0.3, -0.2), (0.7, 0.2))], [at.Weld(MIDDLE, ("y", 0.5))]),
    "clamp": ([B], [at.Clamp(MIDDLE)]),
    "driven weld": ([B, X], [at.Clamp("b.start"), at.Weld(MIDDLE, "x.start", angle=turn)]),
    "slider": ([B], [at.Slider(QUARTER, (1.0, 0.3)), at.Pin("b.end")]),
    "driven slider": ([B], [at.Slider(QUARTER, (1.0, 0.3), position=shift)]),
    "driven prismatic": ([B], [at.Prismatic(MIDDLE, (0.2, 1.0), position=shift)]),
    "guide in a body": ([B, PLATE], [at.Pin("plate.center"), at.Slider(QUARTER, (1.0, 0.0), "plate"), at.Pin("b.end")]),
    "plate": ([B, PLATE], [at.Clamp("b.start"), at.Weld(MIDDLE, "plate.a")]),
    "plate twice": ([B, PLATE], [at.Clamp("b.start"), at.Pin(MIDDLE, "plate.a"), at.Pin(("b", 0.75), "plate.c")]),
    "mass": ([B, at.PointMass("m", 0.1, (0.25, 0.0))], [at.Pin("b.start"), at.Pin(QUARTER, "m.center")]),
    "loops": ([B, FAR, *STRUTS], [at.Pin("b.start"), at.Pin(QUARTER, "s.start"), at.Weld(("far", 0.25), "s.end"),
                                  at.Weld(("b", 0.75), "t.start"), at.Pin(("far", 0.75), "t.end")]),
}  # fmt: skip


@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("how", STEPS)
@pytest.mark.parametrize("name", SCENES)
def test_each_joint_moves_as_in_the_global_dae(name, how, element):
    bodies, joints = SCENES[name]
    scene = at.Scene(name, bodies, joints, [at.Force(("b", 0.6), (0.3, -0.2))], G)
    run, allowed = STEPS[how]
    mesh = {body.name: 4 if body.name in ("b", "far") else 2 for body in scene.beams}
    options = {"mesh": mesh, "element": element, "output_dt": run["t_end"] / 4, **run}
    if element == "shear" and how == "explicit":
        options |= {"dt": 2e-6, "t_end": 8e-5, "output_dt": 2e-5}
    ours, dae = at.solve(scene, **options), global_dae.solve(scene, **options)
    assert apart(ours, dae) < allowed
    size = max(np.abs(dae.reaction(joint)).max() for joint in joints)
    # accelerations that break constraints are found anew by ANC-TMM: those of implicit steps differ then
    known = 1e-5 if how == "implicit" else 1e-6
    for joint in joints:
        assert np.abs(ours.reaction(joint) - dae.reaction(joint)).max() < known * max(size, 1.0)
    if how == "implicit":
        assert np.abs(ours.energy.balance).max() < 0.02 * max(ours.energy.kinetic.max(), 1e-4)


def in_parts(name, cut):
    """A scene of above, its beam b written as parts that are welded to each other."""
    bodies, joints = SCENES[name]
    edges = [0.0, *cut, 1.0]
    parts = [beam(f"b{i}", (a, 0.0), (c, 0.0)) for i, (a, c) in enumerate(pairwise(edges))]
    written = {("b", c): f"b{i}.end" for i, c in enumerate(cut)} | {
        "b.start": "b0.start",
        "b.end": f"b{len(cut)}.end",
    }
    welds = [at.Weld(f"b{i}.end", f"b{i + 1}.start") for i in range(len(cut))]
    renamed = []
    for joint in joints:
        match joint:
            case at.Clamp():
                renamed.append(at.Clamp(written[joint.end], angle=joint.angle))
            case at.Slider():
                renamed.append(at.Slider(written[joint.place], joint.direction, joint.body, joint.position))
            case _:
                ends = [written.get(end, end) for end in joint.ends]
                renamed.append(type(joint)(*ends, grounded=joint.grounded))
    return at.Scene(name, [*parts, *bodies[1:]], renamed + welds, gravity=G), edges


@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("how", [*STEPS, "tolerance"])
@pytest.mark.parametrize(
    ("name", "cut"), [("supports", [0.25, 0.75]), ("pin", [0.5]), ("plate", [0.5]), ("slider", [0.25])]
)
def test_a_beam_is_the_same_written_in_parts(name, cut, how, element):
    parts, edges = in_parts(name, cut)
    bodies, joints = SCENES[name]
    whole = at.Scene(name, bodies, joints, gravity=G)
    mesh = {body.name: round(4 * body.length) for body in parts.beams if body.name[0] == "b"}
    options = {"element": element} | (
        {"integrator": "generalized-alpha", "tolerance": 1e-3, "t_end": 0.02}
        if how == "tolerance"
        else STEPS[how][0]
    )
    if element == "shear" and how == "explicit":
        options |= {"dt": 2e-6, "t_end": 8e-5}
    one = at.solve(whole, mesh={body.name: 4 if body.name == "b" else 2 for body in whole.beams}, **options)
    two = at.solve(parts, mesh={body.name: 2 for body in parts.beams} | mesh, **options)
    for fraction in np.linspace(0.0, 1.0, 9).tolist():
        i = min(int(np.searchsorted(edges, fraction, "right")) - 1, len(edges) - 2)
        inside = (fraction - edges[i]) / (edges[i + 1] - edges[i])
        assert np.abs(one.position("b", fraction) - two.position(f"b{i}", inside)).max() < 1e-11
    assert np.abs(one.energy.strain - two.energy.strain).max() < 1e-9 * two.energy.strain.max()


# --- equilibria -----------------------------------------------------------------------------------------------


def test_a_beam_on_three_supports_has_the_moment_of_clapeyrons_equation():
    """Of spans a and c under a small load q per length, M = −q (a³ + c³) / (8 (a + c)) at the middle."""
    a, c, q, mesh = 0.75, 1.25, 1e-5, 8
    long = beam("b", (0.0, 0.0), (a + c, 0.0))
    left, middle, right = at.Pin("b.start"), at.Pin(("b", a / (a + c))), at.Slider("b.end")
    s = at.solve_static(
        at.Scene("three supports", [long], [left, middle, right], [at.LineLoad("b", (0.0, -q))]), mesh=mesh
    )
    assert s.status.ok
    moment = -q * (a**3 + c**3) / (8.0 * (a + c))
    ends = q * a / 2.0 + moment / a, q * c / 2.0 + moment / c
    exact = {left: ends[0], middle: q * (a + c) - sum(ends), right: ends[1]}
    for joint, force in exact.items():
        assert s.reaction(joint)[-1, 1] == pytest.approx(force, rel=1e-6)
        assert abs(s.reaction(joint)[-1, 2]) < 1e-6 * abs(moment)
    forces = [s.section_force("b", a / (a + c) + x)[-1] for x in (0.0, 1e-9)]
    assert forces[0][2] == pytest.approx(moment, rel=1e-5)
    assert forces[1][2] == pytest.approx(moment, rel=1e-5)
    assert forces[1][1] - forces[0][1] == pytest.approx(-exact[middle], rel=1e-5)  # it jumps there


def test_equilibria_with_interior_joints_are_those_of_the_global_dae_and_stay():
    bodies, joints = SCENES["loops"]
    scene = at.Scene(
        "frame", bodies, [at.Clamp("b.start"), *joints[1:]], [at.LineLoad("far", (0.0, -0.5))], G
    )
    mesh = {"b": 4, "far": 4, "s": 2, "t": 2}
    ours, dae = at.solve_static(scene, mesh=mesh), global_dae.solve_static(scene, mesh=mesh)
    assert apart(ours, dae) < 1e-9
    for integrator, dt in (("zhai", 1e-5), ("generalized-alpha", 1e-3)):
        s = at.solve(scene, mesh=mesh, integrator=integrator, dt=dt, t_end=20 * dt, start=ours)
        assert np.abs(s.position("far", 0.3) - s.position("far", 0.3)[0]).max() < 1e-9


# --- what else acts on beams that are cut ---------------------------------------------------------------------


def pushed(t):
    return 0.4 * np.sin(40.0 * t), -0.5 * np.cos(30.0 * t)


def loaded():
    """A beam with loads, connectors and velocities everywhere on it."""
    spun = beam("b", (0.0, 0.0), (1.0, 0.0), at.RigidVelocity((0.0, 0.0), (1.0, 0.0), (0.5, 0.0), 0.7))
    loads = [at.LineLoad("b", pushed), at.Force(MIDDLE, (0.1, 0.2), follower=True), at.Torque(("b", 0.6), 0.01),
             at.Force(QUARTER, pushed)]  # fmt: skip
    connectors = [
        at.Spring(MIDDLE, (0.6, 0.3), stiffness=20.0, damping=0.1),
        at.Spring(("b", 0.1), "x.end", stiffness=9.0),
        at.RotationalSpring(MIDDLE, "x.end", stiffness=0.2),
        at.RotationalSpring(("b", 0.9), stiffness=0.1),
    ]
    return at.Scene("loaded", [spun, X], [at.Pin(MIDDLE, "x.start")], loads, G, connectors)


@pytest.mark.parametrize("how", STEPS)
def test_loads_connectors_and_velocities_of_a_cut_beam(how):
    """Everywhere on it: beside the global DAE."""
    run, allowed = STEPS[how]
    options = {"mesh": {"b": 4, "x": 2}, "output_dt": run["t_end"] / 4, **run}
    ours, dae = at.solve(loaded(), **options), global_dae.solve(loaded(), **options)
    assert apart(ours, dae) < allowed
    for fraction in (0.1, 0.5, 0.6):
        force, other = ours.section_force("b", fraction), dae.section_force("b", fraction)
        assert np.abs(force - other).max() < 1e-6 * np.abs(other).max()
    assert np.abs(ours.energy.strain - dae.energy.strain).max() < 1e-7 * dae.energy.strain.max()
    assert np.abs(ours.energy.work - dae.energy.work).max() < 1e-6 * np.abs(dae.energy.work).max()


# --- between nodes ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mesh", "kind"), [(3, "cable"), (3, "shear"), (1, "cable")])
@pytest.mark.parametrize("how", STEPS)
def test_joints_within_elements_are_those_of_the_global_dae(mesh, kind, how):
    scene = at.Scene("within", [B, X], [at.Pin("b.start"), at.Pin(MIDDLE, "x.start")], gravity=G)
    options = STEPS[how][0] | {"mesh": {"b": mesh, "x": 2}, "element": kind}
    if kind == "shear" and how == "explicit":
        options |= {"dt": 2e-6, "t_end": 8e-5}
    assert apart(at.solve(scene, **options), global_dae.solve(scene, **options)) < 1e-8
