"""Statistics of repeated runs."""

import numpy as np
import pytest

import anctmm as at
from studies.engine.measuring.timing import least, summarise

COSTS = [
    at.Cost(cpu, wall, 10, build_s=build)
    for cpu, wall, build in [(3.0, 9.0, 2.0), (1.0, 4.0, 5.0), (2.0, 5.0, 3.0)]
]


@pytest.mark.parametrize(
    ("statistic", "cpu_s", "wall_s", "build_s", "spread"),
    [(summarise, 2.0, 5.0, 3.0, 1.0), (least, 1.0, 4.0, 2.0, 2.0)],
)
def test_medians_of_runs_and_the_least_of_runs_in_turn(statistic, cpu_s, wall_s, build_s, spread):
    found = statistic(COSTS)
    assert (found.cpu_s, found.wall_s, found.build_s, found.repeats) == (cpu_s, wall_s, build_s, 3)
    assert found.cpu_spread == spread


@pytest.mark.parametrize("statistic", [summarise, least])
def test_one_run_has_no_spread_and_none_has_no_time(statistic):
    assert np.isnan(statistic(COSTS[:1]).cpu_spread)
    assert np.isnan(statistic([]).cpu_s)
    assert statistic([]).repeats == 0
