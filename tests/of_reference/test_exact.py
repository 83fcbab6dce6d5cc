"""Exact solutions: every number by two roads that share no code."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.optimize import root

from anctmm.elements.shear import ShearElement
from anctmm.errors import AnctmmError, PropertyError, SceneError, SolverError
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene, Torque
from anctmm.model.sections import Rectangle
from reference import exact
from reference.exact.cantilever import Cantilever
from reference.exact.legendre import gauss
from reference.exact.rods import Rigidity

SOFT = Rigidity(bending=1.0, axial=60.0, shear=25.0)
STRETCHY = Rigidity(bending=1.0, axial=60.0)
LOADS = {
    "across": Cantilever(1.0, force=(0.0, 3.0)),
    "heavy across": Cantilever(1.0, force=(0.0, 10.0)),
    "oblique, clamp at an angle": Cantilever(2.0, force=(-0.3, 0.8), start=(1.0, -2.0), angle=0.4),
    "weight": Cantilever(1.0, weight=(0.0, -8.0)),
    "moment": Cantilever(1.0, moment=2.0),
    "all": Cantilever(1.5, force=(0.7, -1.1), moment=1.3, weight=(0.5, 2.0), angle=-0.2),
}


def section(slenderness, length=1.0):
    """Section of a beam with length to height `slenderness`, and its rigidity for E = 1e9."""
    return Rectangle(0.1, length / slenderness)


def loaded(slenderness, poisson, load=0.0, moment=0.0):
    """Cantilever of length 1 m under PL²/EI = load and ML/EI = moment, its section and material."""
    cross, material = section(slenderness), Material(E=1e9, density=1.0, poisson=poisson)
    bending = material.E * cross.second_moment
    return Cantilever(1.0, force=(0.0, load * bending), moment=moment * bending), cross, material


# ------------------------------------------------------------------------------------------ static rods


def shoot(problem, rigidity, fractions):
    """Second road: the four first-order equations by DOP853, their missing start value by a root search."""
    F, w, L = np.array(problem.force), np.array(problem.weight), problem.length

    def slope(s, state):
        _, _, angle, moment = state
        a, b = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        n = F + w * (L - s)
        stretch, shear = 1.0 + n @ a / rigidity.axial, n @ b / rigidity.shear
        axis = stretch * a + shear * b
        return [*axis, moment / rigidity.bending, -(axis[0] * n[1] - axis[1] * n[0])]

    def run(moment):
        start = [*problem.start, problem.angle, moment]
        return solve_ivp(slope, (0.0, L), start, "DOP853", fractions * L, rtol=3e-14, atol=1e-14)

    guess = exact.solve_rod(problem, rigidity).moment(0.0) * 1.02  # only near: the search does the rest
    found = root(lambda m: run(m[0]).y[3, -1] - problem.moment, [guess], tol=1e-14)
    assert abs(found.fun) < 1e-11
    return run(found.x[0]).y.T


@pytest.mark.parametrize("rigidity", [STRETCHY, SOFT], ids=["elastica", "reissner"])
@pytest.mark.parametrize("name", LOADS)
def test_rods_agree_with_shooting(name, rigidity):
    shape = exact.solve_rod(LOADS[name], rigidity)
    fractions = np.array([0.0, 0.37, 1.0])
    for fraction, (x, y, angle, moment) in zip(
        fractions, shoot(LOADS[name], rigidity, fractions), strict=True
    ):
        assert_allclose(shape.position(fraction), (x, y), rtol=0, atol=3e-12)
        assert shape.angle(fraction) == pytest.approx(angle, abs=1e-11)
        assert shape.moment(fraction) == pytest.approx(moment, abs=5e-11)
    assert shape.uncertainty < 2e-13


@pytest.mark.parametrize(
    ("load", "rise", "shortening", "slope"),
    [(1.0, 0.30172, 0.05643, 0.46135), (2.0, 0.49346, 0.16064, 0.78175), (10.0, 0.81061, 0.55500, 1.43029)],
)
def test_inextensible_elastica_equals_the_published_table(load, rise, shortening, slope):
    """Mattiasson 1981, DOI 10.1002/nme.1620170113."""
    shape = exact.solve_rod(Cantilever(1.0, force=(0.0, load)), Rigidity(1.0))
    x, y = shape.position(1.0)
    assert_allclose((y, 1.0 - x, shape.angle(1.0)), (rise, shortening, slope), rtol=0, atol=6e-6)


@pytest.mark.parametrize("rigidity", [Rigidity(3.0), STRETCHY, SOFT])
@pytest.mark.parametrize("turns", [0.0, -0.25, 1.0, 3.0])
def test_end_moment_makes_a_circle(turns, rigidity):
    moment = turns * 2.0 * np.pi * rigidity.bending / 1.5
    shape = exact.solve_rod(Cantilever(1.5, moment=moment), rigidity)
    for fraction in (0.0, 0.31, 1.0):
        arc = exact.moment_arc(1.5, rigidity.bending, moment, fraction)
        assert_allclose(shape.position(fraction), arc, rtol=0, atol=5e-14)
    assert shape.angle(1.0) == pytest.approx(turns * 2.0 * np.pi, abs=1e-12)
    assert shape.strain_energy == pytest.approx(0.5 * moment * turns * 2.0 * np.pi, abs=1e-11)


@pytest.mark.parametrize("rigidity", [STRETCHY, SOFT])
def test_energy_of_a_rod_is_what_its_growing_loads_did(rigidity):
    """Clapeyron's integral: strain energy = ∫ loads · dplaces over the load factor, by Gauss quadrature."""
    full = LOADS["all"]

    def potential(factor):
        force, weight = (tuple(factor * np.array(v)) for v in (full.force, full.weight))
        part = Cantilever(full.length, force, factor * full.moment, weight, full.start, full.angle)
        shape = exact.solve_rod(part, rigidity)
        return (shape.load_potential - shape.moment_work) / factor, shape

    factors, weights = gauss(24)
    unit = np.array([potential(f)[0] for f in factors])
    whole, shape = potential(1.0)
    assert shape.strain_energy == pytest.approx(weights @ unit - whole, rel=1e-12)


