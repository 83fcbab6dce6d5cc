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


def pendulum(**body):
    """A rigid body that swings about a pin."""
    fields = {"mass": 2.0, "inertia": 0.05, "center": (0.0, -0.4), "points": {"pin": (0.0, 0.0)}}
    hanging = at.RigidBody("bob", **(fields | body))
    return at.Scene("pendulum", [hanging], [at.Pin("bob.pin")], gravity=(0, -G))


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


def test_two_masses_and_two_springs():
    masses = [at.PointMass(n, mass=m, position=(x, 0)) for n, m, x in (("a", 2.0, 0.3), ("b", 0.5, 0.8))]
    springs = [
        at.Spring("a.center", (0, 0), stiffness=100.0),
        at.Spring("a.center", "b.center", stiffness=40.0),
    ]
    guides = [at.Slider("a.center", (1, 0)), at.Slider("b.center", (1, 0))]
    found = at.modes(at.Scene("two masses", masses, guides, connectors=springs))
    exact = np.sort(np.linalg.eigvals(np.array([[140.0, -40.0], [-40.0, 40.0]]) / [[2.0], [0.5]]))
    np.testing.assert_allclose((2 * pi * found.frequencies) ** 2, exact, rtol=1e-10)
    a, b = found.displacement("a.center")[:, 0], found.displacement("b.center")[:, 0]
    assert (a[0] / b[0]).real > 0.0 > (a[1] / b[1]).real
    np.testing.assert_allclose(found.damping, 0.0)


@pytest.mark.parametrize("damping", [0.5, 2.0, 40.0])
def test_dampers_of_springs(damping):
    """Under the critical damping and over it."""
    mass, guide = slide(0.5)
    spring = at.Spring("mass.center", (0, 0), stiffness=50.0, damping=damping)
    found = at.modes(at.Scene("damped", [mass], [guide], connectors=[spring]))
    omega, ratio = sqrt(50.0 / 0.5), damping / (2 * sqrt(50.0 * 0.5))
    if ratio < 1.0:
        assert found.damping[0] == pytest.approx(ratio, rel=1e-8)
        assert 2 * pi * found.frequencies[0] == pytest.approx(omega * sqrt(1 - ratio**2), rel=1e-8)
    else:
        assert found.frequencies[0] == 0.0
        assert found.damping[0] == pytest.approx(1.0)


def test_a_law_is_linearised():
    mass, guide = slide(0.5)
    spring = at.Spring("mass.center", (0, 0), law=law)
    found = at.modes(at.Scene("law", [mass], [guide], connectors=[spring]))
    omega, ratio = sqrt(50.0 / 0.5), 0.8 / (2 * sqrt(50.0 * 0.5))
    assert found.damping[0] == pytest.approx(ratio, rel=1e-6)
    assert 2 * pi * found.frequencies[0] == pytest.approx(omega * sqrt(1 - ratio**2), rel=1e-6)


def law(x, v, t):
    return 50.0 * x + 300.0 * x**3 + 0.8 * v


def thick(x, v, t):
    """A damper that resists only where its spring is pulled out, the more the later."""
    return 50.0 * x + 60.0 * x**2 * v * (1.0 + t)


@pytest.mark.parametrize("time", [None, 6.0], ids=["equilibrium", "motion"])
def test_a_law_damps_as_it_does_in_the_configuration(time):
    mass, guide = slide(0.5)
    spring = at.Spring("mass.center", (0, 0), law=thick)
    scene = at.Scene("law", [mass], [guide], [at.Force("mass.center", (5.0, 0.0))], connectors=[spring])
    rest = at.solve_static(scene) if time is None else at.solve(scene, dt=4e-3, t_end=time)
    found = at.modes(scene, about=rest)
    stretch = rest.position("mass.center")[-1, 0] - 1.0
    assert stretch == pytest.approx(0.1, rel=1e-3)
    omega = sqrt(50.0 / 0.5)
    ratio = 60.0 * stretch**2 * (1.0 + (time or 0.0)) / (2.0 * sqrt(50.0 * 0.5))
    assert found.damping[0] == pytest.approx(ratio, rel=1e-5)
    assert 2 * pi * found.frequencies[0] == pytest.approx(omega * sqrt(1 - ratio**2), rel=1e-3)


