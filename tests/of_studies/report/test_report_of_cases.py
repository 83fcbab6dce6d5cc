"""`anctmm report my.py`: the page about a user's cases, and how it behaves in headless Chromium."""

import re
from html import unescape
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from browser import OVERLAPS, Tab, needs_chromium
from typer.testing import CliRunner
from user_cases import PORTAL_FRAME, SLIDER_CRANK

from studies.cases import cases_in
from studies.cli import app
from studies.engine.answers import Answer
from studies.engine.runner import Runner
from studies.engine.study import REPORTED, Options, Result, asked, find
from studies.report.folder import write
from studies.report.page import Subject, write_page

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


# --- in Chromium -----------------------------------------------------------------------------------------------

OPEN = "document.querySelectorAll('details').forEach(d => d.open = true);"
#: Table of the forces: its cells by row, whether each is a line of a card, and the name that stands before it.
CARDS = """
const cells = [...document.querySelectorAll("#table-convergence-forces td")];
return cells.map(c => ({
  said: c.textContent, shown: getComputedStyle(c).display, width: c.getBoundingClientRect().right,
  name: getComputedStyle(c, "::before").display === "none" ? "" : getComputedStyle(c, "::before").content }));
"""


@pytest.fixture(scope="module")
def mechanism(tmp_path_factory) -> Path:
    """The page of bodies of all kinds, of one study."""
    folder = tmp_path_factory.mktemp("mechanism")
    cases = cases_in(SLIDER_CRANK)
    result = find("convergence")(Options(quick=True, cases=cases), Runner(None, repeats=1))
    write(result, folder)
    return write_page([result], folder, True, Subject([c.name for c in cases], ["my.py"]))


@pytest.fixture(params=[390, 1280])
def width(request) -> int:
    return request.param


@pytest.fixture(params=["page", "mechanism"])
def tab(request, browser, width):
    """A page at a width, with everything in it open; the browser is offline."""
    shown = Tab(browser, request.getfixturevalue(request.param), width=width)
    shown.run(OPEN)
    yield shown
    assert shown.wrong == []
    shown.close()


@needs_chromium
def test_it_fits_a_phone_and_a_desktop(tab, width):
    assert tab.run("return document.documentElement.scrollWidth") == width
    pictures = tab.run(WIDTHS)
    assert len(pictures) >= 3
    assert min(pictures) > 100


@needs_chromium
def test_no_text_lies_on_another(tab):
    assert tab.run(OVERLAPS) == []


@needs_chromium
def test_overlapping_texts_would_be_seen(browser, page, tmp_path):
    """The test above can fail: a sentence is moved upon another."""
    moved = page.read_text().replace("</style>", ".take { margin-top: -2.2rem !important; }</style>", 1)
    (tmp_path / "moved.html").write_text(moved)
    assert Tab(browser, tmp_path / "moved.html").run(OVERLAPS)


@needs_chromium
def test_rows_are_cards_on_a_phone(tab, width):
    cells = tab.run(CARDS)
    assert len(cells) >= 6
    names = {cell["name"] for cell in cells}
    if width > 640:
        assert {cell["shown"] for cell in cells} == {"table-cell"}
        assert names == {""}
    else:
        assert {cell["shown"] for cell in cells} == {"flex"}
        assert {'"joint"', '"digits"'} <= names
        assert max(cell["width"] for cell in cells) <= width


@needs_chromium
def test_tables_sort(tab):
    table = "document.querySelector('#table-convergence-forces')"
    order = f"return [...{table}.tBodies[0].rows].map(r => r.cells[0].textContent);"
    tab.click(f"{table}.querySelector('th button')")
    up = tab.run(order)
    tab.click(f"{table}.querySelector('th button')")
    down = tab.run(order)
    assert len(set(up)) > 1
    assert (up, down) == (sorted(up), sorted(up, reverse=True))


