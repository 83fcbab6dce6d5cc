"""The pages: their links lead somewhere, what they name is there, and their examples run."""

import re
import runpy
import tomllib
from pathlib import Path

import pytest

from anctmm.discretise.discretisation import INTEGRATORS
from anctmm.elements.kinds import KINDS
from studies.regression.scenes import declared_in

ROOT = Path(__file__).parents[1]
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
