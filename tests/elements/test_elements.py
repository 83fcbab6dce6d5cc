"""Elements by their axioms: shapes, quadrature, rigid motion, energy → force → tangent, mass, weight, kernels."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from samples import SOFT
from scipy.special import roots_chebyu

from anctmm.elements.cable import CableElement
from anctmm.elements.invariants import InvariantShearElement
from anctmm.elements.quintic import QuinticElement
from anctmm.elements.shapes import gauss, hermite, lobatto, quintic
from anctmm.elements.shear import ShearElement
from anctmm.model.scene import Beam, Material
from anctmm.model.sections import Circle, Rectangle

LENGTH, HEIGHT, WIDTH = 0.4, 0.05, 0.03
TINY = 1e-30


def shear(poisson=0.3, section=None):
    body = Beam("b", (0, 0), (LENGTH, 0), section or Rectangle(WIDTH, HEIGHT), Material(1e7, 1200.0, poisson))
    return ShearElement.of(body, 1)


def cable(quadrature="full"):
    return CableElement.of(Beam("b", (0, 0), (LENGTH, 0), Rectangle(WIDTH, HEIGHT), SOFT), 1, quadrature)


def quintic_cable(damping=0.0):
    body = Beam("b", (0, 0), (LENGTH, 0), Rectangle(WIDTH, HEIGHT), Material(1e7, 1000.0, damping=damping))
    return QuinticElement.of(body, 1)


ELEMENTS = {
    "shear ν=0": shear(0.0),
    "shear ν=0.3": shear(0.3),
    "shear circle": shear(0.45, Circle(HEIGHT)),
    "cable full": cable("full"),
    "cable reduced": cable("reduced"),
    "cable lobatto": cable("lobatto"),
    "quintic": quintic_cable(),
}
every_element = pytest.mark.parametrize("e", ELEMENTS.values(), ids=ELEMENTS.keys())
CABLES = {name: e for name, e in ELEMENTS.items() if isinstance(e, CableElement)}
every_cable_element = pytest.mark.parametrize("e", CABLES.values(), ids=CABLES.keys())


def reference(e):
    """Undeformed coordinates along x."""
    q = np.zeros((2 * e.vectors_per_node, 2))
    q[e.vectors_per_node, 0] = e.l
    q[1 :: e.vectors_per_node, 0] = 1.0
    if isinstance(e, ShearElement):
        q[2::3, 1] = 1.0
    return q


def scales(e):
    """Size of each coordinate: the length for positions, one for gradients; as a column."""
    return np.tile([e.l, *[1.0] * (e.vectors_per_node - 1)], 2)[:, None]


def turn(angle):
    return np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])


def large(e, seed=0, amount=0.3):
    """A large random deformation, turned at random."""
    rng = np.random.default_rng(seed)
    q = reference(e)
    return (q + amount * scales(e) * rng.standard_normal(q.shape)) @ turn(rng.uniform(0, 2 * pi)).T


def stiffness_scale(e):
    """Size of the tangent's entries once coordinates are measured by `scales`."""
    s = np.broadcast_to(scales(e), reference(e).shape)
    return np.abs(e.tangent(reference(e)) * s[:, :, None, None] * s).max()


# --- shapes and rules --------------------------------------------------------------------------------------


@given(st.floats(0.0, 1.0), st.floats(0.01, 100.0))
def test_quintic_functions_reproduce_polynomials_of_degree_five_and_their_derivatives(xi, l):  # noqa: E741
    for p in (np.polynomial.Polynomial(c) for c in np.eye(6)):  # in units of l
        nodal = [[q(x) / l for x in (0.0, 1.0)] for q in (p, p.deriv(), p.deriv(2))]
        nodal = np.array(nodal).T.ravel() * np.tile([l, 1.0, 1.0], 2)
        for order in range(5):
            exact = (p.deriv(order) if order else p)(xi)
            assert quintic(xi, l, order)[0] @ nodal * l**order == pytest.approx(exact, abs=1e-10)


@given(st.floats(0.0, 1.0), st.floats(0.01, 100.0))
def test_hermite_functions_reproduce_cubics_and_their_derivatives(xi, l):  # noqa: E741
    for p in (np.polynomial.Polynomial(c) for c in np.eye(4)):  # in units of l
        nodal = np.array([p(0.0), p.deriv()(0.0) / l, p(1.0), p.deriv()(1.0) / l])
        for order in (0, 1, 2):
            exact = (p.deriv(order) if order else p)(xi)
            assert hermite(xi, l, order)[0] @ nodal * l**order == pytest.approx(exact, abs=1e-13)


