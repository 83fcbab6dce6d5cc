"""Statistics of repeated runs, and which call of a short run is timed."""

from functools import partial
from time import sleep

import numpy as np
import pandas as pd
import pytest

import anctmm as at
from anctmm.results.ended_early import nothing
from anctmm.results.status import Status
from studies.engine.measuring.timing import least, settled, summarise
from studies.engine.runner import Runner
from studies.engine.running.trial import product
from studies.trade.study import time_again

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


@pytest.mark.parametrize(("pause", "calls"), [(0.0, 2), (0.02, 1)])
def test_of_a_short_call_the_second_in_a_row_is_taken(pause, calls):
    seen = []

    def call():
        sleep(pause)
        seen.append(len(seen))
        return seen[-1]

    assert settled(call, short=0.01) == calls - 1
    assert len(seen) == calls


#: s, of a run's steps, and of what the first call of a setting does beside them.
STEPS, FIRST = 1e-4, 1.5e-3
MASS = at.Scene("mass", [at.PointMass("m", 1.0, (0.0, 0.0))], gravity=(0.0, -9.81))


def forgetful(known, scene, run):
    """A solver that has preparations in the first of several calls of one setting, which its clock includes."""
    cost = STEPS if known[-1:] == [run.dt] else STEPS + FIRST
    known.append(run.dt)
    return nothing("stub", scene, run, Status()).with_cost(at.Cost(cost, cost, run.steps))


def short_trials():
    return product(MASS, ["stub"], [(1,)], [0.1, 0.05], t_end=1.0, output_dt=0.1)


def test_times_of_a_sweep_have_steps_alone():
    """Runs of 0.3 ms were timed at 1.7 ms, as each was the first one of its setting."""
    runner = Runner(None, repeats=3, resolve=lambda name: partial(forgetful, []))
    for outcome in runner.sweep(short_trials()):
        assert [cost.cpu_s for cost in outcome.costs] == [STEPS] * 3


def test_times_of_short_runs_without_times_are_not_kept(tmp_path):
    """They are of a first call; who asks for times has the run timed."""
    runner = Runner(tmp_path, repeats=1, resolve=lambda name: partial(forgetful, []))
    runner.key = lambda *cases: repr(cases)  # the solver is code of a test
    runner.sweep(short_trials(), timed=False)
    assert [o.costs[0].cpu_s for o in runner.sweep(short_trials())] == [STEPS] * 2


def test_times_in_turn_have_steps_alone():
    trials, known = short_trials(), []
    runner = Runner(None, resolve=lambda name: partial(forgetful, known))
    frame = pd.DataFrame({"solver": "stub", "robust_error": [1e-2, 1e-3], "cpu_s": [1e-3, 2e-3]})
    found = time_again(trials, frame, 2, runner)
    assert [[s.cost.cpu_s for s in samples] for samples in found.values()] == [[STEPS] * 2] * 2
