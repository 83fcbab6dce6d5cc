"""The trade of error for time on scenes that nobody tuned for: references, recommendations, and what cannot run."""

import gc
import re
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from weakref import ref

import numpy as np
import pandas as pd
import pytest
from rich.console import Console
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM, FILES, PORTAL_FRAME, THROWN_CHAIN

import anctmm as at
from anctmm.results.solution import Solution
from studies.cases import cases_in, find_case
from studies.cli import app
from studies.engine.runner import Runner
from studies.engine.study import Options, StudyError, find
from studies.report.folder import write
from studies.trade.choice import setting_of
from studies.trade.own_ladder import SHARE, NothingMovesError, worth_trying
from studies.trade.recommendation import recommend
from studies.trade.recommendation.recommend_print import show

ERROR = 1e-2


class Reached(Exception):
    """A part of the study, which is asked about."""


def traded(file, **options):
    case = cases_in(file)[0]
    wanted = Options(**({"quick": True, "error": ERROR} | options), cases=(case,))
    return case, find("trade")(wanted, Runner(None, repeats=1))


@pytest.fixture(scope="module", params=FILES, ids=lambda f: Path(f).stem)
def measured(request):
    return request.param, *traded(request.param)


@pytest.mark.exhaustive
def test_a_recommendation_run_again_meets_its_target(measured):
    file, case, result = measured
    found = recommend.of_result(result)
    choice = recommend.choose(found.points, case.name, ERROR, None)
    assert choice.reached, choice.remarks
    again = recommend.rerun(choice.line, found.histories, ERROR, True, recommend.Origin(case, file))
    assert again.met
    assert again.error + choice.line["reference_error"] <= ERROR
    assert again.status == "ok"


@pytest.mark.exhaustive
def test_references_are_better_known_than_the_smallest_target(measured):
    _, _, result = measured
    known = result.table("references").frame
    assert set(known["element"]) == {"cable", "shear"}
    assert (known["uncertainty"] <= SHARE * ERROR).all()
    assert list(result.table("recommended").frame["target_error"]) == [ERROR]


@pytest.mark.exhaustive
def test_texts_speak_of_this_scene(measured):
    _, case, result = measured
    texts = [*result.findings, *map(str, result.answers), *(n for t in result.tables for n in t.notes)]
    texts += [p.caption for p in result.pictures]
    assert any(case.name in text for text in texts)
    assert not [t for t in texts if re.search("crank|coupler|follower|four-bar|cantilever", t)]


@pytest.mark.exhaustive
def test_the_trade_of_one_scene_does_not_overwrite_that_of_the_base_scenes(measured, tmp_path):
    _, case, result = measured
    folder = write(result, tmp_path)
    assert folder.name == f"trade-{case.name}"
    assert recommend.read(folder).points["scene"].eq(case.name).all()


@pytest.mark.exhaustive
def test_a_solver_that_cannot_do_the_scene_is_a_row_with_the_reason():
    _, result = traded(DOUBLE_PENDULUM, solvers=("anctmm", "pyelastica"))
    points = result.table("points").frame
    refused = points[points["solver"] == "pyelastica"]
    assert len(refused)
    assert refused["status"].str.match("(unsupported|refused): .").all()
    assert np.isnan(refused["error"]).all()


@pytest.mark.exhaustive
def test_recommend_takes_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ANCTMM_CACHE", str(tmp_path / "cache"))
    arguments = ["recommend", THROWN_CHAIN, "--error", "1e-2", "--quick"]
    done = CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})
    assert done.exit_code == 0, done.output
    assert "Recommended: " in done.output
    assert f'scene = find_case("{THROWN_CHAIN}", "thrown-chain").scene' in done.output
    assert "meets the target error 0.01" in done.output


