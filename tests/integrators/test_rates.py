"""Convergence with the mesh: each rate with its error level, against exact frequencies and motions."""

import numpy as np
import pytest
from samples import SQUARE, bar, chain_of, row_scene
from scipy.linalg import eigh
from test_explicit import Dense

from anctmm.model.drives import Quintic
from anctmm.model.scene import Beam, Clamp, Material, Pin, Scene
from anctmm.solve import solve
from reference import exact

#: Of squared frequencies, (rad/s)²: without it rigid motions would make the stiffness singular.
SHIFT = 100.0
LENGTH, MATERIAL = 1.0, Material(E=1e7, density=1000.0)
A, EI = SQUARE.area, MATERIAL.E * SQUARE.second_moment
MASS, EA, GA = MATERIAL.density * A, MATERIAL.E * A, MATERIAL.lame[1] * A


def frequencies(scene, kind, mesh):
    """Of small vibrations about the reference, rad/s, growing; rigid motions left out."""
    chain = chain_of(scene, mesh=mesh, element=kind)
    dense, k = Dense(chain), 2 * chain.bodies.meshes[0].vectors

    def stiffness(m, x):
        K = m.element.tangent(m.reference[:2].reshape(k, 2)).reshape(2 * k, 2 * k)
        return (K @ x.ravel()).reshape(x.shape)

    K = np.stack([dense.sum(e.reshape(dense.start.shape), stiffness).ravel() @ dense.T for e in dense.T.T])
    # 1/(ω² + shift): the lowest frequencies are the largest values here, and rounding spares them
    values = 1.0 / eigh(dense.mass, K + SHIFT * dense.mass, eigvals_only=True) - SHIFT
    return np.sort(np.sqrt(values[values > 1.0]))


def errors(scene, kind, meshes, wanted):
    """Relative errors of the frequencies next to the wanted ones, (meshes, wanted)."""
    found = (frequencies(scene, kind, m) for m in meshes)
    return np.array([[np.abs(f / w - 1.0).min() for w in wanted] for f in found])


def orders(e):
    return np.log2(e[:-1] / e[1:])


@pytest.mark.parametrize(("joints", "ends"), [((), "free-free"), ((Clamp("bar.start"),), "clamped-free")])
def test_bending_frequencies_of_cables_converge_at_fourth_order(joints, ends):
    wanted = exact.euler_bernoulli_frequencies(ends, 3, LENGTH, EI, MASS)
    e = errors(bar(joints), "cable", (8, 16, 32), wanted)
    clear = e[1:] > 1e-7  # of rounding, ε ω_max²/ω²
    assert clear.sum() >= 4
    assert orders(e)[clear] == pytest.approx(4.0, abs=0.35)
    assert e[-1].max() < 1.2e-5


def test_axial_frequencies_of_cables_converge():
    """Fast where both ends are free; a clamp, which also holds the stretch of its node, makes it first order."""
    wanted = exact.axial_frequencies("free-free", 1, LENGTH, EA, MASS)
    e = errors(bar(), "cable", (2, 4, 8), wanted)
    assert orders(e).min() > 3.5
    assert e[-1].max() < 1e-5
    wanted = exact.axial_frequencies("clamped-free", 1, LENGTH, EA, MASS)
    e = errors(bar([Clamp("bar.start")]), "cable", (8, 16), wanted)
    assert orders(e) == pytest.approx(np.ones((1, 1)), abs=0.1)
    assert e[-1].max() < 0.01


def test_bending_frequencies_of_shear_elements_converge_at_second_order():
    """Towards Timoshenko's beam with shear factor 1, without Poisson's ratio."""
    inertia = MATERIAL.density * SQUARE.second_moment
    wanted = exact.timoshenko_frequencies("free-free", 2, LENGTH, EI, GA, MASS, inertia)
    e = errors(bar(), "shear", (8, 16, 32), wanted)
    assert orders(e) == pytest.approx(np.full((2, 2), 2.0), abs=0.3)
    assert e[-1].max() < 5e-3


@pytest.mark.parametrize("kind", ["cable", "shear"])
def test_stiff_pendulum_tends_to_the_rigid_one(kind):
    """The softness, 1/E, is what is left: an error of first order in it."""
    gaps = []
    for E in (1e9, 4e9):
        beam = Beam("bar", (0.0, 0.0), (1.0, 0.0), SQUARE, Material(E, 1000.0))
        scene = Scene("pendulum", [beam], [Pin("bar.start")], gravity=(0.0, -9.81))
        motion = solve(scene, mesh=2, element=kind, dt=2e-4, t_end=0.5, output_dt=0.05, spectral_radius=0.5)
        gyration = np.sqrt(SQUARE.second_moment / A) if kind == "shear" else 0.0
        rigid = exact.Pendulum(exact.bar_reduced_length(1.0, gyration), amplitude=np.pi / 2, gravity=9.81)
        angle = rigid.angle(motion.t) - np.pi / 2
        tip = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        gaps.append(np.abs(motion.position("bar", 1.0) - tip).max())
    assert gaps[0] < 2e-3
    assert gaps[1] < 0.5 * gaps[0]


def tip_error(mesh, fine):
    row = row_scene("free", [("pin", 0.5)], "free", gravity=(0.0, -2.0))
    scene = Scene("row", row.bodies, [*row.joints, Clamp("b0.start", Quintic(0.5, 0.2))])
    motion = solve(scene, mesh=mesh, dt=1e-3, t_end=0.2, output_dt=0.2, quadrature="lobatto")
    return (
        motion if fine is None else np.abs((motion.position("b1", 1.0) - fine.position("b1", 1.0))[-1]).max()
    )


def test_motion_of_a_driven_chain_converges_with_the_mesh():
    """Cables with Lobatto's points; the clamp's stretch keeps it from fourth order (see above)."""
    fine = tip_error(32, None)
    e = np.array([tip_error(m, fine) for m in (2, 4, 8)])
    assert orders(e).min() > 1.9
    assert e[-1] < 1e-5
