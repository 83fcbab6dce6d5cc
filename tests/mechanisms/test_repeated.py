"""Which constraints repeat others: those alone are passed over, and what nearly does so is refused."""

from math import cos, sin

import numpy as np
import pytest

import anctmm as at
from anctmm.model.drives import Quintic

G = (0.0, -9.81)


def bar(name, one, two, mass=1.0, inertia=0.1, **motion):
    center = (0.5 * (one[0] + two[0]), 0.5 * (one[1] + two[1]))
    return at.RigidBody(name, mass, inertia, center, {"a": one, "b": two}, **motion)


def corners(count):
    """Places of a chain that winds."""
    steps = [(cos(0.7 * sin(1.3 * k)), sin(0.7 * sin(1.3 * k))) for k in range(count)]
    return [(0.0, 0.0), *map(tuple, np.cumsum(steps, axis=0).tolist())]


def linkage(bars, ground):
    """Bars that pins join where their ends are at one place, some of them at the ground."""
    ends = {}
    for body in bars:
        for point, place in body.points.items():
            ends.setdefault(place, []).append(f"{body.name}.{point}")
    pins = [
        at.Pin(*names, grounded=place in ground) if len(names) > 1 else at.Pin(*names)
        for place, names in ends.items()
        if len(names) > 1 or place in ground
    ]
    return at.Scene("linkage", bars, pins, gravity=G)


def with_knee(links, where, off):
    """A chain that swings between supports, and two bars with a knee off their line at one of its places."""
    places = corners(links)
    one, two = places[where], (places[where][0] + 0.3, places[where][1] + 2.0)
    knee = (0.55 * one[0] + 0.45 * two[0] - 2.0 * off, 0.55 * one[1] + 0.45 * two[1] + 0.3 * off)
    bars = [bar(f"link{k}", *places[k : k + 2]) for k in range(links)]
    return linkage([*bars, bar("p", one, knee), bar("q", knee, two)], {places[0], places[-1], one, two})


@pytest.mark.parametrize("links", [2, 60])
@pytest.mark.parametrize("off", [1e-4, 3e-6, 1e-8])
@pytest.mark.parametrize(("integrator", "dt"), [("zhai", 1e-4), ("generalized-alpha", 1e-3)])
def test_bars_that_are_nearly_straight_hold(links, off, integrator, dt):
    """What cannot move must not fall with the status ok; rows kept to rounding leave the root of it across them."""
    scene = with_knee(links, links // 2, off)
    found = at.solve(scene, mesh=1, integrator=integrator, dt=dt, t_end=10 * dt, newton_tolerance=1e-12)
    assert not found.status.ok or np.abs(found.displacement("p.b")).max() < 1e-6
    assert links == 2 or np.abs(found.displacement("link5.b")).max() > 1e-6


def driven(mass):
    """A four-bar whose crank has a mass, is driven, and moves bars of 1 kg."""
    places = [(0.0, 0.0), (0.0, 0.5), (1.0, 0.7), (1.0, 0.0)]
    bars = [bar("c", *places[:2], mass, 0.1 * mass), bar("k", *places[1:3]), bar("r", *places[2:])]
    joints = [at.Clamp("c.a", Quintic(1.0, 1.0)), at.Pin("c.b", "k.a"), at.Pin("k.b", "r.a"), at.Pin("r.b")]
    return at.Scene("four-bar", bars, joints, gravity=G)


RUNS = {"zhai": 1e-4, "generalized-alpha": 1e-3, "esdirk": 1e-3}


@pytest.mark.parametrize("mass", [1e-6, 1e-9, 1e-11])
@pytest.mark.parametrize("integrator", RUNS)
def test_a_light_crank_drives_heavy_bars(mass, integrator):
    """Of 1e-9 of their mass it left less than 1e-9 of its own pin's pivot, and bars parted from it: `failed`."""
    steps = {"mesh": 1, "integrator": integrator, "dt": RUNS[integrator], "t_end": 50 * RUNS[integrator]}
    light, heavy = at.solve(driven(mass), **steps), at.solve(driven(1.0), **steps)
    assert light.status.ok
    assert np.abs(light.displacement("k.b") - heavy.displacement("k.b")).max() < 1e-9


@pytest.mark.parametrize("inertia", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("off", [1e-3, 1e-4])
@pytest.mark.parametrize("integrator", RUNS)
def test_a_knee_does_not_move_whatever_its_inertia(off, inertia, integrator):
    """With large inertia, or a small one in explicit steps, what cannot move fell, with the status ok."""
    one, knee, two = (0.0, 0.0), (0.7, off), (1.5, 0.0)
    bars = [bar("p", one, knee, 1.0, inertia), bar("q", knee, two, 1.0, inertia)]
    steps = {"mesh": 1, "integrator": integrator, "dt": RUNS[integrator], "t_end": 20 * RUNS[integrator]}
    found = at.solve(linkage(bars, {one, two}), **steps)
    assert found.status.ok
    assert np.abs(found.displacement("p.b")).max() < 1e-10


def parallelogram(angle, count):
    """Cranks of 1 m that turn with 1 rad/s and carry a coupler, without loads: angle + t."""
    c, s = cos(angle), sin(angle)
    feet = [(0.0, 0.0), (1.5, 0.0), (0.85, 0.0)][:count]
    tops = [(x + c, s) for x, _ in feet]
    turning = {"velocity": (-0.5 * s, 0.5 * c), "spin": 1.0}
    points = {f"p{k}": top for k, top in enumerate(tops)}
    coupler = at.RigidBody("k", 1.0, 0.1, (0.75 + c, s), points, velocity=(-s, c))
    bars = [bar(f"c{k}", *ends, **turning) for k, ends in enumerate(zip(feet, tops, strict=True))]
    scene = linkage([coupler, *bars], set(feet))
    return at.Scene("parallelogram", scene.bodies, scene.joints)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha", "esdirk"])
@pytest.mark.parametrize("past", [5e-6, 1.8e-5, -1.9e-5])
def test_a_parallelogram_turns_on_through_its_flat_position(count, integrator, past):
    """Three cranks stopped, or went back: errors of the iteration made what repeats others seem apart."""
    found = at.solve(parallelogram(past - 0.05, count), mesh=1, integrator=integrator, dt=1e-3, t_end=0.1)
    assert found.status.ok
    assert np.abs(found.angle("c0") - found.t).max() < 1e-4
    assert np.abs(found.angle("k")).max() < 1e-4
