"""`anctmm check`: stored histories hold where nothing has changed, and every difference has its verdict."""

import sys
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from typer.testing import CliRunner

import anctmm as at
from anctmm.errors import AnctmmError, DiscretisationError, StabilityError, UnsupportedError
from anctmm.model.connectors import CONNECTORS
from anctmm.model.joints import JOINTS, drive_of
from anctmm.model.loads import LOADS
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from studies.cli import app
from studies.regression import check as checking
from studies.regression.check import BASELINES, check, passed, select
from studies.regression.history import read_history
from studies.regression.reading import solution_of
from studies.regression.report import junit
from studies.regression.scenes import Static, Task, declared_in, tasks_of
from studies.regression.tolerance import MARGIN, measured
from studies.regression.watches import LIMITS, all_watches

TASKS = tasks_of(all_watches())
SMALL = [task for task in TASKS if task.name.startswith("small-")]
BASE = [task for task in TASKS if task not in SMALL]


def findings_of(tasks, baselines=BASELINES, **options):
    return [f for found in check(tasks, baselines, **options) for f in found]


def one(findings):
    (found,) = [f for fs in findings for f in fs]
    return found


def update(tasks, baselines):
    return check(tasks, baselines, update=True)


# --- the stored histories ------------------------------------------------------------------------------------


def test_our_solver_moves_as_stored():
    found = findings_of(select(BASE, (), ("anctmm",)))
    assert {f.verdict for f in found} == {"same"}, [(f.name, f.reason) for f in found if not f.good]


def test_stored_histories_are_those_of_the_tasks_which_end_in_every_way():
    stored = {p.relative_to(BASELINES).with_suffix("").as_posix() for p in BASELINES.glob("*/*/*.csv")}
    assert stored == {task.name for task in TASKS}
    assert {t.ends for t in SMALL} >= {"ok", "refused", "diverged", "unstable", "inaccurate", "failed"}
    kinds = {type(part) for t in SMALL for part in (*t.scene.joints, *t.scene.loads, *t.scene.connectors)}
    assert kinds == {*JOINTS, *LOADS, *CONNECTORS} - {at.Revolute}  # of space


def test_a_peer_of_the_same_equations_is_compared_with_ours_too():
    tasks = select(BASE, ("four-bar/cable-implicit", "cantilever-force-1/"), ("global-dae",))
    found = findings_of(tasks)
    assert [f.against for f in found].count("anctmm") == len(tasks)
    assert passed(found)


def test_stored_tolerances_are_those_that_are_measured():
    for run, solver in (("four-bar/cable-zhai", "anctmm"), ("small-linkage/forces", "anctmm")):
        (task,) = select(TASKS, (run,), (solver,))
        stored = read_history(task.path(BASELINES))
        again = measured(task, stored).tolerances
        for quantity, tolerance in stored.tolerances.items():
            assert 0.1 < tolerance.value / again[quantity].value < 10.0
            causes = [float(c.split(" ")[-1]) for c in tolerance.reason.split(": ")[1].split(", ")]
            assert tolerance.value == pytest.approx(MARGIN * max(causes), rel=0.1)


def test_no_tolerance_is_as_large_as_its_values():
    for path in BASELINES.glob("small-*/*/*.csv"):
        stored = read_history(path)
        for quantity in stored.quantities:
            largest = stored.of_quantity(quantity).abs().to_numpy().max(initial=0.0)
            allowed = 1e-2 if "adaptive" in str(path) else 1e-3
            assert stored.tolerances[quantity].value < allowed * max(largest, 1e-6), (path, quantity)


def _taken_by_the_global_dae(task):
    run = task.run
    if isinstance(run, Static):
        return task.scene.name != "small-held"
    if not isinstance(run, at.Discretisation) or run.tolerance is not None:
        return False
    rigid = "rigid" in {kind for _, kind in run.of(task.scene).values()}
    damped = any(b.material.damping for b in task.scene.beams) and run.integrator != "zhai"
    # explicit steps evaluate drives otherwise, and statics the rates of free lengths at a part of the load
    driven = run.integrator == "zhai" and any(map(drive_of, task.scene.joints))
    return not (rigid or damped or driven)


