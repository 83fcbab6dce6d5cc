"""The study of fidelity, quick: its table is whole, its answers are rows of it, absent features leave no trace."""

from math import inf, sqrt

import pytest

from studies.engine.runner import Runner
from studies.engine.study import Options, find
from studies.fidelity.base_scenes import TARGETS, lowest_frequency
from studies.fidelity.steps import stable_step, step_under
from studies.fidelity.study import run
from studies.report.folder import write
from studies.scenes import cantilever_fall, four_bar


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return run(Options(quick=True), Runner(tmp_path_factory.mktemp("runs"), repeats=1))


def test_every_choice_of_kinds_is_a_row(result):
    frame = result.table("accuracy").frame
    assert find("fidelity") is run
    assert list(frame.groupby("scene", sort=False).size()) == [8, 2]
    assert (frame["status"] == "ok").all()
    assert (frame["cpu_s"] > 0.0).all()
    for _, runs in frame.groupby("scene"):
        richest = runs.iloc[0]  # its error is found from twice its mesh
        assert richest["error"] == richest["reference_error"] > 0.0


def test_poor_models_of_stiff_bodies_are_near_and_of_soft_ones_far(result):
    frame = result.table("accuracy").frame.set_index(["scene", "element"])
    error, step = frame["error"], frame["stable_dt"]
    stiff, soft = ("four-bar", "rigid/cable/rigid"), ("four-bar", "rigid/rigid/rigid")
    assert error[stiff] < 5e-3 < 0.02 < error[soft]
    assert error["cantilever-fall", "rigid"] > 0.02
    assert step[stiff] > 4.0 * step["four-bar", "cable/cable/cable"]
    assert step[soft] == inf


def test_cheapest_models_are_rows_that_meet_the_target(result):
    frame, cheapest = result.table("accuracy").frame, result.table("cheapest").frame
    assert list(cheapest["target_error"]) == [*TARGETS, *TARGETS]
    for line in cheapest.to_dict("records"):
        runs = frame[(frame["scene"] == line["scene"]) & (frame["error"] <= line["target_error"])]
        assert (line["status"] == "ok") != runs.empty
        if line["status"] == "ok":
            assert line["cpu_s"] == runs["cpu_s"].min()
            assert line["error"] <= line["target_error"]
    assert (cheapest["status"] == "ok").any()


def test_rule_of_thumb_tells_soft_bodies_from_stiff_ones(result):
    rules = result.table("rule").frame.set_index(["scene", "body"])
    four = rules.loc["four-bar"]
    assert (four["estimate"] > 0.1).to_dict() == {"crank": False, "coupler": True, "follower": False}
    assert (four["error"] > 0.1).to_dict() == {"crank": False, "coupler": True, "follower": False}
    assert rules.loc["cantilever-fall", "beam"]["estimate"] == 1.0
    assert "misleads" not in set(rules["verdict"])
    # ω₁ = 1.875² √(EI/ρA)/L² of the cantilever, by hand: 1.875²/4 · √(1e9 · 0.005²/12/2000)
    beam = cantilever_fall().scene.bodies[0]
    assert lowest_frequency(beam, held=True) == pytest.approx(0.8970, rel=1e-3)
    # with ten times its mass of 0.2 kg at its end: √(3EI/L³/(2 + 0.243 · 0.2)), EI = 0.104167 N m²
    assert lowest_frequency(beam, True, 2.0) == pytest.approx(sqrt(3 * 0.104167 / 8 / 2.04854), rel=1e-4)


def test_absent_features_leave_no_trace_in_compiled_code(result):
    absent = result.table("absent").frame
    assert absent["common_function_found"].all()
    assert not absent["in_a_plain_run"].any()
    assert absent["cpu_s_present"].iloc[0] > 0.0


def test_pages_can_be_written(result, tmp_path):
    folder = write(result, tmp_path)
    assert {"accuracy.csv", "cheapest.md", "rule.md", "absent.md", "fidelity.svg"} <= {
        f.name for f in folder.iterdir()
    }
    assert len(result.findings) == 4
    assert result.answers == result.findings[:1]


def test_steps_divide_the_output_and_respect_the_limit():
    base = four_bar()
    kinds = ("rigid", "cable", "rigid")
    limit = stable_step(base.scene, (1, 2, 1), kinds)
    dt = step_under(base, limit)
    assert dt <= limit
    assert base.output_dt / dt == pytest.approx(round(base.output_dt / dt), abs=1e-9)
    assert step_under(base, inf) == pytest.approx(base.output_dt / 5)  # a thousandth of the run, rounded down
