"""Kelvin-Voigt damping: the elements' forces, both integrators, an exact decay, and nothing where absent."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from samples import INTEGRATORS, KINDS, SQUARE, bar, system_of

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.cable import CableElement
from anctmm.elements.shear import ShearElement
from anctmm.errors import PropertyError, StabilityError
from anctmm.integrators.stability import highest_frequency, step_limit
from anctmm.model.scene import Beam, Clamp, Material, Scene
from anctmm.solve import solve
from reference import global_dae

TAU = 1e-3
DAMPED = Material(E=1e7, density=1000.0, damping=TAU)
ELEMENTS = {
    "cable": CableElement(0.3, 4e3, 0.13, 0.4, damping=0.02),
    "shear": ShearElement(0.3, 4e-4, 1.3e-8, 7.7e-13, 4e6, 5e6, 1e3, damping=0.02),
}
every_kind = pytest.mark.parametrize("kind", KINDS)


def undeformed(element):
    """Coordinates of the straight element."""
    one, two = [[0, 0], [1, 0], [0, 1]], [[element.l, 0], [1, 0], [0, 1]]
    k = element.vectors_per_node
    return np.array(one[:k] + two[:k], dtype=float)


def state(element):
    """A bent element and velocities of its coordinates."""
    rng, q = np.random.default_rng(3), undeformed(element)
    size = np.array([element.l, *[1.0] * (len(q) // 2 - 1)] * 2)[:, None]
    noise = rng.standard_normal((2, *q.shape)) * size
    return q + 0.1 * noise[0], noise[1]


@every_kind
def test_force_is_gradient_of_dissipation_and_its_power_twice_that(kind):
    element = ELEMENTS[kind]
    q, v = state(element)
    force = element.damping_force(q, v)
    for i in np.ndindex(v.shape):
        shifted = v.astype(complex)
        shifted[i] += 1e-30j
        assert element.dissipation(q, shifted).imag / 1e-30 == pytest.approx(force[i], rel=1e-12, abs=1e-9)
    assert (force * v).sum() == pytest.approx(2.0 * element.dissipation(q, v), rel=1e-12)
    assert np.allclose(np.tensordot(element.damping_matrix(q), v, 2), force, rtol=1e-10)
    # along a motion the elastic force changes by K q̇: where there is no stress the damping force is τ times that
    q = undeformed(element)
    expected = element.damping * np.tensordot(element.tangent(q), v, 2)
    assert np.allclose(element.damping_force(q, v), expected, rtol=1e-10)


@every_kind
def test_rigid_motion_of_a_bent_element_is_not_resisted(kind):
    element = ELEMENTS[kind]
    q, v = state(element)
    spin = 3.0 * q @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    spin[:: element.vectors_per_node] += [2.0, -5.0]
    size = np.abs(element.damping_force(q, v)).max()
    assert np.abs(element.damping_force(q, spin)).max() < 1e-13 * size


@pytest.mark.parametrize("damping", [0.0, TAU])
@pytest.mark.parametrize("integrator", INTEGRATORS)
@every_kind
def test_bodies_without_unknowns_rest_in_every_road(kind, integrator, damping):
    """Clamped at both ends, one element: nothing can move, nothing is divided by."""
    material = replace(DAMPED, damping=damping)
    scene = bar([Clamp("bar.start"), Clamp("bar.end")], gravity=(0.0, -9.81), material=material)
    run = Discretisation(mesh=1, element=kind, integrator=integrator, dt=1e-3, t_end=0.01)
    found = [solve(scene, run), global_dae.solve(scene, run)]
    if integrator != "zhai":
        found.append(solve(scene, mesh=1, element=kind, tolerance=1e-3, t_end=0.01))
    for each in found:
        assert each.status.ok, each.status
        assert each.t[-1] == pytest.approx(0.01)
        assert np.abs(each.displacement(("bar", 0.5))).max() < 1e-12


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_axial_vibration_decays_as_exactly_known(integrator):
    """First mode of a free-free bar, zeta = τω/2, ω = π √(E/ρ)/L: its amplitude falls by exp(−ζωt)."""
    omega, small = pi * sqrt(1e7 / 1000.0), 1e-6
    metal = replace(DAMPED, damping=0.02 / omega)  # ζ = 0.01
    beam = Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, metal, lambda s: (small * np.cos(pi * s), 0.0))
    t_end = 10.0 * pi / omega
    ours = solve(
        Scene("ringing", [beam]), mesh=8, integrator=integrator, dt=t_end / 4000, t_end=t_end, output_dt=t_end / 100,
        spectral_radius=1.0, newton_tolerance=1e-13,
    )  # fmt: skip
    damped = omega * sqrt(1.0 - 0.01**2)
    expected = small / damped * np.exp(-0.01 * omega * ours.t) * np.sin(damped * ours.t)
    assert np.abs(ours.displacement("bar.start")[:, 0] - expected).max() < 2e-4 * np.abs(expected).max()


@pytest.mark.parametrize("solver", [solve, global_dae.solve])
def test_scene_limit_counts_damping(solver):
    scene = bar([Clamp("bar.start")], material=DAMPED)
    system = system_of(scene, mesh=4)
    omega = highest_frequency(system, system.mesh.reference)
    limit = step_limit(0.5, 0.5, omega, TAU * omega**2)  # one τ throughout
    with pytest.raises(StabilityError, match="at most"):
        solver(scene, mesh=4, integrator="zhai", dt=1.001 * limit, t_end=100.1 * limit)
    assert solver(scene, mesh=4, integrator="zhai", dt=0.999 * limit, t_end=99.9 * limit).status.ok


@pytest.mark.parametrize("damping", [-1, float("nan")])
def test_what_cannot_be_is_named(damping):
    with pytest.raises(PropertyError, match=rf"damping \(s\) is {damping}"):
        Material(E=1.0, density=1.0, damping=damping)
