"""The page of all studies: its films, its texts, and how it behaves in headless Chromium, without a network."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from browser import Tab, needs_chromium
from films import decoded
from markupsafe import escape
from small_studies import SMALL

from studies.agreement.study import findings, matrix
from studies.engine.answers import answers_of
from studies.engine.runner import Runner
from studies.engine.running.trial import Trial
from studies.engine.study import Result, find
from studies.engine.tables import MOST_ROWS, Table
from studies.report import animation as film
from studies.report.folder import write
from studies.report.page import inline, prose, write_page
from studies.report.plots import picture, tell
from studies.report.table_view import label
from studies.scenes import cantilever_fall, four_bar
from studies.trade.advice import advice

KEPT = Path(__file__).parents[3] / "reports"
#: Studies whose tables and pictures are of all kinds.
SHOWN = ("four-bar", "cantilever", "agreement", "trade")


def another_study() -> Result:
    """A study as others may add one: texts to be escaped, no number anywhere, no picture, a long table."""
    long = pd.DataFrame({"k": np.arange(MOST_ROWS + 1), "status": "ok"})
    odd = pd.DataFrame(
        {"what": ["<b>", "b", ""], "x_m": [2.0, np.nan, -1e-12], "status": ["failed: x < 1"] * 3}
    )
    return Result(
        name="another",
        title="A study & its <title>",
        question="Does it?",
        findings=("`it < 1` holds",),
        assumptions=(),
        tables=(Table("odd", "Odd", odd), Table("long", "Long", long)),
        answers=("A small answer.",),
    )


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> list[Result]:
    runner = Runner(tmp_path_factory.mktemp("runs"), repeats=1)
    return [*(find(name)(SMALL[name], runner) for name in SHOWN), another_study()]


@pytest.fixture(scope="module")
def folder(results, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("report")
    for result in results:
        write(result, out)
    write_page(results, out, quick=True)
    return out


@pytest.fixture(scope="module", params=["new", "kept"])
def page(request) -> Path:
    """The page of small studies, and the one that is kept with the code."""
    if request.param == "new":
        return request.getfixturevalue("folder") / "index.html"
    if not (KEPT / "trade" / "advice.csv").exists():
        pytest.skip("no report with a measured trade is kept in reports/")
    return KEPT / "index.html"


# --- films ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["four-bar", "cantilever-fall"])
def motion(request):
    base, mesh = {"four-bar": (four_bar(), (2, 8, 2)), "cantilever-fall": (cantilever_fall(), (16,))}[
        request.param
    ]
    case = Trial(base.scene, "anctmm", mesh, dt=5e-3, t_end=base.t_end, output_dt=base.output_dt)
    solution = Runner(None, repeats=1).solve(case).solution
    return solution, film.film("A motion", "Of it.", {"first": solution, "second": solution})


def test_a_film_is_the_motion_to_a_thousandth_of_the_picture(motion):
    solution, made = motion
    data = json.loads(made.data)
    assert len(data["layers"]) == len(made.labels) == 2
    ends = [solution.position(b.name, s) for b in solution.scene.bodies for s in (0.0, 0.5, 1.0)]
    size = np.ptp(np.concatenate(ends), axis=0).max()
    frames = np.linspace(0, len(solution.t) - 1, data["frames"]).round().astype(int)
    for body, (nodes, numbers) in zip(solution.scene.bodies, data["layers"][0], strict=True):
        drawn = decoded(nodes, numbers)
        assert drawn.shape == (data["frames"], nodes, 4)
        for k, fraction in enumerate(np.linspace(0, 1, nodes)):
            true = solution.position(body.name, fraction)[frames] * [1, -1]
            np.testing.assert_allclose(drawn[:, k, :2] * size / film.GRAIN, true, atol=2e-3 * size)


def test_a_film_is_small_and_in_its_box(motion):
    _, made = motion
    assert len(made.data) < 60_000
    left, top, width, height = made.box
    assert max(width, height) <= 1.2 * film.GRAIN
    for layer in json.loads(made.data)["layers"]:
        for nodes, numbers in layer:
            at = decoded(nodes, numbers)[:, :, :2]
            assert (at >= [left, top]).all()
            assert (at <= [left + width, top + height]).all()
    for kind, x, y in made.supports:
        assert kind in ("pin", "clamp")
        assert left < x < left + width
        assert top < y < top + height


def test_no_film_of_runs_that_are_not_whole(motion):
    solution, _ = motion
    cut = replace(solution, status=replace(solution.status, code="diverged"))
    assert film.film("", "", {"cut": cut}) is None
    assert film.film("", "", {"cut": cut, "whole": solution}).labels == ("whole",)


# --- agreement and advice ------------------------------------------------------------------------------------


def test_agreement_of_solvers(results):
    agreement = next(r for r in results if r.name == "agreement")
    pairs = agreement.table("pairs").frame
    ours = pairs[(pairs["solver"] == "anctmm") & (pairs["other"] == "global-dae")]
    # one row for each of two scenes; a quick run leaves the other elements out
    assert list(ours["element"]) == ["cable", "cable"]
    assert (ours["difference"] < 1e-8).all()
    assert (ours["difference"] > 0).all()
    refused = pairs[pairs["other"] == "pyelastica"]
    assert refused["status"].str.startswith("pyelastica unsupported").all()
    square = agreement.table("matrix").frame.set_index("solver")
    assert (
        square.loc["anctmm", "global-dae"] == square.loc["global-dae", "anctmm"] == ours["difference"].max()
    )
    assert np.isnan(square.loc["anctmm", "pyelastica"])
    assert f"{ours['difference'].max():.1e}" in agreement.answers[0]


def test_a_pair_of_which_one_run_failed_is_not_known():
    pairs = pd.DataFrame({
        "scene": "s", "solver": "a", "other": "b", "element": ["cable", "shear"], "difference": [1e-9, np.nan],
        "same_element": True, "status": ["ok", "b diverged"],
    })  # fmt: skip
    assert np.isnan(matrix(pairs, ["a", "b"]).loc["a", "b"])
    assert "agree on both scenes to 1.0e-09" in findings(pairs)[0]
    other = pairs.assign(status=["ok", "b unsupported: no such element"])
    assert matrix(other, ["a", "b"]).loc["a", "b"] == 1e-9


def test_advice_gives_setting_cost_and_reason():
    line = {
        "scene": "s", "target_error": 1e-3, "status": "ok", "solver": "anctmm", "element": "cable", "elements": "8",
        "quadrature": "full", "integrator": "generalized-alpha", "dt": 2e-3, "tolerance": np.nan, "error": 8.123e-4,
        "reference_error": 1.234e-5,
        "mesh_error": 8e-4, "step_error": 1e-4, "error_from": "mesh", "cpu_s": 1.234e-3,
    }  # fmt: skip
    unreached = line | {"target_error": 1e-9, "status": "not reached: so it is"}
    kinds = [
        ("anctmm", "cable", "implicit", 1.0), ("anctmm", "cable", "explicit", 30.0),
        ("anctmm", "shear", "implicit", 9.0), ("peer", "cable", "implicit", 4.0),
        ("peer", "cable", "explicit", 50.0),
    ]  # fmt: skip
    rivals = pd.DataFrame(kinds, columns=["solver", "element", "stepping", "ratio"]).assign(
        scene="s", target_error=1e-3, status="ok"
    )
    first, second = advice(pd.DataFrame([line, unreached]), rivals).frame.to_dict("records")
    assert (first["solver"], first["element"], first["elements"]) == ("anctmm", "cable", "8")
    assert (first["step"], first["cpu_ms"]) == ("implicit, 2 ms", 1.2)
    assert (first["error"], first["reference_error"]) == (8.1e-4, 1.2e-5)
    assert first["why"] == (
        "the mesh's part 0.0008 outweighs the step's 0.0001; peer 4×, shear elements 9×, explicit steps 30×"
    )
    assert second["why"] == "not reached: so it is"
    alone = advice(pd.DataFrame([line | {"error_from": "-", "tolerance": 1e-4}]), rivals[:0]).frame.iloc[0]
    assert alone["step"] == "implicit, tolerance 0.0001"
    assert alone["why"] == "no other kind measured reaches this error"


# --- the text of the page ------------------------------------------------------------------------------------


def test_what_a_reader_needs_stands_in_order(results, folder):
    text = (folder / "index.html").read_text()
    wanted = ['id="answers"', "What to take for a target error, and why", 'id="scenes"', 'id="trade"', 'id="agreement"',
              'id="four-bar"', 'id="cantilever"', 'id="another"', 'id="provenance"', 'id="machine"']  # fmt: skip
    places = [text.index(w) for w in wanted]
    assert places == sorted(places)
    for answer in (a for r in results for a in answers_of(r.question, r.answers)):
        for part in (answer.question, answer.take):
            assert str(prose(part)) in text[: places[2]]
        assert escape(answer.figure) in text[: places[2]]
    assert text.count("<summary>Assumptions</summary>") == len(results)
    assert "A study &amp; its &lt;title&gt;" in text
    assert "<code>it &lt; 1</code> holds" in text
    assert '<td class="bad">failed: x &lt; 1</td>' in text


def test_a_failed_run_is_a_row_with_its_reason(folder):
    text = (folder / "index.html").read_text()
    assert re.search(r'class="(?:long )?bad">diverged: .+?</td>', text)
    assert "pyelastica unsupported: " in text


def test_nothing_is_loaded_from_elsewhere(folder):
    text = (folder / "index.html").read_text()
    assert not re.search(r"""(?:src|href)=["'](?:https?:)?//|@import|url\((?!#)""", text)
    assert "default-src 'none'" in text
    assert "matplotlib.org" not in text
    assert "#1b1b1d" not in text.split("</style>", 1)[1]  # ink has the theme's colour