def test_bodies_without_beams_have_one_model_and_no_limit_of_explicit_steps(tmp_path):
    """Nothing vibrates: the largest stable step is infinite, and no step was left; no text tells of elements."""
    points = {"o": (0.0, 0.0), "e": (0.5, 0.0)}
    upper = at.RigidBody("upper", mass=1.0, inertia=0.02, center=(0.25, 0.0), points=points)
    lower = at.RigidBody("lower", mass=0.5, inertia=0.01, center=(0.7, 0.0), points={"o": (0.5, 0.0)})
    scene = at.Scene(
        "double", [upper, lower], [at.Pin("upper.o"), at.Pin("upper.e", "lower.o")], gravity=(0.0, -9.81)
    )
    case = at.Case(scene, ["lower.center", "upper.o"], t_end=0.3, output_dt=0.02)  # the second rests
    runner = Runner(tmp_path, repeats=1, heading="trade, ")
    rest = at.Case(replace(scene, name="at-rest"), ["lower.center"], t_end=None)
    result = find("trade")(Options(quick=True, error=ERROR, cases=(case, rest)), runner)
    assert runner.heading == "trade, "
    assert result.name == "trade-double"
    assert [text for text in result.findings if "at-rest" in text] == [result.findings[-1]]
    assert "static equilibrium" in result.findings[-1]
    points = result.table("points").frame
    assert set(points["element"]) == {"cable"}
    assert set(points["elements"]) == {"-"}
    texts = [setting_of(line) for line in points.to_dict("records")]
    texts += [*result.findings, *map(str, result.answers), *points["reference"], *advised(result)]
    assert not [text for text in texts if re.search("elements|(?<!exudyn-)cable|mesh", text)]
    why = result.table("advice").frame["why"]
    assert why.str.startswith("the whole error is the step's, ").all()
    explicit = points[points["integrator"] == "zhai"]
    assert len(explicit) > 1
    assert (explicit["status"] == "ok").all()
    measured = recommend.of_result(result)
    choice = recommend.choose(measured.points, case.name, ERROR, None)
    fine = at.solve(scene, dt=2e-4, t_end=0.3, output_dt=0.02)
    origin = recommend.Origin(case, "")
    assert choice.reached, choice.remarks
    console = Console(record=True, width=300)
    show(choice, "here", "", console)
    told = r"error (\S+ ± \S+|< \S+) \(step (< )?\S+\); from here"
    assert re.search(told, console.export_text())
    for line in points[points["status"] == "ok"].drop_duplicates("solver").to_dict("records"):
        script = recommend.script(line, origin)
        assert not re.search("mesh|element|quadrature|cable", script.replace("exudyn-cable", ""))
    assert recommend.rerun(choice.line, measured.histories, ERROR, True, origin).met
    kind = {"integrator": choice.line["integrator"], "dt": choice.line["dt"]}
    again = at.solve(scene, **kind, t_end=0.3, output_dt=0.02)
    assert at.compare(again, fine, case.probes).error < ERROR
    convergence = find("convergence")(Options(error=ERROR, cases=(case,)), runner)
    assert set(convergence.table("step").frame["element"]) == {"-"}


PENDULUM = at.Case(
    at.Scene(
        "pendulum",
        [at.RigidBody("body", 1.0, 0.1, (0.5, 0.0), points={"o": (0.0, 0.0)})],
        [at.Pin("body.o")],
        gravity=(0.0, -9.81),
    ),
    ["body.center"],
    t_end=0.1,
)


@pytest.mark.parametrize("study", ["trade", "convergence"])
@pytest.mark.parametrize(
    "given", [{"meshes": ((4,),)}, {"element": "quintic"}, {"meshes": ((1, 2),), "element": "shear"}]
)
def test_options_about_elements_are_refused_without_beams(study, given):
    """They were taken in silence."""
    with pytest.raises(StudyError, match=r"the elements of beams; pendulum has none: leave (it|them) out"):
        find(study)(Options(cases=(PENDULUM,), quick=True, **given), Runner(None))


@pytest.mark.exhaustive
@pytest.mark.parametrize("study", ["trade", "convergence"])
def test_of_several_cases_those_without_beams_are_told(study, tmp_path):
    case = replace(find_case(THROWN_CHAIN), t_end=0.1, output_dt=0.01)
    options = Options(
        cases=(PENDULUM, case),
        meshes=((1, 1, 1), (2, 2, 2)),
        element="shear",
        error=1e-2,
        quick=True,
        solvers=("anctmm",),
    )
    result = find(study)(options, Runner(tmp_path, repeats=1))
    said = [text for text in result.findings if "has none" in text]
    assert said == ["pendulum: --elements and --element choose the elements of beams, and it has none."]
    rows = result.table("points" if study == "trade" else "step").frame
    of = {scene: set(mine["elements"]) for scene, mine in rows.groupby("scene")}
    assert of["pendulum"] == {"-"}
    assert of["thrown-chain"] <= {"1/1/1", "2/2/2"}
    assert (rows["status"] == "ok").any()


def advised(result):
    return result.table("advice").frame[["element", "elements"]].to_numpy(str).ravel()


def test_meshes_of_one_number_are_found_in_a_table_again(tmp_path):
    """As a table without 2/8/2 they were read as numbers, none of which was what --elements asks for."""
    frames = {
        name: pd.DataFrame({column: ["s"] for column in columns})
        for name, columns in recommend.NEEDED.items()
    }
    frames["points"]["elements"] = [8]
    for name, frame in frames.items():
        frame.to_csv(tmp_path / f"{name}.csv", index=False)
    (tmp_path / "SHA256SUMS").write_text(
        "".join(f"{sha256((tmp_path / f'{n}.csv').read_bytes()).hexdigest()}  {n}.csv\n" for n in frames)
    )
    points = recommend.read(tmp_path).points
    assert len(recommend.narrowed(points, "s", Options(meshes=((8,),)), None)) == 1


