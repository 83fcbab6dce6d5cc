"""Natural modes of mechanisms: rigid bodies, point masses, guides, springs and dampers, against exact frequencies."""

from math import cos, cosh, pi, sin, sinh, sqrt, tan, tanh

import numpy as np
import pytest
from scipy.optimize import brentq

import anctmm as at
from anctmm.errors import DiscretisationError

STEEL = at.Material(E=2e11, density=7800.0)
THIN = at.Rectangle(1e-3, 1e-3)
G = 9.81


def unit(length=1.0):
    """√(EI/ρA)/L² of a thin bar, rad/s."""
    return sqrt(STEEL.E * THIN.second_moment / (STEEL.density * THIN.area)) / length**2


def bar(name, start, end, material=STEEL):
    return at.Beam(name, start, end, THIN, material)


def slide(mass, place=(1.0, 0.0), direction=(1, 0)):
    """A point mass on a line."""
    return at.PointMass("mass", mass=mass, position=place), at.Slider("mass.center", direction)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_a_cantilever_with_a_mass_at_its_tip(ratio):
    beam = bar("beam", (0, 0), (0.6, 0.8))
    mass = at.PointMass("tip", mass=ratio * STEEL.density * THIN.area, position=(0.6, 0.8))
    scene = at.Scene("tip mass", [beam, mass], [at.Clamp("beam.start"), at.Pin("beam.end", "tip.center")])
    found = at.modes(scene, mesh=32, count=4).frequencies

    def equation(b):
        return 1 + cos(b) * cosh(b) + ratio * b * (cos(b) * sinh(b) - sin(b) * cosh(b))

    grid = np.linspace(0.1, 14.0, 500)
    values = [equation(b) for b in grid]
    between = [k for k in range(len(grid) - 1) if values[k] * values[k + 1] < 0]
    roots = [brentq(equation, grid[k], grid[k + 1]) for k in between]
    np.testing.assert_allclose(2 * pi * found, unit() * np.square(roots[:4]), rtol=1e-5)


def test_a_law_is_linearised():
    mass, guide = slide(0.5)
    spring = at.Spring("mass.center", (0, 0), law=law)
    found = at.modes(at.Scene("law", [mass], [guide], connectors=[spring]))
    omega, ratio = sqrt(50.0 / 0.5), 0.8 / (2 * sqrt(50.0 * 0.5))
    assert found.damping[0] == pytest.approx(ratio, rel=1e-6)
    assert 2 * pi * found.frequencies[0] == pytest.approx(omega * sqrt(1 - ratio**2), rel=1e-6)


def law(x, v, t):
    return 50.0 * x + 300.0 * x**3 + 0.8 * v


def test_a_run_that_has_failed_has_no_modes():
    wheel = at.RigidBody("wheel", mass=1.0, inertia=0.02, center=(0.0, 0.0), points={"rim": (0.3, 0.0)})
    spring = at.RotationalSpring("wheel.center", law=thicker)
    torque = at.Torque("wheel.center", 40.0)
    scene = at.Scene("wound", [wheel], [at.Pin("wheel.center")], [torque], connectors=[spring])
    lost = at.solve(scene, dt=1e-2, t_end=1.0)
    assert lost.status == "diverged"
    with pytest.raises(DiscretisationError, match=r"about ended with 'diverged'.*a complete run"):
        at.modes(scene, about=lost)


def thicker(angle, rate, t):
    return 5.0 * angle + 0.05 * angle * rate


def test_a_rigid_beam_on_a_rotational_spring():
    scene = at.Scene(
        "door", [bar("door", (0, 0), (0.6, 0.8))], [at.Pin("door.start")],
        connectors=[at.RotationalSpring("door.start", stiffness=0.2, damping=1e-4)],
    )  # fmt: skip
    inertia = STEEL.density * THIN.area / 3.0
    found = at.modes(scene, mesh=1, element="rigid")
    ratio = 1e-4 / (2 * sqrt(0.2 * inertia))
    assert found.damping[0] == pytest.approx(ratio, rel=1e-6)
    assert 2 * pi * found.frequencies[0] == pytest.approx(sqrt(0.2 / inertia) * sqrt(1 - ratio**2), rel=1e-8)
    stiff = at.modes(scene, mesh=8, element="cable", count=1)
    assert stiff.frequencies[0] < found.frequencies[0]


