"""The trade of error for time, quick: its numbers, its split of errors, and recommendations that are run again."""

import re
from collections import defaultdict
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import anctmm as at
from anctmm.discretise.discretisation import Discretisation
from studies.cli import app
from studies.engine.accuracy.dynamics import cases_of, reference_of
from studies.engine.choices import choices_of, read, written
from studies.engine.pareto_front import excess
from studies.engine.runner import Runner
from studies.engine.study import Options, Result, StudyError, find
from studies.engine.tables import milliseconds
from studies.report.folder import write
from studies.report.plots import picture, tell
from studies.scenes import BASE_SCENES, base_of, cantilever_fall, four_bar
from studies.trade.choice import reaching, setting_of
from studies.trade.contestants import left_out, said_of, without
from studies.trade.plan import FRAME_SOLVERS, QUICK_TOLERANCES, ladders
from studies.trade.recommendation import recommend
from studies.trade.recommendation.snippet import SnippetError, code, snippet
from studies.trade.split import weigh
from studies.trade.tables import Traded, references

TARGETS = [(scene, target) for scene in ("four-bar", "cantilever-fall") for target in (1e-2, 1e-3, 1e-4)]
KEPT = Path(__file__).parents[3] / "reports" / "trade"


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> Result:
    return find("trade")(Options(quick=True), Runner(tmp_path_factory.mktemp("runs"), repeats=1))


@pytest.fixture(scope="module")
def of_shear(tmp_path_factory) -> Result:
    """The four-bar by shear elements, which a quick run leaves out."""
    options = Options(quick=True, cases=(four_bar(),), element="shear", solvers=("anctmm", "global-dae"))
    return find("trade")(options, Runner(tmp_path_factory.mktemp("runs"), repeats=1))


@pytest.fixture(scope="module")
def points(result) -> pd.DataFrame:
    return result.table("points").frame


@pytest.fixture(scope="module")
def measured(result, tmp_path_factory) -> recommend.Measured:
    return recommend.read(write(result, tmp_path_factory.mktemp("trade")))


# --- the study -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scene", "elements", "dt", "error", "source"),
    [
        ("cantilever-fall", "8", 2e-3, 5.7e-3, "mesh"),
        ("cantilever-fall", "16", 5e-3, 8.8e-4, "mesh"),  # the benchmark's finer reference says the same
        ("cantilever-fall", "32", 5e-3, 1.36e-4, "both"),
        ("four-bar", "2/6/2", 1e-3, 4.1e-4, "mesh"),
        ("four-bar", "3/10/3", 5e-3, 1.92e-3, "step"),
    ],
)
def test_errors_and_where_they_come_from(points, scene, elements, dt, error, source):
    line = points[
        (points["scene"] == scene) & (points["elements"] == elements) & (points["dt"] == dt)
        & (points["element"] == "cable") & (points["solver"] == "anctmm") & (points["newton_tolerance"] == 1e-3)
    ].iloc[0]  # fmt: skip
    assert line["error"] == pytest.approx(error, rel=0.05)
    assert line["error_from"] == source
    assert line["reference_error"] < 0.3 * line["error"]


def test_every_way_to_step_and_every_peer_takes_part(points):
    # an ordinary Newton iteration that stops early may end a run of the global DAE
    early = (points["solver"] == "global-dae") & (points["newton_tolerance"] == 1e-3)
    assert set(points[~early]["status"]) == {"ok"}
    assert (points[early]["status"] == "ok").sum() > 10
    assert set(points["solver"]) == {"anctmm", "global-dae", "exudyn-cable"}
    assert set(points["integrator"]) == {"zhai", "generalized-alpha", "esdirk"}
    controlled = points[points["tolerance"] > 0]
    assert list(controlled["integrator"]) == ["generalized-alpha"] * 2 * len(QUICK_TOLERANCES)
    assert controlled["dt"].isna().all()
    assert (controlled["steps"] > 10).all()


def test_mesh_and_step_errors_add_up_to_no_less_than_the_error(points):
    known = points[points["step_error"].notna()]
    assert len(known) > 20
    assert (known["error"] <= 1.02 * (known["mesh_error"] + known["step_error"])).all()
    # a solver with the same elements, mesh and step has the same two errors
    tight = (known["newton_tolerance"] == 1e-7) | (
        (known["solver"] == "exudyn-cable") & (known["own"] == "-")
    )
    same = known[(known["dt"] == 5e-3) & tight & (known["scene"] == "cantilever-fall")]
    for _, group in same.groupby("elements"):
        assert len(group) == 3
        assert np.ptp(group["step_error"]) < 0.02 * group["error"].max()