@pytest.mark.interpreted
@pytest.mark.parametrize(("t_end", "output_dt"), [(0.2, 0.04), (0.1, 0.01), (0.08, 0.02)])
def test_a_table_of_the_case_as_it_was_before_is_refused(t_end, output_dt):
    """Of other times: with as many the n-th was compared with the n-th, with more or fewer it ended with a fault."""
    scene = at.Scene("mass", [at.PointMass("m", 1.0, (0.0, 0.0))], gravity=(0.0, -9.81))
    before = at.solve(scene, dt=0.01, t_end=0.1, output_dt=0.02)
    table = pd.DataFrame(
        {"scene": "mass", "element": "cable", "body": "m", "fraction": "center"}, index=range(6)
    )
    u = before.displacement("m.center")
    table = table.assign(t=before.t + 1e-10, u_x=u[:, 0], u_y=u[:, 1])
    assert recommend.error_against(before, table, "mass", "cable") == 0.0
    now = at.solve(scene, dt=0.01, t_end=t_end, output_dt=output_dt)
    with pytest.raises(recommend.RecommendError, match="measured before the case was changed"):
        recommend.error_against(now, table, "mass", "cable")


def test_a_static_case_has_no_trade():
    case = find_case(PORTAL_FRAME, "portal-frame-at-rest")
    with pytest.raises(StudyError, match="is a static equilibrium; a motion"):
        find("trade")(Options(quick=True, cases=(case,)), Runner(None))


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["recommend", PORTAL_FRAME, "--error", "1e-2"], "has 2 cases; --case is needed"),
        (
            ["recommend", PORTAL_FRAME, "--case", "portal-frame-at-rest", "--error", "1e-2"],
            "a static equilibrium",
        ),
        (["recommend", "cantilever-force-1", "--error", "1e-2"], "a static equilibrium"),
        (["recommend", "five-bar", "--error", "1e-2"], "'five-bar' and is unknown"),
        (["recommend", THROWN_CHAIN], "--error and --budget are both missing"),
        (["recommend", "nowhere.py", "--error", "1e-2"], "no such file"),
        (["study", "trade", THROWN_CHAIN, "--elements", "2/2"], "needs 1 or 3 numbers"),
        (
            ["study", "trade", THROWN_CHAIN, "--element", "rigid"],
            "a trade is measured with cable or quintic or shear",
        ),
    ],
)
def test_what_is_wrong_is_named(arguments, said):
    done = CliRunner().invoke(app, arguments, env={"COLUMNS": "200"})
    assert (done.exit_code, said in " ".join(done.output.split())) == (2, True), done.output
    assert "measuring" not in done.output  # a measurement that was never to be was announced first


class NothingRuns:
    """In a runner's place: any run, or reference, fails the test."""

    def __getattr__(self, name):
        raise AssertionError(f"{name} was asked for before the refusal")


@pytest.mark.parametrize(
    ("file", "asked", "words"),
    [
        (
            THROWN_CHAIN,
            {"element": "shear", "integrator": "esdirk"},
            "ask for shear esdirk; .* is run with cable",
        ),
        (THROWN_CHAIN, {"element": "rigid"}, "--element is 'rigid'"),
    ],
)
@pytest.mark.parametrize("quick", [True, False])
def test_what_nothing_will_be_run_with_is_refused_before_references_are_refined(file, asked, words, quick):
    options = Options(quick=quick, cases=tuple(cases_in(file)[:1]), **asked)
    with pytest.raises(StudyError, match=words):
        find("trade")(options, NothingRuns())


@pytest.mark.parametrize(
    ("finest", "order", "targets", "kept"),
    [
        (1e-5, 4.0, (1e-2, 1e-3), (8, 16, 32)),
        (1e-4, 2.0, (1e-2, 1e-3), (4, 8, 16, 32, 64)),
        (1e-12, 4.0, (1e-2,), (2, 4, 8)),
        (float("inf"), 4.0, (1e-2,), (16, 32, 64)),
    ],
)
def test_a_quick_trade_tries_what_is_near_its_targets(finest, order, targets, kept):
    """From the last level that is too coarse for the largest target to the first that meets the smallest."""
    assert worth_trying((2, 4, 8, 16, 32, 64), finest, order, targets) == kept
    assert worth_trying((2,), finest, order, targets) == (2,)


