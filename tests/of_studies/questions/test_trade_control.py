"""The table of what error control costs: ratios to the front of fixed steps of the same mesh."""

import pandas as pd
import pytest

from studies.trade.control import error_control

NONE = float("nan")
ALIKE = {"scene": "arm", "element": "cable", "quadrature": "full", "elements": "4", "solver": "anctmm",
         "integrator": "generalized-alpha", "stretch": "as given", "status": "ok", "steps": 1,
         "newton_iterations": 1, "newton_tolerance": 1e-7}  # fmt: skip
#: A step, s, that each error of `points` belongs to.
STEP = {1e-2: 1e-1, 1e-3: 3e-2, 1e-4: 1e-2, 1e-6: NONE}


def points():
    """Fixed steps whose cost is that of a second order method, slow ones beside them, and two controlled runs."""
    rows = [ALIKE | {"tolerance": NONE, "step_error": e, "cpu_s": 1e-3 * e**-0.5} for e in (1e-2, 1e-3, 1e-4)]
    rows += [ALIKE | {"tolerance": NONE, "step_error": 1e-3, "cpu_s": 1.0}]
    rows += [ALIKE | {"solver": "global-dae", "tolerance": NONE, "step_error": 1e-4, "cpu_s": 1e-9}]
    rows += [ALIKE | {"elements": "8", "tolerance": NONE, "step_error": 1e-4, "cpu_s": 1e-9}]
    rows += [ALIKE | {"tolerance": 4e-3, "step_error": 1e-3, "cpu_s": 2e-3 * 1e-3**-0.5}]
    rows += [ALIKE | {"tolerance": 1e-5, "step_error": 1e-6, "cpu_s": 1.0}]
    return pd.DataFrame(rows).assign(dt=lambda f: f["step_error"].map(STEP))


def test_cost_is_compared_with_the_best_fixed_step_of_the_same_error_and_of_the_target():
    frame = error_control(points()).frame
    assert list(frame["tolerance"]) == [4e-3, 1e-5]
    assert frame["error_over_asked"].iloc[0] == pytest.approx(0.25)
    assert frame["ratio_at_error"].iloc[0] == pytest.approx(2.0)
    assert frame["ratio_at_target"].iloc[0] == pytest.approx(4.0)
    assert frame[["ratio_at_error", "ratio_at_target"]].iloc[1].isna().all()  # no fixed step tried is as good


def test_each_integrator_is_compared_with_its_own_steps_and_with_the_best_of_all():
    fourth = ALIKE | {"integrator": "esdirk"}
    rows = [
        fourth | {"tolerance": NONE, "step_error": e, "cpu_s": 3e-2 * (e / 1e-3) ** -0.25}
        for e in (1e-2, 1e-4)
    ]
    rows += [fourth | {"tolerance": NONE, "step_error": 1e-4, "stretch": "free", "cpu_s": 1e-9}]
    rows += [fourth | {"tolerance": 2e-3, "step_error": 1e-3, "cpu_s": 6e-2}]
    others = pd.DataFrame(rows).assign(dt=lambda f: f["step_error"].map(STEP))
    frame = error_control(pd.concat([points(), others])).frame.set_index("tolerance")
    assert list(frame["integrator"]) == ["generalized-alpha", "generalized-alpha", "esdirk"]
    assert frame["ratio_at_error"].loc[2e-3] == pytest.approx(2.0)
    assert frame["ratio_at_target"].loc[2e-3] == pytest.approx(2.0 * 2.0**0.25)
    second = 1e-3 * 1e-3**-0.5  # the only fixed step of either that was tried with this error
    assert frame["ratio_to_any"].loc[2e-3] == pytest.approx(6e-2 / second)
    assert frame["ratio_at_error"].loc[4e-3] == pytest.approx(2.0)  # as without the others


def test_a_fixed_step_whose_loose_bound_is_lucky_does_not_count():
    """With the tightest bound the same step has the error 1e-2, so that this step is no cheap way to 1e-3."""
    lucky = ALIKE | {
        "tolerance": NONE,
        "newton_tolerance": 1e-3,
        "dt": STEP[1e-2],
        "step_error": 1e-3,
        "cpu_s": 1e-6,
    }
    frame = error_control(pd.concat([points(), pd.DataFrame([lucky])])).frame
    assert frame["ratio_at_error"].iloc[0] == pytest.approx(2.0)  # as without it
    honest = pd.DataFrame([lucky | {"dt": STEP[1e-3]}])
    assert error_control(pd.concat([points(), honest])).frame["ratio_at_error"].iloc[0] > 1e3
