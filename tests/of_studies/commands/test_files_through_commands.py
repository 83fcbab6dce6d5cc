"""Files that nobody tuned for go through every command, as their users would type it."""

import os
import re
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import pytest
from browser import OVERLAPS, Tab, needs_chromium
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM, FILES, PORTAL_FRAME, THROWN_CHAIN

import anctmm as at
from reference import global_dae
from studies.cases import cases_in
from studies.cli import app

pytestmark = pytest.mark.exhaustive

ERROR = 1e-2
#: Of the independent run: elements of each beam, and steps in each interval of output.
FINE_MESH, FINE_STEPS = 16, 40
#: Words of scenes that are built in.
OTHERS = re.compile("crank|coupler|follower|four-bar|cantilever")
#: A value with its uncertainty and its unit.
VALUE = re.compile(r"-?[\d.]+(e-?\d+)? ± [\d.e+-]+ (m|rad|N|N m)\b")
COMMANDS = {
    "list": "list FILE",
    "run": "run FILE --case CASE --error 1e-2 --out run",
    "convergence": "study convergence FILE --quick",
    "trade": "study trade FILE --case CASE --quick --error 1e-2",
    "fidelity": "study fidelity FILE --case CASE --quick",
    "extremes": "study extremes FILE --case CASE --quick",
    "recommend": "recommend FILE --case CASE --error 1e-2 --quick --rerun",
    "update": "check FILE --baselines kept --update",
    "check": "check FILE --baselines kept",
    "report": "report FILE --quick --out page",
}


@dataclass(frozen=True)
class Session:
    """What a user of a file sees: of each command what it prints, and its files."""

    file: str
    case: at.Case
    folder: Path
    told: dict[str, str]

    @property
    def words(self) -> dict[str, str]:
        """The same with every stretch of white space as one blank."""
        return {command: " ".join(text.split()) for command, text in self.told.items()}


@pytest.fixture(scope="module", params=FILES, ids=lambda file: Path(file).stem)
def session(request, tmp_path_factory) -> Session:
    """Every command ends well, at 80 columns."""
    folder, case = tmp_path_factory.mktemp("session"), cases_in(request.param)[0]
    before, told = Path.cwd(), {}
    os.chdir(folder)
    try:
        for name, command in COMMANDS.items():
            typed = [{"FILE": request.param, "CASE": case.name}.get(word, word) for word in command.split()]
            done = CliRunner().invoke(app, typed, env={"COLUMNS": "80"})
            assert done.exit_code == 0, f"{command}: {done.output}"
            told[name] = done.stdout
    finally:
        os.chdir(before)
    return Session(request.param, case, folder, told)


@pytest.fixture(scope="module")
def fine(session) -> at.Solution:
    """The same motion by the global equations, finely."""
    case = session.case
    found = global_dae.solve(
        case.scene,
        mesh=FINE_MESH,
        dt=case.interval / FINE_STEPS,
        t_end=case.duration,
        output_dt=case.interval,
    )
    assert found.status.ok
    return found


def test_it_speaks_of_this_scene_and_no_other(session):
    for command, text in session.words.items():
        assert session.case.name in text or command == "report", command
        assert not OTHERS.search(text), command
        assert "Traceback" not in text


def test_the_list_tells_what_is_in_the_file(session):
    listed = session.words["list"]
    assert all(body.name in listed for body in session.case.scene.bodies)
    assert all(case.name in listed for case in cases_in(session.file))


def test_values_of_a_run_hold_to_their_uncertainty(session, fine):
    values = pd.read_csv(session.folder / "run" / "values.csv")
    places = {str(p) if isinstance(p, str) else f"{p[0]} at {p[1]:g}": p for p in session.case.probes}
    checked = 0
    for row in values.to_dict("records"):
        assert row["uncertainty"] > 0.0
        if row["quantity"][:2] in ("x ", "y "):
            exact = fine.position(places[row["probe"]])[-1, "xy".index(row["quantity"][0])]
            assert abs(row["value"] - exact) <= 1.1 * row["uncertainty"]
            checked += 1
    assert checked == 2 * len(session.case.probes)
    printed = VALUE.findall(session.words["run"])
    assert len(printed) == len(values)
    assert "estimated error" in session.words["run"]
    names = {path.name for path in (session.folder / "run").iterdir()}
    assert names >= {"solution.npz", "probes.csv", "values.csv", "plot.png", "animation.html"}


