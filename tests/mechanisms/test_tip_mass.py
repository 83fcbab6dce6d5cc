"""A mass at the end of a chain is its last node, wherever the scene names it: one node more, and no branch."""

import numpy as np
import pytest
from random_mechanisms import turn
from scipy.optimize import brentq

import anctmm as at
from reference import global_dae

SECTION, MATERIAL = at.Rectangle(0.02, 0.01), at.Material(E=1e8, density=1000.0)
ROOT, TIP, MIDDLE = (0.0, 0.0), (0.6, -0.8), (0.3, -0.4)
GRAVITY, MESH = (1.0, -9.81), 4
#: Of the mass, kg.
LOAD = 0.05


def beam(name, start, end):
    return at.Beam(name, start, end, SECTION, MATERIAL)


def mass(name="load", m=LOAD):
    return at.PointMass(name, m, TIP)


OUT, BACK, UPPER, LOWER = (
    beam("b", ROOT, TIP),
    beam("b", TIP, ROOT),
    beam("a", ROOT, MIDDLE),
    beam("b", MIDDLE, TIP),
)
#: Bodies and joints.
SCENES = {
    "behind": ([OUT, mass()], [at.Clamp("b.start"), at.Pin("b.end", "load.center")]),
    "named first": ([mass(), OUT], [at.Pin("load.center", "b.end"), at.Clamp("b.start")]),
    "at the start": ([BACK, mass()], [at.Clamp("b.end"), at.Pin("b.start", "load.center")]),
    "first at the start": ([mass(), BACK], [at.Clamp("b.end"), at.Pin("load.center", "b.start")]),
    "behind two beams": (
        [LOWER, mass(), UPPER],
        [at.Pin("a.start"), at.Pin("a.end", "b.start"), at.Pin("load.center", "b.end")],
    ),
    "behind a driven clamp": (
        [OUT, mass()],
        [at.Clamp("b.start", angle=turn), at.Pin("b.end", "load.center")],
    ),
    "before a driven clamp": (
        [mass(), BACK],
        [at.Pin("load.center", "b.start"), at.Clamp("b.end", angle=turn)],
    ),
    "on both ends": (
        [mass(), OUT, at.PointMass("other", 0.02, ROOT)],
        [at.Pin("load.center", "b.end"), at.Pin("b.start", "other.center")],
    ),
}
#: Runs, and what they may differ by from those of another road, relative to the way of the mass.
RUNS = {
    "explicit": ({"integrator": "zhai", "dt": 1e-5, "t_end": 4e-4}, 1e-9),
    "implicit": ({"dt": 1e-3, "t_end": 8e-3, "newton_tolerance": 1e-13}, 1e-9),
}


def scene_of(name, of=SCENES):
    bodies, joints = of[name]
    loads = [at.Force("load.center", (0.02, 0.01))]
    springs = [at.Spring("load.center", (1.0, -1.0), stiffness=3.0, damping=0.01, length=0.3)]
    return at.Scene(name, bodies, joints, loads, GRAVITY, springs)


def assert_alike(scene, ours, other, allowed):
    """Motion, reactions and energies of two solutions."""
    assert ours.status.ok, ours.status
    way = np.abs(other.displacement("load.center")).max()
    for place in ("load.center", ("b", 0.3)):
        assert np.abs(ours.position(place) - other.position(place)).max() < allowed * way
    speed = np.abs(other.velocity("load.center")).max()
    assert np.abs(ours.velocity("load.center") - other.velocity("load.center")).max() < 1e2 * allowed * speed
    for joint, its in zip(scene.joints, other.scene.joints, strict=True):
        size = np.abs(other.reaction(its)).max()
        assert np.abs(ours.reaction(joint) - other.reaction(its)).max() < 1e3 * allowed * size
    for part in ("kinetic", "strain", "potential", "work"):
        mine, its = getattr(ours.energy, part), getattr(other.energy, part)
        assert np.abs(mine - its).max() < 1e2 * allowed * np.abs(other.energy.potential).max()


@pytest.mark.parametrize("how", RUNS)
@pytest.mark.parametrize("name", SCENES)
def test_it_moves_as_in_the_global_dae(name, how):
    scene, (run, allowed) = scene_of(name), RUNS[how]
    ours, dae = (solve(scene, mesh=MESH, **run) for solve in (at.solve, global_dae.solve))
    assert_alike(scene, ours, dae, allowed)


def test_its_pin_carries_what_it_weighs_and_its_inertia():
    scene, (run, _) = scene_of("behind"), RUNS["implicit"]
    s = at.solve(scene, mesh=MESH, **run)
    a = s.fields["load"].accelerations[:, 0]
    spring = np.subtract((1.0, -1.0), s.position("load.center"))
    length, v = np.linalg.norm(spring, axis=1), s.velocity("load.center")
    along = spring / length[:, None]
    pull = 3.0 * (length - 0.3) - 0.01 * (v * along).sum(axis=1)
    on_mass = LOAD * (a - GRAVITY) - (0.02, 0.01) - pull[:, None] * along
    np.testing.assert_allclose(
        s.reaction(scene.joints[1])[:, :2], -on_mass, atol=1e-9 * np.abs(on_mass).max()
    )


def test_equilibria_are_those_of_its_weight():
    bodies, joints = SCENES["named first"]
    laden = at.Scene("laden", bodies, joints, gravity=GRAVITY)
    weight = at.Force("b.end", (LOAD * GRAVITY[0], LOAD * GRAVITY[1]))
    bare = at.Scene("bare", [OUT], joints[1:], [weight], GRAVITY)
    one, two = (at.solve_static(scene, mesh=MESH) for scene in (laden, bare))
    assert one.status.ok
    np.testing.assert_allclose(one.position("load.center"), two.position("b.end"), atol=1e-12)
    np.testing.assert_allclose(one.position("b", 0.4), two.position("b", 0.4), atol=1e-12)


@pytest.mark.parametrize("name", ["behind", "first at the start"])
def test_frequencies_are_those_of_a_cantilever_with_a_tip_mass(name):
    """1 + cos λ cosh λ + μ λ (cos λ sinh λ - sin λ cosh λ) = 0; Blevins (1979), table 8-8."""
    bodies, joints = SCENES[name]
    thin = at.Rectangle(0.002, 0.01)
    rows = [
        at.Beam("b", body.start, body.end, thin, MATERIAL) if body.name == "b" else body for body in bodies
    ]
    line = MATERIAL.density * thin.area
    mu = LOAD / line

    def equation(x):
        return 1 + np.cos(x) * np.cosh(x) + mu * x * (np.cos(x) * np.sinh(x) - np.sin(x) * np.cosh(x))

    roots = np.array([brentq(equation, low, high) for low, high in ((0.3, 2.0), (3.5, 4.7), (6.5, 7.8))])
    exact = roots**2 / (2.0 * np.pi) * np.sqrt(MATERIAL.E * thin.second_moment / line)
    modes = at.modes(at.Scene("arm", rows, joints), mesh=16, count=3)
    np.testing.assert_allclose(modes.frequencies, exact, rtol=2e-4)
