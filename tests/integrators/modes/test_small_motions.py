"""Modes against exact and published frequencies, in any direction, of every copy, and what is refused."""

from math import pi, sqrt

import numpy as np
import pytest

import anctmm as at
from anctmm.errors import DiscretisationError, EquilibriumWarning
from anctmm.small_motions import campbell, modes
from reference.exact.frequencies import euler_bernoulli_frequencies

SLENDER, THIN, THICK = at.Rectangle(5e-3, 5e-3), at.Rectangle(1e-3, 1e-3), at.Rectangle(0.02, 0.01)
STEEL = at.Material(E=2e11, density=7800.0)
JOINTS = {
    "clamped-free": [at.Clamp("bar.start")],
    "pinned-pinned": [at.Pin("bar.start"), at.Pin("bar.end")],
    "free-free": [],
}


def bar(joints=(), material=STEEL, angle=0.9, section=SLENDER):
    end = (np.cos(angle), np.sin(angle))
    return at.Scene("bar", [at.Beam("bar", (0, 0), end, section, material)], joints)


@pytest.mark.parametrize("ends", JOINTS)
def test_the_first_ten_modes_of_a_bar(ends):
    """Fourth order, until rounding takes digits of the lowest one."""
    EI, mass = STEEL.E * SLENDER.second_moment, STEEL.density * SLENDER.area
    exact = euler_bernoulli_frequencies(ends, 10, 1.0, EI, mass) / (2.0 * pi)
    found = {n: modes(bar(JOINTS[ends]), mesh=n, count=13).frequencies for n in (40, 80, 280)}
    still = 3 if ends == "free-free" else 0
    assert (found[280][:still] == 0.0).all()
    errors = {n: np.abs(f[still : still + 10] / exact - 1.0) for n, f in found.items()}
    assert errors[280].max() < 2e-6
    assert errors[280][3:].max() < 1.5e-7
    assert (np.log2(errors[40][5:] / errors[80][5:]) > 3.8).all()


@pytest.mark.parametrize("angle", [0.0, pi / 4, pi / 2, 2.5])
def test_shapes_do_not_depend_on_the_direction_of_a_scene(angle):
    """The tip of a cantilever moves farthest, by 1 m, whatever way the beam points."""
    found = modes(bar(JOINTS["clamped-free"], angle=angle), mesh=4, count=3)
    tip, across = found.displacement("bar.end"), np.array([-np.sin(angle), np.cos(angle)])
    np.testing.assert_allclose(np.linalg.norm(tip, axis=1), 1.0, rtol=1e-9)
    np.testing.assert_allclose(np.abs(tip @ across), 1.0, rtol=1e-9)
    np.testing.assert_allclose(tip.imag, 0.0, atol=1e-12)


def rotor(damping=0.0):
    """A mass on four springs in a hub."""
    hub = at.RigidBody(
        "hub", 1.0, 1.0, (0, 0), {"e": (0.2, 0), "n": (0, 0.2), "w": (-0.2, 0), "s": (0, -0.2)}
    )
    springs = [at.Spring("m.center", f"hub.{p}", stiffness=200.0, damping=damping) for p in "enws"]
    mass = at.PointMass("m", mass=0.5, position=(0, 0))
    return at.Scene("rotor", [hub, mass], [at.Clamp("hub.center")], connectors=springs)


@pytest.mark.parametrize("damping", [0.0, 3.0])
@pytest.mark.parametrize("speed", [12.0, 40.0])
def test_a_mass_on_springs_in_a_hub_that_turns(speed, damping):
    """ω0 ± Ω; with dampers roots of z̈ + (c/m + 2iΩ) ż + (ω0² − Ω²) z = 0, which grow beyond Ω = ω0."""
    found, own = modes(rotor(damping), spin=speed), sqrt(800.0)
    roots = np.roots([1.0, 4.0 * damping + 2j * speed, own**2 - speed**2])
    rates = found.growth_rates + 2j * pi * found.frequencies
    exact = np.where(roots.imag < 0.0, roots.conj(), roots)
    for rate in rates:
        assert np.abs(exact - rate).min() < 1e-7 * own
    assert found.unstable.any() == (damping > 0.0 and speed > own)
    if not damping:
        np.testing.assert_allclose(2 * pi * np.sort(found.frequencies), [abs(own - speed), own + speed])
        size = np.abs(found.displacement("m.center"))  # whirls in circles of 1 m
        np.testing.assert_allclose(size, 1.0, rtol=1e-6)


