"""The trade of a case: one program for any solver, error bounds that are sums of parts, recommendations that hold."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from user_cases import ARM, PORTAL_FRAME

import anctmm as at
from studies.cases import find_case
from studies.engine.refinement import Refinement
from studies.engine.runner import Runner
from studies.engine.study import Options, StudyError
from studies.trade import recommend
from studies.trade.measure import not_timed
from studies.trade.study import run
from studies.trade.tables import at_equal_error, recommended

CASE = find_case(ARM)
SOLVERS = ("anctmm", "global-dae", "exudyn-cable")


@pytest.fixture(scope="module")
def result():
    return run(Options(quick=True, cases=(CASE,), solvers=SOLVERS), Runner(quick=True))


def test_the_error_bound_is_the_sum_of_its_parts_and_bounds_the_error(result):
    rows = result.table("points").frame
    rows = rows[rows["status"] == "ok"]
    parts = rows["mesh_error"] + rows["step_error"] + rows["reference_error"]
    np.testing.assert_allclose(rows["error_bound"], parts)
    assert (rows["error"] <= rows["error_bound"]).all()


def test_a_recommended_setting_meets_its_target_against_a_far_finer_run(result):
    best = result.table("recommended").frame
    assert best["status"].eq("ok").all()
    assert (best["mesh_error"] + best["step_error"] + best["reference_error"] <= best["target"]).all()
    far = Refinement(CASE, Runner(), integrator="esdirk").refined(1e-4)
    for line in best.to_dict("records"):
        solution = Runner().solve(recommend.trial_of(line, CASE))
        assert at.compare(solution, far.solution, CASE.probes).error <= line["target"]


def test_every_solver_has_a_row_at_each_target(result):
    equal = result.table("at_equal_error").frame
    assert set(equal["solver"]) == set(SOLVERS)
    good = equal[equal["status"] == "ok"]
    assert (good.groupby("target")["ratio"].min() == 1.0).all()
    assert (good["whole_s"] > good["cpu_s"]).all()
    corrections = good["corrections_per_step"].dropna()  # explicit steps have none
    assert len(corrections) > 0
    assert (corrections > 0.5).all()


def test_solvers_at_the_same_setting_have_the_same_error(result):
    same = result.table("same_setting").frame
    for _, lines in same.groupby(["element", "quadrature", "integrator", "elements", "dt"]):
        assert len(lines) > 1
        assert lines["error"].max() == pytest.approx(lines["error"].min(), rel=0.05)


def test_kinds_of_outcome_are_told_apart(result):
    kinds = result.table("outcomes").frame.set_index(["solver", "stepping"])["outcome"]
    assert kinds["anctmm", "generalized-alpha"] == "answer"
    assert kinds["exudyn-cable", "generalized-alpha, error-controlled"] == "setting refused"


def test_references_are_checked_by_another_solver(result):
    (line,) = result.table("references").frame.to_dict("records")
    assert line["check"] in SOLVERS
    assert line["check_difference"] < 1e-6


def test_a_static_case_and_one_that_rests_are_refused():
    with pytest.raises(StudyError, match="static equilibrium"):
        run(Options(cases=(find_case(PORTAL_FRAME, "portal-frame-at-rest"),)), Runner())
    wheel = at.RigidBody("wheel", 3.0, 0.02, (0.0, 0.0))
    scene = at.Scene("wheel", [wheel], [at.Pin("wheel.center")], [at.Torque("wheel.center", 5.0)])
    with pytest.raises(StudyError, match=r"wheel\.center, none of which moves"):
        run(Options(quick=True, cases=(at.Case(scene, ["wheel.center"], t_end=0.1),)), Runner())


def test_a_study_of_which_all_runs_fail_says_why():
    spring = at.Spring("m.center", (0.0, 0.0), law=lambda length, rate, t: float("nan") if t > 0.0 else 0.0)
    scene = at.Scene("odd", [at.PointMass("m", 1.0, (1.0, 0.0))], connectors=[spring])
    case = at.Case(scene, ["m.center"], t_end=0.1)
    found = run(Options(quick=True, cases=(case,), solvers=("anctmm",)), Runner())
    assert not found.good
    assert any("law" in finding for finding in found.findings)


def test_solvers_with_features_for_verification_are_not_timed():
    assert list(not_timed(CASE, Options())) == []
    mass, line = at.PointMass("m", 1.0, (0.0, 0.0)), at.Slider("m.center", direction=(1, -1))
    case = at.Case(at.Scene("slider", [mass], [line], gravity=(0, -9.81)), ["m.center"], t_end=0.1)
    late = dict(not_timed(case, Options()))
    assert "sliders" in late["global-dae"]
    assert not list(not_timed(case, Options(solvers=("global-dae",))))


# --- pure functions on made-up points ---------------------------------------------------------------------------


def points(**columns):
    rows = pd.DataFrame({
        "scene": "s", "solver": ["a", "a", "b"], "element": "cable", "asked": "cable", "quadrature": "full",
        "integrator": "generalized-alpha", "elements": "4", "dofs": 20, "dt": [1e-2, 1e-3, 1e-3],
        "tolerance": np.nan, "newton_tolerance": np.nan, "own": "{}", "steps": [100, 1000, 1000],
        "newton_iterations": [200, 2000, 5000], "error": [1e-3, 1e-4, 1e-4], "mesh_error": [4e-3, 1e-4, 1e-4],
        "step_error": [4e-3, 1e-4, 1e-4], "reference_error": 1e-5, "cpu_s": [1.0, 10.0, 50.0],
        "cpu_spread": 0.1, "build_s": 1.0, "whole_s": [2.0, 11.0, 51.0], "repeats": 5, "in_turn": True, "status": "ok",
        **columns,
    })  # fmt: skip
    return rows.assign(error_bound=rows["mesh_error"] + rows["step_error"] + rows["reference_error"])


def test_errors_that_cancel_do_not_count():
    best = recommended(points(), (1e-2, 2e-3, 1e-5)).frame
    assert best["dt"].tolist() == [1e-2, 1e-3, 1e-3]
    assert best["status"].str.split(":").str[0].tolist() == ["ok", "ok", "not reached"]


def test_a_ratio_has_its_part_of_the_corrections():
    line = at_equal_error(points(), (1e-3,)).frame.set_index("solver").loc["b"]
    assert line["ratio"] == pytest.approx(5.0)
    assert line["corrections_per_step"] == pytest.approx(5.0)
    assert line["ratio_per_correction"] == pytest.approx(2.0)
    assert line["ratio_whole"] == pytest.approx(51.0 / 11.0)


# --- recommend --------------------------------------------------------------------------------------------------


def test_recommendations_are_found_where_the_study_writes_and_meet_their_target(
    tmp_path, monkeypatch, result
):
    from studies.report.whole import write_study

    monkeypatch.chdir(tmp_path)
    write_study(replace(result, case=CASE.name), Path("results"))
    measured = recommend.find(CASE)
    assert measured.origin == "results/arm/trade"
    choice = recommend.choose(recommend.narrowed(measured.points, CASE.name, Options()), 1e-2, None)
    assert choice.reached
    again = recommend.rerun(choice, CASE, measured, 1e-2)
    assert again.met
    exec(recommend.script(choice.line, CASE, ARM), names := {})
    assert at.compare(names["solution"], again.solution, CASE.probes).largest == 0.0
    assert again.error == pytest.approx(choice.line["error"], rel=1e-3)


def test_a_trade_of_a_changed_case_is_refused(result):
    measured = recommend.of_result(result)
    recommend.check_case(measured, CASE)
    with pytest.raises(StudyError, match="were changed"):
        recommend.check_case(measured, replace(CASE, t_end=0.2))


def test_a_budget_and_a_target_out_of_reach():
    mine = recommend.narrowed(points(), "s", Options())
    assert recommend.choose(mine, None, 2.0).line["dt"] == 1e-2
    cheap = recommend.choose(mine, None, 0.1)
    assert (cheap.reached, "that cheap" in cheap.remarks[0]) == (False, True)
    both = recommend.choose(mine, 1e-3, 2.0)
    assert (both.reached, "takes 10 s" in both.remarks[0]) == (False, True)
    small = recommend.choose(mine, 1e-6, None)
    assert "does not reach" in small.remarks[0]
    assert "uncertainty of the reference" in small.remarks[1]
    with pytest.raises(StudyError, match="--solvers is 'c'"):
        recommend.narrowed(points(), "s", Options(solvers=("c",)))


def test_a_table_that_is_another_one_is_named(tmp_path):
    with pytest.raises(StudyError, match=r"front\.csv cannot be read"):
        recommend.read(tmp_path)
    (tmp_path / "front.csv").write_text("a,b\n1,2\n")
    with pytest.raises(StudyError, match="has no column 'error_bound'"):
        recommend.read(tmp_path)