def test_continuation_keeps_the_branch_of_the_unloaded_rod():
    """Beyond Euler's load a slightly oblique push bends the rod to one side, without an inflection."""
    shape = exact.solve_rod(Cantilever(1.0, force=(-8.0, 0.01)), Rigidity(1.0))
    moments = [shape.moment(f) for f in np.linspace(0.0, 0.99, 12)]
    assert shape.angle(1.0) > 2.0
    assert min(moments) > 0.0


@pytest.mark.parametrize("push", [3.0, 8.0, 60.0])
def test_a_straight_push_ends_at_eulers_load(push):
    with pytest.raises(SolverError, match="buckles") as raised:
        exact.solve_rod(Cantilever(1.0, force=(-push, 0.0)), Rigidity(1.0))
    reached = float(str(raised.value).split("beyond ")[1].split(" of")[0])
    assert reached * push == pytest.approx(np.pi**2 / 4.0, rel=1e-5)


def test_a_moment_against_a_force_ends_at_its_limit():
    """A long rod along its end force holds an end moment up to M = 2 √(F EI), where it would wind a loop."""
    with pytest.raises(SolverError, match="snaps") as raised:
        exact.solve_rod(Cantilever(1.0, force=(0.0, 100.0), moment=-24.0), Rigidity(1.0))
    reached = float(str(raised.value).split("beyond ")[1].split(" of")[0])
    assert reached * 24.0 == pytest.approx(2.0 * np.sqrt(reached * 100.0), rel=2e-3)


def test_a_rod_squeezed_to_nothing_is_reported():
    with pytest.raises(SolverError, match="squeezed"):
        exact.solve_rod(Cantilever(1.0, force=(-61.0, 0.0)), STRETCHY)


# ------------------------------------------------------------- continuum of the shear-deformable element