@pytest.mark.parametrize("gamma", [0.0, 2.0, 10.0])
def test_a_spinning_blade_has_the_published_lag_frequency(gamma):
    """Wright, Smith, Thresher & Wang 1982: flap at the dimensionless speed γ; in the plane λ² = flap² − γ²."""
    flap = {0.0: 3.5160, 2.0: 4.1373, 10.0: 11.2023}[gamma]
    unit = sqrt(STEEL.E * THIN.second_moment / (STEEL.density * THIN.area))
    found = modes(bar(JOINTS["clamped-free"], section=THIN), mesh=24, count=1, spin=gamma * unit)
    assert 2.0 * pi * found.frequencies[0] / unit == pytest.approx(sqrt(flap**2 - gamma**2), rel=1e-4)
    assert found.damping[0] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("ends", ["clamped-free", "free-free"])
@pytest.mark.parametrize("mesh", [6, 160])
def test_a_damped_bar(ends, mesh):
    """Each oscillator has the damping τω/2; 160 cables have more unknowns than dense matrices are made of."""
    tau = 2e-4
    free = modes(bar(JOINTS[ends]), mesh=mesh, count=6)
    found = modes(bar(JOINTS[ends], at.Material(2e11, 7800.0, damping=tau)), mesh=mesh, count=6)
    moving = free.frequencies > 1.0
    ratio = pi * tau * free.frequencies[moving]
    np.testing.assert_allclose(found.damping[moving], ratio, rtol=1e-5)
    exact = free.frequencies[moving] * np.sqrt(1.0 - ratio**2)
    np.testing.assert_allclose(found.frequencies[moving], exact, rtol=1e-5)
    assert (found.growth_rates[~moving] == 0.0).all()


@pytest.mark.parametrize("damping", [0.5, 40.0])
def test_dampers_of_springs(damping):
    """Under the critical damping and over it, with both rates."""
    mass = at.PointMass("mass", mass=0.5, position=(1.0, 0.0))
    spring = at.Spring("mass.center", (0, 0), stiffness=50.0, damping=damping)
    scene = at.Scene("damped", [mass], [at.Slider("mass.center", (1, 0))], connectors=[spring])
    roots = np.roots([0.5, damping, 50.0])
    exact = roots[roots.imag >= 0.0]
    exact = exact[np.argsort(np.abs(exact))]
    found = modes(scene, count=len(exact))
    np.testing.assert_allclose(found.growth_rates + 2j * pi * found.frequencies, exact, rtol=1e-8)


@pytest.mark.parametrize(("mesh", "number", "count"), [(4, 3, 4), (4, 8, 10), (40, 3, 4)])
def test_every_copy_of_a_frequency_is_found(mesh, number, count):
    """Thin cantilevers of 5 m beside a short thick one; with 40 cables each they are many unknowns."""
    thin = at.Rectangle(0.02, 0.001)
    beams = [at.Beam(f"s{i}", (0, i + 1), (5, i + 1), thin, STEEL) for i in range(number)]
    beams.append(at.Beam("b", (0, 0), (0.2, 0), THICK, STEEL))
    scene = at.Scene("equal", beams, [at.Clamp(f"{body.name}.start") for body in beams])
    found = modes(scene, mesh=mesh, count=count).frequencies
    exact = np.sort(np.tile([0.03272067, 0.20528914], number))[:count]
    np.testing.assert_allclose(found[: len(exact)], exact, rtol=2e-3)


@pytest.mark.parametrize("cranks", [2, 5])
def test_cranks_that_repeat_each_other_hide_no_mode(cranks):
    """A platform on parallel cranks without mass, and a spring: ω² = k/m, whatever the number of cranks."""
    ends = {f"p{n}": (float(n), 1.0) for n in range(cranks)}
    bodies = [at.RigidBody("platform", 2.0, 0.1, (1.0, 1.0), ends)]
    joints = []
    for n in range(cranks):
        points = {"a": (float(n), 0.0), "b": (float(n), 1.0)}
        bodies.append(at.RigidBody(f"c{n}", 1e-6, 1e-9, (float(n), 0.5), points))
        joints += [at.Pin(f"c{n}.a"), at.Pin(f"c{n}.b", f"platform.p{n}")]
    spring = at.Spring("platform.p0", (-3.0, 1.0), stiffness=50.0)
    found = modes(at.Scene("parallel", bodies, joints, connectors=[spring]))
    np.testing.assert_allclose(2.0 * pi * found.frequencies, [5.0], rtol=1e-5)


