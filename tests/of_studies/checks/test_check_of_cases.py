"""`anctmm check my.py`: do the scenes of a user's file still move as they did?"""

from pathlib import Path

import pytest
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM, FILES, PORTAL_FRAME, THROWN_CHAIN

import anctmm as at
from studies.cases import cases_in, find_case
from studies.cli import app
from studies.regression.check import update
from studies.regression.of_cases import watches_of
from studies.regression.scenes import Watch, tasks_of


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def told(*arguments):
    done = CliRunner().invoke(app, ["check", *map(str, arguments)], env={"COLUMNS": "200"})
    return done.exit_code, " ".join(done.output.split())


@pytest.mark.parametrize("file", FILES, ids=lambda f: Path(f).stem)
def test_a_file_is_stored_and_then_the_same(file):
    count = len(cases_in(file))
    code, output = told(file, "--baselines", "kept", "--solver", "anctmm", "--update")
    assert code == 0, output
    assert len(list(Path("kept").glob("*/*/anctmm.csv"))) == count
    code, output = told(file, "--baselines", "kept", "--solver", "anctmm")
    assert code == 0, output
    assert f"{count} same" in output


def test_a_changed_scene_is_found(tmp_path):
    source = Path(THROWN_CHAIN).read_text()
    Path("my.py").write_text(source)
    assert told("my.py", "--solver", "anctmm", "--update")[0] == 0
    assert list(Path("baselines").glob("*/*/*.csv"))  # beside the file
    Path("my.py").write_text(source.replace("spin=4.0", "spin=4.0001"))
    code, output = told("my.py", "--solver", "anctmm")
    assert (code, "1 differs" in output) == (1, True), output


#: Two masses that fall, whose scenes have these names.
NAMED = """
import anctmm as at
mass = at.PointMass("m", 1.0, (0.0, 0.0))
scenes = [at.Scene(name, [mass], gravity=(0.0, -9.81)) for name in {names}]
CASES = [at.Case(scene, ["m.center"], t_end=0.1, output_dt=0.05) for scene in scenes]
"""


def test_any_name_of_a_scene_is_stored():
    """As the other commands take any; of a name that is too long for a file the beginning."""
    Path("my.py").write_text(NAMED.format(names=["two words, 1/2", "二" * 100]))
    arguments = ["my.py", "--solver", "anctmm", "--baselines", "kept"]
    code, output = told(*arguments, "--update")
    assert code == 0, output
    kept = sorted(p.parent.parent.name for p in Path("kept").glob("*/*/*.csv"))
    assert kept[0] == "two-words-1-2"
    assert kept[1].startswith("二" * 30)
    assert len(kept[1].encode()) <= 150
    code, output = told(*arguments)
    assert (code, "2 same" in output) == (0, True), output


def test_scenes_whose_files_would_have_one_name_are_named():
    Path("my.py").write_text(NAMED.format(names=["a b", "a-b"]))
    code, output = told("my.py")
    assert (code, "files of scenes 'a b' and 'a-b' would both be named 'a-b'" in output) == (2, True), output


#: A beam that is pinned at a fifth of its length.
PINNED = """
import anctmm as at
beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.02), at.Material(E=1e8, density=1000.0))
scene = at.Scene("pinned", [beam], [at.Pin(("b", 0.2))], gravity=(0, -9.81))
CASES = [at.Case(scene, ["b.end"], t_end=0.1)]
"""


def test_an_automatic_mesh_has_a_node_at_a_joint_inside_a_beam():
    Path("my.py").write_text(PINNED)
    (watch,) = watches_of(cases_in("my.py"))
    assert watch.runs["cable"].mesh == 5
    assert told("my.py", "--solver", "anctmm", "--update")[0] == 0


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
    """Displacements were zero, and energies are the same in both senses: a wheel that turned back was the same."""
    arguments = ["my.py", "--solver", "anctmm", "--baselines", "kept"]
    Path("my.py").write_text(TURNING)
    code, output = told(*arguments, "--update")
    assert (code, "2 new" in output) == (0, True), output  # of what does not move a tolerance, too
    assert told(*arguments)[0] == 0
    Path("my.py").write_text(TURNING.replace("spin=2.0", "spin=-2.0"))
    code, output = told(*arguments)
    assert (code, "1 same, 1 differs" in output or "1 differs, 1 same" in output) == (1, True), output


@pytest.mark.parametrize(("newton", "blind"), [(1e-3, True), (1e-5, True), (1e-12, False)])
def test_a_history_that_hides_changes_is_told_when_it_is_stored(newton, blind):
    """Of a loose iteration the tolerance was a fiftieth of the motion, and nobody was told."""
    mass = at.PointMass("m", 1.0, (0.0, 0.0))
    spring = at.Spring("m.center", (1.0, 0.0), stiffness=50.0)
    scene = at.Scene("mass", [mass], gravity=(0.0, -9.81), connectors=[spring])
    run = at.Discretisation(mesh=1, dt=0.05, t_end=0.5, output_dt=0.1, newton_tolerance=newton)
    tasks = tasks_of((Watch(scene, ["m.center"], {"run": run}),))
    ((finding,),) = update(tasks, Path("kept"))
    assert finding.good
    assert ("newton_tolerance=1e-12 in its run makes the tolerance smaller" in finding.reason) == blind


