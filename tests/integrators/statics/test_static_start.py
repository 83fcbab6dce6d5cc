"""Motions that start from an equilibrium."""

from dataclasses import replace

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import DiscretisationError, StabilityError

SQUARE, SOFT = at.Rectangle(0.02, 0.02), at.Material(1e7, 1000.0)
BODIES = (
    at.Beam("a", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT),
    at.Beam("b", (1.8, 0.7), (1.0, 0.0), SQUARE, SOFT),
)
JOINTS = (at.Clamp("a.start"), at.Pin("a.end", "b.end"))
CONNECTORS = (
    at.Spring("b.start", (2.0, 2.0), stiffness=40.0, length=0.9, damping=0.1),
    at.RotationalSpring("a.end", "b.end", stiffness=0.4, angle=0.3),
)
LOADS = (
    at.Torque(("a", 0.3), 0.05),
    at.Force("b.start", (0.1, -0.1), follower=True),
    at.LineLoad("a", (0.0, 0.2)),
)


def loaded(**changes):
    scene = at.Scene("loaded", BODIES, JOINTS, LOADS, (0.0, -2.0), connectors=CONNECTORS)
    return replace(scene, **changes)


def rest_of(scene, **options):
    return at.solve_static(scene, **{"mesh": 2, "newton_tolerance": 1e-13, "load_steps": 4} | options)


@pytest.mark.parametrize(
    "options",
    [
        {"integrator": "zhai", "dt": 2e-4},
        {"dt": 2e-3},
        {"tolerance": 1e-3, "integrator": "generalized-alpha"},
    ],
    ids=["explicit", "implicit", "adaptive"],
)
def test_nothing_moves_from_an_equilibrium(options):
    scene = loaded()
    rest = rest_of(scene)
    assert rest.status.ok, rest.status
    assert np.abs(rest.displacement("b.start")[-1]).max() > 0.05
    found = at.solve(scene, mesh=2, t_end=0.1, start=rest, **options)
    assert found.status.ok, found.status
    for body in ("a", "b"):
        for fraction in (0.0, 0.3, 1.0):
            moved = found.position(body, fraction) - rest.position(body, fraction)[-1]
            assert np.abs(moved).max() < 1e-10
    assert found.energy.strain[0] == pytest.approx(rest.energy.strain[-1], rel=1e-9)


def test_a_load_that_is_let_go_gives_back_its_energy():
    """A beam bent by a force swings about its straight shape: it comes to the mirrored place after half a period."""
    beam = at.Beam("beam", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT)
    bent = at.Scene("bent", [beam], [at.Clamp("beam.start")], [at.Force("beam.end", (0.0, 0.01))])
    free = replace(bent, loads=())
    rest = rest_of(bent)
    found = at.solve(free, mesh=2, dt=1e-3, t_end=3.0, spectral_radius=1.0, start=rest, output_dt=0.01)
    assert found.status.ok, found.status
    tip = found.position("beam", 1.0)[:, 1]
    assert tip[0] == rest.position("beam", 1.0)[-1, 1]
    assert tip.min() == pytest.approx(-tip[0], rel=0.05)
    assert np.abs(found.energy.balance).max() < 1e-2 * found.energy.strain[0]


def forces_in(found, output):
    """Forces inside at an output: of connectors, joints and sections."""
    scene = found.scene
    return np.concatenate(
        [np.array([found.tension(connector)[output] for connector in scene.connectors])]
        + [found.reaction(joint)[output] for joint in scene.joints]
        + [found.section_force(body.name, x)[output] for body in scene.beams for x in (0.0, 0.3, 1.0)]
    )


@pytest.mark.parametrize(
    "options", [{"integrator": "zhai", "dt": 2e-4}, {"dt": 2e-3}], ids=["explicit", "implicit"]
)
def test_forces_inside_begin_as_in_the_equilibrium(options):
    """Springs and follower forces know how far their places have turned before the motion begins."""
    scene = loaded()
    rest = rest_of(scene)
    found = at.solve(scene, mesh=2, t_end=0.02, start=rest, **options)
    assert np.abs(found.angle("b.start")).max() < 1e-9, "angles are those since the first output"
    expected = forces_in(rest, -1)
    assert np.abs(expected).max() > 0.1
    for output in (0, -1):
        np.testing.assert_allclose(forces_in(found, output), expected, atol=1e-8)


def test_a_guide_in_a_body_that_has_turned_pushes_across_its_line():
    """A block on the line of a plate, which a torque has turned against its spring."""
    plate = at.RigidBody("plate", mass=2.0, inertia=0.1, center=(0.0, 0.0), points={"o": (0.5, 0.0)})
    block = at.PointMass("block", mass=1.0, position=(0.5, 0.0))
    guide = at.Slider("block.center", direction=(1, 0), body="plate")
    holds = [
        at.RotationalSpring("plate.center", stiffness=3.0),
        at.Spring("block.center", "plate.center", stiffness=200.0, length=0.5),
    ]
    scene = at.Scene(
        "tilted", [plate, block], [at.Pin("plate.center"), guide], [at.Torque("plate.center", 8.0)],
        gravity=(0.0, -9.81), connectors=holds,
    )  # fmt: skip
    rest = at.solve_static(scene, load_steps=4, newton_tolerance=1e-13)
    found = at.solve(scene, dt=1e-3, t_end=0.01, start=rest)
    turned = rest.angle("plate")[-1]
    assert abs(turned) > 0.5
    across = 9.81 * np.cos(turned) * np.array([-np.sin(turned), np.cos(turned)])
    for solution in (rest, found):
        np.testing.assert_allclose(solution.reaction(guide)[-1], [*across, 0.0], atol=1e-8)