@pytest.mark.parametrize("moved", [True, False], ids=["motion", "equilibrium"])
def test_a_law_of_an_angle_damps_as_at_its_whole_angle(moved):
    wheel = at.RigidBody("wheel", mass=1.0, inertia=0.02, center=(0.0, 0.0), points={"rim": (0.3, 0.0)})
    spring = at.RotationalSpring("wheel.center", law=thicker)
    torque = at.Torque("wheel.center", thicker(8.0, 0.0, 0.0))
    scene = at.Scene("wound", [wheel], [at.Pin("wheel.center")], [torque], connectors=[spring])
    rest = at.solve(scene, dt=4e-3, t_end=4.0) if moved else at.solve_static(scene)
    assert rest.status.ok
    assert at.modes(scene, about=rest).growth_rates[0] == pytest.approx(-0.05 * 8.0 / (2 * 0.02), rel=1e-5)


def test_a_run_that_has_failed_has_no_modes():
    wheel = at.RigidBody("wheel", mass=1.0, inertia=0.02, center=(0.0, 0.0), points={"rim": (0.3, 0.0)})
    spring = at.RotationalSpring("wheel.center", law=thicker)
    torque = at.Torque("wheel.center", 40.0)
    scene = at.Scene("wound", [wheel], [at.Pin("wheel.center")], [torque], connectors=[spring])
    lost = at.solve(scene, dt=1e-2, t_end=1.0)
    assert lost.status == "diverged"
    with pytest.raises(
        DiscretisationError, match=r"about is a run that ended with 'diverged'.*a complete run"
    ):
        at.modes(scene, about=lost)


def thicker(angle, rate, t):
    return 5.0 * angle + 0.05 * angle * rate


def test_a_rigid_pendulum_about_its_equilibrium():
    scene = pendulum()
    exact = sqrt(2.0 * G * 0.4 / (0.05 + 2.0 * 0.16))
    found = at.modes(scene, about=at.solve_static(scene))
    assert len(found.frequencies) == 1
    assert 2 * pi * found.frequencies[0] == pytest.approx(exact, rel=1e-9)
    assert at.modes(scene).frequencies[0] == pytest.approx(0.0, abs=1e-4)  # without gravity
    held = at.Scene(
        "held", scene.bodies, scene.joints, connectors=[at.RotationalSpring("bob.pin", stiffness=3.0)]
    )
    assert 2 * pi * at.modes(held).frequencies[0] == pytest.approx(sqrt(3.0 / (0.05 + 0.32)), rel=1e-9)


def test_an_upright_pendulum_leaves():
    scene = pendulum(center=(0.0, 0.4))
    found = at.modes(scene, about=at.solve_static(scene))
    assert found.frequencies[0] == 0.0
    assert found.damping[0] == -1.0


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


def test_a_guided_end():
    """Clamped, and guided across by a prismatic joint, with and without a rigid plate at the end."""
    exact = unit() * brentq(lambda b: tan(b) + tanh(b), 1.8, 3.0) ** 2
    beam = bar("beam", (0, 0), (0.6, 0.8))
    guided = at.Scene("guided", [beam], [at.Clamp("beam.start"), at.Prismatic("beam.end", (-0.8, 0.6))])
    assert 2 * pi * at.modes(guided, mesh=24, count=1).frequencies[0] == pytest.approx(exact, rel=1e-6)
    plate = at.RigidBody("plate", mass=1e-9, inertia=1e-9, center=(0.6, 0.8))
    joints = [
        at.Clamp("beam.start"),
        at.Weld("beam.end", "plate.center"),
        at.Prismatic("plate.center", (-0.8, 0.6)),
    ]
    heavy = at.Scene("plate", [beam, plate], joints)
    assert 2 * pi * at.modes(heavy, mesh=24, count=1).frequencies[0] == pytest.approx(exact, rel=1e-5)