@pytest.mark.parametrize("part", ["zhai", "implicit", "static", "esdirk"])
def test_stored_histories_of_small_scenes_are_those_of_the_global_dae(part):
    """They are stored by the solver that they watch: another one finds the same."""
    tasks = [
        t for t in SMALL
        if t.solver == "anctmm" and t.ends == "ok" and part in t.run_name and _taken_by_the_global_dae(t)
    ]  # fmt: skip
    compared = 0
    for task in tasks:
        stored = read_history(task.path(BASELINES)).of_quantity("displacement").to_numpy()
        try:
            found = solution_of(replace(task, solver="global-dae"), task.run)
        except UnsupportedError:
            continue
        compared += 1
        assert found.status.ok, (task.name, found.status)
        mine = np.concatenate([found.displacement(probe) for probe in task.probes], axis=1)
        assert np.abs(mine - stored).max() < 1e-9 * max(1.0, np.abs(stored).max()), task.name
    assert compared >= 2


def test_stable_steps_end_where_the_global_dae_says():
    """The limits are those of another solver, which finds them from its own matrices."""
    for name in LIMITS:
        for task in (t for t in SMALL if t.run_name.endswith(f"-limit-{name}")):
            if task.ends == "ok":
                assert solution_of(replace(task, solver="global-dae"), task.run).status.ok
            else:
                with pytest.raises(StabilityError):
                    solution_of(replace(task, solver="global-dae"), task.run)


# --- a solver made for the tests -----------------------------------------------------------------------------

BAR = at.Beam("bar", (0.0, 0.0), (2.0, 0.0), at.Rectangle(0.1, 0.1), at.Material(1e9, 1e3))
SCENE = at.Scene("bar", [BAR], [at.Clamp("bar.start")])
RUN = at.Discretisation(2, integrator="zhai", dt=0.01, t_end=1.0, output_dt=0.25)
TASK = Task(SCENE, ("bar.end",), "spin", RUN, "spinner")


class Spinner:
    """A bar that turns rigidly; what else it does can be changed."""

    def __init__(self):
        self.rate, self.t_end, self.status, self.error, self.energies = 1.0, 1.0, Status(), None, True
        self.corrections, self.answer = 100, "a solution"

    def __call__(self, scene, run):
        if self.error is not None:
            raise self.error
        if self.answer != "a solution":
            return self.answer
        t = np.arange(0.0, self.t_end + 1e-9, run.output_dt)
        angle = self.rate * t + scene.bodies[0].angle
        e = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        q = np.stack([np.stack([0 * e, e], 1), np.stack([2 * e, e], 1)], 1)
        energy = Energy(1.0 + 0 * t, *(np.full(len(t), np.nan) for _ in range(3)))
        energy = energy if self.energies else Energy.unknown(len(t))
        cost = Cost(newton_iterations=self.corrections)
        return Solution("spinner", scene, run, t, {"bar": HermiteField(q, 2.0)}, energy, cost, self.status)


@pytest.fixture
def spinner(monkeypatch):
    made, find, known = Spinner(), registry.solver, registry.names()
    monkeypatch.setattr(registry, "solver", lambda name: made if name == "spinner" else find(name))
    monkeypatch.setattr(registry, "names", lambda: sorted([*known, "spinner"]))
    return made


@pytest.fixture
def stored(spinner, tmp_path):
    """Directory of the spinner's stored history."""
    assert one(update([TASK], tmp_path)).verdict == "new"
    return tmp_path


def test_a_difference_has_place_time_and_tolerance(spinner, stored):
    assert one(check([TASK], stored)).verdict == "same"
    spinner.rate += 1e-9
    found = one(check([TASK], stored))
    assert found.verdict == "differs"
    assert (found.where, found.time) == ("displacement bar at 1 x (m)", 1.0)
    assert found.difference == pytest.approx(2e-9 * np.sin(1.0), rel=1e-3)
    assert found.tolerance < 1e-12
    assert not passed([found])


