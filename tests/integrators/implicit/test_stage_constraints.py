"""Steps of fourth order where constraints are nonlinear or driven: their order, other roads, gaps, work, locking."""

from functools import cache
from itertools import pairwise
from math import pi

import numpy as np
import pytest
from driven_bead import bead

import anctmm as at
from reference.exact.andrews import PUBLISHED, andrews_squeezer, angles_of

ROD, SOFT = at.Rectangle(0.04, 0.04), at.Material(E=2e4, density=1100.0)
GRAVITY = (0.0, -9.81)


def link(name, center, *ends):
    points = dict(zip("ab", ends, strict=False))
    return at.RigidBody(name, mass=1.0, inertia=0.02, center=center, points=points)


def four_bar():
    """A loop of rigid bodies that falls."""
    a, b, c, d = (0.0, 0.0), (0.0, 0.3), (0.5, 0.4), (0.5, 0.0)
    bodies = [link("one", (0, 0.15), a, b), link("two", (0.25, 0.35), b, c), link("three", (0.5, 0.2), c, d)]
    joints = [at.Pin("one.a"), at.Pin("one.b", "two.a"), at.Pin("two.b", "three.a"), at.Pin("three.b")]
    return at.Scene("four-bar", bodies, joints, gravity=(4.0, -9.81))


def driven_weld():
    """A drive turns a rigid arm about another one that swings, with a damped spring at its end."""
    bodies = [link("one", (0.2, 0), (0, 0), (0.4, 0)), link("two", (0.6, 0), (0.4, 0), (0.8, 0))]
    weld = at.Weld("one.b", "two.a", angle=at.Quintic(pi / 2, 0.2))
    spring = at.Spring("two.b", (0.8, -0.5), stiffness=30.0, damping=0.5)
    return at.Scene("driven weld", bodies, [at.Pin("one.a"), weld], gravity=GRAVITY, connectors=[spring])


def pulled_beam():
    """A drive pulls one end of a soft beam along the ground; a weld at the other leaves the stretch free."""
    bodies = [
        at.Beam("one", (0, 0), (0.3, 0), ROD, SOFT),
        at.Beam("two", (0.3, 0), (0.6, 0), ROD, SOFT),
    ]
    guide = at.Slider("one.start", (1.0, 0.5), position=at.Quintic(0.1, 0.2))
    return at.Scene("pulled", bodies, [guide, at.Weld("one.end", "two.start", stretch="free")])


def carried_plate():
    """A plate on the end of a soft beam that a drive turns while its stretch is free."""
    beam = at.Beam("beam", (0, 0), (0.3, 0), ROD, SOFT)
    plate = at.RigidBody("plate", mass=0.2, inertia=1e-3, center=(0.35, 0.02), points={"a": (0.3, 0)})
    joints = [
        at.Clamp("beam.start", angle=at.Quintic(1.0, 0.2), stretch="free"),
        at.Weld("beam.end", "plate.a"),
    ]
    return at.Scene("carried", [beam, plate], joints, gravity=GRAVITY)


#: Scenes, places that are looked at, and the longest of three steps, s.
SCENES = {
    "four-bar": (four_bar, ("two.center", "two.b"), 1e-2),
    "bead": (bead, ("bead.center",), 1e-2),
    "driven weld": (driven_weld, ("two.b",), 1e-2),
    "pulled": (pulled_beam, ("one.start", "two.end"), 2e-3),
    "carried": (carried_plate, ("plate.center", "beam.end"), 2e-3),
}


def motion(found, places):
    return np.concatenate([found.position(place) for place in places], axis=1)


def run(name, **options):
    scene = SCENES[name][0]()
    return at.solve(scene, t_end=0.2, output_dt=0.02, **({"mesh": 1} if scene.beams else {}) | options)


@cache
def fixed(name, divisor, **options):
    """A run with the longest step, or a part of it, which several tests look at."""
    return run(name, dt=SCENES[name][2] / divisor, newton_tolerance=1e-15, **options)


