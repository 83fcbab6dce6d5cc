"""Pareto fronts, costs at equal error and robust errors, on made-up numbers."""

import numpy as np
import pandas as pd
import pytest

from studies.engine.fronts import cost_at, excess, front, reaching, robust

ROWS = pd.DataFrame({
    "error_bound": [1e-1, 1e-2, 2e-2, 1e-3, np.nan, 1e-4],
    "cpu_s": [1.0, 2.0, 3.0, 8.0, 1.0, np.nan],
})  # fmt: skip


def test_the_front_has_the_rows_that_no_other_beats():
    assert front(ROWS).index.tolist() == [0, 1, 3]
    assert excess(ROWS).fillna(-1.0).tolist() == [1.0, 1.0, 1.5, 1.0, -1.0, -1.0]


def test_costs_are_interpolated_in_logarithms():
    assert cost_at(ROWS, 1e-2) == pytest.approx(2.0)
    assert cost_at(ROWS, 10**-2.5) == pytest.approx(4.0)
    assert cost_at(ROWS, 1.0) == pytest.approx(1.0)
    assert np.isnan(cost_at(ROWS, 1e-4))


def test_settings_that_reach_a_target_are_ordered_by_cost():
    assert reaching(ROWS, 2e-2).index.tolist() == [1, 2, 3]
    assert reaching(ROWS, 1e-5).empty


def test_no_error_is_smaller_than_by_the_tightest_bound():
    errors = pd.Series([2.0, 1.0, 5.0, np.nan])
    assert robust(errors, "aabb", [True, False, False, True]).fillna(-1).tolist() == [2.0, 2.0, 5.0, -1.0]
