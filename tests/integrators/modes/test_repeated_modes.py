"""Frequencies that several bodies share: all copies are found, whatever else is in the scene."""

import numpy as np

import anctmm as at

E = 2e11
STEEL = at.Material(E=E, density=7800.0)
THICK = at.Rectangle(0.02, 0.01)
#: First frequencies of a thin cantilever of 5 m, of four cables, Hz.
LOWEST = (0.03272067, 0.20528914)


def equal_beams(count, follower=False):
    """Thin cantilevers beside a short thick one, under a load that turns with its end or without load."""
    thin = [at.Beam(f"s{i}", (0, i + 1), (5, i + 1), at.Rectangle(0.02, 0.001), STEEL) for i in range(count)]
    bodies = [*thin, at.Beam("b", (0, 0), (0.2, 0), THICK, STEEL)]
    push = at.Force("b.end", (-E * THICK.second_moment / 0.04, 0.0), follower=True)
    clamps = [at.Clamp(f"{body.name}.start") for body in bodies]
    return at.Scene("equal beams", bodies, clamps, [push] if follower else [])


def test_every_copy_is_found_under_a_load_that_turns():
    """The stiffness is not symmetric: no count of pivots tells how many there are."""
    scene = equal_beams(60, follower=True)
    rest = at.solve_static(scene, mesh=4)
    found = at.modes(scene, mesh=4, about=rest, count=62).frequencies
    np.testing.assert_allclose(found, [LOWEST[0]] * 60 + [LOWEST[1]] * 2, rtol=1e-6)


def test_every_blade_of_a_rotor_is_found():
    """Three blades on a hub have each frequency three times, and stiffen all alike as they spin."""
    angles = 2.0 * np.pi * np.arange(3) / 3
    rays = [np.array([np.cos(a), np.sin(a)]) for a in angles]
    hub = at.RigidBody(
        "h", 5.0, 1.0, (0, 0), points={f"p{i}": tuple(0.1 * ray) for i, ray in enumerate(rays)}
    )
    blades = [
        at.Beam(f"b{i}", tuple(0.1 * ray), tuple(1.1 * ray), THICK, STEEL) for i, ray in enumerate(rays)
    ]
    welds = [at.Weld(f"h.p{i}", f"b{i}.start") for i in range(3)]
    rotor = at.Scene("rotor", [hub, *blades], [at.Clamp("h.center"), *welds])
    found = at.modes(rotor, mesh=8, count=4).frequencies
    np.testing.assert_allclose(found[:3], 8.18, rtol=1e-3)
    assert found[3] > 50.0


def test_motions_of_free_beams_are_all_found():
    """Two of five beams are free and one is on a pin: seven motions without stiffness; three beams are soft."""
    lengths, heights = (5.0, 0.2, 5.0, 5.0, 1.0), (0.01, 0.05, 0.001, 0.001, 0.05)
    sections = [at.Rectangle(0.02, height) for height in heights]
    beams = [at.Beam(f"b{i}", (0, i), (lengths[i], i), sections[i], STEEL) for i in range(5)]
    joints = [at.Clamp("b2.start"), at.Clamp("b3.start"), at.Pin("b0.start")]
    found = at.modes(at.Scene("free", beams, joints), mesh=32, count=10).frequencies
    assert (found[:7] < 1e-2).all()
    np.testing.assert_allclose(found[7:], [0.0327, 0.0327, 0.205], rtol=1e-2)
