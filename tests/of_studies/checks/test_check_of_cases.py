"""`anctmm check my.py`: do the scenes of a user's file still move as they did?"""

from pathlib import Path

import pytest
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM, FILES, PORTAL_FRAME, THROWN_CHAIN

import anctmm as at
from studies.cases import cases_in, find_case
from studies.cli import app
from studies.regression.watches import watches_of


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def checked(*arguments):
    done = CliRunner().invoke(app, ["check", *map(str, arguments)], env={"COLUMNS": "200"})
    return done.exit_code, " ".join(done.output.split())


def histories(folder="baselines"):
    return sorted(Path(folder).glob("*/*/*.csv"))


@pytest.mark.parametrize("file", FILES, ids=lambda f: Path(f).stem)
def test_a_file_is_stored_and_then_the_same(file):
    count = len(cases_in(file))
    code, output = checked(file, "--baselines", "kept", "--solver", "anctmm", "--update")
    assert (code, len(histories("kept"))) == (0, count), output
    code, output = checked(file, "--baselines", "kept", "--solver", "anctmm")
    assert (code, f"{count} same" in output) == (0, True), output


def test_a_changed_scene_is_found():
    source = Path(THROWN_CHAIN).read_text()
    Path("my.py").write_text(source)
    assert checked("my.py", "--solver", "anctmm", "--update")[0] == 0
    assert histories()  # beside the file
    Path("my.py").write_text(source.replace("spin=4.0", "spin=4.0001"))
    code, output = checked("my.py", "--solver", "anctmm")
    assert (code, "1 differs" in output) == (1, True), output


#: Masses that fall, whose scenes have these names.
NAMED = """
import anctmm as at
mass = at.PointMass("m", 1.0, (0.0, 0.0))
scenes = [at.Scene(name, [mass], gravity=(0.0, -9.81)) for name in {names}]
CASES = [at.Case(scene, ["m.center"], t_end=0.1, output_dt=0.05) for scene in scenes]
"""


def test_any_name_of_a_scene_is_stored():
    """Two files of one name are refused."""
    Path("my.py").write_text(NAMED.format(names=["two words, 1/2", "二" * 100]))
    arguments = ["my.py", "--solver", "anctmm", "--baselines", "kept"]
    code, output = checked(*arguments, "--update")
    assert code == 0, output
    one, two = (path.parent.parent.name for path in histories("kept"))
    assert (one, two.startswith("二" * 30), len(two.encode()) <= 150) == ("two-words-1-2", True, True)
    code, output = checked(*arguments)
    assert (code, "2 same" in output) == (0, True), output
    Path("my.py").write_text(NAMED.format(names=["a b", "a-b"]))
    code, output = checked("my.py")
    assert (code, "'a-b/cable/anctmm' is watched 2 times" in output) == (2, True), output


#: A wheel that turns about its axle, at which alone it is looked, and a mass that rests.
TURNING = """
import anctmm as at
wheel = at.RigidBody("wheel", 3.0, 0.02, (0.0, 0.0), spin=2.0)
rest = at.PointMass("rest", 1.0, (0.0, 0.0))
CASES = [
    at.Case(at.Scene("wheel", [wheel]), ["wheel.center"], t_end=0.1, output_dt=0.05),
    at.Case(at.Scene("rest", [rest]), ["rest.center"], t_end=0.1, output_dt=0.05),
]
"""


def test_the_sense_in_which_a_resting_probe_turns_is_seen():
    """Displacements are zero, and energies are the same in both senses."""
    arguments = ["my.py", "--solver", "anctmm", "--baselines", "kept"]
    Path("my.py").write_text(TURNING)
    code, output = checked(*arguments, "--update")
    assert (code, "2 new" in output) == (0, True), output  # of what does not move a tolerance, too
    assert checked(*arguments)[0] == 0
    Path("my.py").write_text(TURNING.replace("spin=2.0", "spin=-2.0"))
    code, output = checked(*arguments)
    assert (code, "1 differs" in output) == (1, True), output


def test_one_case_of_a_file():
    arguments = [PORTAL_FRAME, "--case", "portal-frame-at-rest", "--baselines", "kept", "--solver", "anctmm"]
    assert checked(*arguments, "--update")[0] == 0
    assert [p.parent.parent.name for p in histories("kept")] == ["portal-frame-at-rest"]
    assert checked(*arguments)[0] == 0


def test_runs_are_coarse_and_short_to_read():
    (watch,) = watches_of([find_case(DOUBLE_PENDULUM)])
    run = watch.runs["cable"]
    assert run.mesh == {"upper": 4, "lower": 4}
    assert (run.t_end, run.output_dt) == (0.4, 0.02)
    many = at.Case(watch.scene, watch.probes, t_end=1.0, output_dt=1e-3)
    assert round(1.0 / watches_of([many])[0].runs["cable"].output_dt) == 20
    assert watches_of([many], mesh=(3,), dt=5e-4)[0].runs["cable"].mesh == 3
    beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.02), at.Material(E=1e8, density=1000.0))
    pinned = at.Case(at.Scene("pinned", [beam], [at.Pin(("b", 0.2))]), ["b.end"], t_end=0.1)
    assert watches_of([pinned])[0].runs["cable"].mesh == 5  # a node at the joint inside the beam


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere.py"], "no such file"),
        ([THROWN_CHAIN, "--baselines", "kept"], "is not there; --update makes it"),
        ([THROWN_CHAIN, "--case", "arm"], "'arm' and is unknown"),
        ([THROWN_CHAIN, "--elements", "2/2"], "needs 1 or 3 numbers"),
        ([THROWN_CHAIN, "--elements", "2,3"], "2,3"),
        ([THROWN_CHAIN, "--dt", "0.007"], "whole number of steps"),
        ([PORTAL_FRAME, "--case", "portal-frame-at-rest", "--dt", "1e-3"], "a static equilibrium, which has no step"),
        ([THROWN_CHAIN, "--scenes", THROWN_CHAIN], "one of them is allowed"),
        (["--case", "arm"], "--case is 'arm' without a file"),
        (["--dt", "1e-3"], "--dt is 0.001 without a file"),
    ],
)  # fmt: skip
def test_bad_arguments_are_named(arguments, said):
    code, output = checked(*arguments)
    assert (code, said in output) == (2, True), output
