"""Commands: their exit codes, and one line on standard error for whatever cannot be used."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from studies.cli import app
from studies.engine import provenance

SCENE = """
import anctmm as at

def push(t):
    return 0.0, -0.5 * t

rod = at.Beam("rod", (0, 0), (0.4, 0), at.Circle(0.01), at.Material(E=5e8, density=1000.0))
fall = at.Scene("fall", [rod], [at.Clamp("rod.start")], [at.Force("rod.end", push)], gravity=(0, -9.81))
rest = at.Scene("rest", [rod], [at.Clamp("rod.start")], gravity=(0, -9.81))
CASES = [at.Case(fall, ["rod.end"], t_end=0.2, output_dt=0.01), at.Case(rest, ["rod.end"], t_end=None)]
"""


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    """A directory with a file of cases, and a store of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("studies.engine.files.store_directory", lambda: tmp_path / "cache")
    (tmp_path / "my.py").write_text(SCENE)
    return tmp_path


def called(*line):
    done = CliRunner().invoke(app, list(map(str, line)), env={"COLUMNS": "400"})
    return done.exit_code, " ".join(done.output.split())


#: Command lines that cannot be used, and a part of the line that says why.
WRONG = {
    "no command": (["lisd"], "No such command"),
    "several cases": (["run", "my.py"], "has 2 cases; --case is needed"),
    "no case": (["run", "my.py", "--case", "jump"], "'jump' and is unknown"),
    "an element": (["run", "my.py", "--case", "fall", "--element", "cabel"], "'cabel' is not one of 'cable'"),
    "an integrator": (["study", "trade", "my.py", "--integrator", "rk4"], "'rk4' is not one of"),
    "a solver": (["run", "my.py", "--case", "fall", "--solvers", "me"], "'me'; allowed are anctmm"),
    "a mesh": (["run", "my.py", "--case", "fall", "--elements", "0"], "'0'; allowed are"),
    "a mesh of another scene": (["run", "my.py", "--case", "fall", "--elements", "2/2"], "needs 1 numbers"),
    "a step": (["run", "my.py", "--case", "fall", "--dt", "-1"], "'-1'; allowed are"),
    "a step that does not divide": (["run", "my.py", "--case", "fall", "--dt", "3e-3"], "dt"),
    "a step of an equilibrium": (["run", "my.py", "--case", "rest", "--dt", "1e-3"], "has no step"),
    "an error": (["run", "my.py", "--case", "fall", "--error", "small"], "'small'; allowed are"),
    "an error beside mesh and step": (
        ["run", "my.py", "--case", "fall", "--elements", "2", "--dt", "1e-3", "--error", "1e-3"], "error is 0.001",
    ),
    "an option twice": (["run", "four-bar", "--dt", "1e-3", "--dt", "2e-3"], "is given 2 times"),
    "no study": (["study", "nothing"], "'nothing' is unknown; allowed are trade"),
    "an option of another study": (["study", "fidelity", "my.py", "--dt", "1e-3"], "takes no --dt"),
    "a scene of a study without": (["study", "published", "my.py"], "takes no scene"),
    "a trade of an equilibrium": (["study", "trade", "my.py", "--case", "rest"], "static equilibrium"),
    "workers": (["study", "trade", "my.py", "--workers", "0"], "--workers"),
    "workers and a cluster": (["study", "trade", "--workers", "2", "--cluster", "tcp://h:1"], "one of them"),
    "no cluster": (["study", "convergence", "my.py", "--quick", "--cluster", "nowhere"], "cannot be reached"),
    "out": (["study", "trade", "--out", "/proc/nowhere"], "cannot be written"),
    "an empty path": (["study", "trade", "--out", ""], "not empty"),
    "no target": (["recommend", "my.py", "--case", "fall"], "at least one of them is needed"),
    "a budget": (["recommend", "my.py", "--case", "fall", "--budget", "long"], "'long'; allowed are"),
    "a table": (["recommend", "four-bar", "--error", "1e-3", "--table", "my"], "cannot be read"),
    "conform": (["conform", "nobody"], "'nobody' is not registered"),
    "check without a file": (["check", "--dt", "1e-3"], "without a file"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_what_cannot_be_used_is_one_line_and_exit_code_2(what):
    line, said = WRONG[what]
    code, output = called(*line)
    assert (code, said in output) == (2, True), output
    assert "Traceback" not in output


def test_a_run_writes_its_files_and_is_stored():
    assert called("run", "my.py", "--case", "fall", "--error", "1e-2")[0] == 0
    folder = Path("results/fall")
    assert {p.name for p in folder.iterdir()} >= {"values.csv", "solution.npz", "probes.csv", "machine.json"}
    stored = sum(1 for _ in Path("cache").rglob("output.pkl"))
    assert stored > 0
    assert called("run", "my.py", "--case", "fall", "--error", "1e-2")[0] == 0
    assert sum(1 for _ in Path("cache").rglob("output.pkl")) == stored


def test_the_commit_stands_in_every_result():
    assert called("study", "convergence", "my.py", "--quick")[0] == 0
    for case in ("fall", "rest"):
        folder = Path("results") / case / "convergence"
        assert json.loads((folder / "machine.json").read_text())["commit"] == provenance.commit()
        assert provenance.commit() in (folder / "values.md").read_text()
        assert len(pd.read_csv(folder / "values.csv"))


def test_a_study_of_which_all_runs_fail_is_exit_code_1():
    code, output = called(
        "study", "convergence", "my.py", "--case", "fall", "--solvers", "pyelastica", "--quick"
    )
    assert code == 1
    assert "unsupported" in output


@pytest.mark.exhaustive
@pytest.mark.slow
def test_recommend_finds_the_trade_that_the_study_has_written():
    assert called("study", "trade", "my.py", "--quick", "--solvers", "anctmm,global-dae")[0] == 0
    code, output = called("recommend", "my.py", "--case", "fall", "--error", "1e-2")
    assert (code, "from results/fall/trade" in output, "meets the target" in output) == (0, True, True), (
        output
    )
    assert called("recommend", "my.py", "--case", "fall", "--error", "1e-9")[0] == 1
    Path("my.py").write_text(SCENE.replace("-0.5 * t", "-0.6 * t"))
    code, output = called("recommend", "my.py", "--case", "fall", "--error", "1e-2")
    assert (code, "was measured before scene 'fall'" in output) == (2, True)


def test_a_fault_of_the_program_has_a_code_of_its_own(monkeypatch):
    monkeypatch.setattr("studies.single_run.run_case", lambda *a, **k: 1 / 0)
    code, output = called("run", "my.py", "--case", "fall")
    assert (code, "internal error of anctmm: ZeroDivisionError" in output) == (3, True)


def test_a_solver_that_is_not_installed_is_exit_code_4(monkeypatch):
    monkeypatch.setitem(sys.modules, "elastica", None)
    line = ["run", "my.py", "--case", "rest", "--elements", "4", "--solvers", "anctmm,pyelastica"]
    assert called(*line)[0] == 4


def test_an_interrupt_says_how_to_continue(monkeypatch):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("studies.single_run.run_case", interrupted)
    code, output = called("run", "my.py", "--case", "fall")
    assert (code, "continue with: anctmm" in output) == (130, True)


def test_output_that_its_reader_closes_is_exit_code_141():
    program = f"{sys.executable} -m studies list | head -1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(
        ["bash", "-c", program], capture_output=True, text=True, env=os.environ, check=False
    )
    assert done.returncode == 141
    assert "Traceback" not in done.stderr


def test_list_names_scenes_solvers_and_studies():
    code, output = called("list")
    assert code == 0
    for name in ("four-bar", "cantilever-fall", "anctmm", "exudyn-cable", "trade", "extremes"):
        assert name in output
    assert called("--version") == (0, f"anctmm {provenance.versions()['anctmm']}")
