"""`anctmm recommend` answers from the table that ships with the package: in any directory, of any installation."""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from studies.cli import app
from studies.engine.storage.files import atomic_write
from studies.trade.choice import setting_of
from studies.trade.recommendation import recommend

ROOT = Path(__file__).parents[3]
SHIPPED = ("points.csv", "histories.csv", "references.csv", "SHA256SUMS", "machine.json")


@pytest.fixture
def elsewhere(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def invoke(*arguments: str):
    return CliRunner().invoke(app, ["recommend", *arguments], env={"COLUMNS": "200"})


@pytest.mark.parametrize("scene", ["four-bar", "cantilever-fall"])
def test_the_kept_table_answers_in_any_directory(elsewhere, scene):
    done = invoke(scene, "--error", "1e-3", "--no-rerun")
    assert done.exit_code == 0, done.output
    assert "from the table that ships with anctmm, measured on " in done.output
    assert "measuring" not in done.output
    assert list(elsewhere.iterdir()) == []


def test_a_recommendation_of_the_kept_table_meets_its_error(elsewhere):
    done = invoke("four-bar", "--error", "1e-3")
    assert done.exit_code == 0, done.output
    assert "meets the target error 0.001" in done.output


@pytest.mark.parametrize("scene", ["four-bar", "cantilever-fall"])
@pytest.mark.parametrize("target", [1e-2, 1e-3, 1e-4, 1e-5])
def test_runners_up_are_told_apart_from_what_is_recommended(elsewhere, scene, target):
    """Settings that differ in Newton's tolerance alone have one name."""
    choice = recommend.choose(recommend.kept().points, scene, target, None)
    told = [setting_of(line) for line in (choice.line, *choice.runners_up.to_dict("records"))]
    assert len(told) > 2
    assert len(set(told)) == len(told)


def test_what_the_user_measured_here_comes_first(elsewhere):
    folder = elsewhere / "results" / "trade"
    folder.mkdir(parents=True)
    for name in SHIPPED:
        (folder / name).write_bytes((recommend.KEPT / name).read_bytes())
    assert "from results/trade" in invoke("four-bar", "--error", "1e-3", "--no-rerun").output


def test_a_kept_table_that_was_changed_is_refused(elsewhere, monkeypatch):
    for name in SHIPPED:
        (elsewhere / name).write_bytes((recommend.KEPT / name).read_bytes())
    points = elsewhere / "points.csv"
    points.write_text(points.read_text().replace("0.0", "0.1", 1))
    monkeypatch.setattr(recommend, "KEPT", elsewhere)
    done = invoke("four-bar", "--error", "1e-3", "--no-rerun")
    assert (done.exit_code, "may be damaged" in done.output) == (2, True)


def test_reports_and_the_package_have_one_table():
    """The report refers to what ships: there is no second copy, and each file is the one its checksum names."""
    for name in SHIPPED:
        assert (ROOT / "reports" / "trade" / name).resolve() == (recommend.KEPT / name).resolve()
    sums = dict(
        reversed(line.split("  ")) for line in (recommend.KEPT / "SHA256SUMS").read_text().splitlines()
    )
    for name in SHIPPED[:3]:
        assert sums[name] == hashlib.sha256((recommend.KEPT / name).read_bytes()).hexdigest()


def test_a_new_report_is_written_through_the_reference(tmp_path):
    kept, link = tmp_path / "kept.csv", tmp_path / "link.csv"
    kept.write_text("old")
    link.symlink_to("kept.csv")
    atomic_write(link, "new")
    assert link.is_symlink()
    assert kept.read_text() == "new"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--solvers", "global-dae"], "global-dae, "),
        (["--integrator", "zhai"], "anctmm, explicit"),
        (["--elements", "2/8/2"], "2/8/2 cable"),
        (["--dt", "5e-3"], "Δt = 5 ms"),
        (["--element", "shear"], "shear elements"),
    ],
)
def test_options_narrow_the_choice(elsewhere, arguments, said):
    done = invoke("four-bar", "--error", "1e-2", "--no-rerun", *arguments)
    (line,) = [line for line in done.output.splitlines() if line.startswith(("Recommended", "Nearest"))]
    assert said in line


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--solvers", "pyelastica"], "--solvers is 'pyelastica'; measured on scene 'four-bar' are anctmm"),
        (["--elements", "3/3/3"], "--elements is '3/3/3'; measured on scene 'four-bar' are "),
        (["--dt", "1.2345"], "--dt is '1.2345'"),
        (["--integrator", "euler"], "integrator is 'euler'"),
    ],
)
def test_what_was_not_measured_is_refused_by_name(elsewhere, arguments, said):
    done = invoke("four-bar", "--error", "1e-2", "--no-rerun", *arguments)
    assert (done.exit_code, said in " ".join(done.output.split())) == (2, True), done.output


def test_rows_to_the_digits_that_tables_keep():
    points = pd.DataFrame({"scene": "s", "dt": [1 / 3, 0.25], "solver": "anctmm"})
    options = recommend.Options(steps=(0.333333333,))
    assert len(recommend.narrowed(points, "s", options, None)) == 1


def test_a_scene_that_is_not_in_the_table_is_measured_alone_after_saying_how_long(elsewhere, monkeypatch):
    asked = []

    def study(options, runner):
        asked.append([case.name for case in options.cases])
        raise KeyboardInterrupt

    monkeypatch.setattr("studies.engine.study.find", lambda name: study)
    done = invoke("four-bar-moment", "--error", "1e-2", "--quick")
    assert asked == [["four-bar-moment"]]
    assert "measuring it first takes some " in done.output
    assert done.exit_code == 130


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """What `pip install .` installs: built from what goes into a package, without the links of reports/."""
    pytest.importorskip("setuptools")
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("target")
    for name in ("anctmm", "reference", "studies"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    build = [
        "-W",
        "ignore",
        "-c",
        "import setuptools; setuptools.setup()",
        "-q",
        "build",
        "--build-lib",
        str(target),
    ]
    subprocess.run([sys.executable, *build], cwd=source, check=True, capture_output=True)
    return target


def test_an_installation_has_the_table_and_answers(installed, elsewhere):
    for name in SHIPPED:
        assert (installed / "studies/trade/kept" / name).read_bytes() == (recommend.KEPT / name).read_bytes()
    arguments = ["recommend", "four-bar", "--error", "1e-3", "--no-rerun"]
    environment = {**os.environ, "PYTHONPATH": str(installed), "COLUMNS": "200"}
    done = subprocess.run(
        [sys.executable, "-m", "studies", *arguments], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "from the table that ships with anctmm" in done.stdout