@pytest.mark.interpreted
def test_a_case_whose_probes_rest_is_left_out_by_name(monkeypatch):
    """All its errors were zero, and the trade ended with a fault, KeyError."""
    wheel = at.RigidBody("wheel", 3.0, 0.02, (0.0, 0.0), points={"rim": (0.1, 0.0)}, spin=1.0)
    axle, rim = (
        at.Case(at.Scene(name, [wheel]), [f"wheel.{name}"], t_end=0.1, output_dt=0.05)
        for name in ("center", "rim")
    )
    runner = Runner(None, repeats=1)
    with pytest.raises(StudyError, match=r"probes wheel\.center, none of which moves"):
        find("trade")(Options(quick=True, cases=(axle,), solvers=("anctmm",)), runner)

    def measure(ladder, *_):
        raise Reached(ladder.base.name)

    monkeypatch.setattr("studies.trade.study.measure", measure)
    with pytest.raises(Reached, match="rim"):
        find("trade")(Options(quick=True, cases=(axle, rim), solvers=("anctmm",)), runner)


@pytest.mark.interpreted
def test_cases_that_are_left_out_are_told_before_any_is_refined(monkeypatch):
    """Others that stand before them were refined first, which may take minutes."""
    wheel = at.RigidBody("wheel", 3.0, 0.02, (0.0, 0.0), points={"rim": (0.1, 0.0)}, spin=1.0)
    rim, axle, other = (
        at.Case(at.Scene(name, [wheel]), [f"wheel.{at_}"], t_end=0.1, output_dt=0.05)
        for name, at_ in (("rim", "rim"), ("axle", "center"), ("other", "rim"))
    )
    still = at.Case(at.Scene("still", [wheel]), ["wheel.rim"], t_end=None)
    refined, told = [], []

    def refine(case, *_):
        refined.append((case.name, len(told)))
        raise Reached(case.name) if case is other else NothingMovesError("nothing after all")

    monkeypatch.setattr("studies.trade.study.own_ladder", refine)
    runner = Runner(None, repeats=1, note=told.append, heading="trade, ")
    with pytest.raises(Reached, match="other"):
        find("trade")(Options(quick=True, cases=(rim, axle, still, other), solvers=("anctmm",)), runner)
    assert refined[0] == ("rim", 2)
    assert [text.partition(":")[0] for text in told] == ["still", "axle", "rim"]
    assert "probes wheel.center, none of which moves" in told[1]
    assert runner.heading == "trade, "


@pytest.mark.interpreted
def test_solutions_of_the_settings_are_not_kept(monkeypatch):
    """Those of the four-bar took 5 GB."""
    made = []
    new = Solution.__init__

    def counted(solution, *given, **named):
        new(solution, *given, **named)
        made.append(ref(solution))

    def alive(settings, *_):
        gc.collect()
        raise Reached(len(settings), sum(one() is not None for one in made))

    monkeypatch.setattr(Solution, "__init__", counted)
    monkeypatch.setattr("studies.trade.study.time_again", alive)
    scene = at.Scene("thrown", [at.RigidBody("b", 1.0, 0.02, (0.0, 0.0), velocity=(1.0, 2.0), spin=3.0)])
    case = at.Case(scene, ["b.center"], t_end=0.2, output_dt=0.1)
    with pytest.raises(Reached) as found:
        find("trade")(
            Options(quick=True, cases=(case,), solvers=("anctmm", "global-dae")), Runner(None, repeats=1)
        )
    settings, kept = found.value.args
    assert settings > 10
    assert kept < settings / 2


@pytest.mark.interpreted
def test_a_trade_none_of_whose_runs_ends_well_has_its_rows_and_recommends_nothing():
    """It ended with a fault, KeyError, as did `recommend` with a solver alone that is not installed."""
    scene = at.Scene("mass", [at.PointMass("m", 1.0, (0.0, 0.0))], gravity=(0.0, -9.81))
    case = at.Case(scene, ["m.center"], t_end=0.1, output_dt=0.02)
    options = Options(quick=True, cases=(case,), solvers=("pyelastica",))
    result = find("trade")(options, Runner(None, repeats=1))
    points = result.table("points").frame
    assert len(points)
    assert points["status"].str.match("(unsupported|refused): .").all()
    assert set(points["own"]) == {"-"}  # keyword arguments of Exudyn's are none of its
    assert "did not end well" in result.findings[0]
    with pytest.raises(recommend.RecommendError, match="no setting of which an error and a time are known: "):
        recommend.choose(recommend.of_result(result).points, "mass", 1e-2, None)
