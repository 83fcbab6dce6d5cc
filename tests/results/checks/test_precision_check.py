"""Digits that rounding takes of a motion: told far from the origin and beside bodies too stiff, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from samples import SQUARE

import anctmm as at

SOFT = at.Material(E=1e7, density=1000.0)
ROADS = {
    "fixed": {"dt": 1e-3},
    "tolerance": {"integrator": "generalized-alpha", "tolerance": 1e-3},
    "zhai": {"integrator": "zhai", "dt": 2e-4},
}


def falling(place, velocity=None):
    """A cantilever of rubber that falls, at a place (m, m)."""
    x, y = place
    body = at.Beam("bar", (x, y), (x + 1.0, y), SQUARE, SOFT, velocity)
    return at.Scene("far", [body], [at.Clamp("bar.start")], gravity=(0.0, -9.81))


def fallen(place, road):
    return at.solve(falling(place), mesh=4, t_end=0.25, output_dt=0.05, **ROADS[road])


@pytest.mark.parametrize("place", [(1e12, 0.0), (0.0, -3e12)])
@pytest.mark.parametrize("road", ROADS)
def test_a_scene_that_is_too_far_away_says_so(road, place):
    found, here = fallen(place, road), fallen((0.0, 0.0), road)
    n = len(found.t)
    assert np.abs(found.displacement("bar.end") - here.displacement("bar.end")[:n]).max() > 1e-4
    assert not found.status.ok


@pytest.mark.parametrize("far", [1e6, 1e9])
@pytest.mark.parametrize("road", ROADS)
def test_a_scene_that_has_its_digits_is_ok(road, far):
    found, here = fallen((far, 0.3 * far), road), fallen((0.0, 0.0), road)
    assert found.status.ok, found.status
    assert np.abs(found.displacement("bar.end") - here.displacement("bar.end")).max() < 1e-3


def pulled(soft, stiff, **options):
    """A soft body that is clamped, and a stiff one welded to it, pulled aside by a micronewton."""
    bodies = [
        at.Beam("soft", (0.0, 0.0), (1.0, 0.0), SQUARE, at.Material(E=soft, density=1000.0)),
        at.Beam("stiff", (1.0, 0.0), (2.0, 0.0), SQUARE, at.Material(E=stiff, density=1000.0)),
    ]
    joints = [at.Clamp("soft.start"), at.Weld("soft.end", "stiff.start")]
    scene = at.Scene("pulled", bodies, joints, [at.Force("stiff.end", (0.0, 1e-6))])
    return at.solve(scene, mesh=1, t_end=10.0, output_dt=2.5, **options)


def test_a_body_too_stiff_for_the_forces_that_act_is_told():
    """How far off a run is, rounding decides: of three that are told one at least is."""
    known = pulled(100.0, 1e8, dt=0.025)
    assert known.status.ok, known.status
    moved, away = known.displacement("stiff.end"), []
    for stiff in (3e14, 4e14, 6e14):
        found = pulled(100.0, stiff, dt=0.025)
        assert found.status == "imprecise"
        assert found.status.body == "stiff"
        assert "forces that act" in found.status.message
        away.append(np.abs(found.displacement("stiff.end") - moved).max())
    assert max(away) > 0.05 * np.abs(moved).max()


def test_steel_beside_rubber_is_ok():
    bodies = [
        at.Beam("rubber", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT),
        at.Beam("steel", (1.0, 0.0), (2.0, 0.0), SQUARE, at.Material(E=2e11, density=7850.0)),
    ]
    joints = [at.Pin("rubber.start"), at.Pin("rubber.end", "steel.start")]
    scene = at.Scene("pair", bodies, joints, [at.Force("steel.end", (0.0, 1e-3))])
    assert at.solve(scene, mesh=4, dt=1e-3, t_end=0.2).status.ok


def test_what_rests_has_no_digits_to_lose():
    held = [at.Pin("bar.start"), at.Pin("bar.end")]
    for gravity in ((0.0, 0.0), (-9.81, 0.0)):
        scene = replace(falling((0.0, 0.0)), joints=held, gravity=gravity)
        assert at.solve(scene, mesh=1, dt=1e-2, t_end=1.0).status.ok


@pytest.mark.parametrize("change", ["load", "history", "velocity"])
def test_what_leaves_an_equilibrium_by_little_is_told_still(change):
    """A load that grows by 1e-9 of itself moves nothing that positions at 1000 km show."""
    scene = falling((1e6, 0.0), (lambda s: (0.0, 1e-9 * s)) if change == "velocity" else None)
    rest = at.solve_static(scene, mesh=4)
    if change == "load":
        scene = replace(scene, gravity=(0.0, -9.81 * (1.0 + 1e-9)))
    elif change == "history":
        scene = replace(scene, loads=[at.Force("bar.end", lambda t: (0.0, 1e-9 * t))])
    found = at.solve(scene, mesh=4, start=rest, t_end=0.1, output_dt=0.05, dt=1e-3)
    assert found.status == "imprecise"