@needs_chromium
def test_everything_that_moves_is_in_the_animation(browser, mechanism, width):
    tab = Tab(browser, mechanism, width=width)
    film = "document.querySelector('.film')"
    state = (
        f"return [...{film}.querySelectorAll('path.body')]"
        ".map(p => [p.getAttribute('class'), p.getAttribute('d')]);"
    )
    before = tab.run(state)
    kinds = [classes.split()[1] for classes, _ in before]
    assert sorted(kinds) == ["beam", "beam", "guide", "mass", "rigid", "spring", "spring"]
    tab.click(f"{film}.querySelector('button')")
    tab.run(
        f"while ({film}.querySelector('output').textContent <= '0.30 s') await new Promise(requestAnimationFrame);"
    )
    moved = [kind for kind, (_, a), (_, b) in zip(kinds, before, tab.run(state), strict=True) if a != b]
    # all but the guide, which is fixed in the ground
    assert sorted(moved) == ["beam", "beam", "mass", "rigid", "spring", "spring"]
    named = tab.run(f"return [...{film}.querySelectorAll('.part')].map(p => p.textContent.trim());")
    assert named == ["crank", "rod", "plate", "load"]
    inked = tab.run(f"return [...{film}.querySelectorAll('path.body')].map(p => getComputedStyle(p).stroke);")
    assert "none" not in inked
    assert len(set(inked)) == 5  # bodies by their colours, springs and guides alike
    assert tab.wrong == []


def test_a_newcomer_reads_what_to_take_and_what_the_joints_carry(page):
    text = unescape(re.sub(r"<[^>]+>", " ", page.read_text()))
    text = " ".join(text.split())
    # both solve the same equations, in a millisecond here: times as measured say which is the cheaper one
    solver = "(anctmm|global-dae)"
    take = rf"Take {solver}, implicit, [\d/]+ cable elements.*?, Δt = [\d.]+ ms: its error is (\S+ ± |< )\S+"
    assert re.search(
        rf"frame 1/2 <pushed>: what to take for an error of 0\.001\? \S+ m?s of CPU time quick {take}", text
    )
    assert re.search(r"frame 1/2 <pushed>: how many digits are correct\? [\d.]+ ± \S+ m quick", text)
    assert "largest displacement at the outputs. By " in text
    held = r"Its first (\d )?digits? (is|are) correct\."
    force = rf"what is the largest force in a joint\? [\d.]+ ± \S+ N quick {held} In (clamp|weld) "
    assert len(re.findall(force, text)) == 2  # also of the frame at rest


def test_forces_are_those_of_equilibrium(page):
    """The clamps of the frame at rest carry its load, 20 N down and 5 N aside, to the digits that are said to hold."""
    forces = pd.read_csv(page.parent / "convergence" / "forces.csv")
    held = forces[(forces["scene"] == "portal-frame-at-rest") & forces["joint"].str.startswith("clamp")]
    assert set(held["quantity"]) == {"force at rest", "moment at rest"}
    sizes = held[held["quantity"] == "force at rest"]
    assert len(sizes) == 2
    assert sizes["value"].max() <= 20.0 + 5.0
    assert sizes["value"].sum() >= np.hypot(20.0, 5.0) - sizes["uncertainty"].sum()
    assert (forces["uncertainty"] > 0).all()
    assert (forces["uncertainty"] < 0.2 * forces["value"].abs()).mean() > 0.5


def test_quick_numbers_are_marked(page, tmp_path):
    text = page.read_text()
    assert '<body class="quick">' in text
    assert (
        len(re.findall('<p class="figure">[^<]+ <span class="quick-mark">', text))
        == text.count('class="figure"')
        > 2
    )
    assert re.search('<td class="number found">', text)
    result = Result("s", "S", "?", (), (), (), answers=(Answer("Q?", "1 m", "Take it."), "A sentence."))
    whole = write_page([result], tmp_path, quick=False).read_text()
    assert "quick-mark" not in whole.split("</style>", 1)[1]


# --- which studies ---------------------------------------------------------------------------------------------


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