@pytest.mark.parametrize("ladder", ladders(False), ids=lambda ladder: ladder.base.scene.name)
def test_steps_that_an_error_drives_end_well_with_every_kind_of_the_full_trade(ladder):
    """With the coarsest mesh of each kind and the largest tolerance; a quick run has one kind of them."""
    plan, kinds = ladder.plan(False), {}
    for scheme in plan.schemes:
        if "tolerance" in dict(scheme.options):
            kind = scheme.element, scheme.quadrature, scheme.integrator
            kinds.setdefault(kind, replace(scheme, meshes=scheme.meshes[:1]))
    assert {kind[2] for kind in kinds} == {"generalized-alpha", "esdirk"}
    for case in cases_of(ladder.base, replace(plan, schemes=tuple(kinds.values())), Options()):
        found = at.solve(case.scene, case.run())
        assert found.status.ok, (case, found.status)
        assert found.cost.steps > 10


def test_which_error_outweighs():
    assert [weigh(1.0, 0.4), weigh(0.4, 1.0), weigh(1.0, 0.6)] == ["mesh", "step", "both"]


def test_the_front_is_what_nothing_beats(points):
    for _, mine in points.groupby("scene"):
        for line in mine.to_dict("records"):
            no_worse = mine["robust_error"] <= line["robust_error"]
            assert (no_worse & (mine["cpu_s"] < line["cpu_s"])).any() == (line["excess"] > 1.0)
    frame = pd.DataFrame({"robust_error": [1e-2, 1e-3, 2e-3, np.nan], "cpu_s": [1.0, 2.0, 6.0, np.nan]})
    np.testing.assert_array_equal(excess(frame), [1.0, 1.0, 3.0, np.nan])


def test_tables_and_sentences_come_from_the_points(result, points):
    best = result.table("recommended").frame
    for line in best[best["status"] == "ok"].to_dict("records"):
        assert (
            line["cpu_s"]
            == reaching(points[points["scene"] == line["scene"]], line["target_error"])["cpu_s"].min()
        )
    assert (best[best["target_error"] == 1e-5]["status"] != "ok").all()
    answer, other = result.answers  # one a scene
    assert other.question.startswith("cantilever-fall: ")
    assert answer.question == "four-bar: what to take for an error of 0.001?"
    assert answer.figure.endswith("ms of CPU time")
    assert answer.take.startswith("Take anctmm")
    words = "; at exactly that error the cheapest of other kinds cost more: "
    dearer = [answer.take.partition(words)[2] for answer in result.answers]
    assert any("Exudyn" in others for others in dearer)


def test_a_quick_run_is_of_cables_and_says_so_unless_it_is_asked_for_others(result, points, of_shear):
    assert set(points["element"]) == {"cable"}
    assert result.left_out.startswith("quintic and shear elements, ")
    others, said = of_shear.table("points").frame, of_shear.left_out
    assert set(others["element"]) == {"shear"}
    assert set(others["elements"]) == {"2/8/2", "4/16/4"}
    assert set(others[others["status"] == "ok"]["solver"]) == {"anctmm", "global-dae"}
    assert said == ""


def test_the_distance_of_the_models_stands_in_the_table_of_references(tmp_path):
    ladder, runner = ladders(True)[0], Runner(tmp_path, repeats=1)
    both = {
        name: reference_of(ladder.base, name, ladder.references[name], runner) for name in ("cable", "shear")
    }
    table = references([Traded(ladder.base, pd.DataFrame(), both, [])])
    distance = table.frame.set_index("element")["from_cable"]
    assert distance["shear"] == pytest.approx(0.0138, abs=1e-3)
    assert distance["cable"] == 0.0


def test_pictures_have_a_text_for_every_setting(result, points):
    for shown in result.pictures[::2]:
        scene = shown.name.removeprefix("front_")
        drawn = points[(points["scene"] == scene) & (points["error"] > 0.0)]
        assert shown.svg.count("<title>") == len(drawn)
        assert "reference's own uncertainty" in shown.svg
        assert "tips:" not in shown.svg


