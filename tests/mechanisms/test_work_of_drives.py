"""Work of drives in implicit steps beside the global DAE: Newton's remainder, and two rules of second order."""

from itertools import pairwise

import numpy as np
import pytest
from test_explicit_mechanisms import cut, four_bar, slider_crank

import anctmm as at
from reference import global_dae

SCENES = {
    "four-bar": (four_bar(), cut(four_bar(), "rigid")),
    "slider-crank": (slider_crank(at.Slider), cut(slider_crank(at.Slider))),
}


def work(solver, name, tolerance, dt=1e-3):
    scene, options = SCENES[name]
    s = solver(scene, **options, dt=dt, t_end=0.02, output_dt=0.01, newton_tolerance=tolerance)
    assert s.status.ok
    return s.energy.work


def test_what_is_left_beside_the_global_dae_is_the_rule_of_integration():
    """Both take the trapezoidal rule, by the cosine and the sine of the angle here, by the angle there."""
    steps = (1e-3, 5e-4, 2.5e-4)
    apart = [
        np.abs(
            work(at.solve, "slider-crank", 1e-13, dt) - work(global_dae.solve, "slider-crank", 1e-13, dt)
        ).max()
        for dt in steps
    ]
    for coarse, fine in pairwise(apart):
        assert coarse / fine == pytest.approx(4.0, abs=0.5)


@pytest.mark.parametrize("integrator", ["generalized-alpha", "esdirk"])
def test_drives_of_welded_bars_and_of_bodies_with_two_pins(integrator):
    """Rows that repeated each other had multipliers that grew, and the work of the drive with them: 1e5 J."""
    ends = {"crank": [(0.25, 0), (0, 0.2)], "rod": [(0.25, 0), (1, 0.4)], "tail": [(1, 0.4), (1.5, 0.4)],
            "rocker": [(1, -0.5), (1, 0.4)], "hung": [(0, 0.2), (0, -0.2)]}  # fmt: skip
    bars = [at.Beam(n, p, q, at.Circle(0.02), at.Material(1e9, 1e3)) for n, (p, q) in ends.items()]
    pins = [
        at.Pin(*p.split()) for p in ("crank.start rod.start", "rod.end rocker.end", "crank.end hung.start")
    ]
    joints = [at.Clamp(("crank", 0.5), at.Quintic(1.0, 0.3)), *pins, at.Weld("rod.end", "tail.start")]
    scene = at.Scene("bell crank", bars, [*joints, at.Pin("rocker.start")], gravity=(0, -9.81))
    s = at.solve(scene, mesh=1, element="rigid", integrator=integrator, dt=5e-4, t_end=0.3, output_dt=0.03)
    assert np.abs(s.energy.balance).max() < 1e-4 * s.energy.work.max()
