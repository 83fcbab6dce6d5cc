"""Kelvin-Voigt damping: the elements' forces, both integrators, peers, an exact decay, and nothing where absent."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from samples import INTEGRATORS, KINDS, SQUARE, bar, gap, system_of

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.cable import CableElement
from anctmm.elements.shear import ShearElement
from anctmm.errors import PropertyError, StabilityError
from anctmm.integrators.stability import highest_frequency, highest_rate, step_limit
from anctmm.model.scene import Beam, Clamp, Material, Pin, Scene
from anctmm.solve import solve
from reference import exudyn_cable, global_dae

TAU = 1e-3
DAMPED = Material(E=1e7, density=1000.0, damping=TAU)
ELEMENTS = {
    "cable": CableElement(0.3, 4e3, 0.13, 0.4, damping=0.02),
    "shear": ShearElement(0.3, 4e-4, 1.3e-8, 7.7e-13, 4e6, 5e6, 1e3, damping=0.02),
}


def falling(material=DAMPED, tail=0.0):
    """A clamped bar that falls under gravity, pinned to a second one, by default not damped."""
    bodies = [
        Beam("bar", (0.0, 0.0), (0.6, 0.8), SQUARE, material),
        Beam("tail", (0.6, 0.8), (1.0, 0.8), SQUARE, Material(E=1e7, density=1000.0, damping=tail)),
    ]
    return Scene("falling", bodies, [Clamp("bar.start"), Pin("bar.end", "tail.start")], gravity=(0.0, -9.81))


def undeformed(element):
    """Coordinates of the straight element."""
    one, two = [[0, 0], [1, 0], [0, 1]], [[element.l, 0], [1, 0], [0, 1]]
    k = element.vectors_per_node
    return np.array(one[:k] + two[:k], dtype=float)


def state(element, seed=3):
    """A bent element and velocities of its coordinates."""
    rng = np.random.default_rng(seed)
    q = undeformed(element)
    noise = (
        rng.standard_normal((2, *q.shape)) * np.array([element.l, *[1.0] * (len(q) // 2 - 1)] * 2)[:, None]
    )
    return q + 0.1 * noise[0], noise[1]


@pytest.mark.parametrize("kind", KINDS)
def test_force_is_gradient_of_dissipation_and_its_power_twice_that(kind):
    element = ELEMENTS[kind]
    q, v = state(element)
    force = element.damping_force(q, v)
    for i in np.ndindex(v.shape):
        shifted = v.astype(complex)
        shifted[i] += 1e-30j
        assert element.dissipation(q, shifted).imag / 1e-30 == pytest.approx(force[i], rel=1e-12, abs=1e-9)
    assert (force * v).sum() == pytest.approx(2.0 * element.dissipation(q, v), rel=1e-12)
    # along a motion the elastic force changes by K q̇: where there is no stress the damping force is τ times that
    q = undeformed(element)
    assert np.allclose(
        element.damping_force(q, v), element.damping * np.tensordot(element.tangent(q), v, 2), rtol=1e-10
    )


@pytest.mark.parametrize("kind", KINDS)
def test_rigid_motion_of_a_bent_element_is_not_resisted(kind):
    element = ELEMENTS[kind]
    q, v = state(element)
    spin = 3.0 * q @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    spin[:: element.vectors_per_node] += [2.0, -5.0]
    size = np.abs(element.damping_force(q, v)).max()
    assert np.abs(element.damping_force(q, spin)).max() < 1e-13 * size


def test_explicit_equals_the_global_equations_to_rounding_and_keeps_its_account():
    kinds = {"bar": "shear", "tail": "cable"}
    run = Discretisation(mesh=2, element=kinds, integrator="zhai", dt=2.5e-6, t_end=0.25, output_dt=0.025)
    scene = falling(tail=TAU / 5)
    ours, other = solve(scene, run), global_dae.solve(scene, run)
    assert ours.status.ok
    assert gap(ours, other) < 1e-10
    assert gap(ours, other, body="tail") < 1e-10
    assert np.abs(ours.energy.work - other.energy.work).max() < 1e-10
    assert ours.energy.work[-1] < -1e-3
    assert np.abs(ours.energy.balance).max() < 1e-5 * np.abs(ours.energy.work[-1])


@pytest.mark.parametrize("linear_algebra", ["sparse-factored-once", "dense-refactor"])
@pytest.mark.parametrize("kind", KINDS)
def test_implicit_equals_the_global_equations_and_keeps_its_account(kind, linear_algebra):
    """With speed from the start; damping of each body its own, strong enough to need its part of the matrix."""
    speeds = (lambda s: (s, -s), lambda s: (1.0 - s, s - 1.0))
    scene = falling(replace(DAMPED, damping=1e-2), tail=1e-3)
    bodies = tuple(replace(b, velocity=v) for b, v in zip(scene.bodies, speeds, strict=True))
    scene = replace(scene, bodies=bodies)
    run = Discretisation(mesh=2, element=kind, dt=1e-3, t_end=0.25, output_dt=0.01, newton_tolerance=1e-12)
    ours, other = solve(scene, run), global_dae.solve(scene, run, linear_algebra=linear_algebra)
    assert ours.status.ok
    assert other.status.ok
    assert gap(ours, other) < 1e-8
    assert gap(ours, other, body="tail") < 1e-8
    assert np.abs(ours.energy.work - other.energy.work).max() < 1e-8
    assert ours.energy.work[1] < -1e-5
    assert other.cost.newton_iterations < 14 * run.steps


@pytest.mark.parametrize("damping", [0.0, TAU])
@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("kind", KINDS)
def test_bodies_without_unknowns_rest_in_every_road(kind, integrator, damping):
    """Clamped at both ends, one element: nothing can move, nothing is divided by."""
    scene = bar([Clamp("bar.start"), Clamp("bar.end")], gravity=(0.0, -9.81))
    material = replace(DAMPED, damping=damping)
    scene = replace(scene, bodies=[replace(b, material=material) for b in scene.bodies])
    run = Discretisation(mesh=1, element=kind, integrator=integrator, dt=1e-3, t_end=0.01)
    roads = [
        lambda: solve(scene, run),
        lambda: global_dae.solve(scene, run),
        lambda: global_dae.solve(scene, run, linear_algebra="dense-refactor"),
    ]
    if integrator != "zhai":
        roads.append(
            lambda: solve(scene, mesh=1, element=kind, integrator=integrator, tolerance=1e-3, t_end=0.01)
        )
    if kind == "cable":
        roads.append(lambda: exudyn_cable.solve(scene, run))
    for road in roads:
        found = road()
        if found.status == "unsupported":
            continue
        assert found.status.ok, found.status
        assert found.t[-1] == pytest.approx(0.01)
        for fraction in (0.0, 0.5, 1.0):
            path = found.position("bar", fraction)
            assert np.abs(path - path[0]).max() < 1e-12


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_axial_vibration_decays_as_exactly_known(integrator):
    """First mode of a free-free bar, zeta = τω/2, ω = π √(E/ρ)/L: its amplitude falls by exp(−ζωt)."""
    omega = pi * sqrt(1e7 / 1000.0)
    tau = 0.02 / omega  # ζ = 0.01
    small = 1e-6
    beam = Beam(
        "bar",
        (0.0, 0.0),
        (1.0, 0.0),
        SQUARE,
        replace(DAMPED, damping=tau),
        lambda s: (small * np.cos(pi * s), 0.0),
    )
    periods = 5.0
    t_end = periods * 2.0 * pi / omega
    ours = solve(
        Scene("ringing", [beam]), mesh=8, integrator=integrator, dt=t_end / 4000, t_end=t_end, output_dt=t_end / 100,
        spectral_radius=1.0, newton_tolerance=1e-13,
    )  # fmt: skip
    damped = omega * sqrt(1.0 - 0.01**2)
    expected = small / damped * np.exp(-0.01 * omega * ours.t) * np.sin(damped * ours.t)
    assert np.abs(ours.displacement("bar.start")[:, 0] - expected).max() < 2e-4 * np.abs(expected).max()


def test_scene_limit_counts_damping():
    scene = bar([Clamp("bar.start")], material=DAMPED)
    system = system_of(scene, mesh=4)
    omega, rate = (
        highest_frequency(system, system.mesh.reference),
        highest_rate(system, system.mesh.reference),
    )
    assert rate == pytest.approx(TAU * omega**2, rel=1e-6)  # one τ throughout
    limit = step_limit(0.5, 0.5, omega, rate)
    for solver in (solve, global_dae.solve):
        with pytest.raises(StabilityError, match=f"at most {limit:.6g} s"):
            solver(scene, mesh=4, integrator="zhai", dt=1.01 * limit, t_end=1.01 * limit)
    assert solve(scene, mesh=4, integrator="zhai", dt=0.99 * limit, t_end=99 * limit).status.ok


@pytest.mark.parametrize(
    ("error", "match", "make"),
    [
        (PropertyError, r"damping \(s\) is -1", lambda: Material(E=1.0, density=1.0, damping=-1)),
        (PropertyError, r"damping \(s\) is nan", lambda: Material(E=1.0, density=1.0, damping=float("nan"))),
    ],
)
def test_what_cannot_be_is_named(error, match, make):
    with pytest.raises(error, match=match):
        make()
