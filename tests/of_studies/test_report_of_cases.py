"""`anctmm report my.py`: the page about a user's cases, and how it behaves in headless Chromium."""

import re
from pathlib import Path

import pytest
from browser import CHROMIUM, Browser, Tab
from typer.testing import CliRunner
from user_cases import PORTAL_FRAME

from studies.cases import cases_in
from studies.cli import app
from studies.engine.study import REPORTED, asked

#: Widths of all pictures, as a browser lays them out.
WIDTHS = "return [...document.querySelectorAll('figure svg')].map(s => s.getBoundingClientRect().width)"
WRONG = "'five-bar' and is unknown"


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> Path:
    """Of a file with a motion and an equilibrium, whose name a path could not hold as it is."""
    folder = tmp_path_factory.mktemp("report")
    source = Path(PORTAL_FRAME).read_text().replace('"portal-frame"', '"frame 1/2 <pushed>"')
    (folder / "my.py").write_text(source)
    done = CliRunner().invoke(
        app, ["report", str(folder / "my.py"), "--quick", "--out", str(folder / "page")]
    )
    assert done.exit_code == 0, done.output
    return folder / "page" / "index.html"


def test_the_page_speaks_of_the_files_cases(page):
    text = page.read_text()
    assert 'id="convergence"' in text
    assert all(f'id="{study}"' in text for study in ("trade", "fidelity", "extremes"))
    assert 'id="film-frame-1-2-pushed"' in text
    assert "frame 1/2 &lt;pushed&gt;" in text
    assert "portal-frame-at-rest" in text
    assert "<pushed>" not in text
    assert not re.search("crank|coupler|follower|four-bar|cantilever", text)


def test_its_files_stand_beside_it(page):
    links = set(re.findall(r'href="([^"#:]+\.csv)"', page.read_text()))
    assert links >= {"convergence/values.csv", "trade/points.csv", "trade/advice.csv"}
    assert [link for link in links if not (page.parent / link).is_file()] == []
    assert (page.parent / "trade" / "front_frame-1-2-pushed.svg").is_file()


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
@pytest.mark.parametrize("width", [390, 1280])
def test_it_fits_a_phone_and_a_desktop(page, width, tmp_path):
    browser = Browser(tmp_path)
    try:
        tab = Tab(browser, page, width=width)
        wide = tab.run("return document.documentElement.scrollWidth")
        pictures = tab.run(
            "return [...document.querySelectorAll('figure svg')].map(s => s.getBoundingClientRect().width)"
        )
        assert tab.wrong == []
    finally:
        browser.close()
    assert wide <= width
    assert len(pictures) > 3
    assert min(pictures) > 100


def test_studies_of_a_report():
    assert [name for name, _ in asked(None, quick=True)] == list(REPORTED)
    at_rest = tuple(case for case in cases_in(PORTAL_FRAME) if case.static)
    assert [name for name, _ in asked(at_rest, quick=True)] == ["convergence", "fidelity", "extremes"]
    both = dict(asked(cases_in(PORTAL_FRAME), quick=True))
    assert [case.name for case in both["trade"].cases] == ["portal-frame"]
    assert len(both["convergence"].cases) == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere.py"], "no such file"),
        (["five-bar"], WRONG),
        (["--case", "arm"], "--case is 'arm' without a file"),
    ],
)
def test_what_is_wrong_is_named(arguments, said):
    done = CliRunner().invoke(app, ["report", *arguments], env={"COLUMNS": "200"})
    assert (done.exit_code, said in " ".join(done.output.split())) == (2, True), done.output
