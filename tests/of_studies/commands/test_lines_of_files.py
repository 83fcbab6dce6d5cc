"""What goes wrong inside a user's file is told with its file, its line and the text of that line."""

import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

import anctmm as at
from anctmm.errors import AnctmmError, CaseError
from anctmm.raised import line_of
from studies.cases import cases_in
from studies.cli import app

SCENE = """import anctmm as at
rod, rubber = at.Circle(0.02), at.Material(E=5e6, density=1100.0)
arm = at.Beam("arm", (0, 0), (0.5, 0), rod, rubber)
"""
#: What a file ends with: the line that is told, its text, and what is said of it.
WRONG = {
    "it divides by zero": ("\n\nx = 1 / 0\n", 6, "x = 1 / 0", "ZeroDivisionError: division by zero"),
    "a name that is not there": ("lenght = length\n", 4, "lenght = length", "NameError: name 'length'"),
    "no Python": ("x = (1,\ny = 2\n", 4, "x = (1,", "SyntaxError: '(' was never closed"),
    "wrong indentation": ("if True:\nx = 1\n", 5, "x = 1", "IndentationError"),
    "a negative size": ("at.Circle(-1.0)\n", 4, "at.Circle(-1.0)", "PropertyError: "),
    "an argument of another name": ("at.Circle(radius=1)\n", 4, "at.Circle(radius=1)", "TypeError"),
    "a joint in the air": (
        's = at.Scene(\n    "s", [arm],\n    [at.Pin("leg.end")],\n)\n', 4, "s = at.Scene(",
        "body 'leg' is not in scene",
    ),
    "bodies apart": (
        'b = at.Beam("b", (1, 0), (2, 0), rod, rubber)\nat.Scene("s", [arm, b], [at.Pin("arm.end", "b.start")])\n',
        5, 'at.Scene("s", [arm, b]', "JointGapError",
    ),
    "a probe that is not there": (
        's = at.Scene("s", [arm])\nCASES = [at.Case(s, ["arm.tip"], 1.0)]\n', 5, "CASES = [at.Case(", "'arm.tip'",
    ),
    "in a function of its own": (
        "def length():\n    return undefined\nlength()\n", 5, "return undefined", "NameError",
    ),
    "a function that the scene asks": (
        "def turn(t):\n    return nothing, 0.0, 0.0\nat.solve(at.Scene('s', [arm], [at.Clamp('arm.start', "
        "angle=turn)]), mesh=1, dt=0.1, t_end=0.1)\n", 6, "my.py, line 5, 'return nothing, 0.0, 0.0'", "NameError",
    ),
    "an assertion": ("assert rod is None, 'a rod'\n", 4, "assert rod is None", "AssertionError: a rod"),
    "its own error": ("import sys\nraise SystemExit(3)\n", 5, "raise SystemExit(3)", "sys.exit(3)"),
}  # fmt: skip


def told(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, list(arguments), env={"COLUMNS": "200"})
    return done.exit_code, " ".join(done.output.split())


@pytest.mark.parametrize("name", WRONG)
def test_the_line_of_a_file_that_does_not_run_is_told(name, tmp_path, monkeypatch):
    end, number, text, said = WRONG[name]
    monkeypatch.chdir(tmp_path)
    Path("my.py").write_text(SCENE + end)
    with pytest.raises(CaseError) as caught:
        cases_in("my.py")
    assert caught.value.__cause__ is not None
    message = str(caught.value)
    for part in (f"file my.py, line {number}, ", text, said):
        assert part in message
    code, output = told("list", "my.py")
    assert code == 2
    assert " ".join(message.split()) in output
    assert "Traceback" not in output


def test_the_line_of_a_neighbour_is_told_with_its_file(tmp_path):
    (tmp_path / "parts_of_mine.py").write_text(SCENE + "def leg():\n    return at.Circle(-2.0)\n")
    (tmp_path / "my.py").write_text("from parts_of_mine import leg\nleg()\n")
    with pytest.raises(CaseError, match=r"my\.py, .*parts_of_mine\.py, line 5, 'return at.Circle\(-2.0\)'"):
        cases_in(tmp_path / "my.py")


def test_watched_scenes_tell_their_lines_too(tmp_path):
    (tmp_path / "my.py").write_text(SCENE + "at.Circle(-1.0)\n")
    code, output = told("check", "--scenes", str(tmp_path / "my.py"))
    assert code == 2
    assert "my.py, line 4, 'at.Circle(-1.0)'" in output


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
    place = f"{os.path.basename(__file__)}, line {number}, "
    assert place in str(caught.value)
    assert "RuntimeError: out of data" in str(caught.value)


def test_what_only_this_program_raises_has_no_line():
    with pytest.raises(AnctmmError) as caught:
        at.Circle(-1.0)
    assert line_of(caught.value).text == "at.Circle(-1.0)"
    assert line_of(caught.value.with_traceback(caught.tb.tb_next)) is None  # from this program's own call on


def test_an_error_raised_from_itself_has_its_line():
    with pytest.raises(ValueError, match="again") as caught:
        raise_from_itself(ValueError("again"))
    assert line_of(caught.value).text == "raise error from error"


def raise_from_itself(error):
    raise error from error