@pytest.mark.parametrize(
    ("change", "verdict", "reason"),
    [
        ({"t_end": 0.5, "status": Status("diverged", "too fast")}, "failed", "diverged: too fast"),
        ({"t_end": 0.5}, "differs", "stored times are 5 up to 1; now there are 3 up to 0.5"),
        ({"energies": False}, "differs", "stored with kinetic energy (J); now less"),
        ({"rate": float("nan")}, "differs", ""),
        ({"corrections": 151}, "differs", "Newton corrections are 151, stored are 100"),
        ({"corrections": 149}, "same", ""),
        ({"error": ValueError("a bug")}, "failed", "ValueError: a bug"),
        ({"answer": None}, "failed", "'NoneType'"),
        ({"status": Status("unsupported", "no bars")}, "failed", "unsupported: no bars"),
        ({"status": Status("unsupported", "spin is not installed")}, "not run", "not installed"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_whatever_else_changes_has_its_verdict(spinner, stored, change, verdict, reason):
    vars(spinner).update(change)
    found = one(check([TASK], stored))
    assert found.verdict == verdict, found.reason
    assert reason in found.reason
    assert passed([found]) == (verdict == "same")  # where nothing was compared, nothing is known


def test_the_end_of_a_run_is_stored_and_compared(spinner, tmp_path):
    spinner.status, spinner.t_end = Status("diverged", "too fast", 0.5, 50, "bar", 1), 0.5
    task = replace(TASK, ends="diverged")
    assert one(update([task], tmp_path)).verdict == "new"
    assert one(check([task], tmp_path)).verdict == "same"
    spinner.status = Status("diverged", "", 0.5, 49, "bar", 1)
    assert "it ended with diverged, step 50, body bar, element 1" in one(check([task], tmp_path)).reason
    spinner.status = Status()
    assert one(check([task], tmp_path)).verdict == "failed"


def test_a_run_that_must_be_refused_is_watched_by_the_kind_of_its_error(spinner, tmp_path):
    spinner.error = StabilityError("dt is 1 s; at most 0.5 s is stable")
    task = replace(TASK, ends="refused")
    assert one(update([task], tmp_path)).verdict == "new"
    spinner.error = StabilityError("other words")
    assert one(check([task], tmp_path)).verdict == "same"
    spinner.error = DiscretisationError("dt is 1 s")
    assert "now with refused, DiscretisationError" in one(check([task], tmp_path)).reason


def test_other_settings_are_reported_and_not_compared(stored):
    found = one(check([replace(TASK, run=replace(RUN, dt=0.005))], stored))
    assert (found.verdict, found.reason) == ("other settings", "stored with dt=0.01; now dt=0.005")


def test_a_solver_that_is_not_installed_is_a_row_and_the_rest_runs(stored):
    found = findings_of([replace(TASK, solver="elsewhere"), TASK], stored)
    assert [f.verdict for f in found] == ["not run", "same"]
    assert "solver 'elsewhere' is not registered" in found[0].reason
    assert passed(found)
    results = {case.get("name"): case for case in ElementTree.fromstring(junit(found)).iter("testcase")}
    assert results["elsewhere"].find("skipped") is not None
    assert results["spinner"].find("failure") is None


# --- files ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("# anctmm history 1", "x,y\n1,2"),
        ("# anctmm history 1", "\udcff"),
        ("# rows: 5", "# rows: 6"),
        ("# end", ""),
        ("0.25,", "0.25,1.0,"),
        ("0.25,", "a quarter,"),
        ("displacement bar", "displacment bar"),
        ("# tolerance of displacement: ", "# tolerance of displacement: nan"),
        ("# tolerance of kinetic", "# tolerance of cinetic"),
    ],
)
def test_an_edited_or_foreign_file_is_a_row(stored, old, new):
    path = TASK.path(stored)
    content = path.read_text(encoding="utf-8")
    assert old in content
    path.write_bytes(content.replace(old, new, 1).encode(errors="surrogateescape"))
    found = one(check([TASK], stored))
    assert (found.verdict, found.good) == ("unreadable", False)
    before = path.read_bytes()
    if old.endswith("history 1"):  # nobody's file is overwritten
        assert one(update([TASK], stored)).verdict == "unreadable"
        assert path.read_bytes() == before
    else:
        assert one(update([TASK], stored)).verdict == "renewed"
        assert one(check([TASK], stored)).verdict == "same"


def test_update_renews_what_differs_and_leaves_the_rest(spinner, stored):
    path = TASK.path(stored)
    before = path.read_bytes()
    spinner.rate += 1e-14
    assert one(update([TASK], stored)).verdict == "unchanged"
    assert path.read_bytes() == before  # within the tolerance: small changes do not accumulate
    spinner.rate += 1e-6
    found = one(update([TASK], stored))
    assert found.verdict == "renewed"
    assert found.difference == pytest.approx(2e-6 * np.sin(1.0), rel=1e-3)
    before = path.read_bytes()
    spinner.status, spinner.t_end = Status("diverged", "too fast"), 0.5
    assert one(update([TASK], stored)).verdict == "failed"
    assert path.read_bytes() == before


def test_numbers_that_are_none_are_not_stored(spinner, tmp_path):
    spinner.rate = float("nan")
    assert one(update([TASK], tmp_path)).verdict == "failed"
    assert not list(tmp_path.rglob("*"))


# --- declared runs -------------------------------------------------------------------------------------------

HEAD = "import anctmm as at\nfrom studies.check import Static, Watch\n"
GOOD = f"{HEAD}from bars import bar\nWATCHED = [Watch(bar, ['b.end'], {{'rest': Static(1)}})]\n"
BARS = """
import anctmm as at
beam = at.Beam("b", (0, 0), (1, 0), at.Circle(0.02), at.Material(E=1e9, density=1000.0))
bar = at.Scene("bar", [beam], [at.Clamp("b.start")], [at.Force("b.end", (0.0, -0.5))])
"""


@pytest.fixture
def project(tmp_path):
    """A user's own: scenes that import a neighbour."""
    (tmp_path / "bars.py").write_text(BARS, encoding="utf-8")
    path = tmp_path / "my_scenes.py"
    path.write_text(GOOD, encoding="utf-8")
    yield path
    sys.modules.pop("bars", None)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "no such file"),
        ("", "defines no WATCHED; a list of at least one Watch is needed"),
        (GOOD.replace("bar,", "3,"), "Watch scene is 3; a Scene is needed"),
        (GOOD.replace("['b.end']", "'b.end'"), "probes 'b.end'; a list of at least one is needed"),
        (GOOD.replace("b.end", "c.end"), "body 'c' is not in scene 'bar'"),
        (GOOD.replace("Static(1)", "4"), "run 'rest' of 'bar' is 4; a Discretisation or a Static is needed"),
        (GOOD.replace("Static(1)", "Static(1, load_steps=0)"), "load_steps is 0; a whole number"),
        (GOOD + "WATCHED *= 2", "'bar/rest/anctmm' is watched 2 times; once is allowed"),
    ],
)
def test_a_wrong_file_of_scenes_is_named(project, content, reason):
    project.unlink() if content is None else project.write_text(content, encoding="utf-8")
    with pytest.raises(AnctmmError) as error:
        tasks_of(declared_in(project))
    assert reason in str(error.value)


