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
        {"dt": 2e-3, "integrator": "esdirk"},
        {"tolerance": 1e-3, "integrator": "generalized-alpha"},
    ],
    ids=["explicit", "implicit", "esdirk", "adaptive"],
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
    found = at.solve(free, mesh=2, dt=2e-3, t_end=3.0, spectral_radius=1.0, start=rest, output_dt=0.01)
    assert found.status.ok, found.status
    tip = found.position("beam", 1.0)[:, 1]
    assert tip[0] == rest.position("beam", 1.0)[-1, 1]
    assert tip.min() == pytest.approx(-tip[0], rel=0.05)
    assert np.abs(found.energy.balance).max() < 1e-2 * found.energy.strain[0]


def forces_in(found, output):
    """Forces inside at an output: of connectors, joints and sections."""
    tensions = np.array([found.tension(connector)[output] for connector in found.scene.connectors])
    reactions = [found.reaction(joint)[output] for joint in found.scene.joints]
    sections = [
        found.section_force(body.name, x)[output] for body in found.scene.beams for x in (0.0, 0.3, 1.0)
    ]
    return np.concatenate([tensions, *reactions, *sections])


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


def test_a_start_that_does_not_fit_is_refused_by_name():
    scene = loaded()
    rest = rest_of(scene)
    other = replace(scene, joints=(at.Clamp("a.start"), at.Weld("a.end", "b.end")))
    moving = at.solve(scene, mesh=2, dt=1e-3, t_end=1e-3)
    lost = at.solve_static(replace(scene, joints=(), connectors=(), loads=()), mesh=2)
    for wrong, words in (
        ({"scene": other}, "has other joints than scene 'loaded'"),
        ({"mesh": 3}, "body 'a' cut into 2 elements 'cable'"),
        ({"start": "rest"}, "start is 'rest'"),
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
