"""Command lines, files and environments that go wrong: each ends with its own exit code, and none in a bare exception.

0 done, 1 differs, 2 bad input, 4 nothing could be compared, 130 interrupted, 141 the reader closed the output; 3 is a
fault of the program, which nothing here may find.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import pytest
from typer.testing import CliRunner

from anctmm.solvers import registry
from studies.cli import app
from studies.command_line import ending
from studies.command_line.streams import NARROWEST, substitute

TRADE = Path(__file__).parents[3] / "reports" / "trade"
#: A solver that needs no compiler: bodies fall as if nothing held them.
STILL = """
import numpy as np
import anctmm as at
from anctmm.offer import Offer
from anctmm.results.fields import LagrangeField

OFFER = Offer(lacks={"statics", "joints", "drives", "varying-loads", "energy", "damping", "rigid"})


def solve(scene, run):
    t = run.times(run.output_steps)
    way = 0.5 * np.outer(t**2, scene.gravity)
    fields = {b.name: LagrangeField(np.array([b.start, b.end]) + way[:, None]) for b in scene.bodies}
    return at.Solution("still", scene, run, t, fields, at.Energy.unknown(len(t)), at.Cost(0.0, 0.0, run.steps), dofs=2)
"""
#: Modules of plug-ins by the name of their solver.
SOLVERS = {
    "still": STILL,
    "leaves": "import sys\nsys.exit(0)",
    "flees": "import os\nos._exit(0)",
    "quits": "raise SystemExit",
    "based": "raise BaseException('neither')",
    "raises": "raise RuntimeError('no [/licence]\\nat all')",
    "mute": "class Odd:\n    def __repr__(self): raise ValueError\nsolve = Odd()",
    "leaves-later": "import sys\ndef solve(scene, run): sys.exit(0)",
    "flees-later": "import os\ndef solve(scene, run): os._exit(0)",
    "raises-later": "def solve(scene, run): raise ValueError('[/red] $x_')",
    "odd-later": "class Odd:\n    def __repr__(self): raise ValueError\ndef solve(scene, run): return Odd()",
}
HEAD = """
import anctmm as at
from studies.check import Static, Watch
beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.01), at.Material(1e9, 1000.0))
scene = at.Scene("bar", [beam], gravity=(0, -9.81))
run = at.Discretisation(mesh=1, dt=0.1, t_end=0.2, output_dt=0.1)
"""
GOOD = HEAD + 'WATCHED = [Watch(scene, ["b.end"], {"fall": run}, ["still"])]\n'


def by(solver):
    return GOOD.replace('["still"]', f'["{solver}"]')


def named(body):
    return GOOD.replace('("b"', f'("{body}"').replace('"b.end"', f'"{body}.end"')


#: Files of scenes: their content, the exit code, what is said. The stored history of the good one lies beside it.
SCENES = {
    "good": (GOOD, 0, ["1 same"]),
    "printing": ("print('hello')\n" + GOOD, 0, ["hello", "1 same"]),
    "with a byte order mark": ("\ufeff" + GOOD, 0, ["1 same"]),
    "that turns to another directory": ("import os\nos.chdir('/')\n" + GOOD, 0, ["1 same"]),
    "that takes standard output": ("import io, sys\nsys.stdout = io.StringIO()\n" + GOOD, 0, ["1 same"]),
    "in a tuple": (GOOD.replace("[Watch", "(Watch").replace('["still"])]', '["still"]),)'), 0, ["1 same"]),
    "empty": ("", 2, ["WATCHED = None"]),
    "of one line that is no Python": ("1 +", 2, ["SyntaxError"]),
    "binary": (b"\x7fELF\x00\x01\xff", 2, ["does not run"]),
    "with null bytes": (b"a = 1\x00", 2, ["does not run"]),
    "in Latin-1": ("name = 'caf\xe9'\n".encode("latin-1") + GOOD.encode(), 2, ["SyntaxError"]),
    "in UTF-16": (GOOD.encode("utf-16"), 2, ["does not run"]),
    "that exits": ("import sys\nsys.exit(0)", 2, ["does not run", "sys.exit(0)"]),
    "that exits after it declared": (GOOD + "import sys\nsys.exit()", 2, ["sys.exit(None)"]),
    "that exits with 1": ("raise SystemExit(1)", 2, ["sys.exit(1)"]),
    "that exits with words": ("raise SystemExit('all is [/well]')", 2, ["all is [/well]"]),
    "that calls exit": ("exit()", 2, ["sys.exit(None)"]),
    "that exits for good": ("import os\nos._exit(0)", 2, ["os._exit(0)"]),
    "that exits in what it imports": ("import leaves", 2, ["sys.exit(0)"]),
    "that raises": ("raise RuntimeError('no [/b] $luck$')", 2, ["RuntimeError", "no [/b] $luck$"]),
    "that raises lines": ("raise RuntimeError('one\\ntwo')", 2, ["one two"]),
    "that raises no Exception": ("raise BaseException('neither')", 2, ["BaseException: neither"]),
    "that raises what ends generators": ("raise GeneratorExit", 2, ["GeneratorExit"]),
    "that reads what is not there": ("open('/no/such/file')", 2, ["FileNotFoundError"]),
    "that asks": ("input()", 2, ["EOFError"]),
    "that fails to assert": ("assert False, 'no'", 2, ["AssertionError"]),
    "that recurses": ("def f(): f()\nf()", 2, ["RecursionError"]),
    "that wants memory": ("raise MemoryError('7 TiB')", 2, ["MemoryError"]),
    "that breaks a pipe": ("raise BrokenPipeError(32, 'Broken pipe')", 2, ["BrokenPipeError"]),
    "that warns, as an error": ("import warnings\nwarnings.simplefilter('error')\nwarnings.warn('old')", 2, ["old"]),
    "that is interrupted": ("raise KeyboardInterrupt", 130, ["interrupted"]),
    "that imports nothing known": ("import nonsense_of_nobody", 2, ["nonsense_of_nobody"]),
    "of a bad scene": (HEAD + "at.Circle(-1.0)", 2, ["-1.0"]),
    "of a drive with an argument that it has not": (
        HEAD + "at.Quintic(distance=1.0, duration=1.0)", 2, ["'distance'", "Quintic takes turn, duration"]
    ),
    "of a solver's call with a number too many": (HEAD + "at.solve(1, 2, 3)", 2, ["solve takes scene, run, start"]),
    "of a call of something else": (HEAD + "dict(1, 2)", 2, ["TypeError"]),
    "without a list": (HEAD + "WATCHED = Watch(scene, ['b.end'], {'fall': run})", 2, ["a list of at least one Watch"]),
    "of nothing": ("WATCHED = []", 2, ["WATCHED = []"]),
    "of a text": ("WATCHED = 'scene'", 2, ["WATCHED = 'scene'"]),
    "of a mapping": ("WATCHED = {}", 2, ["WATCHED = {}"]),
    "of a generator": ("WATCHED = (w for w in [])", 2, ["generator"]),
    "of a module": ("import sys as WATCHED", 2, ["module"]),
    "of a class": (HEAD + "WATCHED = [Watch]", 2, ["a list of at least one Watch"]),
    "of what cannot be shown": ("class Odd:\n    def __repr__(self): raise ValueError\nWATCHED = Odd()", 2, ["Odd"]),
    "of what exits when shown": ("class Odd:\n    def __repr__(self): exit()\nWATCHED = [Odd()]", 2, ["WATCHED"]),
    "of a million": ("WATCHED = list(range(10**6))", 2, ["WATCHED = [0, 1, 2", "…"]),
    "that exits when looked at": ("class Odd(list):\n    def __iter__(self): exit()\nWATCHED = Odd([1])", 2, ["exit"]),
    "of no scene": (GOOD.replace("(scene,", "(3,"), 2, ["Watch scene is 3"]),
    "of probes that are a number": (GOOD.replace('["b.end"]', "3"), 2, ["has probes 3"]),
    "of probes that are a text": (GOOD.replace('["b.end"]', '"b.end"'), 2, ["has probes 'b.end'"]),
    "of a probe that is a number": (GOOD.replace('["b.end"]', "[3]"), 2, []),
    "of a probe that is nowhere": (GOOD.replace('"b.end"', '("b", 2.0)'), 2, ["2.0"]),
    "of a probe of no body": (GOOD.replace('"b.end"', '"c.end"'), 2, ["'c'"]),
    "of solvers that are a number": (GOOD.replace('["still"]', "3"), 2, ["has solvers 3"]),
    "of a solver that is a number": (GOOD.replace('["still"]', "[3]"), 2, ["solver is 3"]),
    "of a solver with a slash": (by("a/b"), 2, ["solver is 'a/b'"]),
    "of runs that are a list": (GOOD.replace('{"fall": run}', "[run]"), 2, ["has runs"]),
    "of a run that is a number": (GOOD.replace('"fall": run', '"fall": 4'), 2, ["is 4"]),
    "of a run named ..": (GOOD.replace('"fall"', '".."'), 2, ["run name is '..'"]),
    "of a run without a name": (GOOD.replace('"fall"', "None"), 2, ["run name is None"]),
    "of a scene with a slash": (GOOD.replace('"bar"', '"a/b"'), 2, ["scene name is 'a/b'"]),
    "of a body with a comma": (named("b,c"), 2, ["'b,c'", "comma"]),
    "of a body with a line break": (named("b\\nc"), 2, ["printable"]),
    "twice": (GOOD + "WATCHED *= 2", 2, ["watched 2 times"]),
    "of a name too long": (GOOD.replace('"bar"', f'"{"b" * 300}"'), 2, ["at most 100"]),
    "of a solver that is not there": (by("adams"), 4, ["1 not run"]),
    "of a solver that leaves": (by("leaves"), 4, ["sys.exit(0)", "1 not run"]),
    "of a solver that flees": (by("flees"), 4, ["os._exit(0)", "1 not run"]),
    "of a solver that raises": (by("raises"), 4, ["no [/licence]", "1 not run"]),
    "of a solver that leaves later": (by("leaves-later"), 1, ["sys.exit(0)", "1 failed"]),
    "of a solver that flees later": (by("flees-later"), 1, ["os._exit(0)", "1 failed"]),
    "of a solver that raises later": (by("raises-later"), 1, ["ValueError: [/red] $x_", "1 failed"]),
    "of a solver that answers oddly": (by("odd-later"), 1, ["Odd", "1 failed"]),
    "of other settings": (GOOD.replace("t_end=0.2", "t_end=0.3"), 1, ["t_end=0.2", "1 other settings"]),
    "of another name": (GOOD.replace('"fall"', '"drop"'), 1, ["1 no baseline", "1 unasked"]),
    "of another motion": (GOOD.replace("-9.81", "-9.82"), 1, ["1 differs"]),
    "of a body in brackets": (named("b[/red] $x_$"), 1, ["1 differs"]),
    "of statics nobody offers": (GOOD.replace('"fall": run', '"rest": Static(1)'), 1, ["no solve_static"]),
}  # fmt: skip

#: What becomes of the stored history, the exit code, what is said.
BASELINES = {
    "untouched": (lambda b: b, 0, ["1 same"]),
    "with the ends of lines of Windows": (lambda b: b.replace(b"\n", b"\r\n"), 0, ["1 same"]),
    "gone": (lambda b: None, 1, ["1 no baseline"]),
    "empty": (lambda b: b"", 1, ["does not begin with"]),
    "foreign": (lambda b: b"t,x\n0,1\n", 1, ["does not begin with"]),
    "binary": (lambda b: bytes(range(256)) * 40, 1, ["does not begin with"]),
    "in UTF-16": (lambda b: b.decode().encode("utf-16"), 1, ["does not begin with"]),
    "with a byte order mark": (lambda b: b"\xef\xbb\xbf" + b, 1, ["does not begin with"]),
    "of another version": (lambda b: b.replace(b"history 1", b"history 2", 1), 1, ["does not begin with"]),
    "half": (lambda b: b[: len(b) // 2], 1, ["cut short"]),
    "without its last line": (lambda b: b[: b.rindex(b"# end")], 1, ["cut short"]),
    "without a row": (lambda b: b.replace(b.split(b"\n")[-3] + b"\n", b""), 1, ["cut short"]),
    "with a word": (lambda b: b"word".join(b.rsplit(b"0.", 1)), 1, ["cannot be read"]),
    "with a number too many": (lambda b: b.replace(b"\n# end", b",1\n# end"), 1, ["cannot be read"]),
    "with a column too many": (lambda b: b.replace(b"t (s),", b"t (s),colour,"), 1, ["cannot be read"]),
    "with a column too few": (lambda b: b.replace(b"t (s),displacement b at 1 x (m)", b"t (s)"), 1, ["cannot be read"]),
    "without tolerances": (lambda b: b.replace(b"# tolerance of", b"# colour of"), 1, ["cannot be read"]),
    "with a tolerance of 0": (lambda b: tolerance(b, b"0.0"), 1, ["cannot be read", "tolerance"]),
    "with a negative tolerance": (lambda b: tolerance(b, b"-1.0"), 1, ["cannot be read"]),
    "with an infinite tolerance": (lambda b: tolerance(b, b"inf"), 1, ["cannot be read"]),
    "with a tolerance that is no number": (lambda b: tolerance(b, b"nan"), 1, ["cannot be read"]),
    "with a tolerance in words": (lambda b: tolerance(b, b"much"), 1, ["cannot be read"]),
    "without settings": (lambda b: b.replace(b"# settings", b"# colours"), 1, ["1 other settings"]),
    "without corrections": (lambda b: b.replace(b"# Newton corrections: 0", b"# none"), 1, ["cannot be read"]),
    "with a value that is no number": (lambda b: last(b, b"nan"), 1, ["1 differs"]),
    "with an infinite value": (lambda b: last(b, b"inf"), 1, ["1 differs"]),
    "with another value": (lambda b: last(b, b"0.5"), 1, ["1 differs"]),
    "with a time that is no number": (lambda b: b.replace(b"\n0.1,", b"\nnan,"), 1, ["1 differs"]),
    "with other times": (lambda b: b.replace(b"\n0.1,", b"\n0.15,"), 1, ["1 differs"]),
}  # fmt: skip


def tolerance(content, value):
    head, _, rest = content.partition(b"# tolerance of displacement: ")
    return head + b"# tolerance of displacement: " + value + b" m," + rest.partition(b" m,")[2]


def last(content, value):
    """Another value at the end of the last row."""
    lines = content.split(b"\n")
    lines[-3] = lines[-3].rpartition(b",")[0] + b"," + value
    return b"\n".join(lines)


def damaged(name, change):
    """A change of one table of the trade."""

    def spoil(folder):
        path = folder / name
        before = path.read_bytes()
        content = change(before)
        assert content != before  # a table that is measured again may have no such words
        path.unlink()
        if content is not None:
            path.write_bytes(content)

    return spoil


def another_digit(content):
    """A table of which the last digit is another one."""
    before, digit, after = re.split(rb"(\d)(?=,[^,\n]*\n$)", content)
    return before + b"%d" % ((int(digit) + 1) % 10) + after


def rows(content, part):
    """The first part of a table, cut at the end of a row."""
    lines = content.split(b"\n")
    return b"\n".join([*lines[: int(part * len(lines))], b""])


def directory(folder):
    (folder / "points.csv").unlink()
    (folder / "points.csv").mkdir()


#: What becomes of a kept trade, the exit code, what is said.
TABLES = {
    "untouched": (lambda folder: None, 0, ["Recommended: anctmm"]),
    "half the points, by rows": (damaged("points.csv", lambda b: rows(b, 0.5)), 2, ["points.csv", "cut or edited"]),
    "half the points, by bytes": (damaged("points.csv", lambda b: b[: len(b) // 2]), 2, ["points.csv"]),
    "all points but the last": (damaged("points.csv", lambda b: rows(b, 0.999)), 2, ["cut or edited"]),
    "one digit": (damaged("points.csv", another_digit), 2, ["edited"]),
    "half the histories": (damaged("histories.csv", lambda b: rows(b, 0.5)), 2, ["histories.csv", "cut or"]),
    "half the references": (damaged("references.csv", lambda b: rows(b, 0.6)), 2, ["references.csv", "cut or"]),
    "no points": (damaged("points.csv", lambda b: None), 2, ["points.csv cannot be read"]),
    "no histories": (damaged("histories.csv", lambda b: None), 2, ["histories.csv cannot be read"]),
    "no references": (damaged("references.csv", lambda b: None), 2, ["references.csv cannot be read"]),
    "no checksums": (damaged("SHA256SUMS", lambda b: None), 2, ["SHA256SUMS cannot be read", "study trade"]),
    "checksums of nothing": (damaged("SHA256SUMS", lambda b: b""), 2, ["SHA256SUMS has no checksum"]),
    "checksums in binary": (damaged("SHA256SUMS", lambda b: b"\xff\xfe"), 2, ["SHA256SUMS cannot be read"]),
    "points empty": (damaged("points.csv", lambda b: b""), 2, ["points.csv cannot be read"]),
    "points of one line": (damaged("points.csv", lambda b: b.split(b"\n")[0] + b"\n"), 2, ["cut or edited"]),
    "points without a head": (damaged("points.csv", lambda b: b.partition(b"\n")[2]), 2, ["no column 'scene'"]),
    "points without a column": (damaged("points.csv", lambda b: b.replace(b"cpu_s,", b"s,", 1)), 2, ["'cpu_s'"]),
    "points in binary": (damaged("points.csv", lambda b: bytes(range(256)) * 99), 2, ["points.csv"]),
    "points in UTF-16": (damaged("points.csv", lambda b: b.decode().encode("utf-16")), 2, ["points.csv"]),
    "points in Latin-1": (damaged("points.csv", lambda b: b.replace(b"ok", b"\xe9")), 2, ["points.csv"]),
    "points of null bytes": (damaged("points.csv", lambda b: b"\x00" * 999), 2, ["points.csv"]),
    "points with an open quote": (damaged("points.csv", lambda b: b.replace(b"ok", b'"ok', 1)), 2, ["points.csv"]),
    "points of too many cells": (damaged("points.csv", lambda b: b + b",".join([b"1"] * 99)), 2, ["points.csv"]),
    "points in words": (damaged("points.csv", lambda b: b.replace(b"0.00", b"little")), 2, ["points.csv"]),
    "a directory for points": (directory, 2, ["points.csv is no file"]),
    "histories in binary": (damaged("histories.csv", lambda b: bytes(range(256)) * 99), 2, ["histories.csv"]),
    "nothing at all": (shutil.rmtree, 2, ["points.csv cannot be read"]),
}  # fmt: skip

#: Arguments, the exit code, what is said. FILE is a file, DIR an empty directory, TRADE a kept trade.
ARGUMENTS = {
    "nothing": ([], 2, ["Usage"]),
    "help": (["--help"], 0, ["Exit codes: 0 success", "recommend"]),
    "help of a command": (["check", "--help"], 0, ["--baselines"]),
    "list": (["list"], 0, ["four-bar", "pyelastica"]),
    "list of more": (["list", "more"], 2, ["more"]),
    "no command": (["lists"], 2, ["'lists'"]),
    "an empty command": ([""], 2, ["''"]),
    "a command in brackets": (["[/red]"], 2, ["[/red]"]),
    "a surrogate": (["\udcff"], 2, ["No such command"]),
    "an option of nobody": (["--fast"], 2, ["--fast"]),
    "study of nothing": (["study"], 2, ["Missing argument"]),
    "study of two": (["study", "four-bar", "trade"], 2, ["trade"]),
    "study of nobody": (["study", "five-bar"], 2, ["'five-bar'", "fidelity"]),
    "study in capitals": (["study", "Four-Bar"], 2, ["'Four-Bar'"]),
    "study by an empty name": (["study", ""], 2, ["study ''"]),
    "study by brackets": (["study", "[/red]"], 2, ["[/red]"]),
    "meshes of words": (["study", "four-bar", "--elements", "many"], 2, ["'many'"]),
    "meshes of a fraction": (["study", "four-bar", "--elements", "2.5"], 2, ["'2.5'"]),
    "meshes of 0": (["study", "four-bar", "--elements", "0"], 2, ["'0'"]),
    "meshes below 0": (["study", "four-bar", "--elements=-4"], 2, ["'-4'"]),
    "meshes of too many digits": (["study", "four-bar", "--elements", "9" * 5000], 2, ["--elements"]),
    "meshes of one body too few": (["study", "four-bar", "--elements", "2/8", "--out", "DIR"], 2, ["'2/8'"]),
    "meshes of one body too many": (["study", "four-bar", "--elements", "2/8/2/8", "--out", "DIR"], 2, ["1 or 3"]),
    "meshes with a comma too many": (["study", "four-bar", "--elements", "8,,16"], 2, ["''"]),
    "steps of words": (["study", "four-bar", "--dt", "small"], 2, ["'small'"]),
    "steps of 0": (["study", "four-bar", "--dt", "0"], 2, ["'0'"]),
    "steps below 0": (["study", "four-bar", "--dt=-1e-3"], 2, ["'-1e-3'"]),
    "steps that are no number": (["study", "four-bar", "--dt", "nan"], 2, ["'nan'"]),
    "steps without end": (["study", "four-bar", "--dt", "1e999"], 2, ["'1e999'"]),
    "steps with a unit": (["study", "four-bar", "--dt", "1ms"], 2, ["'1ms'"]),
    "solvers of nobody": (["study", "four-bar", "--solvers", "adams"], 2, ["'adams'"]),
    "solvers of nothing": (["study", "four-bar", "--solvers", ""], 2, ["''"]),
    "meshes of extremes": (["study", "extremes", "--elements", "8", "--out", "DIR"], 2, ["takes no --elements: "]),
    "steps of extremes": (["study", "extremes", "--dt", "1e-3", "--out", "DIR"], 2, ["takes no --dt: "]),
    "solvers of extremes": (["study", "extremes", "--solvers", "anctmm", "--out", "DIR"], 2, ["takes no --solvers: "]),
    "meshes of fidelity": (["study", "fidelity", "--elements", "8", "--out", "DIR"], 2, ["takes no --elements: "]),
    "quick with a value": (["study", "four-bar", "--quick=yes"], 2, ["--quick"]),
    "a study's out that is a file": (["study", "four-bar", "--out", "FILE"], 2, ["--out", "File exists"]),
    "a study's out below a file": (["study", "four-bar", "--out", "FILE/x"], 2, ["Not a directory"]),
    "a study's out that is empty": (["study", "four-bar", "--out", ""], 2, ["--out", "empty path"]),
    "a study's out too long": (["study", "four-bar", "--out", "x" * 300], 2, ["File name too long"]),
    "a study's out in no file system": (["study", "four-bar", "--out", "/proc/none"], 2, ["--out"]),
    "a study's out with a null": (["study", "four-bar", "--out", "a\0b"], 2, ["null"]),
    "a report's out that is a file": (["report", "--out", "FILE"], 2, ["--out"]),
    "a report of something": (["report", "trade"], 2, ["trade"]),
    "a bench's out that is a file": (["bench", "--quick", "--out", "FILE"], 2, ["--out"]),
    "check of nothing": (["check", "--only", "five-bar"], 2, ["leaves nothing"]),
    "check of one and of another": (
        ["check", "--only", "four-bar", "--only", "small"], 2, ["--only is given 2 times; once is allowed"]
    ),
    "check twice stored": (["check", "--update", "--update"], 2, ["--update is given 2 times"]),
    "check of an empty text": (["check", "--only", ""], 2, ["--only is ''"]),
    "check of commas": (["check", "--only", " , "], 2, ["--only"]),
    "check by nobody": (["check", "--solver", "adams"], 2, ["'adams'", "still"]),
    "check by an empty name": (["check", "--solver", ""], 2, ["--solver is ''"]),
    "check of scenes that are not there": (["check", "--scenes", "none.py"], 2, ["no such file"]),
    "check of scenes that are a directory": (["check", "--scenes", "DIR"], 2, ["no file"]),
    "check of scenes of an empty name": (["check", "--scenes", ""], 2, ["--scenes", "empty path"]),
    "check of scenes that are a device": (["check", "--scenes", "/dev/null"], 2, ["no file"]),
    "check of scenes below a file": (["check", "--scenes", "FILE/x.py"], 2, ["no such file"]),
    "check of scenes and nobody's": (["check", "--scenes", "GOOD", "--only", "four-bar"], 2, ["leaves nothing"]),
    "check against nothing": (["check", "--baselines", "none", "--out", "DIR"], 2, ["no such directory"]),
    "check against a file": (["check", "--baselines", "FILE", "--out", "DIR"], 2, ["no such directory"]),
    "check against an empty name": (["check", "--baselines", ""], 2, ["--baselines", "empty path"]),
    "check against an empty directory": (
        ["check", "--scenes", "GOOD", "--baselines", "DIR", "--out", "DIR"], 1, ["1 no"]
    ),
    "check into a file": (["check", "--scenes", "GOOD", "--out", "FILE"], 2, ["--out"]),
    "check into an empty name": (["check", "--scenes", "GOOD", "--out", ""], 2, ["--out", "empty path"]),
    "update into a file": (
        ["check", "--scenes", "GOOD", "--update", "--baselines", "FILE", "--out", "DIR"], 2, ["--baselines"]
    ),
    "update with a value": (["check", "--update=yes"], 2, ["--update"]),
    "conform of nothing": (["conform"], 2, ["Missing argument"]),
    "conform of nobody": (["conform", "adams"], 2, ["'adams'"]),
    "conform of an empty name": (["conform", ""], 2, ["''"]),
    "conform of who leaves": (["conform", "leaves"], 1, ["sys.exit(0)", "1 broken"]),
    "conform of who flees": (["conform", "flees"], 1, ["os._exit(0)", "1 broken"]),
    "conform of who raises": (["conform", "raises"], 1, ["no [/licence]", "1 broken"]),
    "conform of who cannot be shown": (["conform", "mute"], 1, ["1 broken"]),
    "recommend nothing": (["recommend"], 2, ["Missing argument"]),
    "recommend for nobody": (["recommend", "five-bar", "--error", "1e-3"], 2, ["'five-bar'"]),
    "recommend for an empty name": (["recommend", "", "--error", "1e-3"], 2, ["''"]),
    "recommend without a target": (["recommend", "four-bar"], 2, ["--error and --budget"]),
    "recommend for a word": (["recommend", "four-bar", "--error", "small"], 2, ["'small'"]),
    "recommend for 0": (["recommend", "four-bar", "--error", "0"], 2, ["'0'"]),
    "recommend for less": (["recommend", "four-bar", "--error=-1"], 2, ["'-1'"]),
    "recommend for no number": (["recommend", "four-bar", "--error", "nan"], 2, ["'nan'"]),
    "recommend for all": (["recommend", "four-bar", "--error", "inf"], 2, ["'inf'"]),
    "recommend in words": (["recommend", "four-bar", "--budget", "soon"], 2, ["'soon'"]),
    "recommend in hours": (["recommend", "four-bar", "--budget", "1h"], 2, ["'1h'"]),
    "recommend in no time": (["recommend", "four-bar", "--budget", "0s"], 2, ["'0s'"]),
    "recommend an element of nobody": (
        ["recommend", "four-bar", "--error", "1e-3", "--element", "shell", "TABLE"], 2, ["'shell'"]
    ),
    "recommend an empty element": (["recommend", "four-bar", "--error", "1e-3", "--element", "", "TABLE"], 2, ["''"]),
    "recommend from nowhere": (["recommend", "four-bar", "--error", "1e-3", "--table", "none"], 2, ["points.csv"]),
    "recommend from a file": (["recommend", "four-bar", "--error", "1e-3", "--table", "FILE"], 2, ["points.csv"]),
    "recommend from an empty name": (["recommend", "four-bar", "--error", "1", "--table", ""], 2, ["empty path"]),
    "recommend": (["recommend", "four-bar", "--error", "1e-3", "--no-rerun", "TABLE"], 0, ["Recommended"]),
    "recommend by a beginning": (["recommend", "cant", "--error", "1e-2", "--no-rerun", "TABLE"], 0, ["Recommended"]),
    "recommend within a budget": (["recommend", "four", "--budget", "20ms", "--no-rerun", "TABLE"], 0, ["Recommended"]),
    "recommend what nobody reaches": (
        ["recommend", "four", "--error", "1e-300", "--no-rerun", "TABLE"], 1, ["Not reached"]
    ),
    "recommend what is not known": (
        ["recommend", "four", "--error", "1e-10", "--no-rerun", "TABLE"], 1, ["Not reached"]
    ),
    "recommend in too little time": (
        ["recommend", "four", "--budget", "1us", "--no-rerun", "TABLE"], 1, ["Not reached"]
    ),
    "recommend both, which is too much": (
        ["recommend", "four", "--error", "1e-5", "--budget", "1ms", "--no-rerun", "TABLE"], 1, ["Not reached"]
    ),
}  # fmt: skip

#: Environments in which the same command must say the same, in the characters and the width that there are.
ENVIRONMENTS = {
    "ASCII": ({}, "ascii"), "Latin-1": ({}, "latin-1"), "code page 437": ({}, "cp437"), "UTF-16": ({}, "utf-16"),
    "one column": ({"COLUMNS": "1"}, "utf-8"), "no column": ({"COLUMNS": "0"}, "utf-8"),
    "columns below 0": ({"COLUMNS": "-5"}, "utf-8"), "columns in words": ({"COLUMNS": "wide"}, "utf-8"),
    "too many columns": ({"COLUMNS": "9" * 30}, "utf-8"), "a superscript for columns": ({"COLUMNS": "²"}, "utf-8"),
    "dumb": ({"TERM": "dumb"}, "utf-8"), "no terminal": ({"TERM": ""}, "utf-8"),
    "no colour": ({"NO_COLOR": "1"}, "utf-8"),
    "unknown terminal": ({"TERM": "nonsense"}, "utf-8"), "no lines": ({"LINES": "0"}, "utf-8"),
    "another backend": ({"MPLBACKEND": "nonsense"}, "utf-8"), "a width in words": ({"TERMINAL_WIDTH": "x"}, "utf-8"),
    "all colours in ASCII": ({"FORCE_COLOR": "1"}, "ascii"),
}  # fmt: skip


@pytest.fixture(scope="module")
def plugins(tmp_path_factory):
    """Installed plug-ins that do what they should not."""
    site = tmp_path_factory.mktemp("site")
    for solver, module in SOLVERS.items():
        name = solver.replace("-", "_")
        (site / f"{name}.py").write_text(module)
        info = site / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[{registry.GROUP}]\n{solver} = {name}:solve\n")
    sys.path.insert(0, str(site))
    yield site
    sys.path.remove(str(site))
    for name in [s.replace("-", "_") for s in SOLVERS]:
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def stored(plugins, tmp_path_factory):
    """A good file of scenes with its stored history."""
    folder = tmp_path_factory.mktemp("project")
    (folder / "scenes.py").write_text(GOOD)
    run(["check", "--scenes", folder / "scenes.py", "--out", folder / "out", "--update"], 0, ["1 new"])
    return folder


@pytest.fixture
def project(stored, tmp_path):
    """A copy of it, to be spoilt."""
    shutil.copytree(stored, tmp_path / "project")
    return tmp_path / "project"


@pytest.fixture
def trade(tmp_path):
    """A copy of the kept trade, to be spoilt."""
    return Path(shutil.copytree(TRADE, tmp_path / "trade"))


def run(arguments, code, words, environment=None, charset="utf-8"):
    """Run a command in this process; its output with every stretch of white space as one."""
    runner = CliRunner(env={"COLUMNS": "200"} | (environment or {}), charset=charset)
    done = runner.invoke(app, [str(a) for a in arguments])
    said = " ".join(done.output.split())
    assert (done.exit_code, done.exception is None or isinstance(done.exception, SystemExit)) == (
        code,
        True,
    ), said
    assert "Traceback" not in said
    assert [w for w in words if w not in said] == [], said
    if code in (2, 130) and "Usage:" not in done.output and "Error" not in done.stderr.split("\n")[0]:
        assert done.stderr.count("\n") == 1
        assert done.stderr.startswith("anctmm: ")
    return said


@pytest.mark.parametrize("what", SCENES)
def test_a_file_of_scenes(what, project, monkeypatch):
    content, code, words = SCENES[what]
    path = project / "scenes.py"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    if code == 4:  # else the history of the good one is told to be unasked
        shutil.rmtree(project / "baselines" / "bar")
    monkeypatch.chdir(project)
    run(["check", "--scenes", "scenes.py", "--out", "out"], code, words)
    assert Path.cwd() == project
    if code in (0, 1, 4):
        assert (project / "out" / "check" / "junit.xml").read_text().startswith("<testsuites ")


@pytest.mark.parametrize("what", BASELINES)
def test_a_stored_history(what, project):
    change, code, words = BASELINES[what]
    (path,) = (project / "baselines").rglob("*.csv")
    content = change(path.read_bytes())
    path.unlink()
    if content is not None:
        path.write_bytes(content)
    run(["check", "--scenes", project / "scenes.py", "--out", project / "out"], code, words)


def test_a_directory_in_the_place_of_a_stored_history(project):
    (path,) = (project / "baselines").rglob("*.csv")
    path.unlink()
    path.mkdir()
    arguments = ["check", "--scenes", project / "scenes.py", "--out", project / "out"]
    run(arguments, 1, ["1 unreadable", "Is a directory"])
    run([*arguments, "--update"], 1, ["1 unreadable", "not overwritten"])


@pytest.mark.parametrize("what", TABLES)
def test_a_kept_trade(what, trade):
    spoil, code, words = TABLES[what]
    spoil(trade)
    run(["recommend", "four-bar", "--error", "1e-3", "--no-rerun", "--table", trade], code, words)


@pytest.mark.parametrize("what", ARGUMENTS)
def test_arguments(what, project, tmp_path, monkeypatch):
    arguments, code, words = ARGUMENTS[what]
    (tmp_path / "file").write_text("")
    (tmp_path / "dir").mkdir()
    places = {"FILE": tmp_path / "file", "FILE/x": tmp_path / "file" / "x", "FILE/x.py": tmp_path / "file" / "x.py",
              "DIR": tmp_path / "dir", "GOOD": project / "scenes.py"}  # fmt: skip
    given = [part for a in arguments for part in (["--table", TRADE] if a == "TABLE" else [places.get(a, a)])]
    monkeypatch.chdir(tmp_path)
    run(given, code, words)


@pytest.mark.parametrize("what", ENVIRONMENTS)
def test_an_environment(what):
    environment, charset = ENVIRONMENTS[what]
    arguments = ["recommend", "four-bar", "--error", "1e-3", "--no-rerun", "--table", TRADE]
    said = run(arguments, 0, ["Recommended: anctmm, implicit"], environment, charset)
    assert "from __future__" in said or "import anctmm as at" in said


@pytest.mark.parametrize("charset", ["ascii", "latin-1"])
def test_a_check_in_other_characters(charset, project):
    arguments = ["check", "--scenes", project / "scenes.py", "--out", project / "out"]
    run(arguments, 0, ["1 same", "bar . fall" if charset == "ascii" else "bar · fall"], charset=charset)
    run([*arguments, "--baselines", project], 1, ["1 no baseline"], charset=charset)


def test_the_table_is_long():
    assert sum(map(len, (SCENES, BASELINES, TABLES, ARGUMENTS, ENVIRONMENTS))) >= 240


def test_the_version_is_told_before_anything_is_done():
    done = CliRunner().invoke(app, ["--version", "run", "five-bar"])
    assert (done.exit_code, done.output) == (0, f"anctmm {version('anctmm')}\n")


def test_what_an_encoding_lacks_has_a_likeness():
    assert substitute(UnicodeEncodeError("ascii", "aΔ·\udcff", 1, 4, "")) == ("D.?", 4)
    assert NARROWEST >= 40


def test_a_fault_of_the_program_is_told_in_one_line_with_a_code_of_its_own(monkeypatch):
    def fail(name):
        raise ZeroDivisionError("division by\nzero")

    monkeypatch.setattr("studies.trade.recommendation.recommend.scene_name", fail)
    runner = CliRunner()
    arguments = ["recommend", "four-bar", "--error", "1e-3"]
    done = runner.invoke(app, arguments)
    assert done.exit_code == ending.Code.FAULT == 3
    assert done.stderr.startswith(
        "anctmm: internal error of anctmm: ZeroDivisionError: division by zero (ANCTMM_TRACEBACK=1"
    )
    assert done.stderr.count("\n") == 1
    done = runner.invoke(app, arguments, env={ending.TRACEBACK: "1"})
    assert (done.exit_code, "Traceback" in done.stderr, "in fail" in done.stderr) == (3, True, True)


def test_what_leaves_where_nobody_expects_it_is_no_success(monkeypatch):
    monkeypatch.setattr("studies.trade.recommendation.recommend.scene_name", lambda name: sys.exit(0))
    run(["recommend", "four-bar", "--error", "1e-3"], 2, ["sys.exit(0)", "nothing was done"])


# --- processes -----------------------------------------------------------------------------------------------

RECOMMEND = ["recommend", "four-bar", "--error", "1e-3", "--no-rerun", "--table", str(TRADE)]
#: Options of Python, environment, how the shell runs it, and the exit code; the output must be whole where it is 0.
PROCESSES = {
    "in the C locale": ([], {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, "{}", 0),
    "in ASCII": ([], {"PYTHONIOENCODING": "ascii"}, "{}", 0),
    "without docstrings and assertions": (["-OO"], {}, "{}", 0),
    "without a home": ([], {"HOME": None, "XDG_CACHE_HOME": None, "ANCTMM_CACHE": None}, "{}", 0),
    "with a home that is none": ([], {"HOME": "/nonexistent", "ANCTMM_CACHE": "/dev/null"}, "{}", 0),
    "without an environment": ([], None, "{}", 0),
    "in a directory that is gone": ([], {}, "mkdir gone && cd gone && rmdir ../gone && {}", 0),
    "without input": ([], {}, "{} <&-", 0),
    "without output": ([], {}, "{} >&-", 0),
    "without standard error": ([], {}, "{} 2>&-", 0),
    "without any": ([], {}, "{} <&- >&- 2>&-", 0),
    "into a full disk": ([], {}, "{} >/dev/full", 2),
    "into a reader that leaves": ([], {}, "{} | head -c 1; exit ${{PIPESTATUS[0]}}", 141),
    "into no reader": ([], {}, "{} | exit 0; exit ${{PIPESTATUS[0]}}", 141),
}


@pytest.mark.parametrize("what", PROCESSES)
def test_a_process(what, tmp_path):
    options, changes, line, code = PROCESSES[what]
    base = {**os.environ, "PYTHONPATH": str(TRADE.parents[1]), "COLUMNS": "200"}
    environment = (
        {"PYTHONPATH": base["PYTHONPATH"], "PATH": base["PATH"]} if changes is None else base | changes
    )
    environment = {name: value for name, value in environment.items() if value is not None}
    command = " ".join([sys.executable, *options, "-m", "studies", *RECOMMEND])
    done = subprocess.run(
        ["bash", "-c", line.format(command)], cwd=tmp_path, env=environment, capture_output=True, check=False
    )  # fmt: skip
    said = done.stderr.decode()
    assert (done.returncode, "Traceback" in said, "Exception ignored" in said) == (code, False, False), said
    if code == 0 and ">&-" not in line.replace("2>&-", ""):
        assert b"Recommended: anctmm" in done.stdout
        assert b"solution = " in done.stdout


def test_an_interrupt_while_a_file_of_scenes_hangs(tmp_path):
    (tmp_path / "scenes.py").write_text("import time\nprint('here', flush=True)\ntime.sleep(300)")
    process = subprocess.Popen(
        [sys.executable, "-m", "studies", "check", "--scenes", "scenes.py"],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=os.environ | {"PYTHONPATH": str(TRADE.parents[1])},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    assert process.stdout.readline() == "here\n"
    time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, "anctmm: interrupted" in said.splitlines(), "Traceback" in said) == (
        130,
        True,
        False,
    )
