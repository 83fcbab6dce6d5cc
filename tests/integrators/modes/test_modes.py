"""Natural modes against exact frequencies, published blades, and small vibrations in runs."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import anctmm as at
from reference.exact.frequencies import axial_frequencies

L, SLENDER = 1.0, at.Rectangle(5e-3, 5e-3)
STEEL = at.Material(E=2e11, density=7800.0)


def bar(joints=(), material=STEEL, **options):
    return at.Scene("bar", [at.Beam("bar", (0, 0), (0.6, 0.8), SLENDER, material)], joints, **options)


def test_axial_modes_converge_at_first_order_where_a_clamp_holds_the_stretch():
    """A clamp holds the whole gradient, and so the strain, which is largest there in this mode."""
    thick = at.Rectangle(0.1, 0.1)
    scene = at.Scene("bar", [at.Beam("bar", (0, 0), (1, 0), thick, STEEL)], [at.Clamp("bar.start")])
    wanted = axial_frequencies("clamped-free", 1, 1.0, STEEL.E * thick.area, STEEL.density * thick.area)
    errors = [
        np.abs(2 * np.pi * at.modes(scene, mesh=n, count=6).frequencies / wanted[0] - 1.0).min()
        for n in (16, 32)
    ]
    assert 1.8 < errors[0] / errors[1] < 2.2
    assert errors[1] < 4e-3


def test_a_bent_beam_vibrates_as_it_does_in_a_run():
    """The frequency about an equilibrium, from zeros of a small vibration around it."""
    rubber = at.Material(E=5e6, density=1100.0)
    beam = at.Beam("beam", (0, 0), (0.4, 0), at.Rectangle(0.01, 0.01), rubber)
    held = at.Scene("held", [beam], [at.Clamp("beam.start")], gravity=(0, -9.81))
    rest = at.solve_static(held, mesh=3)
    assert rest.angle("beam.end")[-1] < -0.5
    slow = at.modes(held, mesh=3, count=5, about=rest)
    straight = at.modes(held, mesh=3, count=1)
    assert abs(slow.frequencies[0] / straight.frequencies[0] - 1.0) > 0.01
    pushed = at.Scene(
        "pushed", [beam], [at.Clamp("beam.start")], [at.Force("beam.end", (0, 1e-4))], gravity=(0, -9.81)
    )
    start = at.solve_static(pushed, mesh=3)
    run = at.solve(held, mesh=3, dt=1e-3, t_end=round(4.0 / slow.frequencies[0], 2), start=start)
    y = run.position("beam.end")[:, 1] - rest.position("beam.end")[-1, 1]

    def left(lowest):
        """What cosines and sines of the modes' frequencies leave of the motion."""
        phases = 2.0 * np.pi * np.outer(run.t, [lowest, *slow.frequencies[1:]])
        table = np.concatenate([np.cos(phases), np.sin(phases)], axis=1)
        return float(np.sum((y - table @ np.linalg.lstsq(table, y, rcond=None)[0]) ** 2))

    guess = slow.frequencies[0]
    found = minimize_scalar(
        left, bounds=(0.98 * guess, 1.02 * guess), method="bounded", options={"xatol": 1e-7}
    )
    assert left(found.x) < 1e-3 * float(np.sum(y**2))
    assert found.x == pytest.approx(guess, rel=1e-4)