@pytest.mark.parametrize("points", range(2, 7))
@pytest.mark.parametrize(("rule", "lost"), [(gauss, 1), (lobatto, 3)])
def test_rules_are_exact_to_their_degree_and_no_further(rule, lost, points):
    x, w = rule(points)
    assert ((x[0], x[-1]) == (0.0, 1.0)) == (rule is lobatto)
    exact = 2 * points - lost
    for degree in range(exact + 1):
        assert w @ x**degree == pytest.approx(1.0 / (degree + 1), abs=1e-15)
    assert abs(w @ x ** (exact + 1) - 1.0 / (exact + 2)) > 1e-8


@pytest.mark.parametrize(
    ("section", "y", "w"),
    [
        (Rectangle(WIDTH, HEIGHT), (gauss(6)[0] - 0.5) * HEIGHT, gauss(6)[1] * HEIGHT * WIDTH),
        (Circle(HEIGHT), HEIGHT / 2 * roots_chebyu(6)[0], HEIGHT**2 / 2 * roots_chebyu(6)[1]),
    ],
)
def test_moments_of_sections(section, y, w):
    moments = (section.area, section.second_moment, section.fourth_moment)
    assert moments == pytest.approx([w.sum(), w @ y**2, w @ y**4], rel=1e-13)


# --- energy, force, tangent --------------------------------------------------------------------------------


@every_element
@given(angle=st.floats(-10.0, 10.0), x=st.floats(-5.0, 5.0), y=st.floats(-5.0, 5.0))
def test_rigid_motion_bears_no_force(e, angle, x, y):
    q = reference(e) @ turn(angle).T
    q[:: e.vectors_per_node] += [x, y]
    assert np.abs(e.force(q) * scales(e)).max() < 1e-13 * stiffness_scale(e)
    assert e.energy(q) < 1e-26 * stiffness_scale(e)


@every_element
@given(seed=st.integers(0, 1000))
def test_force_is_the_gradient_of_the_energy_and_turns_with_the_body(e, seed):
    q = large(e, seed)
    gradient = np.empty_like(q)
    for i in np.ndindex(q.shape):
        step = np.zeros_like(q, dtype=complex)
        step[i] = 1j * TINY
        gradient[i] = e.energy(q + step).imag / TINY
    force = e.force(q)
    assert np.abs((force - gradient) * scales(e)).max() < 1e-12 * np.abs(force * scales(e)).max()
    R = turn(1.0)
    assert (
        np.abs((e.force(q @ R.T) - force @ R.T) * scales(e)).max() < 1e-12 * np.abs(force * scales(e)).max()
    )


@every_element
@given(seed=st.integers(0, 1000))
def test_tangent_is_the_derivative_of_the_force(e, seed):
    q = large(e, seed)
    K, s = e.tangent(q), np.broadcast_to(scales(e), q.shape)
    derivative = np.empty_like(K)
    for i in np.ndindex(q.shape):
        step = np.zeros_like(q, dtype=complex)
        step[i] = 1j * TINY
        derivative[:, :, *i] = e.force(q + step).imag / TINY
    size = np.abs(K * s[:, :, None, None] * s).max()
    assert np.abs((K - derivative) * s[:, :, None, None] * s).max() < 1e-12 * size
    assert np.abs(K - K.transpose(2, 3, 0, 1)).max() < 1e-12 * np.abs(K).max()


def continuum_energy(e, q, poisson=0.3, E=1e7):
    """Saint Venant-Kirchhoff energy over the rectangle, from the deformation gradient of r = c + y d."""
    lam, G = E * poisson / ((1 + poisson) * (1 - 2 * poisson)), E / (2 * (1 + poisson))
    total = 0.0
    for xi, wx in zip(*gauss(8), strict=True):
        for eta, wy in zip(*gauss(6), strict=True):
            y = (eta - 0.5) * HEIGHT
            by_x = np.zeros(6)
            by_x[[0, 1, 3, 4]] = hermite(xi, e.l, 1)[0]
            by_x[[2, 5]] = -y / e.l, y / e.l
            F = np.stack([by_x @ q, np.array([0, 0, 1 - xi, 0, 0, xi]) @ q], axis=1)
            strain = 0.5 * (F.T @ F - np.eye(2))
            density = 0.5 * lam * np.trace(strain) ** 2 + G * (strain * strain).sum()
            total += wx * wy * e.l * HEIGHT * WIDTH * density
    return total