def section_energy(cross, material, p, d, q):
    """Energy per length of method.md (anctmm/elimination), section 1: integrated over the section by A, I, J."""
    (lame, G), A, I, J = material.lame, cross.area, cross.second_moment, cross.fourth_moment  # noqa: E741
    a0, a1, a2, e = 0.5 * (p @ p - 1.0), p @ q, 0.5 * q @ q, 0.5 * (d @ d - 1.0)
    xx = A * a0**2 + I * (a1**2 + 2.0 * a0 * a2) + J * a2**2
    xy = 0.25 * (A * (p @ d) ** 2 + I * (q @ d) ** 2)
    return 0.5 * (lame + 2.0 * G) * (xx + A * e**2) + lame * e * (A * a0 + I * a2) + 2.0 * G * xy


def section_forces(cross, material, p, d, q):
    """Derivatives of `section_energy` by p, d and q, (3, 2), by complex step."""
    fields = np.array([p, d, q], complex)
    forces = np.empty((3, 2))
    for index in np.ndindex(3, 2):
        shifted = fields.copy()
        shifted[index] += 1e-30j
        forces[index] = section_energy(cross, material, *shifted).imag / 1e-30
    return forces


@pytest.mark.parametrize(
    ("slenderness", "poisson", "load", "moment"),
    [
        (10, 0.0, 3.0, 0.0),
        (20, 0.3, 3.0, 0.0),
        (20, 0.0, 10.0, 0.0),
        (5, 0.2, 1.0, -0.4),
        (20, 0.3, 0.0, 2.0),
    ],
)
def test_director_continuum_satisfies_its_strong_form(slenderness, poisson, load, moment):
    """Force balance ∂W/∂p = n, moment balance and the first integral, at points no quadrature used."""
    problem, cross, material = loaded(slenderness, poisson, load, moment)
    shape = exact.solve_director(problem, cross, material)
    n, scale = np.array(problem.force), material.E * cross.second_moment
    integrals = []
    for fraction in (0.003, 0.11, 0.5, 0.83, 0.998):
        (_, d), (p, q) = shape.fields(fraction)
        by_p, _, by_q = section_forces(cross, material, p, d, q)
        assert_allclose(by_p, n, rtol=0, atol=1e-8 * scale)
        arm = shape.position(1.0) - shape.position(fraction)
        expected = problem.moment + arm[0] * n[1] - arm[1] * n[0]
        assert d[0] * by_q[1] - d[1] * by_q[0] == pytest.approx(expected, abs=1e-8 * scale)
        integrals.append(section_energy(cross, material, p, d, q) - p @ by_p - q @ by_q)
    assert_allclose(integrals, integrals[0], rtol=0, atol=1e-8 * scale)
    assert shape.uncertainty < 1e-11


@pytest.mark.parametrize("poisson", [0.0, 0.3])
def test_shear_element_tends_to_the_director_continuum(poisson):
    """Second road: the element, c'(0) free as the continuum has it, extrapolated from its even error series."""
    problem, cross, material = loaded(5.0, poisson, 0.5)
    tip = exact.solve_director(problem, cross, material).position(1.0)
    errors = [element_tip(problem, cross, material, n) - tip for n in (8, 16, 32)]
    sizes = np.linalg.norm(errors, axis=1)
    assert sizes[0] < 4e-3
    assert_allclose(np.log2(sizes[:-1] / sizes[1:]), 2.0, atol=0.06)
    once = [(4.0 * b - a) / 3.0 for a, b in pairwise(errors)]
    assert np.linalg.norm((16.0 * once[1] - once[0]) / 15.0) < 2e-7


def element_tip(problem, cross, material, n):
    """Tip of a cantilever of n shear elements by Newton, started from the rod with the same rigidities."""
    A, I, J = cross.area, cross.second_moment, cross.fourth_moment  # noqa: E741
    element = ShearElement(problem.length / n, A, I, J, *material.lame, material.density)
    rod = exact.solve_rod(problem, Rigidity.shear_element(cross, material))
    q = np.array([node(rod, i / n) for i in range(n + 1)])
    q[0] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    free = np.ones(q.shape, bool)
    free[0, [0, 2]] = False
    free = free.ravel()
    for _ in range(20):
        residual, tangent = np.zeros(q.size), np.zeros((q.size, q.size))
        residual[-6:-4] = -np.array(problem.force)
        for e in range(n):
            ours, part = q[e : e + 2].reshape(6, 2), slice(6 * e, 6 * e + 12)
            residual[part] += element.force(ours).ravel()
            tangent[part, part] += element.tangent(ours).reshape(12, 12)
        step = np.zeros(q.size)
        step[free] = np.linalg.solve(tangent[np.ix_(free, free)], residual[free])
        q -= step.reshape(q.shape)
        if np.abs(step).max() < 1e-11:
            return q[-1, 0]
    raise AssertionError("no equilibrium")