def test_convergence_tells_orders_digits_and_joint_forces(session):
    said = session.words["convergence"]
    assert "Error over the mesh" in said
    assert "has an estimated error of" in said
    assert VALUE.search(said)
    forces = pd.read_csv(session.folder / "results" / "convergence" / "forces.csv")
    mine = forces[forces["scene"] == session.case.name]
    assert set(mine["unit"]) <= {"N", "N m"}
    assert mine["joint"].nunique() == len(session.case.scene.joints)
    assert (mine["uncertainty"] > 0.0).all()


def test_fidelity_judges_every_beam(session):
    said = session.words["fidelity"]
    assert f"{session.case.name}: for a target error of 0.01 take " in said
    for beam in session.case.scene.beams:
        assert re.search(rf"{session.case.name}, {beam.name}(,|:)|{beam.name}", said)


def test_extremes_tell_the_stable_step_and_how_a_disturbance_grows(session):
    said = session.words["extremes"]
    assert re.search(r"the largest stable explicit step is \S+ ms over all of the motion", said)
    assert re.search(r"a disturbance of 1e-10 grows \S+ times", said)
    assert "in units that are powers of two not one bit differs" in said


def test_the_recommended_script_meets_its_target_error(session, fine):
    """The script as it is printed, run, against another solver's fine run."""
    told = session.told["recommend"]
    assert "meets the target error 0.01" in session.words["recommend"]
    assert re.search(r"expected \S+ m?s of CPU time; error \S+ ± \S+", session.words["recommend"])
    script = told[told.index("import anctmm as at") : told.index("Rerun of this script")]
    found: dict = {}
    exec(script, found)
    solution = found["solution"]
    assert solution.status.ok
    apart = [at.compare(solution, fine, session.case.probes).error]
    if solution.run.element != "cable":  # a model of its own: against a finer run of that
        finer = at.solve(
            session.case.scene, mesh=2 * FINE_MESH, element=solution.run.element, t_end=session.case.duration,
            dt=session.case.interval / FINE_STEPS, output_dt=session.case.interval,
        )  # fmt: skip
        apart = [at.compare(solution, finer, session.case.probes).error]
    assert apart[0] <= ERROR


def test_a_trade_names_a_setting_with_its_cost_and_error(session):
    said = session.words["trade"]
    assert re.search(rf"{session.case.name}, error 0\.01: \S+, (im|ex)plicit, .*? m?s, measured error ", said)


def test_histories_are_stored_and_are_the_same_again(session):
    assert re.search(r"\d+ new", session.words["update"])
    assert re.search(r"\d+ same", session.words["check"])
    assert "differ" not in session.words["check"].replace("difference", "")
    assert list((session.folder / "kept").rglob("*.csv"))


@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
def test_the_page_passes_in_a_browser(session, browser, width):
    page = session.folder / "page" / "index.html"
    text = page.read_text()
    assert all(f'id="{study}"' in text for study in ("convergence", "trade", "fidelity", "extremes"))
    assert not OTHERS.search(text.split("<main", 1)[-1])
    tab = Tab(browser, page, width=width)
    tab.run("document.querySelectorAll('details').forEach(d => d.open = true);")
    assert tab.run("return document.documentElement.scrollWidth") == width
    assert tab.run(OVERLAPS) == []
    assert tab.run("return document.querySelectorAll('figure svg').length") >= 3
    assert tab.wrong == []
    tab.close()


def told(*typed: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, list(typed), env={"COLUMNS": "80"})
    return done.exit_code, " ".join(done.output.split())


