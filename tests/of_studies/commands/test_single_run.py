"""`anctmm run`: one run of a case, of a file or built in, and what it leaves behind."""

import re
import resource
import sys

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM, PORTAL_FRAME, THROWN_CHAIN

import anctmm as at
from anctmm.errors import CaseError, OutputError, StepError
from studies.cases import find_case
from studies.cli import app
from studies.engine.runner import Runner
from studies.engine.study import StudyError
from studies.single_run.study import run_case, write_run


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")


def told(*arguments):
    done = CliRunner().invoke(app, list(map(str, arguments)))
    return done.exit_code, done.output


def run(case, **options):
    return run_case(case, Runner(None, repeats=1), **options)


def test_a_run_leaves_its_files(tmp_path):
    code, output = told("run", DOUBLE_PENDULUM, "--error", "1e-2", "--out", "made")
    assert code == 0, output
    assert re.search(r"estimated error 0\.00\d+ \(mesh .*, step .*\)", output)
    assert re.search(r"lower\.end +x at 0\.4 s +0\.\d+ ± \S+ m", output)
    names = {p.name for p in (tmp_path / "made").iterdir()}
    assert names >= {"solution.npz", "probes.csv", "values.csv", "plot.png", "animation.html"}
    solution = at.load(tmp_path / "made" / "solution.npz")
    frame = pd.read_csv(tmp_path / "made" / "probes.csv")
    assert frame["lower.end x (m)"].to_numpy() == pytest.approx(
        solution.position("lower.end")[:, 0], rel=1e-12
    )
    assert (tmp_path / "made" / "plot.png").read_bytes()[:4] == b"\x89PNG"
    assert "<script" in (tmp_path / "made" / "animation.html").read_text()
    values = pd.read_csv(tmp_path / "made" / "values.csv")
    assert (values["uncertainty"] > 0).all()


def oscillator():
    """A mass on a spring with a damper, released from its unloaded place: a period has four outputs."""
    mass = at.PointMass("m", mass=2.0, position=(0.0, 0.0))
    spring = at.Spring("m.center", (-1.0, 0.0), stiffness=800.0, damping=8.0, length=0.9)
    scene = at.Scene("oscillator", [mass], [at.Slider("m.center", (1, 0))], connectors=[spring])
    return at.Case(scene, ["m.center"], t_end=2.0, output_dt=0.05)


def test_the_largest_of_a_motion_is_said_to_be_of_its_outputs(tmp_path):
    """0.1720 ± 1e-6 m was told as the largest of a motion whose largest, between two outputs, is 0.1729 m."""
    found = run(oscillator(), error=1e-3)
    (value,) = [v for v in found.values if v.quantity.startswith("largest")]
    assert value.quantity == "largest displacement at the outputs"
    decay, rate = 2.0, np.sqrt(400.0 - 4.0)
    exact = 0.1 * (1.0 + np.exp(-decay * np.pi / rate))
    assert exact - value.value > 10.0 * value.uncertainty
    write_run(found, tmp_path)
    assert "at the outputs: between two of them it may be larger" in (tmp_path / "values.md").read_text()


def test_a_built_in_scene_runs_by_its_name():
    code, output = told("run", "cantilever-force-1", "--error", "1e-2")
    assert code == 0, output
    assert "static equilibrium" in output
    assert "results/cantilever-force-1" in output


def test_a_given_mesh_and_step_are_one_run():
    done = run(find_case(THROWN_CHAIN), mesh=(2,), dt=5e-3)
    assert done.found.levels.runs == 1
    assert "not estimated" in done.error
    same = at.solve(done.case.scene, mesh=2, dt=5e-3, t_end=0.3, output_dt=0.01)
    assert np.array_equal(done.solution.position("link2.end"), same.position("link2.end"))


ONE_RUN = ("run", THROWN_CHAIN, "--elements", "2", "--dt", "5e-3")