def test_a_portal_with_a_slider_vibrates_as_in_a_run():
    """Columns and a girder that carries a rigid box on a spring: the lowest frequency is that of a small motion."""
    soft = at.Material(E=5e7, density=1000.0)
    section = at.Rectangle(0.02, 0.02)
    bodies = [
        at.Beam("left", (0, 0), (0, 0.5), section, soft),
        at.Beam("girder", (0, 0.5), (0.6, 0.5), section, soft),
        at.RigidBody("box", mass=0.3, inertia=1e-3, center=(0.6, 0.5), points={"hook": (0.65, 0.5)}),
    ]
    joints = [at.Clamp("left.start"), at.Weld("left.end", "girder.start"), at.Pin("girder.end", "box.center"),
              at.Slider("box.center", (1, 0))]  # fmt: skip
    springs = [
        at.Spring("box.hook", (1.0, 0.5), stiffness=30.0),
        at.RotationalSpring("box.center", stiffness=2.0),
    ]
    scene = at.Scene("portal", bodies, joints, connectors=springs)
    found = at.modes(scene, mesh=4, count=4)
    pushed = at.Scene("portal", bodies, joints, [at.Force("box.center", (1e-3, 0.0))], connectors=springs)
    f = found.frequencies[0]
    run = at.solve(
        scene, mesh=4, dt=1e-3, t_end=round(6.0 / f, 3), start=at.solve_static(pushed, mesh=4),
        integrator=at.GeneralizedAlpha(spectral_radius=1.0),
    )  # fmt: skip
    x = run.position("box.center")[:, 0] - 0.6
    phases = 2 * pi * np.outer(run.t, found.frequencies)
    table = np.concatenate([np.cos(phases), np.sin(phases)], axis=1)
    left = x - table @ np.linalg.lstsq(table, x, rcond=None)[0]
    assert float(np.abs(left).max()) < 0.01 * float(np.abs(x).max())


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


def test_a_campbell_diagram_of_a_blade():
    """Wright et al. 1982: λ² = flap² − γ² in the plane."""
    gamma, flap = np.array([0.0, 1.0, 2.0, 5.0, 10.0]), np.array([3.5160, 3.6817, 4.1373, 6.4495, 11.2023])
    blade = at.Scene("blade", [bar("blade", (0, 0), (0.6, 0.8))], [at.Clamp("blade.start")])
    found = at.campbell(blade, unit() * gamma[::-1], mesh=24, count=3)
    np.testing.assert_allclose(
        2 * pi * found.frequencies[:, 0] / unit(), np.sqrt(flap**2 - gamma**2), rtol=1e-4
    )
    assert found.frequencies.shape == found.damping.shape == (5, 3)
    (speed, frequency), *_ = found.resonances(1)
    assert unit() * 2.0 < speed < unit() * 5.0
    assert frequency == pytest.approx(speed / (2 * pi))
    assert found.resonances(1) == found.resonances()
    assert "rad/s" in repr(found)
    figure = found.plot()
    assert [line.get_label() for line in figure.axes[0].lines[:3]] == ["mode 1", "mode 2", "mode 3"]
    grown = at.campbell(lambda speed: blade, unit() * gamma, mesh=24, count=3)
    np.testing.assert_allclose(grown.frequencies, found.frequencies)


