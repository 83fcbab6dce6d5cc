"""What goes wrong inside a user's file is told with its file, its line and the text of that line."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import anctmm as at
from anctmm.errors import AnctmmError, CaseError
from studies.cases import cases_in
from studies.cli import app

SCENE = """import anctmm as at
rod, rubber = at.Circle(0.02), at.Material(E=5e6, density=1100.0)
arm = at.Beam("arm", (0, 0), (0.5, 0), rod, rubber)
"""
#: What a file ends with: the line that is told, its text, and what is said of it.
WRONG = {
    "it divides by zero": ("\n\nx = 1 / 0\n", 6, "x = 1 / 0", "ZeroDivisionError: division by zero"),
    "no Python": ("x = (1,\ny = 2\n", 4, "x = (1,", "SyntaxError: '(' was never closed"),
    "a negative size": ("at.Circle(-1.0)\n", 4, "at.Circle(-1.0)", "PropertyError: "),
    "an argument of another name": ("at.Circle(radius=1)\n", 4, "at.Circle(radius=1)", "TypeError"),
    "bodies apart": (
        'b = at.Beam("b", (1, 0), (2, 0), rod, rubber)\nat.Scene("s", [arm, b], [at.Pin("arm.end", "b.start")])\n',
        5, 'at.Scene("s", [arm, b]', "JointGapError",
    ),
    "in a function of its own": (
        "def length():\n    return undefined\nlength()\n", 5, "return undefined", "NameError",
    ),
    "a function that the scene asks": (
        "def turn(t):\n    return nothing, 0.0, 0.0\nat.solve(at.Scene('s', [arm], [at.Clamp('arm.start', "
        "angle=turn)]), mesh=1, dt=0.1, t_end=0.1)\n", 6, "my.py, line 5, 'return nothing, 0.0, 0.0'", "NameError",
    ),
    "its own error": ("import sys\nraise SystemExit(3)\n", 5, "raise SystemExit(3)", "sys.exit(3)"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_the_line_of_a_file_that_does_not_run_is_told(name, tmp_path, monkeypatch):
    end, number, text, said = WRONG[name]
    monkeypatch.chdir(tmp_path)
    Path("my.py").write_text(SCENE + end)
    with pytest.raises(CaseError) as caught:
        cases_in("my.py")
    assert all(part in str(caught.value) for part in (f"file my.py, line {number}, ", text, said))


def test_the_line_of_a_neighbour_is_told_with_its_file(tmp_path):
    (tmp_path / "parts_of_mine.py").write_text(SCENE + "def leg():\n    return at.Circle(-2.0)\n")
    (tmp_path / "my.py").write_text("from parts_of_mine import leg\nleg()\n")
    with pytest.raises(CaseError, match=r"my\.py, .*parts_of_mine\.py, line 5, 'return at.Circle\(-2.0\)'"):
        cases_in(tmp_path / "my.py")


def test_watched_scenes_tell_their_lines_too(tmp_path):
    (tmp_path / "my.py").write_text(SCENE + "at.Circle(-1.0)\n")
    done = CliRunner().invoke(app, ["check", "--scenes", str(tmp_path / "my.py")], env={"COLUMNS": "200"})
    assert done.exit_code == 2
    assert "my.py, line 4, 'at.Circle(-1.0)'" in " ".join(done.output.split())


def load_that_fails(t):
    """Fails in the middle of a motion."""
    if t > 0.055:
        raise RuntimeError("out of data")  # this line is told
    return 0.0, -1.0


def test_a_history_that_fails_in_a_run_tells_its_line():
    beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.01), at.Material(1e9, 1000.0))
    scene = at.Scene("s", [beam], [at.Clamp("b.start")], [at.Force("b.end", load_that_fails)])
    number = load_that_fails.__code__.co_firstlineno + 3
    with pytest.raises(AnctmmError) as caught:
        at.solve(scene, mesh=1, dt=0.01, t_end=0.1)
    assert f"{Path(__file__).name}, line {number}, " in str(caught.value)
    assert "RuntimeError: out of data" in str(caught.value)
