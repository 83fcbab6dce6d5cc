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
