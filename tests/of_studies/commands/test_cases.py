"""Files of cases: how they are found, and what is said where they cannot be used."""

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM, FILES, PORTAL_FRAME

from anctmm.errors import CaseError
from studies import scenes
from studies.cases import assumptions_of, built_in, cases_in, find_case, find_cases
from studies.cli import app

HEAD = """
import anctmm as at
beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.01), at.Material(1e9, 1000.0))
def case(name): return at.Case(at.Scene(name, [beam]), ["b.end"], t_end=1.0)
"""
#: Files that cannot be used: their content, and what is said.
WRONG = {
    "empty": ("", "defines no CASES; a list of at least one Case is needed"),
    "no list": (HEAD + "CASES = case('a')", "a list of at least one"),
    "nothing in it": ("CASES = []", "CASES = []"),
    "a mixed list": (HEAD + "CASES = [case('a'), 'b']", "a list of at least one Case"),
    "one name twice": (HEAD + "CASES = [case('a'), case('c'), case('a')]", "2 cases of scenes named 'a'"),
    "it exits": ("import sys\nsys.exit(0)", "sys.exit(0)"),
    "it imports what is not there": ("import nonsense_of_nobody", "nonsense_of_nobody"),
    "its probe is wrong": (HEAD + "CASES = [at.Case(case('a').scene, ['c.end'], 1.0)]", "'c'"),
    "it asks": ("input()", "EOFError"),
}


def ended(*arguments):
    done = CliRunner().invoke(app, list(map(str, arguments)), env={"COLUMNS": "200"})
    return done.exit_code, " ".join(done.output.split())


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_cannot_be_used_is_named(name, tmp_path, monkeypatch):
    content, said = WRONG[name]
    monkeypatch.chdir(tmp_path)
    Path("my.py").write_text(content)
    code, output = ended("list", "my.py")
    assert (code, said in output) == (2, True), output


@pytest.mark.parametrize("path", ["nowhere.py", "a/b.py", "."])
def test_a_file_that_is_not_there_is_named(path):
    assert ended("list", path)[0] == 2
    with pytest.raises(CaseError, match=r"no (such )?file; a Python file that defines CASES is needed"):
        cases_in(path)


def test_a_file_may_import_its_neighbours_and_leaves_no_trace(tmp_path):
    shutil.copy(DOUBLE_PENDULUM, tmp_path / "neighbour.py")
    (tmp_path / "my.py").write_text("from neighbour import CASES")
    assert [case.name for case in cases_in(tmp_path / "my.py")] == ["double-pendulum"]


@pytest.mark.parametrize("file", FILES)
def test_cases_of_files_are_listed(file):
    code, output = ended("list", file)
    assert code == 0
    for case in cases_in(file):
        assert case.name in output
        assert case.note in output


def test_one_of_several_cases_is_chosen_by_name():
    two = "has 2 cases; --case is needed, one of 'portal-frame', 'portal-frame-at"
    with pytest.raises(CaseError, match=two):
        find_case(PORTAL_FRAME)
    assert find_case(PORTAL_FRAME, "portal-frame-at").static
    whole_name = "portal-frame"  # another name begins with it
    assert find_case(PORTAL_FRAME, whole_name).duration == 0.3
    assert len(find_cases(PORTAL_FRAME)) == 2
    with pytest.raises(CaseError, match="'arm' and is unknown; allowed are 'portal-frame', "):
        find_case(PORTAL_FRAME, "arm")


def test_built_in_scenes_are_cases_too():
    assert [case.name for case in built_in()] == [case.name for case in cases_in(scenes.__file__)]
    assert find_case("cantilever-fa").duration == 1.0
    assert find_case("cantilever-force-3").static
    with pytest.raises(CaseError, match=r"'five-bar' and is unknown; allowed are 'four-bar'.*no file either"):
        find_case("five-bar")
    with pytest.raises(CaseError, match=r"fits 'cantilever-force-0.5'"):
        find_case("cantilever-force-")
    with pytest.raises(CaseError, match="''"):
        find_case("")


def test_a_case_states_what_stands_beside_its_results():
    assert assumptions_of(find_case(DOUBLE_PENDULUM)) == ("double-pendulum: A soft arm is turned.",)
    assert assumptions_of(find_case(PORTAL_FRAME, "portal-frame")) == ()
    assert "Table 1" in assumptions_of(find_case("four-bar"))[0]
