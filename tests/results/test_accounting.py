"""A cost says what the steps took, what building the rest took, and what the compiler took."""

from time import process_time

import pytest
from samples import bar

from anctmm.model.scene import Clamp
from anctmm.solve import solve, solve_static
from reference import global_dae

SCENE = bar([Clamp("bar.start")], gravity=(0.0, -9.81))
RUNS = {
    "anctmm": lambda: solve(SCENE, mesh=2, dt=1e-3, t_end=2e-3),
    "anctmm, statics": lambda: solve_static(SCENE, mesh=2),
    "global-dae": lambda: global_dae.solve(SCENE, mesh=2, dt=1e-3, t_end=2e-3),
    "global-dae, statics": lambda: global_dae.solve_static(SCENE, mesh=2),
}


@pytest.mark.parametrize("run", RUNS)
def test_the_parts_of_a_cost_add_up_to_the_call(run):
    RUNS[run]()
    began = process_time()
    cost = RUNS[run]().cost
    took = process_time() - began
    assert cost.build_s > 0.0
    assert cost.compile_s == 0.0
    assert 0.0 < cost.cpu_s + cost.build_s <= took