def test_names_are_for_people():
    assert [label(n) for n in ("cpu_s", "target_error", "dt")] == ["CPU time (s)", "target error", "Δt (s)"]
    assert str(prose("`a<b` & c")) == "<code>a&lt;b</code> &amp; c"


# --- in Chromium ---------------------------------------------------------------------------------------------

LOOK = """
document.querySelectorAll("details").forEach(d => d.open = true);
const ids = [...document.querySelectorAll("[id]")].map(e => e.id);
const links = [...document.querySelectorAll("a[href]")].map(a => a.getAttribute("href"));
const seen = box => e => {
  const b = e.getBoundingClientRect(), across = b.right > box.left - 2 && b.left < box.right + 2;
  return b.width + b.height > 0 && across && b.bottom > box.top - 2 && b.top < box.bottom + 2;
};
const figures = [...document.querySelectorAll("figure")].map(figure => {
  const svg = figure.querySelector("svg"), box = svg.getBoundingClientRect();
  const shapes = [...svg.querySelectorAll("path, use, text, rect")].filter(seen(box)).length;
  const texts = [...svg.querySelectorAll("text")].map(t => t.getBoundingClientRect().height).filter(h => h > 0);
  const said = figure.querySelector("figcaption").innerText;
  return { id: figure.id, width: box.width, height: box.height, shapes, said, lowest: Math.min(99, ...texts) };
});
const colour = (selector, name) => getComputedStyle(document.querySelector(selector))[name];
return {
  ids, links, figures, tables: document.querySelectorAll("table").length,
  across: [document.documentElement.scrollWidth, innerWidth],
  ink: [colour("body", "color"), colour(".soft", "color"), colour("a", "color")],
  ground: [colour("body", "backgroundColor"), colour("figure", "backgroundColor")],
};
"""