def test_other_solvers_are_compared():
    code, output = told(*ONE_RUN, "--solvers", "anctmm,global-dae")
    assert code == 0, output
    found = re.search(r"global-dae on the same mesh and by the same step: differs by (\S+);", output)
    assert float(found[1]) < 1e-9
    # one that cannot do the scene fails as it does alone
    code, output = told(*ONE_RUN, "--solvers", "anctmm,global-dae,pyelastica")
    assert code == 1, output
    assert re.search(r"pyelastica on the same mesh .*: unsupported", output)
    assert "nan s" not in output


@pytest.fixture
def heavier(tmp_path, monkeypatch):
    """A solver that takes gravity for a tenth more than it is."""
    site = tmp_path / "site"
    (site / "heavier-1.0.dist-info").mkdir(parents=True)
    (site / "heavier-1.0.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: heavier\nVersion: 1.0\n"
    )
    entry = "[anctmm.solvers]\nheavier = heavier:solve\n"
    (site / "heavier-1.0.dist-info" / "entry_points.txt").write_text(entry)
    (site / "heavier.py").write_text(
        "from dataclasses import replace\n"
        "import anctmm as at\n"
        "def solve(scene, run):\n"
        "    x, y = scene.gravity\n"
        "    return replace(at.solve(replace(scene, gravity=(1.1 * x, 1.1 * y)), run), scene=scene)\n"
    )
    monkeypatch.syspath_prepend(site)


@pytest.mark.usefixtures("heavier")
def test_a_solver_that_differs_by_more_than_the_target_is_a_miss():
    asked = ("--solvers", "anctmm,heavier")
    code, output = told("run", THROWN_CHAIN, *asked, "--error", "1e-2")
    assert code == 1, output
    assert re.search(
        r"heavier on the same mesh .*: differs by \S+, above the target 0\.01;", " ".join(output.split())
    )
    # the same with the mesh and the step given: the target is what others may differ by
    assert told(*ONE_RUN, *asked, "--error", "1e-2")[0] == 1
    assert told(*ONE_RUN, "--solvers", "anctmm,global-dae", "--error", "1e-9")[0] == 0
    # without a target no difference is too large
    code, output = told(*ONE_RUN, *asked)
    assert (code, "above" in output) == (0, False), output


def test_a_solver_that_is_asked_for_and_is_not_installed_has_its_exit_code(monkeypatch):
    monkeypatch.setitem(sys.modules, "exudyn", None)
    for solvers in (
        "anctmm,exudyn-cable",
        "exudyn-cable",
        "exudyn-cable,anctmm",
        "anctmm,global-dae,exudyn-cable",
    ):
        code, output = told(*ONE_RUN, "--solvers", solvers)
        assert code == 4, output
        assert "exudyn is not installed" in " ".join(output.split())
    # what is known to be wrong counts more
    assert told(*ONE_RUN, "--solvers", "anctmm,exudyn-cable,pyelastica")[0] == 1


def test_a_mesh_or_a_step_alone_leaves_the_other_to_be_chosen():
    assert "that of the mesh is not known" in run(find_case(THROWN_CHAIN), mesh=(2,), error=1e-2).error
    assert "that of the step is not known" in run(find_case(THROWN_CHAIN), dt=5e-3, error=1e-2).error


def test_a_run_that_fails_says_so_and_exits_with_1(tmp_path):
    code, output = told("run", DOUBLE_PENDULUM, "--solvers", "pyelastica", "--out", "made")
    assert code == 1
    assert "unsupported" in output
    assert (tmp_path / "made" / "values.csv").exists()


def test_files_of_another_run_do_not_stay_beside_those_of_one_that_has_none(tmp_path):
    assert told("run", THROWN_CHAIN, "--elements", "1", "--dt", "1e-2", "--out", "made")[0] == 0
    assert (tmp_path / "made" / "solution.npz").exists()
    assert told("run", THROWN_CHAIN, "--solvers", "pyelastica", "--out", "made")[0] == 1
    names = {p.name for p in (tmp_path / "made").iterdir()}
    assert names == {"values.csv", "values.md", "machine.json"}


