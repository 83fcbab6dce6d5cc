"""Nothing that a command prints is broken inside a word at 80 columns, on a terminal or where a width is stated."""

import io
import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM, SLIDER_CRANK

from studies.cli import app
from studies.engine.console import fitted, say, show_table

#: Lines that rich draws around helps, and marks at the beginning of lines.
FRAME = "│╭╮╰╯─"
HELPS = {
    f"help of {name or 'anctmm'}": [*name.split(), "--help"]
    for name in ("", "list", "run", "study", "report", "recommend", "bench", "check", "conform")
}
COMMANDS = HELPS | {
    "list": ["list"],
    "list of a file": ["list", SLIDER_CRANK],
    "run": ["run", DOUBLE_PENDULUM, "--error", "1e-2", "--out", "OUT"],
    "run by others": ["run", DOUBLE_PENDULUM, "--elements", "2", "--dt", "5e-3", "--solvers", "anctmm,pyelastica",
                      "--out", "OUT"],
    "convergence": ["study", "convergence", DOUBLE_PENDULUM, "--quick", "--out", "OUT"],
    "four-bar": ["study", "four-bar", "--quick", "--elements", "2/8/2", "--dt", "5e-3", "--solvers", "anctmm",
                 "--out", "OUT"],
    "recommend": ["recommend", "four-bar", "--error", "1e-3", "--no-rerun"],
    "recommend what nobody reaches": ["recommend", "four-bar", "--error", "1e-9", "--no-rerun"],
    "check": ["check", "--only", "thrown-bar/", "--out", "OUT"],
    "an unknown scene": ["run", "five-bar"],
    "an unknown study": ["study", "five"],
    "an option that is not taken": ["study", "fidelity", "--solvers", "anctmm"],
}  # fmt: skip


def printed(arguments: list[str], width: int, folder: Path) -> str:
    words = [str(folder) if a == "OUT" else a for a in arguments]
    done = CliRunner().invoke(app, words, env={"COLUMNS": str(width)}, catch_exceptions=False)
    assert done.exit_code in (0, 1, 2)
    return done.output


def words(text: str) -> set[str]:
    """Words of a text, without times and other numbers that differ from run to run."""
    found = text.translate(dict.fromkeys(map(ord, FRAME), " ")).split()
    return {word for word in found if not re.search(r"\d", word)}


@pytest.mark.parametrize("name", COMMANDS)
def test_no_word_is_broken(name, tmp_path):
    """Words are those of a line that is never broken, and a line is longer than 80 only where its one word is."""
    if name not in HELPS:
        printed(COMMANDS[name], 200, tmp_path)  # what is done and kept now is not told again
    narrow = printed(COMMANDS[name], 80, tmp_path)
    wide = printed(COMMANDS[name], 1000, tmp_path)
    assert len(words(wide)) > 3
    assert words(narrow) - {":"} <= words(wide) | {word + ":" for word in words(wide)}
    assert words(wide) <= words(narrow) | {word.removesuffix(":") for word in words(narrow)}
    program = narrow.partition("import anctmm as at")[0]  # a script is not broken: it is to be run
    unbroken = ("anctmm: ", "Written to ")  # messages are one line for programs; on a terminal see below
    for line in program.splitlines():
        if not line.startswith(unbroken):
            assert len(line) <= 80 or len(line.split()) == 1, line


def test_a_terminal_breaks_messages_between_words():
    """An error on a terminal of 80 columns, as its user sees it."""
    first, second = pty.openpty()
    environment = {k: v for k, v in os.environ.items() if k != "COLUMNS"} | {"TERM": "xterm"}
    command = [sys.executable, "-c", "import os, fcntl, struct, termios, sys;"
               "fcntl.ioctl(2, termios.TIOCSWINSZ, struct.pack('HHHH', 24, 80, 0, 0));"
               "os.execv(sys.executable, [sys.executable, '-m', 'studies', 'run', 'five-bar'])"]  # fmt: skip
    done = subprocess.Popen(command, stdin=second, stdout=second, stderr=second, env=environment)
    os.close(second)
    shown = b""
    while True:
        try:
            part = os.read(first, 4096)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        shown += part
    os.close(first)
    assert done.wait() == 2
    lines = shown.decode().replace("\r", "").splitlines()
    assert lines[0].startswith("anctmm: scene is 'five-bar'")
    assert max(map(len, lines)) <= 80
    assert len(lines) > 2
    assert "cantilever-moment-3.14" in " ".join(lines)


def console(width: int) -> Console:
    return Console(file=io.StringIO(), width=width, force_terminal=False)


def table() -> Table:
    made = Table(box=None, padding=(0, 2, 0, 0))
    for head in ("name", "where it comes from", "what it lacks"):
        made.add_column(head)
    made.add_row("exudyn-reissner", "reference.exudyn.reissner:solve", "rotational-springs, sliders, springs")
    made.add_row("a", "", "[b]")
    return made


@pytest.mark.parametrize("width", [40, 60, 72, 73, 80, 100, 200])
def test_tables_fit_or_become_lines(width):
    shown = console(width)
    show_table(shown, table())
    text = shown.file.getvalue()
    for word in (
        "exudyn-reissner",
        "reference.exudyn.reissner:solve",
        "rotational-springs,",
        "sliders,",
        "springs",
    ):
        assert word in text.split()
    assert max(len(line) for line in text.splitlines()) <= width
    widths = fitted(table(), width)
    assert bool(widths) == (width >= 15 + 31 + 19 + 6)


def test_sentences_in_a_pipe_are_lines(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    shown = console(40)
    say(shown, "word " * 30 + "[end]")
    assert shown.file.getvalue() == "word " * 30 + "[end]\n"
    monkeypatch.setenv("COLUMNS", "40")
    broken = console(40)
    say(broken, "word " * 30 + "[end]")
    assert max(map(len, broken.file.getvalue().splitlines())) <= 40