@needs_chromium
def test_every_figure_is_there_and_links_resolve(browser, page):
    tab = Tab(browser, page)
    found = tab.run(LOOK)
    assert tab.wrong == []
    assert len(found["ids"]) == len(set(found["ids"]))
    inside = {link[1:] for link in found["links"] if link.startswith("#")}
    assert inside
    assert inside <= set(found["ids"])
    for link in found["links"]:
        assert link.startswith("#") or (page.parent / link).is_file(), link
    text = page.read_text()
    assert [f["id"] for f in found["figures"]] == re.findall(r'<figure (?:class="film" )?id="(.*?)"', text)
    assert {f["id"] for f in found["figures"]} >= {"film-four-bar", "film-cantilever-fall"}
    for figure in found["figures"]:
        assert min(figure["width"], figure["height"]) > 100, figure
        assert figure["shapes"] >= 2, figure
        assert len(figure["said"]) > 20, figure


@needs_chromium
def test_every_picture_and_table_of_the_studies_is_on_the_page(browser, results, folder):
    found = Tab(browser, folder / "index.html").run(LOOK)
    wanted = {f"{r.name}-figure-{p.name}" for r in results for p in r.pictures}
    assert len(wanted) > 15
    assert wanted <= {f["id"] for f in found["figures"]}
    shown = [t for r in results for t in r.tables if len(t.frame) <= MOST_ROWS]
    assert found["tables"] == len(shown) + 1  # and that of provenance
    assert {f"{r.name}/{t.name}.csv" for r in results for t in r.tables} <= set(found["links"])