@pytest.mark.parametrize("name", SCENES)
def test_their_order_is_four_and_their_limit_that_of_steps_of_second_order(name):
    places = SCENES[name][1]
    found = [fixed(name, k, integrator="esdirk") for k in (1, 2, 4)]
    assert {each.status.code for each in found} == {"ok"}
    four, two, one = (motion(each, places) for each in found)
    assert np.log2(np.abs(four - two).max() / np.abs(two - one).max()) == pytest.approx(4.0, abs=0.5)
    second = {"integrator": "generalized-alpha", "spectral_radius": 1.0}
    coarse, fine = (motion(fixed(name, k, **second), places) for k in (2, 4))
    off = np.abs(fine + (fine - coarse) / 3.0 - one).max()
    assert 1e-13 < off < 0.1 * np.abs(fine - one).max()  # as far as the extrapolation is exact


@pytest.mark.parametrize("name", SCENES)
def test_drives_and_forces_do_the_work_that_energies_show(name):
    found = [fixed(name, k, integrator="esdirk") for k in (1, 2, 4)]
    lost = [np.abs(each.energy.balance).max() for each in found]
    size = max(np.abs(found[-1].energy.kinetic).max(), np.abs(found[-1].energy.work).max())
    assert lost[2] < 1e-5 * size
    assert lost[2] < lost[0] / 64.0 + 1e-13 * size


@pytest.mark.parametrize("tolerance", [None, 1e-3])
def test_joints_stay_closed_to_rounding(tolerance):
    """Kept as accelerations alone, positions would leave each other by the error of the steps."""
    scene = four_bar()
    steps = {"dt": 2e-2} if tolerance is None else {"tolerance": tolerance}
    found = at.solve(scene, integrator="esdirk", t_end=1.0, output_dt=0.02, **steps)
    assert found.status.ok
    for one, two in (("one.b", "two.a"), ("two.b", "three.a")):
        assert np.abs(found.position(one) - found.position(two)).max() < 1e-13
    for place in ("one.a", "three.b"):
        assert np.abs(found.displacement(place)).max() < 1e-13
    arm = found.position("one.b") - found.position("one.a")
    assert np.abs(np.hypot(*arm.T) - 0.3).max() < 1e-13


def test_a_floating_pair_keeps_its_momenta():
    one = at.RigidBody("one", 1.0, 0.02, (0, 0), {"a": (0.2, 0)}, velocity=(0.3, -0.1), spin=4.0)
    two = at.RigidBody("two", 0.5, 0.01, (0.4, 0.1), {"a": (0.2, 0)}, velocity=(-0.1, 1.5), spin=4.0)
    scene = at.Scene("pair", [one, two], [at.Pin("one.a", "two.a")])
    found = at.solve(scene, integrator="esdirk", dt=5e-3, t_end=0.5, output_dt=0.05)
    momenta = []
    for body in (one, two):
        v = found.velocity(f"{body.name}.center")
        momenta.append(body.mass * v)
    total = sum(momenta)
    assert np.abs(total - total[0]).max() < 1e-12
    assert np.abs(found.energy.balance).max() < 1e-6 * found.energy.kinetic.max()


@pytest.mark.slow
def test_andrews_squeezer_comes_to_its_published_angles():
    scene, errors = andrews_squeezer(), []
    for steps in (240, 480, 960):
        found = at.solve(scene, integrator="esdirk", dt=0.03 / steps, t_end=0.03, newton_tolerance=1e-15)
        turns = {body.name: found.angle(f"{body.name}.center") for body in scene.bodies}
        angles = angles_of(turns)
        errors.append(max(abs(float(angles[name][-1]) - value) for name, value in PUBLISHED.items()))
    assert errors[-1] < 1e-7
    assert all(two < one for one, two in pairwise(errors))
    assert errors[0] / errors[-1] > 4.0**2
