"""The command `report` end to end, as the README's first command has it: every study runs, is written and shown.

Each study in its smallest form, on a page of its own: what it finds is the business of its own tests.
"""

from pathlib import Path

import pandas as pd
import pytest
from small_studies import SMALL
from typer.testing import CliRunner

from anctmm.jit.files import cache_dir
from studies.cli import app
from studies.engine import study
from studies.engine.runner import Runner
from studies.engine.running.ahead import kind_of
from studies.engine.tables import Table
from studies.report.table_view import view


@pytest.fixture(scope="module")
def prepared():
    """For each call of `Runner.prepare` the kinds of runs that it is given."""
    told = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Runner, "prepare", lambda self, cases: told.append({kind_of(case) for case in cases}))
        yield told


@pytest.fixture(scope="module", params=list(SMALL))
def reported(request, tmp_path_factory, prepared) -> tuple[str, Path]:
    """A study's name, and the folder that the command has written."""
    name, out = request.param, tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "asked", lambda cases, quick: [(name, SMALL[name])])
        runs = tmp_path_factory.mktemp("runs")  # nothing that was computed before is found
        patch.setattr(cache_dir, "kept_in", lambda what: runs)
        done = CliRunner().invoke(app, ["report", "--quick", "--out", str(out)])
    assert done.exit_code == 0, done.output
    return name, out


def test_every_study_of_the_report_is_run():
    assert tuple(SMALL) == study.REPORTED


def test_a_study_tells_all_kinds_of_its_runs_before_it_runs(reported, prepared):
    """The report compiles them in two processes before it times any."""
    name, _ = reported
    first, *later = prepared
    prepared.clear()
    assert bool(first) == (name in ("four-bar", "cantilever", "agreement", "trade", "fidelity"))
    if first:
        assert set().union(*later) <= first


def test_its_tables_are_whole_and_can_be_shown(reported):
    """Nothing in them has failed; a solver may refuse a scene, and a run diverge."""
    name, out = reported
    tables = sorted((out / name).glob("*.csv"))
    assert tables
    for path in tables:
        frame = pd.read_csv(path)
        assert not frame.empty, path.name
        assert len(view(Table(path.stem, path.stem, frame)).rows) == len(frame)
        if "status" in frame:
            assert frame["status"].notna().all(), path.name
            assert [s for s in frame["status"] if s.startswith("failed")] == [], path.name


def test_it_stands_on_the_page(reported):
    name, out = reported
    assert f'id="{name}"' in (out / "index.html").read_text(encoding="utf-8")