@needs_chromium
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_a_phone_shows_all_in_light_and_dark(browser, page, dark):
    tab = Tab(browser, page, width=390, dark=dark)
    found = tab.run(LOOK)
    assert tab.wrong == []
    assert found["across"] == [390, 390]  # the page itself does not scroll sideways
    for figure in found["figures"]:
        assert figure["lowest"] >= 8.0, figure
    grounds = [luminance(c) for c in found["ground"]]
    assert all((ground < 0.05) == dark for ground in grounds)
    for ink in map(luminance, found["ink"]):
        for ground in grounds:
            assert (max(ink, ground) + 0.05) / (min(ink, ground) + 0.05) > 4.5


@needs_chromium
def test_what_is_wider_than_its_place_says_so(browser, page):
    """Until it is scrolled to its end; on a wide window pictures have room."""
    box = "document.querySelector('figure .scroll')"
    found = f"const box = {box}; return [...box.classList].filter(name => name !== 'scroll');"
    phone, wide = Tab(browser, page, 390), Tab(browser, page, 1200)
    phone.shown.wait_for_selector("figure .scroll.wide")
    assert phone.run(found) == ["wide", "more"]
    assert "scroll" in phone.run(f"return getComputedStyle({box}, '::before').content")
    phone.run(f"{box}.scrollLeft = 1e4")
    phone.shown.wait_for_selector("figure .scroll.wide:not(.more)")
    wide.run("return new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert wide.run(found) == []
    assert [*phone.wrong, *wide.wrong] == []
    phone.close()
    wide.close()


def luminance(colour: str) -> float:
    """Relative luminance of "rgb(r, g, b)", as WCAG defines it."""
    values = np.array([float(v) for v in re.findall(r"[\d.]+", colour)[:3]]) / 255
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


FILM = """
const film = document.querySelector("#film-%s"), slider = film.querySelector("input");
const button = film.querySelector("button"), speed = film.querySelector("select");
const frame = () => new Promise(requestAnimationFrame);
const state = () => ({
  t: Number(slider.value), button: button.textContent, said: film.querySelector("output").textContent,
  shape: [...film.querySelectorAll("path.body")].map(p => p.getAttribute("d")),
});
"""
#: What a frame shows is taken down within that frame: a busy machine may be late, but sees the same.
PLAY = """
const first = state();
button.click();
while (Number(slider.value) <= first.t) await frame();
const playing = state();
button.click();
const paused = state();
for (let i = 0; i < 5; i++) await frame();
return [first, playing, paused, state()];
"""
REPLAY = """
speed.value = "1";
button.click();
const start = state();
while (button.textContent === "Pause") await frame();
return [start, state()];
"""


@needs_chromium
@pytest.mark.parametrize("name", ["four-bar", "cantilever-fall"])
def test_a_film_plays_pauses_and_is_dragged(browser, page, name):
    tab, head = Tab(browser, page), FILM % name
    first, playing, paused, later = tab.run(head + PLAY)
    assert (first["button"], playing["button"], paused["button"]) == ("Play", "Pause", "Play")
    assert later == paused
    assert all(a != b for a, b in zip(playing["shape"], first["shape"], strict=True))

    slider = f"document.querySelector('#film-{name} input')"
    tab.click(f"document.querySelector('#film-{name} button')")  # playing, until the slider is taken
    tab.run(f"{slider}.scrollIntoView({{block: 'center'}});")
    left, right, height = tab.run(
        f"const b = {slider}.getBoundingClientRect(); return [b.left, b.right, (b.top + b.bottom) / 2];"
    )
    tab.mouse("mousePressed", right - 9, height)
    tab.mouse("mouseMoved", (left + right) / 2, height)
    half = tab.run(head + "return state();")
    tab.mouse("mouseMoved", left - 20, height)
    start = tab.run(head + "return state();")
    tab.mouse("mouseMoved", right + 20, height)
    tab.mouse("mouseReleased", right + 20, height)
    end = tab.run(head + "return state();")
    assert (start["t"], start["said"], start["button"]) == (0, "0.00 s", "Play")
    assert half["t"] == pytest.approx(end["t"] / 2, rel=0.02)
    assert end["said"] == f"{end['t']:.2f} s"
    again, over = tab.run(head + REPLAY)  # from the end it begins anew
    assert (again["t"], again["button"]) == (0, "Pause")
    assert over == end
    assert tab.wrong == []

    data = json.loads(tab.run(head + "return film.querySelector('script').textContent;"))
    bodies = [decoded(*body) for layer in data["layers"] for body in layer]
    for shown, frame in ((start, 0), (end, -1)):
        # paths stand in the opposite order: what is drawn last lies on top
        for drawn, body in zip(reversed(shown["shape"]), bodies, strict=True):
            points = [float(x) for x in re.findall(r"-?[\d.]+", drawn)]
            assert points[:2] == list(body[frame, 0, :2])
            assert points[-2:] == list(body[frame, -1, :2])


@needs_chromium
def test_tables_sort(browser, folder):
    tab = Tab(browser, folder / "index.html")
    tab.run("document.querySelectorAll('details').forEach(d => d.open = true);")
    table = '[...document.querySelectorAll("#another table")].find(t => t.innerText.includes("x m"))'
    seen = []
    for column in (1, 1, 0):
        tab.click(f"{table}.querySelectorAll('th button')[{column}]")
        seen.append(
            tab.run(
                f"const t = {table}; return [t.querySelectorAll('th')[{column}].ariaSort, "
                f"[...t.tBodies[0].rows].map(r => r.cells[{column}].textContent)];"
            )
        )
    assert seen == [
        ["ascending", ["-1e-12", "2", ""]],
        ["descending", ["2", "-1e-12", ""]],
        ["ascending", ["<b>", "b", ""]],
    ]
    assert tab.run(f"return [...{table}.querySelectorAll('th')].map(h => h.ariaSort);") == [
        "ascending",
        None,
        None,
    ]
    assert tab.wrong == []


@needs_chromium
def test_markers_tell_what_they_are(browser, page):
    tab = Tab(browser, page)
    tab.click('document.querySelector("figure use:has(> title)")')
    told, titles = tab.run("""
        const figure = document.querySelector("figure use > title").closest("figure");
        const titles = [...figure.querySelectorAll("use > title")].map(t => t.textContent);
        return [figure.querySelector(".told").textContent, titles];
    """)
    assert len(titles) > 5
    assert told in titles  # that of the marker on top, where some lie on one another
    assert re.search(r"(elements|cable|shear).*: error \d", told)
    assert tab.wrong == []


@needs_chromium
def test_what_goes_wrong_is_seen(browser, folder, tmp_path):
    """The tests above would see a script that fails, a warning, and anything from a network."""
    bad = '<img src="http://localhost:9/x.png"><script>console.error("said", 1); nowhere.x = 1;</script>'
    page, open_page = (
        (folder / "index.html").read_text().replace("</main>", bad + "</main>"),
        tmp_path / "open.html",
    )
    closed = tmp_path / "closed.html"
    closed.write_text(page)
    open_page.write_text(re.sub(r'<meta http-equiv="Content-Security-Policy".*?>', "", page))
    for shown, part in (
        (closed, "Content Security Policy"),
        (open_page, "request: http://localhost:9/x.png"),
    ):
        wrong = "\n".join(Tab(browser, shown).wrong)
        for text in ("said 1", "nowhere is not defined", part):
            assert text in wrong


def test_a_picture_on_the_page_has_the_themes_colours():
    def draw(figure):
        (drawn,) = figure.subplots().plot([0, 1], [0, 1], "o")
        tell(drawn, ["a", "b"])

    svg = inline(picture("p", 'with "quotes" & <more>', draw), "s")
    assert 'aria-label="with &quot;quotes&quot; &amp; &lt;more>"' in svg
    assert "var(--ink)" in svg
    assert "#1b1b1d" not in svg
    assert all(i.startswith("s-p-") for i in re.findall(r' id="(.*?)"', svg))
    assert not re.search(r"\.\d{3,}", "".join(re.findall(r' d="(.*?)"', svg)))
