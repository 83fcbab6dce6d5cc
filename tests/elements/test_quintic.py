"""The quintic cable in scenes: its order in space, what joints leave free, results between nodes, what is refused."""

from math import cos, pi, sin

import numpy as np
import pytest
from samples import SOFT, SQUARE

import anctmm as at
from anctmm.errors import UnsupportedError
from anctmm.model.scene import Material
from anctmm.model.sections import Circle
from anctmm.solve import solve_static
from reference import exact, global_dae
from studies.scenes import LENGTH, cantilever_tip_force

STEEL = Material(2e11, 7800.0)
WIRE = Circle(0.02)


def orders(errors):
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def rest(scene, mesh, **options):
    found = solve_static(scene, mesh=mesh, element="quintic", newton_tolerance=1e-12, **options)
    assert found.status.ok
    return found


@pytest.mark.parametrize(
    ("load", "meshes", "level"),
    [(0.5, (1, 2, 4), 1e-9), (10.0, (8, 16, 32), 5e-11)],
)
def test_the_tip_of_a_cantilever_tends_to_the_elastica_with_order_eight(load, meshes, level):
    scene = cantilever_tip_force(load).scene
    tip = exact.cantilever_static(scene, "elastica").position(1.0)
    errors = [np.linalg.norm(rest(scene, mesh).position("beam", 1.0)[-1] - tip) / LENGTH for mesh in meshes]
    assert orders(errors)[-1] > 6.0
    assert errors[-1] < level


def hanging(stretch):
    beam = at.Beam("rope", (0.0, 0.0), (0.0, -2.0), WIRE, SOFT)
    return at.Scene("hanging", [beam], [at.Clamp("rope.start", stretch=stretch)], gravity=(0.0, -9.81))


def test_a_bar_under_its_weight_is_exact_where_its_clamp_leaves_the_stretch_free():
    """u = ρ g (L x − x²/2)/E is a polynomial; a clamp that holds r_x whole holds the strain there, at first order."""
    pull, x = SOFT.density * 9.81 / SOFT.E, np.array([0.3, 1.1, 2.0])
    wanted = -x - pull * (2.0 * x - 0.5 * x**2)
    for mesh in (1, 3):
        found = rest(hanging("free"), mesh)
        places = [found.position("rope", float(s) / 2.0)[-1, 1] for s in x]
        assert places == pytest.approx(wanted, abs=1e-13)
        assert found.section_force("rope", 0.25)[-1, 0] == pytest.approx(
            SOFT.density * WIRE.area * 9.81 * 1.5
        )
    errors = [
        abs(rest(hanging("held"), mesh).position("rope", 1.0)[-1, 1] - wanted[-1]) for mesh in (2, 4, 8)
    ]
    assert orders(errors) == pytest.approx([1.0, 1.0], abs=0.2)


@pytest.mark.parametrize("supports", ["clamped-free", "pinned-pinned"])
def test_frequencies_tend_to_those_of_slender_beams_with_order_eight(supports):
    beam = at.Beam("b", (0.0, 0.0), (1.0, 0.0), WIRE, STEEL)
    joints = {
        "clamped-free": [at.Clamp("b.start", stretch="free")],
        "pinned-pinned": [at.Pin("b.start", grounded=True), at.Slider("b.end")],
    }[supports]
    bending, mass = STEEL.E * WIRE.second_moment, STEEL.density * WIRE.area
    wanted = exact.euler_bernoulli_frequencies(supports, 4, 1.0, bending, mass)
    errors = []
    for mesh in (2, 4, 8):
        found = at.modes(at.Scene("s", [beam], joints), mesh=mesh, element="quintic", count=4).frequencies
        errors.append(np.abs(2.0 * pi * found[1] / wanted[1] - 1.0))
    assert orders(errors)[-1] > 7.0
    assert errors[-1] < 1e-8


def arms(angle=0.0, first=WIRE, second=WIRE, **weld):
    """Two beams, welded at an angle, under a moment at the end."""
    end = 1.0 + cos(angle), sin(angle)
    bodies = [at.Beam("a", (0.0, 0.0), (1.0, 0.0), first, SOFT), at.Beam("c", (1.0, 0.0), end, second, SOFT)]
    joints = [at.Clamp("a.start"), at.Weld("a.end", "c.start", **weld)]
    return at.Scene("arms", bodies, joints, [at.Torque("c.end", 0.05)])


def arc(length, bent):
    return np.array([sin(length * bent), 1.0 - cos(length * bent)]) / bent