def test_a_file_that_has_no_room_is_named_and_not_left_in_part(tmp_path):
    done = run(find_case(THROWN_CHAIN), mesh=(1,), dt=1e-2)
    at_most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, at_most[1]))
    try:
        with pytest.raises(OutputError, match=r"plot\.png"):
            write_run(done, tmp_path / "made")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, at_most)
    assert {p.name for p in (tmp_path / "made").glob("*.np*")} == {"solution.npz"}
    assert not list((tmp_path / "made").glob("*plot.png*"))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--case", "arm"], "'arm' and is unknown; allowed are 'portal-frame'"),
        ([], "has 2 cases; --case is needed"),
        (["--case", "portal-frame", "--error", "0"], "--error has '0'"),
        (["--case", "portal-frame", "--error", "x"], "--error has 'x'"),
        (["--case", "portal-frame", "--elements", "2,3"], "--elements has 2 values; one is allowed"),
        (["--case", "portal-frame", "--elements", "2/3"], "'2/3'; scene 'portal-frame' needs 1 or 3 numbers"),
        (["--case", "portal-frame", "--dt", "1e-3,1e-4"], "--dt has 2 values"),
        (["--case", "portal-frame", "--dt", "0.007"], "a whole number of steps"),
        (["--case", "portal-frame", "--element", "cabel"], "element is 'cabel'; allowed are 'cable'"),
        (["--case", "portal-frame", "--integrator", "rk4"], "integrator is 'rk4'; allowed are"),
        (["--case", "portal-frame", "--solvers", "me"], "--solvers has 'me'"),
        (["--case", "portal-frame", "--error", "1e-3", "--elements", "2", "--dt", "1e-3"], "one of them to refine"),
        (["--case", "portal-frame-at-rest", "--dt", "1e-3"], "a static equilibrium; it has no step"),
        (
            ["--case", "portal-frame-at-rest", "--integrator", "zhai"],
            "--integrator chooses the steps of motions; portal-frame-at-rest is a static equilibrium: leave it out",
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_before_any_work(options, said):
    code, output = told("run", PORTAL_FRAME, *options)
    assert (code, said in " ".join(output.split())) == (2, True), output


@pytest.mark.parametrize(
    "command", [("run",), ("study", "trade"), ("study", "convergence"), ("recommend",), ("check",)]
)
@pytest.mark.parametrize("option", [("--elements", "4"), ("--element", "quintic"), ("--element", "cable")])
def test_options_about_elements_are_refused_without_beams(tmp_path, command, option):
    (tmp_path / "own.py").write_text(
        "import anctmm as at\n"
        "body = at.RigidBody('body', 1.0, 0.1, (0.5, 0.0), points={'o': (0.0, 0.0)})\n"
        "scene = at.Scene('pendulum', [body], [at.Pin('body.o')], gravity=(0.0, -9.81))\n"
        "CASES = [at.Case(scene, probes=['body.center'], t_end=0.3)]\n"
    )
    if command == ("check",) and option[0] == "--element":
        pytest.skip("it has no such option")
    error = ["--error", "1e-2"] if command == ("recommend",) else []
    code, output = told(*command, "own.py", *option, *error)
    assert code == 2
    assert f"{option[0]} chooses the elements of beams; pendulum has none: leave it out" in " ".join(
        output.split()
    )


def test_the_function_refuses_the_same():
    case = find_case(PORTAL_FRAME, "portal-frame")
    with pytest.raises(CaseError, match="error is 'a'"):
        run(case, error="a")
    with pytest.raises(StudyError, match="needs 1 or 3"):
        run(case, mesh=(1, 2))
    with pytest.raises(StepError, match="whole number"):
        run(case, dt=0.007)


def test_a_run_may_be_written_anywhere(tmp_path):
    written = write_run(run(find_case(THROWN_CHAIN), mesh=(1,), dt=1e-2), tmp_path / "a" / "b")
    assert all(path.is_file() for path in written)
    assert len(written) == 5