def test_a_solver_that_nobody_watches_gets_every_run(spinner):
    assert len(select(BASE, (), ("spinner",))) == len({(t.scene.name, t.run_name) for t in BASE})


def command(*arguments):
    done = CliRunner().invoke(app, ["check", *map(str, arguments)])
    return done.exit_code, " ".join(done.output.split())


def test_a_users_own_project(project):
    """Store, check, break, check, renew; other programs can read the results."""
    out, folder = project.parent / "out", project.parent / "out" / "check"
    run = ("--scenes", project, "--out", out)
    assert command(*run)[0] == 2  # there is no directory of baselines yet
    code, said = command(*run, "--update")
    assert (code, "1 new" in said) == (0, True)
    assert (project.parent / "baselines" / "bar" / "rest" / "anctmm.csv").exists()
    assert command(*run)[0] == 0
    (project.parent / "bars.py").write_text(BARS.replace("-0.5", "-0.5000001"), encoding="utf-8")
    sys.modules.pop("bars", None)
    code, said = command(*run)
    assert (code, "bar/rest/anctmm" in said, "1 differs" in said) == (1, True, True)
    (suite,) = ElementTree.parse(folder / "junit.xml").getroot()
    (case,) = suite
    assert (suite.get("failures"), case.get("name"), case.get("classname")) == ("1", "anctmm", "bar.rest")
    assert case.find("failure") is not None
    assert "load factor" in (folder / "bar--rest--anctmm.svg").read_text(encoding="utf-8")
    code, said = command(*run, "--update")
    assert (code, "1 renewed" in said) == (0, True)
    assert command(*run)[0] == 0
    assert not (folder / "bar--rest--anctmm.svg").exists()  # an old picture of a difference that is gone


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--solver", "nobody"], "--solver has 'nobody'; allowed are anctmm"),
        (["--only", "nothing"], "--only 'nothing' with --solver 'any' leaves nothing; allowed are parts"),
        (["--scenes", "none.py"], "--scenes none.py: no such file"),
        (["--baselines", "nowhere"], "nowhere, is not there; --update makes it"),
        (["--update", "--baselines", "{file}"], "cannot be written"),
    ],
)
def test_bad_arguments_are_named_before_any_run(arguments, reason, tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_text("", encoding="utf-8")
    monkeypatch.setattr(checking, "answered", lambda task: pytest.fail("ran"))
    code, said = command(*(a.format(file=file) for a in arguments), "--out", tmp_path / "out")
    assert (code, reason in said) == (2, True), said