@pytest.mark.parametrize("reversed_", [False, True])
def test_curvature_jumps_at_a_weld(reversed_):
    """Two circular arcs of different curvature, M/EI each: with a common r'' the order would be two."""
    angle, thick = 0.7, Circle(0.03)
    scene = arms(angle, WIRE, thick)
    if reversed_:
        body = scene.bodies[1]
        joints = [at.Clamp("a.start"), at.Weld("a.end", "c.end")]
        other = at.Beam("c", body.end, body.start, thick, SOFT)
        scene = at.Scene("arms", [scene.bodies[0], other], joints, [at.Torque("c.start", 0.05)])
    one, two = (0.05 / (SOFT.E * s.second_moment) for s in (WIRE, thick))
    turn = angle + one
    R = np.array([[cos(turn), -sin(turn)], [sin(turn), cos(turn)]])
    wanted = arc(1.0, one) + R @ arc(1.0, two)
    tip = 0.0 if reversed_ else 1.0
    errors = [np.linalg.norm(rest(scene, mesh).position("c", tip)[-1] - wanted) for mesh in (1, 2, 4)]
    assert orders(errors)[-1] > 6.0
    assert errors[-1] < 1e-10
    found = rest(scene, 2)
    assert found.section_force("a", 0.37)[-1, 2] == pytest.approx(0.05, rel=1e-9)
    assert abs(found.section_force("c", 0.5)[-1, 2]) == pytest.approx(0.05, rel=1e-9)


def test_a_pin_leaves_everything_but_the_place_free():
    bodies = [at.Beam(name, (x, 0.0), (x + 1.0, 0.0), WIRE, SOFT) for name, x in (("a", 0.0), ("c", 1.0))]
    joints = [at.Clamp("a.start"), at.Pin("a.end", "c.start"), at.Clamp("c.end")]
    found = rest(at.Scene("s", bodies, joints, [at.Torque("a.end", 0.02)]), 2)
    free = found.fields["a"].coordinates[-1, -1, 2], found.fields["c"].coordinates[-1, 0, 2]
    assert found.section_force("a", 1.0)[-1, 2] == pytest.approx(0.02, abs=1e-12)
    assert abs(found.section_force("c", 0.0)[-1, 2]) < 1e-12
    assert np.linalg.norm(free[0]) != pytest.approx(np.linalg.norm(free[1]))


def test_quintic_and_plain_cables_are_welded_to_each_other():
    scene = arms(0.4)
    mixed = solve_static(scene, mesh=16, element={"a": "quintic", "c": "cable"}, newton_tolerance=1e-12)
    tip = rest(scene, 8).position("c", 1.0)[-1]
    assert np.abs(mixed.position("c", 1.0)[-1] - tip).max() < 1e-7


@pytest.mark.parametrize("road", [solve_static, global_dae.solve_static, at.modes])
def test_joints_between_the_ends_of_a_beam_are_refused_by_name(road):
    beam = at.Beam("b", (0.0, 0.0), (1.0, 0.0), WIRE, SOFT)
    scene = at.Scene("s", [beam], [at.Clamp("b.start"), at.Pin(("b", 0.5), grounded=True)])
    with pytest.raises(UnsupportedError, match=r"acts at .*0\.5.*'quintic'.*two beams welded"):
        road(scene, mesh=2, element="quintic")


def swung(**options):
    """A free beam that turns and bends, from its initial velocities."""
    beam = at.Beam(
        "b", (0.0, 0.0), (1.0, 0.0), SQUARE, SOFT, velocity=lambda s: (0.2, 3.0 * sin(pi * s) + 2.0 * s)
    )
    given = {"mesh": 3, "element": "quintic", "dt": 1e-3, "t_end": 0.02, "output_dt": 0.005} | options
    return at.solve(at.Scene("swung", [beam]), **given)


def test_initial_velocities_are_those_of_the_function():
    found, s = swung(), np.linspace(0.0, 1.0, 41)
    v = np.array([found.velocity("b", float(x))[0] for x in s])
    assert np.abs(v - np.stack([0.2 + 0.0 * s, 3.0 * np.sin(pi * s) + 2.0 * s], axis=1)).max() < 2e-4


def test_momentum_and_energy_of_a_free_beam_are_kept():
    found = swung(spectral_radius=1.0, newton_tolerance=1e-12)
    x, w = np.polynomial.legendre.leggauss(4)
    places = [(i + 0.5 * (1.0 + a)) / 3.0 for i in range(3) for a in x.tolist()]
    momentum = sum(b * found.velocity("b", a) for a, b in zip(places, np.tile(w, 3), strict=True))
    assert np.ptp(momentum, axis=0) == pytest.approx([0.0, 0.0], abs=1e-8)
    assert np.abs(found.energy.balance - found.energy.balance[0]).max() < 1e-2 * found.energy.kinetic[0]


def test_a_section_bears_what_the_motion_of_what_lies_beyond_needs():
    """N, Q, M at a section from the elements beyond equal those from the elements before."""
    found = swung(mesh=2)
    assert np.abs(found.section_force("b", 0.0)).max() < 1e-6 * np.abs(found.section_force("b", 0.5)).max()
    before, behind = (found.section_force("b", 0.5 + d) for d in (-1e-9, 1e-9))
    assert np.abs(before - behind).max() < 1e-6 * np.abs(before).max()
