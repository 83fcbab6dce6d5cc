"""An error that a loose bound of Newton's iteration makes smaller by chance does not count."""

import numpy as np
import pandas as pd
import pytest
from marks import interpreted_where

from anctmm.discretise.discretisation import Discretisation
from anctmm.solvers import registry
from studies.engine.accuracy.robust import halved_errors, robust_errors
from studies.engine.choices import choices_of
from studies.scenes import cantilever_fall

LOOSE, TIGHT = (("newton_tolerance", 1e-3),), (("newton_tolerance", 1e-7),)


def test_no_error_counts_as_smaller_than_with_the_tightest_bound():
    errors = pd.Series([1.0, 2.0, 3.0, 4.0, np.nan, 6.0], index=[5, 3, 1, 1, 2, 4])
    alike = [("a", 8), ("a", 8), ("a", 8), ("a", 16), ("a", 16), ("b", 8)]
    found = robust_errors(errors, alike, [False, True, False, False, True, False])
    assert found.index.equals(errors.index)
    # the first was lucky; what the tightest bound failed at says nothing, nor what was not run with it
    np.testing.assert_array_equal(found, [2.0, 2.0, 3.0, 4.0, np.nan, 6.0])


def test_a_failed_run_stays_failed():
    assert np.isnan(robust_errors(pd.Series([np.nan, 1.0]), ["a", "a"], [False, True]).iloc[0])


def test_no_error_counts_as_smaller_than_that_of_steps_shorter_by_up_to_a_half():
    steps = [8.0, 4.0, 2.0, 1.0, 0.5, 1.0]
    errors = pd.Series([4.0, 0.1, 0.5, np.nan, 0.7, 9.0], index=[5, 3, 1, 1, 2, 4])
    found = halved_errors(errors, ["a"] * 5 + ["b"], steps)
    assert found.index.equals(errors.index)
    np.testing.assert_array_equal(found, [4.0, 0.5, 0.5, np.nan, 0.7, 9.0])


def test_errors_that_fall_with_the_step_are_left_as_they_are():
    steps = 2.0 ** -np.arange(0.0, 6.0, 0.5)
    np.testing.assert_array_equal(halved_errors(pd.Series(steps**2), ["a"] * 12, steps), steps**2)


@pytest.mark.parametrize(
    "solver",
    interpreted_where(
        lambda solver: solver == "global-dae", ["anctmm", "global-dae", "exudyn-cable", "exudyn-reissner"]
    ),
)
def test_the_first_choice_of_a_solver_iterates_the_most(solver):
    """With one way to take tangents, so that corrections tell how far the iteration goes."""
    solve, scene = registry.solver(solver), cantilever_fall().scene
    run = {"mesh": 2, "dt": 1e-2, "t_end": 0.1, "output_dt": 1e-2}
    corrections = [
        solve(scene, Discretisation(**run, **dict(shared)), **dict(own)).cost.newton_iterations
        for shared, own in choices_of(solver)
        if "newton" not in dict(own)
    ]
    assert len(corrections) == 3
    assert corrections == sorted(corrections, reverse=True)
    assert corrections[0] > corrections[-1]
