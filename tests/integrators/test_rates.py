"""Convergence with the mesh: each rate with its error level, against exact frequencies and motions."""

import numpy as np
import pytest
from samples import SQUARE, row_scene

from anctmm.model.drives import Quintic
from anctmm.model.scene import Beam, Clamp, Material, Pin, Scene
from anctmm.solve import solve
from reference import exact

LENGTH, MATERIAL = 1.0, Material(E=1e7, density=1000.0)
A, EI = SQUARE.area, MATERIAL.E * SQUARE.second_moment


def orders(e):
    return np.log2(e[:-1] / e[1:])


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
