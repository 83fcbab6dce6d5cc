"""Motions that grow about unstable equilibria: rates and frequencies against exact ones, and what the user sees."""

from math import pi, sqrt

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import root

import anctmm as at
from anctmm.elements.cable import CableElement
from anctmm.errors import SolverError

G, THIN = 9.81, at.Rectangle(2e-4, 2e-4)
E, DENSITY = 2e11, 7800.0
EI, MASS = E * THIN.second_moment, DENSITY * THIN.area
EULER = pi**2 * EI  # of a bar of 1 m, N


def rates(found):
    """λ of the modes, 1/s."""
    return found.growth_rates + 2j * pi * found.frequencies


def about_equilibrium(scene, count=None, **cut):
    """Modes about the equilibrium under the whole load, and whether that was called stable."""
    rest = at.solve_static(scene, **cut)
    return at.modes(scene, count=count, about=rest, **cut), rest.status.ok


def column(ratio, damping=0.0):
    """Pinned at both ends and pressed with so many times Euler's load."""
    bar = at.Beam("bar", (0, 0), (0, 1), THIN, at.Material(E, DENSITY, damping=damping))
    ends = [at.Pin("bar.start"), at.Slider("bar.end", (0, 1))]
    return at.Scene("column", [bar], ends, [at.Force("bar.end", (0, -ratio * EULER))])


def rates_of_column(ratio, damping, waves=12):
    """Roots of λ² + τ w λ + w (1 − ratio/n²) = 0, w = (nπ)⁴ EI/ρA; λ with Im λ ≥ 0."""
    w = (np.arange(1, waves + 1) * pi) ** 4 * EI / MASS
    stiffness = w - ratio * EULER * (np.arange(1, waves + 1) * pi) ** 2 / MASS
    both = np.concatenate([np.roots([1.0, damping * a, b]) for a, b in zip(w, stiffness, strict=True)])
    found = both[(both.imag > 0.0) | ((both.imag == 0.0) & ((both.real > 0.0) | (damping > 0.0)))]
    kind = np.where(found.imag != 0.0, 1, np.where(found.real > 0.0, 0, 2))  # grow, swing, decay
    return found[np.lexsort((np.where(kind == 0, -1.0, 1.0) * np.abs(found), kind))]


@pytest.mark.parametrize("damping", [0.0, 1e-4])
@pytest.mark.parametrize(("ratio", "leaving"), [(0.9, 0), (1.2, 1), (4.1, 2), (9.3, 3)])
def test_a_column_beyond_its_critical_load_diverges_at_the_exact_rate(ratio, leaving, damping):
    """In so many modes, the fastest first: not the first of all, and slow ones are not taken for rounding."""
    found, stable = about_equilibrium(column(ratio, damping), 4, mesh=8, element="quintic")
    exact = rates_of_column(ratio, damping)[:4]
    np.testing.assert_allclose(rates(found), exact, rtol=2e-5, atol=1e-9)
    assert list(found.unstable) == [True] * leaving + [False] * (4 - leaving)
    assert stable == (leaving == 0)
    np.testing.assert_allclose(found.damping, -exact.real / np.abs(exact), rtol=2e-5, atol=1e-9)
    assert repr(found).count("unstable (divergence)") == leaving
    if leaving:
        assert f"{found.growth_rates[0]:11.4g} 1/s  unstable (divergence)" in repr(found)


def test_the_fastest_of_many_is_found_though_damping_asks_for_few():
    """Six modes leave, at rates on both sides of those that swing: as many pairs as ARPACK is asked for and more."""
    found, _ = about_equilibrium(column(40.0, 1e-6), 1, mesh=24)
    np.testing.assert_allclose(rates(found), rates_of_column(40.0, 1e-6)[:1], rtol=2e-3)


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_an_upright_pendulum_leaves_at_the_exact_rate(damping):
    body = at.RigidBody("bob", mass=2.0, inertia=0.05, center=(0.0, 0.4), points={"pin": (0.0, 0.0)})
    turn = [at.RotationalSpring("bob.pin", stiffness=0.0, damping=damping)] if damping else []
    scene = at.Scene("pendulum", [body], [at.Pin("bob.pin")], gravity=(0, -G), connectors=turn)
    inertia = 0.05 + 2.0 * 0.4**2
    found, stable = about_equilibrium(scene)
    grows = max(np.roots([inertia, damping, -2.0 * G * 0.4]))
    assert found.growth_rates[0] == pytest.approx(grows, rel=1e-9)
    assert (found.frequencies[0], found.damping[0], stable) == (0.0, -1.0, False)
    assert "growth rate" in repr(found)
    assert found.motion(1).t[-1] == 1.0


def drawn_in(x, v, t):
    """A spring that pushes away, and a damper that feeds energy."""
    return -50.0 * x - 3.0 * v