@pytest.mark.parametrize("poisson", [0.0, 0.3])
def test_energy_of_the_shear_element_is_that_of_the_continuum(poisson):
    e = shear(poisson)
    for seed in range(3):
        q = large(e, seed)
        assert e.energy(q) == pytest.approx(continuum_energy(e, q, poisson), rel=1e-12)


@every_cable_element
def test_energy_of_a_stretched_cable(e):
    assert e.energy(1.7 * reference(e)) == pytest.approx(0.5 * e.EA * 0.7**2 * e.l, rel=1e-12)


@every_cable_element
def test_energy_of_a_slightly_bent_cable(e):
    """y = bx²/2 has the curvature b; its stretch enters at fourth order in b."""
    b, k = 1e-6, e.vectors_per_node
    q = reference(e)
    q[k : k + 2, 1] = 0.5 * b * e.l**2, b * e.l
    if isinstance(e, QuinticElement):
        q[2::3, 1] = b * e.l
    assert e.energy(q) == pytest.approx(0.5 * e.EI * b**2 * e.l, rel=1e-8)


@every_cable_element
def test_curvature_of_a_cable_is_divided_by_the_square_of_the_stretch(e):
    """A bent cable scaled by λ: each κ falls as (λ·λ)/λ², so the bending energy stays; |r'|³ would change it."""
    e = replace(e, EA=0.0)
    q = large(e, 3)
    assert e.energy(2.0 * q) == pytest.approx(e.energy(q), rel=1e-12)


@pytest.mark.parametrize("e", [shear(0.0), shear(0.3), shear(0.3, Circle(HEIGHT))])
def test_force_by_invariant_matrices_is_that_by_quadrature(e):
    invariant = InvariantShearElement(e)
    for seed in range(5):
        q = large(e, seed)
        force = e.force(q) * scales(e)
        assert np.abs(invariant.force(q) * scales(e) - force).max() < 1e-12 * np.abs(force).max()


# --- mass and weight ---------------------------------------------------------------------------------------


def shapes(e, xi, y):
    """N of r = N q at a point of the volume."""
    N = e.axis(xi)[0]
    return N + y * e.turning(xi)[0] if isinstance(e, ShearElement) else N


def volume(e):
    """Points (ξ, y) and weights of high order over the rectangular volume; a cable is a line of the same mass."""
    for xi, wx in zip(*gauss(8), strict=True):
        for eta, wy in zip(*gauss(6), strict=True):
            yield xi, (eta - 0.5) * HEIGHT, wx * wy * e.l * HEIGHT * WIDTH


@pytest.mark.parametrize("e", [shear(), cable(), quintic_cable()], ids=["shear", "cable", "quintic"])
def test_mass_and_weight_are_the_integrals_over_the_volume(e):
    density = e.density if isinstance(e, ShearElement) else e.mass_per_length / (HEIGHT * WIDTH)
    N = [(shapes(e, xi, y), density * w) for xi, y, w in volume(e)]
    s = scales(e)[:, 0]
    mass, weight = sum(w * np.outer(n, n) for n, w in N), sum(w * n for n, w in N)
    total = density * e.l * HEIGHT * WIDTH
    assert np.abs((e.mass - mass) * np.outer(s, s)).max() < 1e-14 * total * e.l**2
    assert np.abs((e.gravity - weight) * s).max() < 1e-14 * total * e.l
    assert np.abs(e.gravity - density * HEIGHT * WIDTH * e.load).max() < 1e-15 * total


@every_element
def test_kinetic_energy_of_rigid_motion(e):
    """½mv² + ½Jω² about the middle; a cable has no rotary inertia."""
    q, velocity, omega = reference(e), np.array([1.0, -2.0]), 3.0
    v = omega * q @ turn(pi / 2).T
    v[:: e.vectors_per_node] += velocity - omega * np.array([0.0, e.l / 2])
    mass = e.gravity[:: e.vectors_per_node].sum()
    inertia = mass * e.l**2 / 12 + (e.density * e.I * e.l if isinstance(e, ShearElement) else 0.0)
    kinetic = 0.5 * np.einsum("ic,ij,jc", v, e.mass, v)
    assert kinetic == pytest.approx(0.5 * mass * velocity @ velocity + 0.5 * inertia * omega**2, rel=1e-13)