def stored_of(**names):
    """Files of cases with scenes of these names, and their histories in one folder."""
    for file, scenes in names.items():
        Path(f"{file}.py").write_text(NAMED.format(names=scenes))
        code, output = told(f"{file}.py", "--update")
        assert code == 0, output


@pytest.mark.parametrize("given", [[], ["--baselines", "."]])
def test_histories_of_another_file_in_the_folder_are_left_to_it(given):
    """Two files in one folder share the histories' folder: the check of each was red after it was stored."""
    for file in ("one", "two"):
        Path(f"{file}.py").write_text(NAMED.format(names=[f"fall {file}"]))
        assert told(f"{file}.py", *given, "--update")[0] == 0
    for file in ("one", "two"):
        code, output = told(f"{file}.py", *given)
        assert (code, "unasked" in output) == (0, False), output


def test_a_case_removed_from_a_file_is_noticed_beside_another_file():
    stored_of(one=["a", "b"], two=["c"])
    Path("one.py").write_text(NAMED.format(names=["a"]))
    code, output = told("one.py")
    assert (code, "2 unasked" in output, "delete it, or ask for it" in output) == (1, True, True), output
    assert told("two.py")[0] == 0


def test_histories_that_do_not_name_their_file_say_what_to_do():
    """They were stored before; an update of their file notes it, and changes nothing else."""
    stored_of(one=["a"], two=["b"])
    histories = sorted(Path("baselines").glob("*/*/*.csv"))
    before = [path.read_text() for path in histories]
    for path, text in zip(histories, before, strict=True):
        path.write_text("\n".join(line for line in text.split("\n") if not line.startswith("# file: ")))
    code, output = told("one.py")
    assert (code, "check that with --update once" in output) == (1, True), output
    for file in ("one.py", "two.py"):
        code, output = told(file, "--update")
        assert (code, "2 unchanged" in output) == (0, True), output
    assert [path.read_text() for path in histories] == before
    assert told("one.py")[0] == told("two.py")[0] == 0


def test_histories_follow_a_file_that_is_renamed():
    stored_of(one=["a", "b"])
    Path("one.py").rename("new.py")
    assert told("new.py", "--update")[0] == 0
    Path("new.py").write_text(NAMED.format(names=["a"]))
    assert told("new.py")[0] == 1


def test_nothing_stored_is_told():
    code, output = told(THROWN_CHAIN, "--baselines", "kept")
    assert (code, "no such directory; --update makes it" in output) == (2, True), output


def test_one_case_of_a_file():
    arguments = [PORTAL_FRAME, "--case", "portal-frame-at-rest", "--baselines", "kept", "--solver", "anctmm"]
    assert told(*arguments, "--update")[0] == 0
    assert [p.parent.parent.name for p in Path("kept").glob("*/*/*.csv")] == ["portal-frame-at-rest"]
    assert told(*arguments)[0] == 0


def test_what_is_watched_is_coarse_and_short_to_read():
    (watch,) = watches_of([find_case(DOUBLE_PENDULUM)])
    run = watch.runs["cable"]
    assert run.mesh == {"upper": 4, "lower": 4}
    assert (run.t_end, run.output_dt) == (0.4, 0.02)
    many = at.Case(watch.scene, watch.probes, t_end=1.0, output_dt=1e-3)
    assert round(1.0 / watches_of([many])[0].runs["cable"].output_dt) == 20
    assert watches_of([many], mesh=(3,), dt=5e-4)[0].runs["cable"].mesh == 3


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere.py"], "no such file"),
        ([THROWN_CHAIN, "--case", "arm"], "'arm' and is unknown"),
        ([THROWN_CHAIN, "--elements", "2/2"], "needs 1 or 3 numbers"),
        ([THROWN_CHAIN, "--elements", "2,3"], "one is allowed here"),
        ([THROWN_CHAIN, "--dt", "0.007"], "whole number of steps"),
        (
            [PORTAL_FRAME, "--case", "portal-frame-at-rest", "--dt", "1e-3"],
            "a static equilibrium; it has no step",
        ),
        ([THROWN_CHAIN, "--scenes", THROWN_CHAIN], "one of them is allowed"),
        (["--case", "arm"], "--case is 'arm' without a file"),
        (["--dt", "1e-3"], "--dt is '1e-3' without a file"),
    ],
)
def test_what_is_wrong_is_named(arguments, said):
    code, output = told(*arguments)
    assert (code, said in output) == (2, True), output
