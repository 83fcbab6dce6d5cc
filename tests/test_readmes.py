"""The pages: their links lead somewhere, what they name is there, and their examples run."""

import re
import runpy
import tomllib
from pathlib import Path

import pandas as pd
import pytest

from anctmm.discretise.discretisation import INTEGRATORS
from anctmm.elements.kinds import KINDS
from studies.regression.scenes import declared_in

ROOT = Path(__file__).parents[1]
#: Tables in `reports/` from which the README's results are.
TABLES = ("trade/at_equal_error", "trade/same_setting", "bench/contests", "agreement/pairs")
FOLDERS = ("anctmm", "reference", "studies", "reports", "tests")
PAGES = sorted(
    p.relative_to(ROOT).as_posix()
    for p in (*ROOT.glob("*.md"), *(p for f in FOLDERS for p in (ROOT / f).rglob("*.md")))
    if not (p.parts[len(ROOT.parts)] == "reports" and p.name != "README.md")
)


def examples(page):
    """The Python blocks of a page."""
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    links = re.findall(r"\]\((?!https?:)([^)#]+)", text)
    assert [x for x in links if not ((ROOT / page).parent / x).exists()] == []


@pytest.mark.parametrize("page", PAGES)
def test_files_and_folders_that_a_page_names_are_there(page):
    """Relative to the page's folder, to a room in it, or to the top."""
    text = (ROOT / page).read_text(encoding="utf-8")
    folder = (ROOT / page).parent
    names = re.findall(r"(?<!\[)`([\w./-]+(?:\.py|\.md|\.toml|/))`", text)
    places = [ROOT, folder, *(p for p in folder.iterdir() if p.is_dir())]
    # made by a reader who follows the page
    mine = {"my.py", "my_scenes.py", "results/", "results/check/", "baselines/"}
    assert [
        n
        for n in names
        if n not in mine and not n.startswith("results/") and not any((p / n).exists() for p in places)
    ] == []


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_room_stands_in_its_folders_page(folder):
    text = (ROOT / folder / "README.md").read_text(encoding="utf-8")
    rooms = [p.parent.name for p in (ROOT / folder).glob("*/*.py")]
    assert [r for r in set(rooms) if f"`{r}/`" not in text and f"{r}/" not in text] == []


def test_the_readme_is_short_and_its_scene_runs_as_it_says():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert readme.count("\n") < 150
    (example,) = examples("README.md")
    made = {}
    exec(compile(example, "README.md", "exec"), made)
    assert made["ours"].status.ok
    assert made["at"].compare(made["ours"], made["dae"], probes=["right.end", ("left", 0.5)]).error < 1e-9
    assert all(f"`{name}`" in readme for name in (*KINDS, *INTEGRATORS))


def test_the_citation_is_of_this_version_and_of_the_papers_method():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    fields = dict(re.findall(r"^([a-z-]+): (.+)$", citation, re.MULTILINE))
    assert fields["version"] == project["version"]
    assert fields["title"] == project["name"]
    assert fields["license"] == project["license"]["text"]
    (doi,) = re.findall(r"doi: (.+)", citation)
    assert doi in (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"## [{project['version']}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_scenes_to_watch_are_declared_as_the_page_shows(tmp_path):
    (example,) = examples("studies/regression/README.md")
    path = tmp_path / "my_scenes.py"
    path.write_text(example)
    assert [w.scene.name for w in runpy.run_path(str(path))["WATCHED"]] == ["swing", "sag"]
    assert len(declared_in(path)) == 2


# --- figures of the README ----------------------------------------------------------------------------------------


def spans(frame, value):
    """Least and largest value of each scene, with two digits."""
    found = []
    for scene in ("four-bar", "cantilever-fall"):
        ends = [f"{x:.2g}" for x in frame.loc[frame.scene == scene, value].agg(["min", "max"])]
        found.append(" … ".join(dict.fromkeys(ends)))
    return "; ".join(found)


def rows_of_results():
    """The rows of the README's table of results, from these tables."""
    best, same, bench, pairs = (pd.read_csv(ROOT / "reports" / f"{name}.csv") for name in TABLES)
    best, same = (
        best[best.status == "ok"],
        same[(same.integrator == "generalized-alpha") & (same.element == "cable")],
    )
    exudyn, dae = (lambda t, s=s: t[t.solver == s] for s in ("exudyn-cable", "global-dae"))
    paper = bench[bench.contest == "four-bar, the paper's elements"].set_index("solver").ratio_step
    apart = pairs[(pairs.solver == "anctmm") & pairs.same_element]
    both = {peer: spans(apart[apart.other == peer], "difference") for peer in ("global-dae", "exudyn-cable")}
    steps, at_best = "CPU time of steps", "each solver at its best settings for errors 1e-2 and 1e-3"
    return [
        (f"{steps}: Exudyn / ANC–TMM", at_best, spans(exudyn(best), "ratio")),
        ("CPU time of whole calls: Exudyn / ANC–TMM", "the same", spans(exudyn(best), "ratio_whole")),
        (f"{steps}: Exudyn / ANC–TMM", "same cable elements, mesh and step", spans(exudyn(same), "ratio")),
        (f"{steps}: sparse global DAE / ANC–TMM", at_best, spans(dae(best), "ratio")),
        (f"{steps}: sparse global DAE / ANC–TMM", "same cable elements, mesh and step", spans(dae(same), "ratio")),
        (
            f"{steps}: ordinary ANCF, dense matrix solved in each step / ANC–TMM",
            "the paper's elements of the four-bar, explicit", f"{paper['global-dae-dense']:.2g} (published: 7.8)",
        ),
        (f"{steps}: ordinary ANCF, sparse matrix factored once / ANC–TMM", "the same", f"{paper['global-dae']:.2g}"),
        ("largest difference from the global DAE, relative", "same elements, mesh and step", both["global-dae"]),
        ("largest difference from Exudyn, relative", "the same", both["exudyn-cable"]),
    ]  # fmt: skip


def test_results_in_the_readme_are_those_of_the_report():
    table = "\n".join(f"| {what} | {case} | {value} |" for what, case, value in rows_of_results())
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert table in readme, table
    dense, sparse = (value.split()[0] for what, _, value in rows_of_results() if "ordinary ANCF" in what)
    assert f"{dense} times against a solver that solves a dense matrix in each step, {sparse} times" in readme