def test_a_y_frame_turns_its_joint():
    """Three equal legs, clamped outside: in one mode the joint turns, and each leg is clamped and pinned."""
    ends = [(cos(a), sin(a)) for a in (0.3, 0.3 + 2 * pi / 3, 0.3 + 4 * pi / 3)]
    legs = [bar(f"leg{k}", (0, 0), end) for k, end in enumerate(ends)]
    joints = [at.Weld("leg0.start", "leg1.start", "leg2.start"), *(at.Clamp(f"leg{k}.end") for k in range(3))]
    found = at.modes(at.Scene("y", legs, joints), mesh=24, count=6).frequencies
    exact = unit() * brentq(lambda b: tan(b) - tanh(b), 3.5, 4.5) ** 2 / (2 * pi)
    assert np.abs(found / exact - 1.0).min() < 1e-6


def test_a_hinged_blade_lags_by_its_offset():
    """A rigid blade hinged at e from the axis: ω = Ω √(3e/2L) in the plane; a damper at the hinge damps it."""
    e, length, speed = 0.1, 0.9, 30.0
    hub, blade = bar("hub", (0, 0), (e, 0)), bar("blade", (e, 0), (e + length, 0))
    joints = [at.Clamp("hub.start"), at.Pin("hub.end", "blade.start")]
    scene = at.Scene("blade", [hub, blade], joints)
    found = at.modes(scene, mesh=1, element="rigid", spin=speed)
    exact = speed * sqrt(1.5 * e / length)
    assert 2 * pi * found.frequencies[0] == pytest.approx(exact, rel=1e-9)
    inertia = STEEL.density * THIN.area * length**3 / 3.0
    damper = at.RotationalSpring("hub.end", "blade.start", damping=1e-2)
    damped = at.Scene("blade", [hub, blade], joints, connectors=[damper])
    ratio = at.modes(damped, mesh=1, element="rigid", spin=speed).damping[0]
    assert ratio == pytest.approx(1e-2 / (2 * inertia * exact), rel=1e-6)


def test_about_an_equilibrium_that_was_not_found_there_are_no_modes():
    fallen = at.Scene("fallen", [at.PointMass("m", 1.0, (0.0, 0.0))], gravity=(0.0, -G))
    with pytest.raises(DiscretisationError, match=r"about ended with .diverged"):
        at.modes(fallen, about=at.solve_static(fallen))


def hung(length, mass, time):
    """A beam with a damped plate at its end, which a spring and a moment hold, in units of length, mass and time."""
    force = mass * length / time**2
    material = at.Material(1e8 * force / length**2, 1000.0 * mass / length**3, damping=1e-4 * time)
    square = at.Rectangle(0.01 * length, 0.01 * length)
    beam = at.Beam("beam", (0.0, 0.0), (0.8 * length, 0.3 * length), square, material)
    plate = at.RigidBody(
        "plate", 0.05 * mass, 1e-4 * mass * length**2, (0.85 * length, 0.33 * length),
        points={"a": (0.8 * length, 0.3 * length)},
    )  # fmt: skip
    spring = at.Spring("plate.center", (length, length), 5.0 * force / length, 0.01 * force * time / length)
    joints = [at.Clamp("beam.start"), at.Pin("beam.end", "plate.a")]
    loads = [at.Torque("plate.center", 0.01 * force * length)]
    return at.Scene("hung", [beam, plate], joints, loads, (0.0, -9.81 * length / time**2), [spring])


@pytest.mark.parametrize("units", [(1e-5, 1e-12, 1e-4), (1e3, 1e7, 50.0), (1e-6, 1e-3, 1.0)], ids=str)
def test_small_motions_are_the_same_in_all_units(units):
    """Of a micrometre's plate and of a kilometre's: places and directions weigh alike in the constraints."""
    frequencies, damping, places = [], [], []
    for length, mass, time in ((1.0, 1.0, 1.0), units):
        scene = hung(length, mass, time)
        rest = at.solve_static(scene, mesh=3)
        assert rest.status.ok, rest.status
        assert "rounding" not in rest.status.message
        found = at.modes(scene, mesh=3, about=rest, count=4)
        frequencies.append(found.frequencies * time)
        damping.append(found.damping)
        places.append(rest.position("plate.center")[-1] / length)
    np.testing.assert_allclose(places[1], places[0], rtol=1e-9)
    np.testing.assert_allclose(frequencies[1], frequencies[0], rtol=1e-5)
    np.testing.assert_allclose(damping[1], damping[0], rtol=1e-3)