def test_texts_of_markers_are_escaped():
    def draw(figure):
        (drawn,) = figure.subplots().plot([0, 1, 2], [0, 1, 0], "o-")
        tell(drawn, ['a "quoted" <b> & more', "two", "three"])

    svg = picture("told", "", draw).svg
    texts = re.findall(r"<title>(.*?)</title></use>", svg)
    assert texts == ["a &quot;quoted&quot; &lt;b&gt; &amp; more", "two", "three"]


def test_meshes_are_given_to_the_scenes_they_fit(tmp_path):
    options = Options(quick=True, meshes=((2, 8),))
    with pytest.raises(StudyError, match="--elements has '2/8'"):
        find("trade")(options, Runner(None))
    only = Options(quick=True, meshes=((1, 3, 1),), steps=(1e-2,), solvers=("anctmm",))
    found = find("trade")(only, Runner(None, repeats=1)).table("points").frame
    assert set(found["scene"]) == {"four-bar"}
    assert set(found["elements"]) == {"1/3/1"}


def swing(ladder):
    """The scene of a ladder with a spring at its first probe."""
    first = ladder.base.scene.beams[0].name
    spring = at.RotationalSpring(f"{first}.start", stiffness=1.0)
    return replace(ladder, base=replace(ladder.base, scene=replace(ladder.base.scene, connectors=[spring])))


@pytest.mark.parametrize("quick", [False, True])
def test_who_only_checks_answers_is_not_timed_unless_asked_for(quick):
    """The global DAE does mechanisms by plain NumPy: a quick trade took 23 minutes, most of them its times."""
    for ladder in ladders(quick):
        plan, sprung = ladder.plan(quick), swing(ladder)
        assert left_out(plan, ladder.base, None) == {}
        out = left_out(plan, sprung.base, None)
        assert set(out) == {"global-dae"} | ({"global-dae-dense"} if not quick else set())
        assert "rotational springs" in " ".join(said_of(sprung.base, out))
        assert left_out(plan, sprung.base, ("global-dae", "global-dae-dense")) == {}
        rest = without(plan, out)
        assert all(scheme.solvers for scheme in rest.schemes)
        assert {x for s in rest.schemes for x in s.solvers} == {
            x for s in plan.schemes for x in s.solvers
        } - set(out)


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("element", ["cable", "shear"])
def test_every_solver_has_every_freedom(element, quick):
    for ladder in ladders(quick):
        tried, chosen = defaultdict(set), defaultdict(set)
        for s in ladder.plan(quick).schemes:
            if (
                s.element == element
                and s.integrator == "generalized-alpha"
                and "tolerance" not in dict(s.options)
            ):
                for solver in set(s.solvers) - {"global-dae-dense"}:
                    chosen[solver] |= {(s.options, s.own)}
                    # those have elements of second order: finer meshes, and no quadrature
                    if solver not in FRAME_SOLVERS:
                        tried[solver] |= {(s.quadrature, m, dt) for m in s.meshes for dt in s.steps(m)}
        if quick and element == "shear":
            continue  # a quick run has our own shear elements alone
        assert len(tried) == 3
        ours = tried.pop("anctmm")
        assert all(settings == ours for settings in tried.values())
        assert all(len(choices) >= len(chosen["anctmm"]) > 1 for choices in chosen.values())
        assert all(chosen[solver] == set(choices_of(solver)) for solver in chosen)


def test_keyword_arguments_are_written_and_read_alike():
    for _, own in choices_of("exudyn-cable"):
        assert read(written(own)) == own
    for wrong in ("tolerances", "1", "**a", "f(", "a=b"):
        with pytest.raises(ValueError, match=r"keyword arguments|malformed"):
            read(wrong)


# --- recommendations -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("scene", "target"), TARGETS)
def test_a_recommendation_rerun_from_its_script_meets_its_error(measured, scene, target):
    _check(measured, scene, target)


@pytest.mark.skipif(not (KEPT / "points.csv").exists(), reason="no measured trade is kept in reports/trade")
@pytest.mark.parametrize(("scene", "target"), TARGETS)
def test_a_kept_recommendation_rerun_from_its_script_meets_its_error(scene, target):
    _check(recommend.read(KEPT), scene, target)