def node(rod, fraction):
    """r, r_x and r_y of a rod without strain."""
    c, s = np.cos(rod.angle(fraction)), np.sin(rod.angle(fraction))
    return [rod.position(fraction), [c, s], [-s, c]]


@pytest.mark.parametrize(("slenderness", "poisson"), [(3.0, 0.45), (10.0, 0.0), (40.0, 0.3)])
def test_small_strain_limit_of_the_director_continuum_is_timoshenkos_with_poisson_locking(
    slenderness, poisson
):
    problem, cross, material = loaded(slenderness, poisson, 1e-5)
    _, G = material.lame
    locking = (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    bending = locking * material.E * cross.second_moment
    linear = problem.force[1] * (1.0 / (3.0 * bending) + 1.0 / (G * cross.area))
    shape = exact.solve_director(problem, cross, material)
    assert shape.position(1.0)[1] == pytest.approx(linear, rel=2e-8)


def test_director_continuum_turns_with_its_clamp_and_balances_its_energy():
    _, cross, material = loaded(20.0, 0.3)
    bending = material.E * cross.second_moment
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    force, weight = np.array([0.4, 1.0]) * bending, np.array([0.3, -2.0]) * bending
    plain = exact.solve_director(Cantilever(1.0, tuple(force), 0.5 * bending, tuple(weight)), cross, material)
    turned = exact.solve_director(
        Cantilever(1.0, tuple(turn @ force), 0.5 * bending, tuple(turn @ weight), (3.0, 4.0), 0.7),
        cross,
        material,
    )
    for fraction in (0.0, 0.4, 1.0):
        assert_allclose(
            turned.position(fraction), np.array([3.0, 4.0]) + turn @ plain.position(fraction), atol=1e-10
        )
        assert turned.angle(fraction) - 0.7 == pytest.approx(plain.angle(fraction), abs=1e-9)
    for name in ("strain_energy", "load_potential", "moment_work"):
        assert getattr(turned, name) == pytest.approx(getattr(plain, name), rel=1e-8)
    rod = exact.solve_rod(plain.problem, Rigidity.shear_element(cross, material))
    assert plain.load_potential == pytest.approx(rod.load_potential, rel=5e-3)
    assert plain.strain_energy == pytest.approx(rod.strain_energy, rel=5e-3)


# ------------------------------------------------------------------------------------------ frequencies


@pytest.mark.parametrize(
    ("ends", "wave_numbers"),
    [
        ("clamped-free", (1.875104068711961, 4.694091132974174, 7.854757438237612)),
        ("clamped-pinned", (3.926602312047919, 7.068582745628732, 10.210176122813031)),
        ("clamped-clamped", (4.730040744862704, 7.853204624095838, 10.995607838001671)),
        ("free-free", (4.730040744862704, 7.853204624095838, 10.995607838001671)),
        ("pinned-pinned", (np.pi, 2 * np.pi, 3 * np.pi)),
    ],
)
def test_euler_bernoulli_frequencies_equal_the_published_wave_numbers(ends, wave_numbers):
    """Blevins 1979, "Formulas for Natural Frequency and Mode Shape", table 8-1; numbering up to the 30th."""
    L, bending, mass = 2.0, 3.0, 0.7
    found = exact.euler_bernoulli_frequencies(ends, 30, L, bending, mass)
    scale = np.sqrt(bending / mass) / L**2
    assert_allclose(found[:3], np.square(wave_numbers) * scale, rtol=1e-14)
    spacing = np.diff(np.sqrt(found / scale))
    assert_allclose(spacing[4:], np.pi, rtol=1e-6)


# ----------------------------------------------------------------------------------------------- scenes


CLAMPED = (Clamp("beam.start"),)


def scene(joints=CLAMPED, loads=(), gravity=(0.0, 0.0), bodies=None):
    beam = Beam("beam", (1.0, 1.0), (1.0, 3.0), Rectangle(0.01, 0.005), Material(1e9, 2000.0))
    return Scene("flag", bodies or (beam,), joints, loads, gravity)


@pytest.mark.parametrize("model", ["elastica", "reissner", "director"])
def test_a_scene_becomes_its_cantilever(model):
    loads = [Force("beam.end", (0.01, 0.02)), Force("beam.end", (0.0, 0.01)), Torque("beam.end", 0.03)]
    flag = scene(loads=[*loads, Force("beam.start", (5.0, 5.0))], gravity=(0.0, -0.3))
    shape = exact.cantilever_static(flag, model)
    assert shape.problem.force == pytest.approx((0.01, 0.03))
    assert shape.problem.moment == pytest.approx(0.03)
    assert shape.problem.weight == pytest.approx((0.0, -0.3 * 2000.0 * 5e-5))
    assert_allclose(shape.position(0.0), (1.0, 1.0), atol=1e-15)
    assert shape.angle(0.0) == pytest.approx(np.pi / 2)
    slender = exact.solve_rod(shape.problem, Rigidity(1e9 * 0.01 * 0.005**3 / 12))
    assert_allclose(shape.position(1.0), slender.position(1.0), rtol=0, atol=2e-5)


@pytest.mark.parametrize("model", ["elastica", "director"])
def test_the_cantilevers_of_the_study_are_resolved_to_rounding(model):
    """L/h = 400, PL²/EI = 0.5 and 10."""
    bending = 1e9 * 0.01 * 0.005**3 / 12
    for load in (0.5, 10.0):
        shape = exact.cantilever_static(scene(loads=[Force("beam.end", (-load * bending / 4, 0.0))]), model)
        x, y = exact.solve_rod(Cantilever(2.0, force=(0.0, load / 4.0)), Rigidity(1.0)).position(1.0)
        assert_allclose(shape.position(1.0), (1.0 - y, 1.0 + x), rtol=0, atol=3e-5)
        assert shape.uncertainty < 1e-12


def two_beams():
    other = Beam("other", (1.0, 3.0), (2.0, 3.0), Rectangle(0.01, 0.005), Material(1e9, 2000.0))
    return (*scene().bodies, other)


@pytest.mark.parametrize(
    ("flag", "message"),
    [
        (lambda: scene(bodies=two_beams()), "2 bodies .*'beam', 'other'"),
        (lambda: scene(joints=()), r"joints \(\), .*beam.start"),
        (lambda: scene(joints=(Clamp("beam.end"),)), "Clamp.*beam.end"),
        (lambda: scene(joints=(Pin("beam.start"),)), "Pin.*has an exact static"),
        (lambda: scene(joints=(Clamp("beam.start"), Pin("beam.end"))), "Pin"),
        (lambda: scene(loads=[Force("beam.end", lambda t: (t, 0.0))]), "varies in time"),
    ],
)
def test_scenes_without_an_exact_solution_are_refused(flag, message):
    with pytest.raises(SceneError, match=message):
        exact.cantilever_static(flag())


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: exact.cantilever_static(scene(), "fem"), AnctmmError, "'fem'.*elastica"),
        (lambda: Cantilever(0.0), PropertyError, "length.*0.0"),
        (lambda: Cantilever(1.0, force=(np.nan, 0.0)), PropertyError, "force.*nan"),
        (lambda: Rigidity(-1.0), PropertyError, "bending.*-1.0"),
        (lambda: Rigidity(1.0, axial=0.0), PropertyError, "axial.*0.0"),
        (lambda: Rigidity(1.0, shear=float("nan")), PropertyError, "shear.*nan"),
        (lambda: exact.euler_bernoulli_frequencies("pinned-free", 1, 1, 1, 1), AnctmmError, "pinned-free"),
        (lambda: exact.euler_bernoulli_frequencies("free-free", 0, 1, 1, 1), AnctmmError, "count is 0"),
        (lambda: exact.axial_frequencies("free-free", 1, -1, 1, 1), PropertyError, "length.*-1"),
    ],
)
def test_bad_input_is_named(call, error, message):
    with pytest.raises(error, match=message):
        call()
