"""Explicit steps of linkages of beams and rigid bodies beside the global DAE, far away, and over many steps."""

from math import pi

import numpy as np
import pytest

import anctmm as at
from reference import global_dae

SECTION, MATERIAL = at.Rectangle(0.02, 0.01), at.Material(E=1e9, density=1000.0)
G = 9.81
TURN = at.Quintic(turn=2.0 * pi, duration=0.4)
DRIVEN = at.Clamp("crank.start", angle=TURN)
BETWEEN = {"crank": "cable", "coupler": "rigid", "follower": "cable"}
RIGID = {"crank": "rigid", "coupler": "cable", "follower": "rigid"}
ENDS = {
    "crank": ((0.0, 0.0), (0.2, 0.0)),
    "coupler": ((0.2, 0.0), (0.9, 0.4)),
    "follower": ((0.9, 0.4), (0.7, 0.0)),
}


def four_bar(first=DRIVEN, *more, ends=ENDS, joint=at.Pin):
    bodies = [at.Beam(name, *places, SECTION, MATERIAL) for name, places in ends.items()]
    joints = [
        first,
        joint("crank.end", "coupler.start"),
        at.Pin("coupler.end", "follower.start"),
        at.Pin("follower.end"),
    ]
    return at.Scene("four-bar", bodies, [*joints, *more], gravity=(0.0, -G))


def slider_crank(kind):
    block = [at.PointMass("block", 0.3, (0.8, 0.0))] if kind is at.Slider else []
    bodies = [
        at.RigidBody("crank", 1.0, 0.01, (0.1, 0.0), {"o": (0.0, 0.0), "e": (0.2, 0.0)}),
        at.Beam("rod", (0.2, 0.0), (0.8, 0.0), SECTION, MATERIAL),
        *block,
    ]
    joints = [at.Clamp("crank.o", angle=TURN), at.Pin("crank.e", "rod.start"), kind("rod.end")]
    joints += [at.Pin("rod.end", "block.center")] if block else []
    return at.Scene("slider-crank", bodies, joints, gravity=(0.0, -G))


def ring():
    """Four beams in a loop, no rigid body: one junction is kept, it hangs by a tail."""
    corners = [(0.0, 0.0), (0.4, 0.0), (0.4, 0.2), (0.4, 0.4)]
    bodies = [at.Beam(f"b{k}", corners[k], corners[(k + 1) % 4], SECTION, MATERIAL) for k in range(4)]
    bodies.append(at.Beam("tail", (0.4, 0.4), (0.6, 0.4), SECTION, MATERIAL))
    joints = [at.Pin(f"b{k}.end", f"b{(k + 1) % 4}.start") for k in (0, 2, 3)]
    joints += [at.Weld("b1.end", "b2.start"), at.Pin("b2.end", "tail.start"), at.Pin("tail.end")]
    return at.Scene("ring", bodies, joints, gravity=(0.0, -G))


SCENES = {
    "rigid crank and follower": (four_bar(), {"element": RIGID}),
    "welded coupler": (four_bar(joint=at.Weld), {"element": RIGID}),
    "three rigid bodies": (four_bar(), {"mesh": 1, "element": "rigid"}),
    "rigid coupler, driven beam": (four_bar(), {"element": BETWEEN}),
    "shear coupler": (four_bar(), {"element": {**RIGID, "coupler": "shear"}}),
    "fixed crank": (four_bar(at.Clamp("crank.start")), {"element": RIGID}),
    "slider-crank": (slider_crank(at.Slider), {"mesh": 3}),
    "prismatic": (slider_crank(at.Prismatic), {"mesh": 3}),
    "ring": (ring(), {}),
}  # fmt: skip


def cut(scene, element="cable", mesh=2, **options):
    """Options with so many elements of each beam, and one of each rigid one."""
    kinds = (
        element if isinstance(element, dict) else dict.fromkeys((beam.name for beam in scene.beams), element)
    )
    each = mesh if isinstance(mesh, dict) else dict.fromkeys(kinds, mesh)
    fine = {name: 1 if kind == "rigid" else each[name] for name, kind in kinds.items()}
    return {"mesh": fine or 1, "element": kinds or "cable", **options}


@pytest.mark.parametrize("name", SCENES)
def test_they_move_as_in_the_global_dae(name):
    scene, options = SCENES[name]
    steps = {"integrator": "zhai", "dt": 2e-6, "t_end": 2e-4, "output_dt": 5e-5, "check_stability": False}
    ours, dae = (solve(scene, **cut(scene, **options), **steps) for solve in (at.solve, global_dae.solve))
    assert ours.status.ok
    for body in scene.bodies:
        place = f"{body.name}.{'end' if isinstance(body, at.Beam) else 'center'}"
        assert np.abs(ours.displacement(place) - dae.displacement(place)).max() < 1e-13
    assert np.abs(ours.energy.work - dae.energy.work).max() <= 1e-6 * np.abs(dae.energy.kinetic).max()


def coupler_far_away(kind, place):
    """A rigid body that falls about a pin, and another one on a line in it."""
    x, y = place
    bodies = [
        at.RigidBody("coupler", 2.0, 0.05, (x + 0.45, y + 0.3), {"a": (x + 0.2, y + 0.1)}),
        at.RigidBody("slide", 0.5, 0.001, (x + 0.5, y + 0.4), {"a": (x + 0.5, y + 0.4)}),
    ]
    joints = [at.Pin("coupler.a"), kind("slide.a", (1, 1), body="coupler")]
    return at.Scene("far", bodies, joints, gravity=(0.0, -G))


@pytest.mark.parametrize("kind", [at.Slider, at.Prismatic])
def test_guides_in_rigid_bodies_stand_anywhere(kind):
    """Coordinates of 10 km made a guide seem to repeat other constraints: it was passed over, and the run failed."""
    options = {"t_end": 0.02, "output_dt": 0.01}
    other = at.solve(coupler_far_away(kind, (0.0, 0.0)), integrator="esdirk", dt=1e-3, **options)
    wanted = other.displacement("slide.center")
    for place in ((0.0, 0.0), (1e4, -1e4), (1e6, 2e6)):
        far = at.solve(coupler_far_away(kind, place), integrator="zhai", dt=1e-4, **options)
        assert far.status.ok, far.status
        off = np.abs(far.displacement("slide.center") - wanted).max()
        assert off < 1e-4 * np.abs(wanted).max()