def pendulum(angle):
    """A rod at a pin, let go at an angle; and the last output of a motion of it."""
    center = (0.5 * np.sin(angle), -0.5 * np.cos(angle))
    rod = at.RigidBody("rod", 1.0, 1.0 / 12.0, center, {"pin": (0.0, 0.0)})
    scene = at.Scene("pendulum", [rod], [at.Pin("rod.pin")], gravity=(0.0, -9.81))
    return scene, at.solve(scene, dt=1e-2, t_end=0.1)


def test_about_motions_forces_of_constraints_stiffen():
    """A pendulum held at an angle has √cos φ of its frequency, and is no equilibrium; upside down it leaves."""
    scene, motion = pendulum(0.5)
    with pytest.warns(EquilibriumWarning, match=r"'pendulum' are about is no equilibrium.*about 0\.2\d m"):
        found = modes(scene, about=motion)
    exact = sqrt(1.5 * 9.81 * np.cos(motion.angle("rod")[-1] + 0.5))
    assert 2 * pi * found.frequencies[0] == pytest.approx(exact, rel=1e-6)
    upright = modes(pendulum(pi)[0], about=pendulum(pi)[1])
    assert upright.growth_rates[0] == pytest.approx(sqrt(1.5 * 9.81), rel=1e-6)
    assert list(upright.unstable) == [True]
    assert "unstable (divergence)" in repr(upright)
    assert modes(scene).frequencies[0] == 0.0  # without gravity


def test_next_to_an_equilibrium_and_in_free_flight_nothing_is_told():
    """Warnings are errors here."""
    scene, motion = pendulum(1e-4)
    assert 2 * pi * modes(scene, about=motion).frequencies[0] == pytest.approx(sqrt(1.5 * 9.81), rel=1e-6)
    thrown = at.Scene("thrown", bar().bodies, gravity=(0.0, -9.81))
    falling = modes(thrown, mesh=2, count=4, about=at.solve(thrown, mesh=2, dt=2e-2, t_end=0.1)).frequencies
    np.testing.assert_allclose(falling[3], modes(thrown, mesh=2, count=4).frequencies[3], rtol=1e-6)


def test_a_campbell_diagram():
    found = campbell(rotor(3.0), [40.0, 12.0])
    assert list(found.speeds) == [12.0, 40.0]
    np.testing.assert_array_equal(found.unstable, [[False, False], [True, False]])
    assert [line.endswith("unstable") for line in repr(found).splitlines()] == [False, False, True]
    labels = [line.get_label() for line in found.plot().axes[0].lines]
    assert labels.count("unstable") == 1
    (speed, frequency), *_ = campbell(rotor(), [1.0, 5.0, 10.0, 15.0, 20.0]).resonances()
    assert speed == pytest.approx(sqrt(800.0) / 2.0, rel=1e-2)
    assert frequency == pytest.approx(speed / (2.0 * pi))


def test_shapes_are_drawn_and_move(tmp_path):
    found = modes(bar(JOINTS["clamped-free"]), mesh=2, count=3)
    titles = [axes.get_title() for axes in found.plot().axes[:3]]
    assert titles == [f"{k + 1}: {f:.4g} Hz" for k, f in enumerate(found.frequencies)]
    motion = found.motion(2, amplitude=0.2)
    assert np.linalg.norm(motion.displacement("bar.end") + 0.0, axis=1).max() <= 0.4 * (1.0 + 1e-9)
    assert motion.t[-1] == pytest.approx(1.0 / found.frequencies[1])
    assert found.animate(tmp_path / "mode.gif", mode=3).stat().st_size > 1000


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"count": 0}, "count is 0"),
        ({"count": 500}, "count is 500.*has 8 free motions"),
        ({"spin": float("nan")}, "spin"),
        ({"about": 3}, "about is 3"),
        ({"element": {"bar": "rigid"}, "mesh": 1}, "nothing that can move"),
    ],
)
def test_wrong_questions_are_refused_by_name(options, words):
    with pytest.raises(DiscretisationError, match=words):
        modes(bar(JOINTS["clamped-free"]), **{"mesh": 2, **options})


def test_spins_and_speeds_that_do_not_fit_are_refused():
    blade = bar(JOINTS["clamped-free"])
    heavy = at.Scene("heavy", blade.bodies, blade.joints, gravity=(0, -9.81))
    for scene, words in [(heavy, "gravity or loads"), (bar(JOINTS["pinned-pinned"]), "held by 2 joints")]:
        with pytest.raises(DiscretisationError, match=words):
            modes(scene, mesh=2, spin=1.0)
    for speeds, words in [([], "speeds are 0"), ("fast", "speeds is 'fast'"), ([float("nan")], "a speed")]:
        with pytest.raises(DiscretisationError, match=words):
            campbell(blade, speeds, mesh=2)