def _check(measured: recommend.Measured, scene: str, target: float) -> None:
    choice = recommend.choose(measured.points, scene, target, None)
    assert choice.reached
    again = recommend.rerun(choice.line, measured.histories, target, met=True)
    assert again.met
    assert again.error <= target
    # what a loose Newton tolerance leaves depends on the last bit of compiled code (anctmm/modelling.md)
    near = 0.01 if choice.line["newton_tolerance"] < 1e-5 else 0.2
    assert again.error == pytest.approx(choice.line["error"], rel=near)
    meeting = measured.points[(measured.points["scene"] == scene) & (measured.points["error"] <= target)]
    assert meeting["cpu_s"].min() >= 0.8 * choice.line["cpu_s"]
    ratios = choice.runners_up["ratio"]
    assert (ratios >= 1.0).all()


def test_the_command_prints_setting_cost_runners_up_and_a_script_that_runs(result, tmp_path):
    folder = write(result, tmp_path)
    asked = ["recommend", "four-bar", "--budget", "0.5s", "--table", str(folder)]
    answer = CliRunner().invoke(app, [*asked, "--error", "1e-3"])
    assert answer.exit_code == 0
    chosen = recommend.choose(result.table("points").frame, "four-bar", 1e-3, 0.5)
    said = answer.stdout
    unbroken = " ".join(said.split())  # lines end where the terminal does
    for part in (
        f"Recommended: {setting_of(chosen.line)}",
        f"expected {milliseconds(chosen.line['cpu_s'])} of CPU time; error {chosen.line['error']:.2g}",
        "Runners-up, the cheapest of each kind",
        "meets the target error 0.001",
    ):
        assert part in unbroken
    script = said[said.index("import anctmm") : said.index("Rerun of this script")]
    with redirect_stdout(StringIO()) as printed:
        exec(compile(script, "<printed>", "exec"), {})
    assert re.match(r"ok: [\d.]+ ms\ncoupler\.end \[", printed.getvalue())
    unmet = CliRunner().invoke(app, [*asked, "--error", "1e-9", "--no-rerun"])
    assert "Not reached: the measured range does not reach 1e-09" in unmet.stdout


def test_a_peer_is_run_by_its_script_too(measured):
    lines = measured.points[(measured.points["solver"] == "exudyn-cable")]
    line = lines[lines["scene"] == "four-bar"].iloc[0].to_dict()
    again = recommend.rerun(line, measured.histories, None, met=False)
    assert again.met
    assert again.error == pytest.approx(line["error"], rel=1e-6)


def test_an_explicit_step_is_written_with_all_its_digits(measured):
    line = measured.points[measured.points["integrator"] == "zhai"].iloc[0].to_dict()
    case = recommend.case_of(line, base_of(str(line["scene"])))
    assert case.run().steps == round(case.t_end / case.dt)


FRAME = pd.DataFrame({
    "scene": "s", "solver": "anctmm", "element": "cable", "integrator": "generalized-alpha", "quadrature": "full",
    "elements": ["1", "2", "3", "4"], "dt": 0.1, "tolerance": np.nan, "newton_tolerance": 1e-3,
    "error": [1e-1, 1e-2, 1e-3, np.nan], "robust_error": [1e-1, 1e-2, 1e-3, np.nan], "reference_error": 1e-4,
    "mesh_error": [9e-2, 9e-3, 9e-4, np.nan], "step_error": [2e-2, 2e-3, 2e-4, np.nan],
    "cpu_s": [1.0, 2.0, 5.0, np.nan],
    "status": ["ok", "ok", "ok", "failed"], "family": "cable",
})  # fmt: skip