@pytest.mark.parametrize(
    "element", ["cable", *(pytest.param(kind, marks=pytest.mark.exhaustive) for kind in ("shear", "quintic"))]
)
def test_whole_turns_of_an_equilibrium_are_counted(element):
    """A cantilever that a moment rolls up, at once, in small parts, downhill and along the path: by M L/EI."""
    beam = at.Beam("beam", (0.0, 0.0), (1.0, 0.0), at.Rectangle(0.02, 0.02), SOFT)
    moment = 2.0 * np.pi * 1.2 * SOFT.E * beam.section.second_moment
    scene = at.Scene("rolled", [beam], [at.Clamp("beam.start")], [at.Torque("beam.end", moment)])
    run = at.Discretisation(mesh=16, element=element)
    parts = at.solve_static(scene, run, load_steps=16)
    places = [0.0, 0.31, 0.5, 1.0]
    field = replace(parts.fields["beam"], turned=None)  # half a turn from one output to the next at most
    turned = np.array([field.angle(place, parts.t)[-1] for place in places])
    assert turned[-1] > (1.1 if element == "shear" else 2.3) * np.pi
    for options in ({"load_steps": 16}, {}, {"branch": "stable"}, {"path": "arclength"}):
        found = at.solve_static(scene, run, **options)
        np.testing.assert_allclose(found.angle("beam", places)[-1], turned, atol=1e-6)


@pytest.mark.parametrize("steps", [1, 8])
def test_turns_of_the_start_are_counted(steps):
    """A rotational spring wound by more than a turn: it pushes back by all of it."""
    beam = at.Beam("beam", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT)
    bending = SOFT.E * SQUARE.second_moment
    spring = at.RotationalSpring("beam.end", stiffness=1e-3 * bending)
    moment = 2.0 * np.pi * 1.2 * bending
    scene = at.Scene(
        "wound", [beam], [at.Clamp("beam.start")], [at.Torque("beam.end", moment)], connectors=[spring]
    )
    rest = at.solve_static(scene, mesh=8, load_steps=steps, newton_tolerance=1e-12)
    assert rest.status.ok, rest.status
    found = at.solve(scene, mesh=8, dt=1e-3, t_end=0.05, start=rest)
    assert found.energy.strain[0] == pytest.approx(rest.energy.strain[-1], rel=1e-9)
    assert np.abs(found.position("beam", 1.0) - rest.position("beam", 1.0)[-1]).max() < 1e-8
    assert rest.angle("beam.end")[-1] > 2.0 * np.pi
    for solution in (rest, found):
        assert solution.tension(spring)[-1] == pytest.approx(
            1e-3 * bending * rest.angle("beam.end")[-1], rel=1e-9
        )


@pytest.mark.exhaustive
def test_a_start_that_does_not_fit_is_refused_by_name():
    scene = loaded()
    rest = rest_of(scene)
    other = replace(scene, joints=(at.Clamp("a.start"), at.Weld("a.end", "b.end")))
    longer = replace(scene, bodies=(BODIES[0], replace(BODIES[1], start=(1.9, 0.7))))
    moving = at.solve(scene, mesh=2, dt=1e-3, t_end=1e-3)
    lost = at.solve_static(replace(scene, joints=(), connectors=(), loads=()), mesh=2)
    for wrong, words in (
        ({"scene": other}, "start of scene 'loaded' has other joints than scene 'loaded'"),
        ({"scene": longer}, "start of scene 'loaded' has other bodies than scene 'loaded'"),
        ({"mesh": 3}, "body 'a' cut into 2 elements 'cable', and the run into 3 elements 'cable'"),
        ({"element": "shear"}, "2 elements 'cable', and the run into 2 elements 'shear'"),
        ({"start": "rest"}, "start is 'rest'; start needs a Solution of solve_static"),
        ({"start": moving}, "is no static equilibrium"),
        ({"start": lost}, "ended with 'diverged'"),
    ):
        given = {"scene": scene, "mesh": 2, "start": rest, "dt": 1e-3, "t_end": 0.01} | wrong
        with pytest.raises(DiscretisationError) as refused:
            at.solve(given.pop("scene"), **given)
        assert words in str(refused.value)


def test_the_largest_stable_step_is_that_of_the_equilibrium():
    """A beam stretched by a third bends more easily, and its fastest motion is bending."""
    beam = at.Beam("beam", (0.0, 0.0), (1.0, 0.0), at.Rectangle(0.02, 0.5), SOFT)
    pull = 0.33 * SOFT.E * 0.02 * 0.5
    scene = at.Scene("pulled", [beam], [at.Clamp("beam.start")], [at.Force("beam.end", (pull, 0.0))])
    rest = rest_of(scene, mesh=4)
    options = {"mesh": 4, "integrator": "zhai", "t_end": 1.0, "output_dt": 1.0}
    with pytest.raises(StabilityError) as free:
        at.solve(scene, dt=0.01, **options)
    with pytest.raises(StabilityError) as preloaded:
        at.solve(scene, dt=0.01, start=rest, **options)
    limits = [float(str(e.value).split("at most ")[1].split(" s")[0]) for e in (free, preloaded)]
    assert limits[1] != limits[0]