def test_what_cannot_be_asked_of_a_campbell_diagram():
    blade = at.Scene("blade", [bar("blade", (0, 0), (1, 0))], [at.Clamp("blade.start")])
    for speeds, words in [
        ([], "speeds are 0"),
        ("fast", "speeds is 'fast'"),
        ([float("nan")], "a speed"),
        (3.0, "list"),
    ]:
        with pytest.raises(DiscretisationError, match=words):
            at.campbell(blade, speeds, mesh=2)
    with pytest.raises(DiscretisationError, match="raises ZeroDivisionError"):
        at.campbell(lambda speed: 1 / 0, [1.0], mesh=2)
    with pytest.raises(DiscretisationError, match="order"):
        at.campbell(blade, [0.0], mesh=2, count=2).resonances(0)
    sprung = at.Scene(
        "sprung", blade.bodies, blade.joints, connectors=[at.Spring("blade.end", (1, 1), stiffness=1.0)]
    )
    with pytest.raises(DiscretisationError, match="stands still"):
        at.campbell(sprung, [1.0], mesh=2)


def test_shapes_are_drawn_and_move(tmp_path):
    scene = pendulum()
    mass, guide = slide(0.5)
    arm = bar("arm", (0, 0.5), (1, 0.5))
    every = at.Scene(
        "every", [*scene.bodies, mass, arm], [*scene.joints, guide, at.Clamp("arm.start")],
        connectors=[at.Spring("mass.center", "bob.center", stiffness=20.0)],
    )  # fmt: skip
    found = at.modes(every, mesh=2, count=3)
    figure = found.plot()
    assert [axes.get_title() for axes in figure.axes[:3]] == [
        f"{k + 1}: {f:.4g} Hz" for k, f in enumerate(found.frequencies)
    ]
    motion = found.motion(3, amplitude=0.2)
    assert max(np.abs(motion.displacement(p)).max() for p in ("arm.end", "bob.center", "mass.center")) <= 0.41
    assert motion.t[-1] == pytest.approx(1.0 / found.frequencies[2])
    np.testing.assert_allclose(motion.position("arm.end")[0], motion.position("arm.end")[-1], atol=1e-12)
    assert found.animate(tmp_path / "mode.gif", mode=3).stat().st_size > 1000
    with pytest.raises(DiscretisationError, match="mode is 9"):
        found.motion(9)
    with pytest.raises(DiscretisationError, match="amplitude"):
        found.motion(1, amplitude=-1.0)


def test_long_chains_of_mechanisms():
    """A rope of many elements with a box at its end hangs as a pendulum; nothing global is assembled."""
    rope = at.Beam("rope", (0, 0), (0, -10.0), at.Circle(0.01), at.Material(E=1e7, density=1000.0))
    box = at.RigidBody("box", mass=5.0, inertia=0.1, center=(0, -10.2), points={"top": (0, -10.0)})
    scene = at.Scene(
        "rope", [rope, box], [at.Pin("rope.start"), at.Pin("rope.end", "box.top")], gravity=(0, -G)
    )
    frequencies = []
    for mesh in (64, 256, 2048):
        rest = at.solve_static(scene, mesh=mesh)
        frequencies.append(at.modes(scene, mesh=mesh, count=2, about=rest).frequencies)
    np.testing.assert_allclose(frequencies[1:], [frequencies[0]] * 2, rtol=1e-3)
    assert 2 * pi * frequencies[0][0] == pytest.approx(sqrt(G / 10.6), rel=0.05)


def test_about_an_equilibrium_that_was_not_found_there_are_no_modes():
    fallen = at.Scene("fallen", [at.PointMass("m", 1.0, (0.0, 0.0))], gravity=(0.0, -G))
    with pytest.raises(DiscretisationError, match="about ended at 0 of the load"):
        at.modes(fallen, about=at.solve_static(fallen))


def test_meshes_that_rounding_spoils_are_refused():
    """The stiffness of an element grows as its length to the power of −4 beside that of the lowest mode."""
    beam = at.Scene("beam", [bar("beam", (0, 0), (1, 0))], [at.Clamp("beam.start")])
    assert 2 * pi * at.modes(beam, mesh=1000, count=1).frequencies[0] == pytest.approx(
        3.5160 * unit(), rel=1e-3
    )
    with pytest.raises(at.errors.SolverError, match="no digit of the lowest modes"):
        at.modes(beam, mesh=100_000, count=1)


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
