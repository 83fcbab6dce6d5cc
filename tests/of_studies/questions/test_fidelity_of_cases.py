"""The study of fidelity on scenes of a user's: which beam may be a cable or rigid, and how sure that is."""

import re
from dataclasses import replace
from math import pi

import numpy as np
import pytest
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM, PORTAL_FRAME, THREE_SUPPORTS

import anctmm as at
from studies.cases import cases_in, find_cases
from studies.cli import app
from studies.engine.runner import Runner
from studies.engine.study import Options, StudyError, find
from studies.fidelity.choices import Choices, said
from studies.report.folder import write

ERROR = 1e-2
STEEL = at.Material(E=2e11, density=7800.0)
RUBBER = at.Material(E=2e6, density=1100.0)


def study(*cases, **options):
    return find("fidelity")(
        Options(**({"quick": True, "error": ERROR} | options), cases=cases), Runner(None, repeats=1)
    )


@pytest.fixture(scope="module")
def pendulum():
    case = cases_in(DOUBLE_PENDULUM)[0]
    return case, study(case)


def test_every_choice_is_a_row_for_each_integrator(pendulum):
    _, result = pendulum
    rows = result.table("choices").frame
    assert rows.groupby("model").size().eq(2).all()
    assert len(rows) == 18
    done = rows["status"].eq("ok")
    assert rows["status"][~done].str.startswith("not run: ").all()
    assert (rows["cpu_s"][done] > 0.0).all()
    assert (rows["build_s"][done] > 0.0).all()
    explicit = rows[done & rows["integrator"].eq("zhai")]
    assert (explicit["dt"] <= 0.9001 * explicit["stable_dt"]).all()


def test_distances_are_those_of_runs_that_are_finer_still(pendulum):
    """An independent fine run of shear elements stands for the richest model."""
    case, result = pendulum
    options = {"dt": 2.5e-4, "t_end": case.t_end, "output_dt": case.output_dt}
    exact = at.solve(case.scene, mesh=64, element="shear", **options)
    rows = result.table("choices").frame
    for line in rows[rows["status"].eq("ok")].to_dict("records"):
        kinds = dict(zip(("upper", "lower"), line["element"].split("/"), strict=True))
        mesh = dict(zip(kinds, map(int, line["elements"].split("/")), strict=True))
        run = at.solve(
            case.scene,
            mesh=mesh,
            element=kinds,
            integrator=line["integrator"],
            **options | {"dt": line["dt"]},
        )
        true = at.compare(run, exact, probes=case.probes).error
        assert abs(true - line["error"]) <= line["reference_error"]


def test_the_cheapest_model_meets_its_target_for_sure(pendulum):
    _, result = pendulum
    rows, cheapest = result.table("choices").frame, result.table("cheapest").frame
    assert list(cheapest["target_error"]) == [0.1, 0.03, ERROR]
    assert list(cheapest["status"]) == ["ok"] * 3
    for line in cheapest.to_dict("records"):
        good = rows[rows["error"] + rows["reference_error"] <= line["target_error"]]
        assert line["cpu_s"] == good["cpu_s"].min()
    assert not cheapest["model"].str.contains("upper rigid|all rigid").any()
    beams = result.table("beams").frame.set_index(["beam", "kind"])
    assert beams["distance"]["upper", "rigid"] > 0.3
    assert np.isnan(beams["enough_for"]["upper", "rigid"])
    assert beams["enough_for"]["lower", "rigid"] == ERROR


def test_texts_and_files_are_of_this_scene(pendulum, tmp_path):
    case, result = pendulum
    assert result.answers[0].question == f"{case.name}: which beams may be modelled more simply?"
    assert result.answers[0].take.startswith("For a target error of 0.01 take ")
    texts = [*result.findings, *result.assumptions, *(n for t in result.tables for n in t.notes)]
    assert not [t for t in texts if re.search("crank|coupler|follower|four-bar|cantilever", t)]
    folder = write(result, tmp_path)
    assert folder.name == "fidelity-double-pendulum"
    assert {"choices.csv", "cheapest.md", "beams.md", "fidelity_double-pendulum.svg"} <= {
        f.name for f in folder.iterdir()
    }


def test_welded_beams_are_cables_together():
    case = cases_in(THREE_SUPPORTS)[0]
    result = study(case)
    rows = result.table("choices").frame
    assert not rows["status"].str.startswith("refused").any()
    beams = result.table("beams").frame
    assert set(beams[beams["kind"].eq("cable")]["model"]) == {"all cable"}
    assert set(result.table("cheapest").frame["model"]) == {"all cable"}