def fed(x, v, t):
    """A spring with a damper that feeds energy."""
    return 50.0 * x - 3.0 * v


@pytest.mark.parametrize(("law", "stiffness"), [(drawn_in, -50.0), (fed, 50.0)])
def test_what_a_law_feeds_grows(law, stiffness):
    """Of two rates the one that grows is first, though it is the larger one; an oscillation that grows is flutter."""
    mass = at.PointMass("mass", mass=0.5, position=(1.0, 0.0))
    spring = at.Spring("mass.center", (0, 0), law=law)
    scene = at.Scene("fed", [mass], [at.Slider("mass.center", (1, 0))], connectors=[spring])
    found = at.modes(scene)
    exact = max(np.roots([0.5, -3.0, stiffness]), key=lambda x: (x.real, x.imag))
    np.testing.assert_allclose(rates(found)[0], exact, rtol=1e-6)
    assert ("flutter" if stiffness > 0.0 else "divergence") in repr(found)


@pytest.mark.parametrize("damping", [20.0, 40.0])
def test_motions_that_creep_back_tell_their_rate(damping):
    mass = at.PointMass("mass", mass=0.5, position=(1.0, 0.0))
    spring = at.Spring("mass.center", (0, 0), stiffness=50.0, damping=damping)
    found = at.modes(at.Scene("slow", [mass], [at.Slider("mass.center", (1, 0))], connectors=[spring]))
    assert found.growth_rates[0] == pytest.approx(max(np.roots([0.5, damping, 50.0])), rel=1e-8)
    assert not found.unstable.any()
    assert "unstable" not in repr(found)


def beck(load, damping=0.0):
    """Beck's column: clamped, under a force that turns with its tip, in EI/L²."""
    bar = at.Beam("bar", (0, 0), (0.6, 0.8), THIN, at.Material(E, DENSITY, damping=damping))
    force = at.Force("bar.end", (-0.6 * load * EI, -0.8 * load * EI), follower=True)
    return at.Scene("Beck", [bar], [at.Clamp("bar.start")], [force])


def beck_rate(near, load, damping):
    """The root λ near another of Beck's equation (Bolotin 1963): p² + 2ω²(1 + cosh a cos b) + p ω sinh a sin b = 0.

    Kelvin-Voigt damping makes EI one of EI (1 + τλ).
    """

    def equation(x):
        rate = x[0] + 1j * x[1]
        loss = 1.0 + damping * rate
        p, w = load / loss, np.sqrt(-(rate**2) * MASS / (EI * loss) + 0j)
        r = np.sqrt(p**2 / 4.0 + w**2)
        a, b = np.sqrt(r - p / 2.0), np.sqrt(r + p / 2.0)
        left = p**2 + 2.0 * w**2 * (1.0 + np.cosh(a) * np.cos(b)) + p * w * np.sinh(a) * np.sin(b)
        return left.real, left.imag

    found = root(equation, (near.real, near.imag), tol=1e-13)
    return complex(*found.x)


@pytest.mark.parametrize("damping", [0.0, 2e-4])
@pytest.mark.parametrize("load", [8.0, 15.0, 20.0, 20.1, 25.0])
@pytest.mark.parametrize(("mesh", "element"), [(6, "quintic"), (18, "cable")])
def test_frequencies_and_flutter_of_becks_column(load, damping, mesh, element):
    """Without damping it flutters beyond p = 20.05; a little damping makes it flutter earlier (Ziegler 1952)."""
    found, stable = about_equilibrium(beck(load, damping), 3, mesh=mesh, element=element)
    exact = [beck_rate(rate, load, damping) for rate in rates(found)]
    assert np.abs(np.diff(exact)).min() > 0.1  # three roots, not one twice
    np.testing.assert_allclose(rates(found), exact, rtol=2e-3 if abs(load - 20.05) < 0.1 else 1e-4, atol=1e-6)
    assert found.unstable.any() == (load > (11.0 if damping else 20.05))
    assert repr(found).count("unstable (flutter)") == found.unstable.sum() <= 1
    if not damping:
        assert stable == (load < 20.05)


def test_damped_motions_of_a_free_body_are_the_same_about_its_start():
    """About a solution the stiffness is taken as that of a stressed body, whose damping is no multiple of it."""
    bar = at.Beam("bar", (0, 0), (0.6, 0.8), at.Rectangle(0.01, 0.01), at.Material(E, DENSITY, damping=1e-4))
    free = at.Scene("free", [bar])
    rest = at.solve(free, mesh=2, dt=1e-3, t_end=2e-3)
    found, known = at.modes(free, mesh=2, about=rest), at.modes(free, mesh=2)
    np.testing.assert_allclose(rates(found), rates(known), rtol=1e-8, atol=1e-3)
    assert (rates(found)[:3] == 0.0).all()


