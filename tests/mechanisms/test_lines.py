"""Places that guides hold on lines in the ground: nothing is kept for them in trees, and they stay on their lines."""

import numpy as np
import pytest
from random_mechanisms import turn

import anctmm as at
from reference import global_dae

SECTION, MATERIAL = at.Rectangle(0.02, 0.01), at.Material(E=1e8, density=1000.0)
STEPS = {
    "explicit": ({"integrator": "zhai", "dt": 1e-5, "t_end": 4e-4}, 1e-9),
    "implicit": ({"dt": 1e-3, "t_end": 8e-3, "newton_tolerance": 1e-13}, 1e-8),
}


def beam(name, start, end):
    return at.Beam(name, start, end, SECTION, MATERIAL)


B, X = beam("b", (0.0, 0.0), (1.0, 0.0)), beam("x", (0.5, 0.0), (0.5, 0.4))
Z, MASS = beam("z", (1.0, 0.0), (1.3, 0.3)), at.PointMass("m", 0.2, (1.0, 0.0))
FAR = beam("far", (0.0, 0.5), (1.0, 0.5))
STRUTS = [beam("s", (0.25, 0.0), (0.25, 0.5)), beam("t", (0.75, 0.0), (0.75, 0.5))]
#: Bodies, joints, and whether a line of the scene is one of constraints all the same, as on a loop.
SCENES = {
    "end": ([B], [at.Clamp("b.start"), at.Slider("b.end", (1.0, 0.4))], False),
    "beside a driven clamp": ([B], [at.Clamp("b.start", angle=turn), at.Slider("b.end", (1.0, 0.4))], False),
    "before a driven clamp": ([B], [at.Slider("b.start", (1.0, 0.4)), at.Clamp("b.end", angle=turn)], False),
    "driven clamp at the root": ([B], [at.Slider(("b", 0.25), (1.0, 0.4)), at.Clamp("b.end", angle=turn)], False),
    "both ends": ([B], [at.Prismatic("b.start", (0.3, 1.0)), at.Slider("b.end", (1.0, 0.4))], False),
    "inside": ([B], [at.Slider(("b", 0.25), (1.0, 0.3)), at.Pin("b.end")], False),
    "branches": ([B, X], [at.Slider("b.start", (0.0, 1.0)), at.Pin(("b", 0.5), "x.start"),
                          at.Slider("x.end", (1.0, 1.0)), at.Prismatic(("b", 0.5), (0.0, 1.0))], False),
    "mass": ([B, MASS], [at.Clamp("b.start"), at.Pin("b.end", "m.center"), at.Slider("m.center", (1.0, -0.3))], False),
    "angled weld": ([B, Z], [at.Clamp("b.start"), at.Weld("b.end", "z.start"), at.Slider("b.end", (0.2, 1.0))], False),
    "loop": ([B, FAR, *STRUTS], [at.Slider("b.start"), at.Pin(("b", 0.25), "s.start"), at.Weld(("far", 0.25), "s.end"),
                                 at.Weld(("b", 0.75), "t.start"), at.Pin(("far", 0.75), "t.end"),
                                 at.Slider(("b", 0.75), (0.0, 1.0)), at.Slider("far.end", (1.0, 0.1))], True),
}  # fmt: skip


def scene_of(name):
    bodies, joints, _ = SCENES[name]
    return at.Scene(name, bodies, joints, [at.Force(("b", 0.6), (0.3, -0.2))], (0.0, -9.81))


def mesh_of(scene):
    return {body.name: 4 if body.name in ("b", "far") else 2 for body in scene.beams}


def off_line(solution, guide):
    """Largest distance of a place from its line, m."""
    moved, (x, y) = solution.displacement(guide.place), guide.direction
    return np.abs(moved @ np.array([-y, x])).max()


@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("how", STEPS)
@pytest.mark.parametrize("name", SCENES)
def test_guided_places_move_as_in_the_global_dae(name, how, element):
    scene, (run, allowed) = scene_of(name), STEPS[how]
    options = {"mesh": mesh_of(scene), "element": element, **run}
    if element == "shear" and how == "explicit":
        options |= {"dt": 2e-6, "t_end": 8e-5}
    ours, dae = at.solve(scene, **options), global_dae.solve(scene, **options)
    assert ours.status.ok
    for body in scene.bodies:
        for key in (0.0, 0.3, 0.75, 1.0) if isinstance(body, at.Beam) else body.keys:
            path, other = ours.position(body.name, key), dae.position(body.name, key)
            assert np.abs(path - other).max() < allowed * max(np.abs(other - other[0]).max(), 1e-5)
    size = max(np.abs(dae.reaction(joint)).max() for joint in scene.joints)
    for joint in scene.joints:
        assert np.abs(ours.reaction(joint) - dae.reaction(joint)).max() < 1e-7 * size
        if isinstance(joint, at.Slider | at.Prismatic):
            assert off_line(ours, joint) < 1e-15
    assert np.abs(ours.energy.work - dae.energy.work).max() < 1e-6 * max(np.abs(dae.energy.work).max(), 1e-6)


@pytest.mark.parametrize("how", STEPS)
def test_nothing_leaves_its_line_in_many_steps(how):
    scene = scene_of("end")
    run = {**STEPS[how][0], "t_end": 1000 * STEPS[how][0]["dt"]}
    s = at.solve(scene, mesh=4, output_dt=run["t_end"] / 10, **run)
    assert s.status.ok
    assert off_line(s, scene.joints[1]) < 1e-14  # rounding of places of 1 m, which compilers differ in
    assert np.abs(s.energy.balance).max() < 1e-3 * s.energy.kinetic.max()