def test_a_frame_at_rest_holds_its_digits(tmp_path):
    code, said = told("run", PORTAL_FRAME, "--case", "portal-frame-at-rest", "--out", str(tmp_path))
    assert code == 0
    assert "static equilibrium" in said
    values = pd.read_csv(tmp_path / "values.csv").set_index("quantity")
    exact = at.solve_static(cases_in(PORTAL_FRAME)[1].scene, mesh=64).position("girder.start")[-1]
    for axis, place in zip("xy", exact, strict=True):
        row = values.loc[f"{axis} at rest"]
        assert abs(row["value"] - place) <= row["uncertainty"]


def test_an_equilibrium_that_is_unstable_ends_at_once_and_says_so(tmp_path):
    """Two struts in compression beyond their buckling load: no mesh changes that."""
    (tmp_path / "struts.py").write_text(STRUTS)
    code, said = told("run", str(tmp_path / "struts.py"), "--out", str(tmp_path / "out"))
    assert code == 1
    assert "unstable: the equilibrium at load factor 1 is unstable" in said
    assert re.search(r"[1-4] runs? in all", said)


STRUTS = """
import anctmm as at
steel = at.Material(E=1e9, density=1000.0)
section = at.Rectangle(0.02, 0.02)
left, right = at.Beam("left", (0, 0), (1, 0.1), section, steel), at.Beam("right", (1, 0.1), (2, 0), section, steel)
joints = [at.Pin("left.start"), at.Pin("left.end", "right.start"), at.Pin("right.end")]
scene = at.Scene("struts", [left, right], joints, [at.Force("left.end", (0.0, -50.0))])
CASES = [at.Case(scene, ["left.end"], t_end=None)]
"""


@pytest.mark.parametrize(
    ("options", "kinds"),
    [
        (["--element", "shear"], {("shear", "generalized-alpha"), ("shear", "zhai")}),
        (["--element", "cable", "--integrator", "zhai"], {("cable", "zhai")}),
    ],
)
def test_a_trade_of_what_is_asked_for(options, kinds, tmp_path):
    typed = [
        "study",
        "trade",
        THROWN_CHAIN,
        "--quick",
        "--solvers",
        "anctmm",
        "--out",
        str(tmp_path),
        *options,
    ]
    code, said = told(*typed)
    assert code == 0, said
    points = pd.read_csv(tmp_path / "trade-thrown-chain" / "points.csv")
    assert {*zip(points["element"], points["integrator"], strict=True)} == kinds
    known = pd.read_csv(tmp_path / "trade-thrown-chain" / "references.csv")
    assert set(known["element"]) == {element for element, _ in kinds}


@pytest.mark.parametrize(
    ("study", "options"),
    [
        ("four-bar", ["--elements", "1/4/1", "--dt", "5e-3"]),
        ("cantilever", ["--elements", "4", "--dt", "2e-3"]),
    ],
)
def test_studies_of_the_base_scenes_narrow_to_what_is_asked_for(study, options, tmp_path):
    asked = ["--element", "cable", "--integrator", "generalized-alpha", "--solvers", "anctmm"]
    code, said = told("study", study, "--quick", *asked, *options, "--out", str(tmp_path))
    assert code == 0, said
    rows = pd.read_csv(tmp_path / study / "accuracy.csv")
    assert set(rows["element"]) == {"cable"}
    assert set(rows["integrator"]) <= {"generalized-alpha", "static"}
    assert not (tmp_path / study / "shear_limits.csv").exists()
    code, said = told("study", study, "--quick", "--element", "rigid")
    assert code == 2
    assert "--element and --integrator ask for rigid; scene" in said


def test_meshes_and_steps_of_convergence_are_those_asked_for(tmp_path):
    typed = [
        "study",
        "convergence",
        DOUBLE_PENDULUM,
        "--elements",
        "4,8,16",
        "--dt",
        "2e-3,1e-3",
        "--element",
        "cable",
    ]
    code, said = told(*typed, "--out", str(tmp_path))
    assert code == 0, said
    assert all(f"{n}/{n}" in said for n in (4, 8, 16))
    steps = pd.read_csv(tmp_path / "convergence" / "step.csv")
    assert steps["dt"].tolist() == [2e-3, 1e-3]