def trolley(damping, rise, spring=0.0):
    """A cart that is free to move along a line, with a beam that its weight bends."""
    cart = at.RigidBody("cart", 3.0, 0.1, (0, 0), points={"w": (0.1, 0.0)})
    rubber = at.Material(5e7, 1200.0, damping=damping)
    arm = at.Beam(
        "arm", (0.1, 0.0), (0.1 + 0.8 * sqrt(1 - rise**2), 0.8 * rise), at.Rectangle(0.01, 0.01), rubber
    )
    joints = [at.Prismatic("cart.center", (1, 0)), at.Weld("cart.w", "arm.start")]
    springs = [at.Spring("cart.center", (-1.0, 0.0), stiffness=spring)] if spring else []
    return at.Scene("trolley", [cart, arm], joints, gravity=(0, -G), connectors=springs)


@pytest.mark.parametrize("damping", [1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("rise", [0.3, 1.0])
def test_a_damped_trolley_that_nothing_holds_moves_as_one_that_a_soft_spring_holds(damping, rise):
    """The stiffness is singular: in one motion nothing acts; upright, the beam falls besides."""
    free, stable = about_equilibrium(trolley(damping, rise), 5, mesh=4)
    held, _ = about_equilibrium(trolley(damping, rise, spring=1e-3), 8, mesh=4)
    own = np.sqrt(1e-3 / 3.3)
    found, known = (x[np.abs(x) > 10.0 * own] for x in (rates(free), rates(held)))
    assert len(found) == 4
    np.testing.assert_allclose(found, known[:4], rtol=2e-5)
    assert free.unstable.sum() == held.unstable.sum() == (1 if rise == 1.0 else 0)
    assert not stable


def test_damping_beyond_all_measure_is_refused_where_nothing_holds():
    scene = trolley(100.0, 0.3)
    rest = at.solve_static(scene, mesh=4)
    with pytest.raises(
        SolverError, match=r"'trolley' are singular there: some motion needs no force.*less damping"
    ):
        at.modes(scene, mesh=4, count=5, about=rest)


def test_a_campbell_diagram_shows_what_grows():
    """A mass on springs with dampers in a hub: beyond its own frequency damping drives it out."""
    hub = at.RigidBody(
        "hub", 1.0, 1.0, (0, 0), points={"e": (0.2, 0), "n": (0, 0.2), "w": (-0.2, 0), "s": (0, -0.2)}
    )
    springs = [at.Spring("m.center", f"hub.{p}", stiffness=200.0, damping=3.0) for p in "enws"]
    mass = at.PointMass("m", mass=0.5, position=(0, 0))
    scene = at.Scene("rotor", [hub, mass], [at.Clamp("hub.center")], connectors=springs)
    own, speeds = sqrt(800.0), [12.0, 40.0]
    found = at.campbell(scene, speeds)
    for speed, rate in zip(speeds, found.growth_rates, strict=True):
        roots = np.roots([1.0, 12.0 + 2j * speed, own**2 - speed**2])
        np.testing.assert_allclose(rate, roots.real[np.argsort(np.abs(roots))], rtol=1e-7)
    np.testing.assert_array_equal(found.unstable, [[False, False], [True, False]])
    assert [line.endswith("unstable") for line in repr(found).splitlines()] == [False, False, True]
    labels = [line.get_label() for line in found.plot().axes[0].lines]
    assert labels.count("unstable") == 1
    assert "unstable" not in [line.get_label() for line in at.campbell(scene, [12.0]).plot().axes[0].lines]


def test_pictures_of_modes_tell_rates_where_nothing_oscillates():
    found, _ = about_equilibrium(column(1.2, 1e-4), 12, mesh=2)
    titles = [axes.get_title() for axes in found.plot().axes[:12]]
    assert titles[0].split()[1] == "grows"
    assert titles[1].endswith("Hz")
    assert titles[-1].split()[1] == "decays"


PLATES = [("a", (0.0, 0.0), (0.3, 0.2), (0.4, -0.1)), ("b", (1.0, 0.5), (0.7, 0.3), (0.8, 0.9))]


def plate(number):
    """A plate of 2 kg and 0.1 kg m² with two points."""
    name, center, p, q = PLATES[number]
    return at.RigidBody(name, 2.0, 0.1, center, points={"p": p, "q": q})


def pull(number, point, along):
    """Forces (x, y, moment) on a plate of a unit force at a point."""
    x, y = np.subtract(PLATES[number][2 + "pq".index(point)], PLATES[number][1])
    return [*along, x * along[1] - y * along[0]]


def direction(one, two):
    return np.subtract(one, two) / np.linalg.norm(np.subtract(one, two))


@pytest.mark.parametrize("damping", [0.0, 1e-9])
@pytest.mark.parametrize("stiffness", [1e2, 1e8, 1e12])
def test_plates_on_stiff_springs_are_free_to_move_and_do_not_grow(stiffness, damping):
    """However stiff the springs: frequencies are theirs, those of a free body 0."""
    pairs = ["pp", "qq", "pq"]
    springs = [
        at.Spring(f"a.{one}", f"b.{two}", stiffness=stiffness, damping=damping * stiffness)
        for one, two in pairs
    ]
    found = at.modes(at.Scene("plates", [plate(0), plate(1)], connectors=springs))
    K = np.zeros((6, 6))
    for one, two in pairs:
        along = direction(PLATES[0][2 + "pq".index(one)], PLATES[1][2 + "pq".index(two)])
        g = np.array([*pull(0, one, along), *pull(1, two, -along)])
        K += stiffness * np.outer(g, g)
    exact = np.sqrt(eigh(K, np.diag([2.0, 2.0, 0.1] * 2), eigvals_only=True)[3:])
    np.testing.assert_allclose(np.abs(rates(found))[3:], exact, rtol=1e-5)
    assert np.abs(rates(found))[:3].max() < 1e-5 * exact[0]
    assert not found.unstable.any()


@pytest.mark.parametrize("stiffness", [1e4, 1e6, 1e8, 1e10])
def test_a_soft_beam_on_stiff_springs(stiffness):
    """Springs between distant nodes, up to 1e7 times as stiff as the beam, beside dense matrices assembled here.

    The relative error grows with the stiffness of the springs: 1.6e-4 at 1e10 N/m, where EA is 1e3 N.
    """
    mesh, ends = 3, {"p": (2.0, 0.0), "q": (3.0, 0.0)}
    beam = at.Beam("beam", ends["p"], ends["q"], at.Rectangle(0.01, 0.01), at.Material(1e7, 1000.0))
    springs = [
        at.Spring(f"a.{p}", f"beam.{q}", stiffness=stiffness) for p, q in (("p", "start"), ("q", "end"))
    ]
    found = at.modes(at.Scene("held", [plate(0), beam], connectors=springs), mesh=mesh, count=7)
    element, n = CableElement.of(beam, mesh), 4 * (mesh + 1)
    K, M = np.zeros((n + 3, n + 3)), np.diag([0.0] * n + [2.0, 2.0, 0.1])
    straight = np.array([(0.0, 0.0), (1.0, 0.0), (element.l, 0.0), (1.0, 0.0)])
    for k in range(mesh):
        own = slice(4 * k, 4 * k + 8)
        K[own, own] += element.tangent(straight).reshape(8, 8)
        M[own, own] += np.kron(element.mass, np.eye(2))
    for point, row in (("p", 0), ("q", n - 4)):
        along = direction(PLATES[0][2 + "pq".index(point)], ends[point])
        g = np.zeros(n + 3)
        g[row : row + 2], g[n:] = -along, pull(0, point, along)
        K += stiffness * np.outer(g, g)
    squares = eigh(K, M, eigvals_only=True)
    exact = np.sqrt(squares[4:7]) / (2 * pi)
    np.testing.assert_allclose(found.frequencies[4:], exact, rtol=1e-5 + 3e-14 * stiffness)
    assert (2 * pi * found.frequencies[:4].max()) ** 2 < 1e-12 * squares[-1]  # what counts as rounding
    assert not found.unstable.any()


@pytest.mark.parametrize("second", [1.0, 1e3, 1e9])
def test_no_unit_of_time_makes_a_growth_rounding(second):
    """A pendulum upside down, which leaves at the rate √(m g l / J) in any unit, also in nanoseconds."""
    rod = at.RigidBody("rod", 1.0, 0.1, (0.0, 0.5), {"hinge": (0.0, 0.0)})
    scene = at.Scene("upright", [rod], [at.Pin("rod.hinge")], gravity=(0.0, -G / second**2))
    found, stable = about_equilibrium(scene)
    assert not stable
    assert list(found.unstable) == [True]
    np.testing.assert_allclose(found.growth_rates * second, sqrt(0.5 * G / 0.35), rtol=1e-9)


def test_frequencies_of_a_bar_are_those_of_any_unit_of_time():
    """In seconds and in nanoseconds, of a damped one with a body at its end."""

    def frequencies(second):
        material = at.Material(E / second**2, DENSITY, damping=1e-6 * second)
        bar = at.Beam("bar", (0, 0), (1, 0), at.Rectangle(1e-2, 1e-2), material)
        load = at.RigidBody("load", 2.0, 0.01, (1.1, 0.0), {"a": (1.0, 0.0)})
        scene = at.Scene("loaded", [bar, load], [at.Clamp("bar.start"), at.Pin("bar.end", "load.a")])
        return at.modes(scene, mesh=4, count=4).frequencies * second

    np.testing.assert_allclose(frequencies(1e9), frequencies(1.0), rtol=1e-8, atol=1e-6)