@pytest.mark.parametrize(
    ("error", "budget", "elements", "reached", "remark"),
    [
        (0.2, None, "1", True, ""),
        (1e-2, None, "3", True, ""),  # 2 misses it by the reference's uncertainty
        (
            1.02e-2,
            None,
            "2",
            True,
            "cancel in part, which may not happen in another motion; without, anctmm, implicit, 3 c",
        ),
        (None, 3.0, "2", True, ""),
        (None, 100.0, "3", True, ""),
        (2e-2, 3.0, "2", True, ""),
        (2e-3, 3.0, "2", False, "an error of 0.002 takes 5 s; this is the best within 3 s"),
        (
            5e-4,
            None,
            "3",
            False,
            "the measured range does not reach 0.0005: it ends at 0.001 ± 0.0001",
        ),
        (1e-5, None, "3", False, "1e-05 is below the reference's own uncertainty, 0.0001"),
        (0.2, 0.5, "1", False, "no measured setting is that cheap: the cheapest one takes 1 s"),
    ],
)
def test_choices(error, budget, elements, reached, remark):
    choice = recommend.choose(FRAME, "s", error, budget)
    assert choice.line["elements"] == elements
    assert choice.reached == reached
    assert remark in "; ".join(choice.remarks)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (("s", None, None), "neither error nor budget is given"),
        (("s", -1.0, None), "error is -1.0; a positive number"),
        (("s", 1e-3, float("nan")), "budget (s) is nan; a positive number"),
        (("t", 1e-3, None), "scene 't' has no measured setting; those of the table are s"),
    ],
)
def test_bad_targets_are_named(ask, message):
    with pytest.raises(recommend.RecommendError, match=re.escape(message)):
        recommend.choose(FRAME, *ask)


def test_an_element_can_be_chosen_and_models_are_told_apart():
    measured = recommend.kept()
    choice = recommend.choose(measured.points, "four-bar", 1e-2, None, element="shear")
    assert choice.line["elements"] == "4/16/4"
    assert "two models, 0.014 apart" in recommend.models_apart(measured, "four-bar", 1e-2)
    assert recommend.models_apart(measured, "four-bar", 0.1) == ""
    with pytest.raises(
        recommend.RecommendError, match="element is 'shell'; measured on scene 'four-bar' are cable"
    ):
        recommend.choose(measured.points, "four-bar", 1e-2, None, element="shell")


def test_bad_tables_and_scenes_are_named(tmp_path):
    with pytest.raises(recommend.RecommendError, match=r"points\.csv cannot be read"):
        recommend.read(tmp_path)
    (tmp_path / "points.csv").write_text("")
    with pytest.raises(recommend.RecommendError, match=r"points\.csv cannot be read"):
        recommend.read(tmp_path)
    (tmp_path / "points.csv").write_text("scene,solver\n1,2\n")
    with pytest.raises(recommend.RecommendError, match=r"points\.csv has no column 'element'"):
        recommend.read(tmp_path)
    with pytest.raises(
        recommend.RecommendError, match="scene 'five-bar' is unknown; allowed are four-bar, canti"
    ):
        recommend.scene_name("five-bar")
    assert recommend.scene_name("cantilever") == "cantilever-fall"


# --- scripts -------------------------------------------------------------------------------------------------


def evaluated(text: str):
    return eval(text, {"at": at})


@pytest.mark.parametrize("build", BASE_SCENES)
def test_a_scene_written_as_code_is_the_same_scene(build):
    scene = build().scene
    assert evaluated(code(scene)) == scene


def test_all_kinds_of_joints_and_sections_are_written():
    steel = at.Material(E=2.1e11, density=7850.0, poisson=0.3)
    odd = at.Section(1e-4, 2e-9, 1e-12)
    bodies = tuple(at.Beam(name, (k, 0.0), (k + 1.0, 0.0), odd, steel) for k, name in enumerate('a"b'))
    scene = at.Scene(
        "kinds", bodies, (at.Weld('a.end', '".start', grounded=True), at.Pin('".end', "b.start"), at.Clamp("b.end")),
        (at.Force("a.start", (0.0, -1.0)), at.Torque("a.start", 2.0)),
    )  # fmt: skip
    assert evaluated(code(scene)) == scene
    run = Discretisation(mesh={"a": 1, '"': 2, "b": 3}, tolerance=1e-3, t_end=0.2)
    assert evaluated(code(run)) == run


def test_a_plain_function_cannot_be_written():
    pulled = replace(four_bar().scene, loads=(at.Force("coupler.end", lambda t: (0.0, t)),))
    with pytest.raises(SnippetError, match="has no text"):
        code(pulled)


def test_a_script_names_a_peer_by_the_registry():
    run = Discretisation(mesh=2, dt=1e-2)
    text = snippet(cantilever_fall().scene, run, "global-dae", ["beam.end"])
    assert 'registry.solver("global-dae")(scene, run)' in text
    assert 'element="cable"' in text
