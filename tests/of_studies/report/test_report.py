"""The report of cases: one page, few files, no part outside of a narrow screen."""

from dataclasses import replace

import pandas as pd
import pytest
from browser import Tab, needs_chromium
from user_cases import ARM

import anctmm as at
from studies.cases import find_case
from studies.engine import provenance
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Result, StudyError
from studies.engine.tables import Table, write_table
from studies.report.page import html, page
from studies.report.plots import look_of, picture
from studies.report.whole import defaults, join, run_study, write_report

FRAME = pd.DataFrame({
    "scene": ["a <b>", "a <b>"], "error": [1e-5, 1e-2], "reference_error": [1e-4, 1e-4], "cpu_s": [0.1, 0.2],
    "status": ["ok", "diverged: & lost"],
})  # fmt: skip


def made(name="trade", place="page", case="a"):
    def draw(figure):
        figure.subplots().plot([1, 2], [3, 4])

    return Result(
        name, "Made up", "Why?", (f"{case}: a finding of `code`.",), ("An assumption.",),
        (Table("best", "The best", FRAME, ("A note.",)), Table("all", "All", FRAME, place=place)),
        (picture(f"front_{case}", "A <caption>", draw),), (Answer("What?", "1 ms", "Take it."), "A sentence."),
    )  # fmt: skip


def test_the_page_has_all_its_parts_and_no_mark_of_a_table():
    text = page([made()], ["a"], True, ("my.py", None))
    for part in ("Quick run", "What?", "1 ms", "A sentence.", "<code>code</code>", "<svg role", "A &lt;caption&gt;",
                 "anctmm report my.py --quick", provenance.commit(), "best.csv"):  # fmt: skip
        assert part in text
    assert "<b>" not in html(made().tables[0])
    assert "a &lt;b&gt;" in html(made().tables[0])


def test_a_report_has_one_table_of_all_cases_and_none_of_a_study_alone(tmp_path):
    done = [replace(made(place="study", case=case), case=case) for case in "ab"]
    write_report(done, tmp_path, False, (None, None))
    assert {p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file()} == {
        "index.html", "machine.json", "trade/best.csv", "trade/front_a.svg", "trade/front_b.svg",
    }  # fmt: skip
    assert len(pd.read_csv(tmp_path / "trade" / "best.csv")) == 4
    assert join(done).findings == ("a: a finding of `code`.", "b: a finding of `code`.")


def test_tables_have_their_commit(tmp_path):
    write_table(made().tables[0], tmp_path)
    text = (tmp_path / "best.md").read_text()
    assert provenance.commit() in text
    assert "diverged: & lost" in text


def test_pictures_are_reproducible_and_solvers_have_one_colour():
    one, other = (made().pictures[0].svg for _ in range(2))
    assert one == other
    assert look_of("anctmm") != look_of("global-dae")
    assert look_of("mine") == look_of("mine")


def test_a_study_that_fits_no_case_is_refused():
    with pytest.raises(StudyError, match="static equilibrium"):
        list(run_study("trade", Options(quick=True, cases=(find_case("cantilever-force-1"),)), Runner()))
    assert [case.name for case in defaults("trade")] == ["four-bar", "cantilever-fall"]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of a bar and of a soft arm, whose trade is of one solver."""
    folder = tmp_path_factory.mktemp("report")
    bar = at.RigidBody("bar", 1.0, 0.02, (0.25, 0.0), points={"o": (0.0, 0.0), "tip": (0.5, 0.0)})
    turning = at.Scene(
        "a bar of rigid parts that turns about a pin", [bar], [at.Pin("bar.o")], gravity=(0, -9.81)
    )
    cases = (at.Case(turning, ["bar.tip"], t_end=0.1, output_dt=0.01), find_case(ARM))
    runner, options = Runner(folder / "store", quick=True), Options(quick=True, cases=cases)
    done = [
        one for name in ("convergence", "fidelity", "extremes") for one in run_study(name, options, runner)
    ]
    done += run_study("trade", replace(options, cases=cases[1:], solvers=("anctmm",)), runner)
    write_report(done, folder / "report", True, ("my.py", None))
    return done, folder / "report"


@pytest.mark.slow
def test_the_report_of_cases_has_all_studies_in_few_files(report):
    done, folder = report
    assert all(one.good for one in done)
    assert {one.name for one in done} == {"trade", "convergence", "fidelity", "extremes"}
    files = [p for p in folder.rglob("*") if p.is_file()]
    assert len(files) <= 40
    assert sum(p.stat().st_size for p in files) < 4e6


@pytest.mark.slow
@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
def test_no_part_of_the_page_is_wider_than_the_screen(report, browser, width):
    tab = Tab(browser, report[1] / "index.html", width=width)
    assert tab.run("return document.documentElement.scrollWidth") <= width
    tab.close()
