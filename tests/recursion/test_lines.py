"""Places that guides hold on lines in the ground: nothing is kept for them in trees, and they stay on their lines."""

import numpy as np
import pytest
from random_mechanisms import turn

import anctmm as at
from anctmm.discretise.chain import FEW_GUIDES, Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.fitting import mass_matrix
from anctmm.discretise.joined import Joined
from anctmm.integrators.stability import highest_frequency
from anctmm.recursion.riccati import mass_factors, solve
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
#: Those without constraints: for the others there is `test_constrained`.
FREE = [name for name, (_, _, looped) in SCENES.items() if not looped]


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


@pytest.mark.parametrize("name", SCENES)
def test_nothing_is_kept_for_lines_in_the_ground_of_trees(name):
    scene = scene_of(name)
    chain, (_, joints, looped) = Chain(scene, Discretisation(mesh=mesh_of(scene))), SCENES[name]
    guides = [joint for joint in joints if isinstance(joint, at.Slider | at.Prismatic)]
    assert bool(chain.plan.kept) == looped
    assert len(chain.guided) + len(chain.kept.constraints.names) == len(guides)
    assert chain.split == (not looped and name != "angled weld" and name != "branches")


@pytest.mark.parametrize("element", ["cable", "shear"])
@pytest.mark.parametrize("name", FREE)
def test_a_solution_is_that_of_the_dense_matrix(name, element):
    scene = scene_of(name)
    chain = Chain(scene, Discretisation(mesh=mesh_of(scene), element=element))
    assert not chain.kept.constraints.names
    f = np.random.default_rng(1).standard_normal((chain.bodies.rows, chain.bodies.nodes))
    f[chain.prescribed] = 0.0
    joined = Joined(chain)
    T = joined.matrix
    dense = (T.T @ mass_matrix(chain.bodies) @ T).toarray()
    x = np.linalg.solve(dense, joined.gather(f))
    found, exact = solve(mass_factors(chain), f), joined.spread(x)
    assert np.abs(found - exact).max() < 1e-11 * np.abs(exact).max()
    assert np.abs(joined.unknowns(exact) - x).max() < 1e-12 * np.abs(x).max()
    assert np.abs(joined.gather(joined.load(x)) - x).max() < 1e-12 * np.abs(x).max()


def supports(count):
    """A beam over sliders of several directions, and a clamp."""
    places = [i / (count + 1) for i in range(1, count + 1)]
    joints = [at.Slider(("b", x), (1.0, 0.5 * x)) for x in places]
    return at.Scene("supports", [B], [at.Clamp("b.start"), *joints], gravity=(0.0, -9.81))


def test_many_guides_take_full_blocks():
    count = FEW_GUIDES + 1
    scene = supports(count)
    options = {"mesh": count + 1, "integrator": "zhai", "dt": 1e-5, "t_end": 4e-4}
    assert not Chain(scene, Discretisation(**options)).split
    assert Chain(supports(FEW_GUIDES), Discretisation(mesh=count)).split
    ours, dae = at.solve(scene, **options), global_dae.solve(scene, **options)
    for x in np.linspace(0.0, 1.0, 9).tolist():
        assert np.abs(ours.position("b", x) - dae.position("b", x)).max() < 1e-14


@pytest.mark.parametrize("name", ["end", "inside", "branches", "angled weld"])
def test_the_highest_frequency_is_that_of_the_dense_matrices(name):
    """Of the undeformed scene, element by element."""
    scene = scene_of(name)
    chain = Chain(scene, Discretisation(mesh=mesh_of(scene)))
    bodies, T = chain.bodies, Joined(chain).matrix
    index = np.arange(bodies.rows * bodies.nodes).reshape(bodies.rows, bodies.nodes)
    K, q = np.zeros((index.size, index.size)), bodies.reference()
    for b, mesh in enumerate(bodies.meshes):
        for i in range(bodies.first[b], bodies.first[b] + mesh.elements):
            at_nodes = index[:, i : i + 2].T.ravel()
            tangent = mesh.element.tangent(q[:, i : i + 2].T.reshape(-1, 2))
            K[np.ix_(at_nodes, at_nodes)] += tangent.reshape(len(at_nodes), -1)
    M = (T.T @ mass_matrix(bodies) @ T).toarray()
    exact = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, T.T @ K @ T)).real.max())
    assert highest_frequency(chain) == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("how", STEPS)
def test_nothing_leaves_its_line_in_many_steps(how):
    scene = scene_of("end")
    run = {**STEPS[how][0], "t_end": 1000 * STEPS[how][0]["dt"]}
    s = at.solve(scene, mesh=4, output_dt=run["t_end"] / 10, **run)
    assert s.status.ok
    assert off_line(s, scene.joints[1]) < 1e-14  # rounding of places of 1 m, which compilers differ in
    assert np.abs(s.energy.balance).max() < 1e-3 * s.energy.kinetic.max()


def test_equilibria_on_lines_are_those_of_the_global_dae_and_their_stability_is_known():
    for name in ("end", "branches", "angled weld"):
        scene = scene_of(name)
        ours, dae = (
            solve(scene, mesh=mesh_of(scene)) for solve in (at.solve_static, global_dae.solve_static)
        )
        assert ours.status.code == dae.status.code
        if ours.status.ok:
            for x in (0.3, 1.0):
                assert np.abs(ours.position("b", x)[-1] - dae.position("b", x)[-1]).max() < 1e-9
    column = [at.Pin("b.start"), at.Slider("b.end")]
    limit = np.pi**2 * MATERIAL.E * SECTION.second_moment
    for part, code in ((0.9, "ok"), (1.1, "unstable")):
        s = at.solve_static(
            at.Scene("column", [B], column, [at.Force("b.end", (-part * limit, 0.0))]), mesh=8
        )
        assert s.status == code