def test_shear_elements_that_lock_are_no_measure_and_equilibria_are_compared_at_rest():
    moving, at_rest = find_cases(PORTAL_FRAME)
    result = study(moving, at_rest)
    rows = result.table("choices").frame
    assert rows["reference"].str.startswith("all cable").all()
    shear = rows[rows["model"].eq("all shear") & rows["integrator"].isin(["generalized-alpha", "static"])]
    assert (shear["error"] > 0.03).all()  # bending stiffness off by 1.35
    assert any("bend too stiffly by 1.35" in text for text in result.assumptions)
    assert set(rows[rows["scene"].eq(at_rest.name)]["integrator"]) == {"static"}


def test_what_cannot_be_rigid_is_a_row_with_the_reason():
    """A beam whose ends are held apart, and stretched, cannot be rigid."""
    bow = at.Beam("bow", (0, 0), (1, 0), at.Circle(0.01), RUBBER)
    scene = at.Scene(
        "bow", [bow], [at.Pin("bow.start"), at.Slider("bow.end", (1, 0), position=at.History(moved))]
    )
    rows = study(at.Case(scene, [("bow", 0.3)], t_end=0.1, output_dt=0.01)).table("choices").frame
    rigid = rows[rows["model"].eq("rigid")]
    assert len(rigid)
    assert not rigid["status"].eq("ok").any()
    assert rows[rows["model"].eq("cable")]["status"].eq("ok").any()


def moved(t):
    """A stretch by 1 % and its rates."""
    w = 5.0 * pi
    return 0.01 * np.sin(w * t) ** 2, 0.01 * w * np.sin(2 * w * t), 0.02 * w * w * np.cos(2 * w * t)


def chain(count):
    """Stiff and soft links in turn, hung at one end."""
    links = [
        at.Beam(f"link{k}", (0.2 * k, 0), (0.2 * k + 0.2, 0), at.Circle(0.01), RUBBER if k % 2 else STEEL)
        for k in range(count)
    ]
    pins = [at.Pin(f"link{k}.end", f"link{k + 1}.start") for k in range(count - 1)]
    return at.Scene("chain", links, [at.Pin("link0.start"), *pins], gravity=(0, -9.81))


def test_of_many_beams_like_ones_are_chosen_together():
    scene = chain(10)
    choices = Choices.of(scene, ("shear", "cable", "rigid"))
    assert choices.units == ((0, 2, 4, 6, 8), (1, 3, 5, 7, 9))
    assert len(choices.first()) == 9
    result = study(at.Case(scene, ["link9.end"], t_end=0.1, output_dt=0.01), error=3e-2)
    best = result.table("cheapest").frame.iloc[-1]
    assert best["status"] == "ok"
    assert best["model"] == "all cable" or "rigid" in best["model"]


def test_combinations_hold_the_poorest_beams_that_sum_up_to_the_target():
    choices = Choices.of(chain(5), ("shear", "cable", "rigid"))
    assert not choices.all_tried
    assert len(choices.first()) == 3 + 10 + 5
    distance = {(k, "cable"): 1e-4 for k in range(5)} | {
        (k, "rigid"): d for k, d in enumerate((1e-3, 0.5, 2e-3, 0.5, 8e-3))
    }
    (every,) = {c for c in choices.best(distance, [5e-3]) if "shear" not in c and c.count("rigid") == 2}
    assert every == ("rigid", "cable", "rigid", "cable", "cable")
    assert said(every, choices.names) == "cable, but link0, link2 rigid"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["study", "fidelity", DOUBLE_PENDULUM, "--elements", "8"],
            "takes no --elements: it compares kinds of elements",
        ),
        (["study", "fidelity", "--error", "1e-3"], "--error is 0.001 without a scene"),
        (["study", "fidelity", "five-bar"], "'five-bar' and is unknown"),
        (["study", "fidelity", DOUBLE_PENDULUM, "--element", "cable"], "takes no --element"),
    ],
)
def test_what_is_wrong_is_named(arguments, words):
    done = CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})
    assert (done.exit_code, words in " ".join(done.output.split())) == (2, True), done.output


BALL = at.Case(
    at.Scene("ball", [at.PointMass("ball", mass=1.0, position=(0, 0))], [], gravity=(0, -9.81)),
    ["ball.center"],
    t_end=0.1,
)


def test_cases_without_beams_alone_are_refused():
    with pytest.raises(StudyError, match="case 'ball' has no beam"):
        study(BALL)
    with pytest.raises(StudyError, match="cases 'ball', 'other' have no beam"):
        study(BALL, replace(BALL, scene=replace(BALL.scene, name="other")))


def test_a_case_without_beams_is_left_out_by_name_and_the_others_are_studied():
    bar = at.Beam("bar", (0, 0), (0.3, 0), at.Rectangle(0.02, 0.02), RUBBER)
    scene = at.Scene("bar", [bar], [at.Clamp("bar.start")], gravity=(0.0, -1.0))
    result = study(BALL, at.Case(scene, ["bar.end"], t_end=None), error=0.1)
    assert result.name == "fidelity-bar"
    assert set(result.table("choices").frame["scene"]) == {"bar"}
    assert result.findings[-1].startswith("ball: left out")
