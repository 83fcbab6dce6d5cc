"""`anctmm check`: stored histories hold where nothing has changed, and every planted fault is seen."""

import json
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import faults
import numpy as np
import pytest
from junitparser import Failure, JUnitXml, Skipped
from typer.testing import CliRunner
from uncompiled import said_by

from anctmm.discretise.discretisation import Discretisation
from anctmm.errors import AnctmmError, DiscretisationError, StabilityError
from anctmm.model.scene import Beam, Clamp, Force, Material, Pin, Scene
from anctmm.model.sections import Rectangle
from anctmm.results.ended_early import nothing
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from studies.cli import app
from studies.engine.other_numbers import Change
from studies.regression import check as checking
from studies.regression.check import BASELINES, check, passed, select, update
from studies.regression.history import read_baseline
from studies.regression.report import frame_of, junit, pictures
from studies.regression.scenes import Static, Task, base_watches, declared_in, tasks_of
from studies.regression.small_watches import all_watches
from studies.regression.tolerance import MARGIN, measured, simulate

HELPERS = Path(__file__).parents[2] / "helpers"
ROOT = Path(__file__).parents[3]
WATCHED = HELPERS / "watched_scenes.py"
BASE = tasks_of(base_watches())
#: Quick and telling: of each kind of element, explicitly and implicitly, and at rest.
TELLING = (
    "four-bar/cable-zhai/anctmm", "four-bar/shear-zhai/anctmm", "four-bar/*-implicit/anctmm",
    "cantilever-fall/*/anctmm", "cantilever-force-3/*/anctmm",
)  # fmt: skip


def findings_of(tasks, baselines=BASELINES):
    return {f.name: f for found in check(tasks, baselines) for f in found}


def told(finding):
    return finding.verdict, finding.reason, finding.worst


# --- the stored histories of the base scenes -----------------------------------------------------------------


def test_our_solver_moves_as_stored():
    """The control of all faults below. `.ci/run` does the same with every solver."""
    found = findings_of(select(BASE, (), ("anctmm",)))
    assert {f.verdict for f in found.values()} == {"same"}, [told(f) for f in found.values() if not f.good]


def test_every_base_scene_element_integrator_and_solver_is_watched():
    stored = {p.relative_to(BASELINES).with_suffix("").as_posix() for p in BASELINES.glob("*/*/*.csv")}
    assert stored == {task.name for task in tasks_of(all_watches())}
    from studies.scenes import BASE_SCENES

    assert {task.scene.name for task in BASE} == {base().scene.name for base in BASE_SCENES}
    dynamic = [task for task in BASE if isinstance(task.run, Discretisation)]
    for scene in {task.scene.name for task in dynamic}:
        kinds = {
            (t.run.element, t.run.integrator, t.solver) for t in dynamic if t.scene.name == scene
        }  # fmt: skip
        both = [(e, i) for e in ("cable", "shear") for i in ("zhai", "generalized-alpha")]
        assert kinds >= {(e, i, s) for e, i in both for s in ("anctmm", "global-dae")}
        assert {s for _, _, s in kinds} == set(registry.names()) & {t.solver for t in BASE}


def test_a_peer_of_the_same_equations_is_compared_with_ours_too():
    tasks = select(BASE, ("four-bar/cable-implicit", "cantilever-force-1/"), ("global-dae", "exudyn-cable"))
    found = [f for fs in check(tasks, BASELINES) for f in fs]
    assert [f.against for f in found if f.against != f.solver] == ["anctmm"] * 5
    assert passed(found)
    assert all(f.worst.column.quantity == "displacement" for f in found if f.against == "anctmm")


def test_stored_tolerances_are_what_is_measured():
    for run, solver in (("four-bar/cable-zhai", "anctmm"), ("cantilever-fall/shear-implicit", "global-dae")):
        (task,) = select(BASE, (run,), (solver,))
        stored = read_baseline(task.path(BASELINES))
        again = measured(task, stored.history).tolerances
        for quantity, tolerance in stored.tolerances.items():
            assert 0.1 < tolerance.value / again[quantity].value < 10.0
            causes = [float(c.split(" ")[-1]) for c in tolerance.reason.split(": ")[1].split(", ")]
            assert tolerance.value == pytest.approx(MARGIN * max(causes), rel=0.1)


def test_stored_histories_are_package_data_small_and_clean():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    patterns = project["tool"]["setuptools"]["package-data"]["studies"]
    packed = {path for pattern in patterns for path in (ROOT / "studies").glob(pattern)}
    files = sorted(BASELINES.rglob("*.csv"))
    assert set(files) <= packed
    for path in files:
        content = path.read_text(encoding="utf-8")
        assert len(content) < 12_000
        assert " at 0x" not in content
        head = [line.split(": ")[0] for line in content.splitlines() if line.startswith("# ")]
        assert {"# scene", "# run", "# solver", "# settings"} <= set(head)
        assert {"# tolerance of displacement", "# ending"} & set(head)


# --- planted faults ------------------------------------------------------------------------------------------


def caught(finding):
    return finding.verdict == "differs" or finding.reason.startswith("diverged")


def test_a_density_off_by_a_millionth_is_caught():
    tasks = [replace(t, scene=faults.denser(t.scene)) for t in select(BASE, TELLING, ())]
    found = findings_of(tasks)
    for task in tasks:
        # a cantilever that bears a force and no weight does not know its density
        blind = isinstance(task.run, Static)
        assert caught(found[task.name]) != blind, told(found[task.name])


@pytest.mark.parametrize(
    ("fault", "runs"),
    [
        (faults.one_gauss_point_less_of_the_cable, "*/cable-zhai/anctmm"),
        (faults.one_gauss_point_less_of_the_cable, "*/cable-implicit/anctmm"),
        (faults.one_gauss_point_less_of_the_cable, "*/cable-static/anctmm"),
        (faults.zhais_psi_a_little_less, "*-zhai/anctmm"),
        (faults.swapped_sign_in_the_transfer_of_the_mass, "*-zhai/anctmm"),
    ],
    ids=lambda value: getattr(value, "__name__", value),
)
def test_a_fault_in_what_the_compiled_kernels_read_is_caught(fault, runs):
    tasks = select(BASE, (runs,), ())
    with faults.planted(fault):
        found = findings_of(tasks)
    assert all(caught(f) for f in found.values()), [told(f) for f in found.values()]
    assert len(found) >= 3


@pytest.fixture(scope="module")
def verdicts(tmp_path_factory):
    """Histories stored by compiled kernels, then checked by the same code uncompiled, with and without faults."""
    baselines = tmp_path_factory.mktemp("stored")
    assert {f.verdict for fs in update(tasks_of(declared_in(WATCHED)), baselines) for f in fs} == {"new"}
    return json.loads(said_by("faults.py", WATCHED, baselines))


def test_without_a_fault_other_rounding_is_no_difference(verdicts):
    """Uncompiled, nothing is fused or vectorised: as on a processor that cannot."""
    assert {name: v for name, (v, _, _) in verdicts["none"].items()} == dict.fromkeys(
        verdicts["none"], "same"
    )
    parts = [ratio for _, _, ratio in verdicts["none"].values()]
    assert len(parts) == 6
    assert max(parts) < 0.5


@pytest.mark.parametrize("fault", faults.AS_DATA + faults.IN_CODE, ids=lambda fault: fault.__name__)
def test_a_fault_in_the_code_is_caught(verdicts, fault):
    found = verdicts[fault.__name__]
    assert len(found) >= 2
    assert all(v == "differs" or reason.startswith("diverged") for v, reason, _ in found.values()), found


# --- a solver made for the tests -----------------------------------------------------------------------------

BAR = Beam("bar", (0.0, 0.0), (2.0, 0.0), Rectangle(0.1, 0.1), Material(1e9, 1e3))
SCENE = Scene("bar", [BAR], [Clamp("bar.start")])
RUN = Discretisation(2, integrator="zhai", dt=0.01, t_end=1.0, output_dt=0.25)


class Spinner:
    """A bar that turns rigidly; what else it does can be changed."""

    def __init__(self):
        self.rate, self.t_end, self.status, self.error, self.energies = 1.0, 1.0, Status(), None, True
        self.corrections, self.answer = 100, "a solution"

    def __call__(self, scene, run):
        if self.error is not None:
            raise self.error
        if self.status.code == "unsupported":
            return nothing("spinner", scene, run, self.status)
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


TASK = Task(SCENE, ("bar.end",), "spin", RUN, "spinner")


@pytest.fixture
def stored(spinner, tmp_path):
    """Where the spinner's history is stored."""
    assert one(update([TASK], tmp_path)).verdict == "new"
    return tmp_path


def one(findings):
    (found,) = [f for fs in findings for f in fs]
    return found


def test_a_difference_is_told_with_place_time_and_tolerance(spinner, stored):
    assert one(check([TASK], stored)).verdict == "same"
    spinner.rate += 1e-9
    found = one(check([TASK], stored))
    assert found.verdict == "differs"
    assert (found.worst.column.where, found.worst.time) == ("bar at 1 x", 1.0)
    assert found.worst.difference == pytest.approx(2e-9 * np.sin(1.0), rel=1e-3)
    assert found.worst.tolerance < 1e-12
    assert not passed([found])


@pytest.mark.parametrize(
    ("change", "verdict", "reason"),
    [
        ({"t_end": 0.5, "status": Status("diverged", "too fast")}, "failed", "diverged: too fast"),
        ({"t_end": 0.5}, "differs", "stored times are 5 up to 1; now there are 3 up to 0.5"),
        ({"energies": False}, "differs", "kinetic energy (J)"),
        ({"rate": float("nan")}, "differs", ""),
        # a wrong tangent leaves the history as it is, but takes more work
        ({"corrections": 151}, "differs", "Newton corrections are 151, stored are 100"),
        ({"corrections": 149}, "differs", "Newton corrections are 149, stored are 100 ± 3"),
        ({"corrections": 103}, "same", ""),
        ({"error": ValueError("a bug")}, "failed", "ValueError: a bug"),
        ({"answer": None}, "failed", "solver 'spinner' answers None; a Solution is needed"),
        (
            {"answer": Solution("spinner", SCENE, RUN, np.zeros(5), {"no": 1}, Energy.unknown(5))},
            "failed",
            "KeyError",
        ),
        ({"status": Status("unsupported", "no bars")}, "failed", "unsupported: no bars"),
        ({"status": Status("unsupported", "spin is not installed")}, "not run", "not installed"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_whatever_else_changes_has_its_verdict(spinner, stored, change, verdict, reason):
    vars(spinner).update(change)
    found = one(check([TASK], stored))
    assert found.verdict == verdict
    assert reason in found.reason
    assert found.good == (verdict in ("not run", "same"))
    assert passed([found]) == (verdict == "same")  # where nothing was compared, nothing is known


def test_a_scene_that_has_changed_is_told_beside_the_difference(spinner, stored):
    """A history that differs has another cause where the scene is not the one that was stored."""
    spinner.rate *= 1.001
    assert "scene" not in one(check([TASK], stored)).reason
    stiffer = [replace(b, material=replace(b.material, E=2.0 * b.material.E)) for b in SCENE.bodies]
    scene = replace(SCENE, bodies=stiffer, gravity=(0.0, -1.5))
    found = one(check([replace(TASK, scene=scene)], stored))
    assert found.verdict == "differs"
    beam, material = SCENE.bodies[0], SCENE.bodies[0].material
    assert f"the scene has changed: Beam {beam.name!r}: stored with " in found.reason
    assert f"E={material.E}" in found.reason
    assert f"E={2.0 * material.E}" in found.reason
    assert f"stored with gravity {SCENE.gravity}; now gravity (0.0, -1.5)" in found.reason


def test_how_a_run_must_end_is_stored_and_compared(spinner, tmp_path):
    """Of a run that must diverge, status, step, body and element; less or more of it is a difference."""
    spinner.status = Status("diverged", "too fast", 0.5, 50, "bar", 1)
    spinner.t_end = 0.5
    task = replace(TASK, ends="diverged")
    assert one(update([task], tmp_path)).verdict == "new"
    assert read_baseline(task.path(tmp_path)).history.ending == "diverged, step 50, body bar, element 1"
    assert one(check([task], tmp_path)).verdict == "same"
    for status in (Status("diverged", "", 0.5, 49, "bar", 1), Status("diverged", "", 0.5, 50, "bar", 0)):
        spinner.status = status
        found = one(check([task], tmp_path))
        assert (found.verdict, "it ended with diverged, step 50" in found.reason) == ("differs", True)
    spinner.status = Status()
    found = one(check([task], tmp_path))
    assert (found.verdict, found.reason) == ("failed", "it must end as 'diverged', and ended ok")


def test_a_run_that_must_be_refused_is_watched_by_the_kind_of_its_error(spinner, tmp_path):
    spinner.error = StabilityError("dt is 1 s; at most 0.5 s is stable")
    task = replace(TASK, ends="refused")
    assert one(update([task], tmp_path)).verdict == "new"
    spinner.error = StabilityError("other words")
    assert one(check([task], tmp_path)).verdict == "same"
    spinner.error = DiscretisationError("dt is 1 s")
    assert one(check([task], tmp_path)).reason == (
        "it ended with refused, StabilityError; now with refused, DiscretisationError"
    )
    spinner.error = None
    assert one(check([task], tmp_path)).verdict == "failed"


def test_update_stores_other_settings_of_a_run_that_is_refused(spinner, tmp_path):
    """It has no history: nothing tells how far it has changed."""
    spinner.error = StabilityError("dt is 1 s; at most 0.5 s is stable")
    task = replace(TASK, ends="refused")
    assert one(update([task], tmp_path)).verdict == "new"
    found = one(update([replace(task, run=replace(RUN, dt=0.005))], tmp_path))
    assert (found.verdict, found.worst) == ("renewed", None)


def test_counts_of_work_are_stored_with_margins_and_compared(spinner, stored):
    found = read_baseline(TASK.path(stored))
    assert (found.history.counts["Newton corrections"], found.margins["Newton corrections"]) == (100, 3)
    for corrections, verdict in ((103, "same"), (104, "differs"), (97, "same"), (96, "differs")):
        spinner.corrections = corrections
        assert one(check([TASK], stored)).verdict == verdict


def test_other_settings_are_told_and_not_compared(stored):
    found = one(check([replace(TASK, run=replace(RUN, dt=0.005))], stored))
    assert (found.verdict, found.reason) == ("other settings", "stored with dt=0.01; now dt=0.005")


def test_a_solver_that_is_not_installed_is_a_row_and_the_rest_runs(stored):
    found = [f for fs in check([replace(TASK, solver="elsewhere"), TASK], stored) for f in fs]
    assert [f.verdict for f in found] == ["not run", "same"]
    assert "solver 'elsewhere' is not installed; installed are anctmm" in found[0].reason
    assert passed(found)


def test_without_exudyn_its_rows_say_so_and_the_rest_runs(monkeypatch):
    monkeypatch.setitem(sys.modules, "exudyn", None)
    tasks = select(BASE, ("cantilever-force-1/cable",), ())
    found = {f.solver: f for fs in check(tasks, BASELINES) for f in fs}
    assert {s: f.verdict for s, f in found.items()} == {
        "anctmm": "same", "global-dae": "same", "exudyn-cable": "not run",
    }  # fmt: skip
    assert "exudyn is not installed" in found["exudyn-cable"].reason
    assert passed(list(found.values()))


def test_a_stored_history_that_no_run_asks_for_is_told(stored):
    found = [f for fs in check([replace(TASK, run_name="other")], stored, whole=True) for f in fs]
    assert [f.verdict for f in found] == ["no baseline", "unasked"]
    assert found[1].name == TASK.name
    assert not passed(found[1:])


# --- files ---------------------------------------------------------------------------------------------------


def test_a_file_cut_anywhere_is_refused(stored):
    path = TASK.path(stored)
    whole = path.read_bytes()
    for length in [*range(0, len(whole), 23), *range(len(whole) - 12, len(whole))]:
        path.write_bytes(whole[:length])
        found = one(check([TASK], stored))
        assert found.verdict == "unreadable", length
        assert str(path) in found.reason
    path.write_bytes(whole)
    assert one(check([TASK], stored)).verdict == "same"


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("# anctmm history 1", "x,y\n1,2", "is no history stored by anctmm check"),
        ("# anctmm history 1", "\udcff", "is no history stored by anctmm check"),
        ("# rows: 5", "# rows: 6", "cut short or edited: 5 rows"),
        ("0.25,", "0.25,1.0,", "cannot be read"),
        ("0.25,", "a quarter,", "a quarter"),
        ("displacement bar", "displacment bar", "displacment bar"),
        ("# tolerance of displacement: ", "# tolerance of displacement: nan", "cannot be read"),
        ("# tolerance of displacement: ", "# tolerance of displacement: 9", "more than its causes make it"),
        ("# tolerance of kinetic", "# tolerance of cinetic", "cannot be read"),
        ("# Newton corrections: 100", "# Newton corrections: ", "cannot be read"),
    ],
)
def test_an_edited_or_foreign_file_is_a_row(stored, old, new, reason):
    path = TASK.path(stored)
    content = path.read_text(encoding="utf-8")
    assert old in content
    path.write_bytes(content.replace(old, new, 1).encode(errors="surrogateescape"))
    found = one(check([TASK], stored))
    assert (found.verdict, found.good) == ("unreadable", False)
    assert reason in found.reason
    if "no history" in reason:  # nobody's file is overwritten
        before = path.read_bytes()
        assert "not overwritten" in one(update([TASK], stored)).reason
        assert path.read_bytes() == before
    else:
        assert one(update([TASK], stored)).verdict == "renewed"
        assert one(check([TASK], stored)).verdict == "same"


# --- renewing ------------------------------------------------------------------------------------------------


def test_update_renews_what_differs_and_says_by_how_much(spinner, stored):
    path = TASK.path(stored)
    spinner.rate += 1e-14
    before = path.read_bytes()
    assert one(update([TASK], stored)).verdict == "unchanged"
    assert path.read_bytes() == before  # within the tolerance: nothing creeps
    spinner.rate += 1e-6
    found = one(update([TASK], stored))
    assert found.verdict == "renewed"
    assert found.worst.difference == pytest.approx(2e-6 * np.sin(1.0), rel=1e-3)
    assert one(check([TASK], stored)).verdict == "same"
    finer = replace(TASK, run=replace(RUN, dt=0.005))
    found = one(update([finer], stored))
    assert (found.verdict, found.reason) == ("renewed", "stored with dt=0.01; now dt=0.005")


def test_update_keeps_what_was_stored_where_a_run_fails(spinner, stored):
    before = TASK.path(stored).read_bytes()
    spinner.status, spinner.t_end = Status("diverged", "too fast"), 0.5
    found = one(update([TASK], stored))
    assert found.verdict == "failed"
    assert "diverged: too fast (what was stored is kept)" in found.reason
    assert TASK.path(stored).read_bytes() == before
    assert not list(stored.rglob(".*"))


def test_what_is_no_number_is_not_stored(spinner, tmp_path):
    spinner.rate = float("nan")
    found = one(update([TASK], tmp_path))
    assert (found.verdict, "no numbers" in found.reason) == ("failed", True)
    assert not list(tmp_path.rglob("*"))


def test_a_directory_in_the_place_of_a_history_is_a_row(spinner, tmp_path):
    TASK.path(tmp_path).mkdir(parents=True)
    found = one(check([TASK], tmp_path))
    assert (found.verdict, "Is a directory; a file is needed" in found.reason) == ("unreadable", True)
    assert "not overwritten" in one(update([TASK], tmp_path)).reason


def test_a_turned_scene_moves_alike():
    """With everything that turns: places, velocities, constant and varying forces, gravity."""
    bodies = [
        Beam("a", (0.1, 0.0), (0.6, 0.2), BAR.section, Material(1e6, 1e3), lambda s: (-0.1 * s, 0.3 * s)),
        Beam("b", (0.6, 0.2), (0.6, 0.9), BAR.section, Material(1e6, 1e3), lambda s: (-0.1, 0.3)),
    ]
    loads = [Force("b.end", (3.0, 5.0)), Force("a.end", lambda t: (20.0 * t, -3.0))]
    scene = Scene("two", bodies, [Pin("a.start"), Pin("a.end", "b.start")], loads, (1.0, -9.0))
    task = Task(
        scene, ("b.end",), "r", Discretisation(2, dt=2e-3, t_end=0.1, newton_tolerance=1e-12), "anctmm"
    )
    straight = simulate(task).displacement("b.end")
    u = simulate(replace(task, scene=Change(turn=0.7).scene(scene))).displacement("b.end")
    back = u @ np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    assert np.abs(back - straight).max() < 1e-11
    assert np.abs(u - straight).max() > 5e-3


# --- what is declared ----------------------------------------------------------------------------------------

HEAD = "import anctmm as at\nfrom studies.regression.check import Static, Watch\n"
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
        ("1 +", "does not run: SyntaxError"),
        (
            "import nonsense_of_nobody",
            "does not run: ModuleNotFoundError: No module named 'nonsense_of_nobody'",
        ),
        ("", "defines WATCHED = None; a list of at least one Watch is needed"),
        ("WATCHED = []", "WATCHED = []"),
        ("WATCHED = [1]", "WATCHED = [1]"),
        (GOOD.replace("bar,", "3,"), "Watch scene is 3; a Scene is needed"),
        (GOOD.replace("['b.end']", "'b.end'"), "probes 'b.end'; a list of at least one is needed"),
        (GOOD.replace("['b.end']", "[]"), "has probes []"),
        (GOOD.replace("b.end", "c.end"), "body 'c' is not in scene 'bar'"),
        (GOOD.replace("{'rest': Static(1)}", "{}"), "has runs {}"),
        (GOOD.replace("Static(1)", "4"), "run 'rest' of 'bar' is 4; a Discretisation or a Static is needed"),
        (GOOD.replace("'rest'", "'../rest'"), "run name is '../rest'; letters, digits"),
        (GOOD.replace("Static(1)}", "Static(1)}, ['a/b']"), "solver is 'a/b'"),
        (GOOD + "WATCHED *= 2", "'bar/rest/anctmm' is watched 2 times; once is allowed"),
        (HEAD + "at.Circle(-1.0)", "-1.0"),
    ],
)
def test_a_wrong_file_of_scenes_is_named(project, content, reason):
    project.unlink() if content is None else project.write_text(content, encoding="utf-8")
    with pytest.raises(AnctmmError) as error:
        tasks_of(declared_in(project))
    assert reason in str(error.value)


@pytest.mark.parametrize(
    ("only", "solvers", "count"),
    [
        (("four-bar/",), (), 12),
        (("*-zhai/anctmm",), (), 6),
        (("cable-reduced", "cable-lobatto"), ("exudyn-cable",), 2),
        ((), ("global-dae-dense",), 6),
    ],
)
def test_tasks_are_selected(only, solvers, count):
    assert len(select(BASE, only, solvers)) == count


def test_a_solver_nobody_watches_gets_every_run(spinner):
    tasks = select(BASE, (), ("spinner",))
    assert len(tasks) == len({(t.scene.name, t.run_name) for t in BASE})
    assert {t.solver for t in tasks} == {"spinner"}


# --- the command ---------------------------------------------------------------------------------------------


def command(*arguments):
    done = CliRunner().invoke(app, ["check", *map(str, arguments)])
    return done.exit_code, " ".join(done.output.split())


def test_a_users_own_project(project):
    """Store, check, break, check, renew; what is left behind can be read by other programs."""
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
    assert code == 1
    assert "bar · rest" in said
    assert "1 differs" in said
    (suite,) = JUnitXml.fromfile(str(folder / "junit.xml"))
    (case,) = suite
    assert (suite.failures, case.name, case.classname) == (1, "anctmm", "bar.rest")
    assert isinstance(case.result[0], Failure)
    for name in ("bar--rest", "bar--rest--anctmm"):
        drawn = (folder / f"{name}.svg").read_text(encoding="utf-8")
        assert "load factor" in drawn
        assert "difference (J)" in drawn
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
        (["--baselines", "nowhere"], "--baselines nowhere: no such directory; --update makes it"),
        (["--out", "{file}"], "a directory that can be written is needed"),
        (["--update", "--baselines", "{file}"], "a directory that can be written is needed"),
    ],
)
def test_bad_arguments_are_named_before_any_run(arguments, reason, tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_text("", encoding="utf-8")
    monkeypatch.setattr(checking, "simulate", lambda task: pytest.fail("ran"))
    arguments = [a.format(file=file) for a in arguments]
    out = [] if "--out" in arguments else ["--out", tmp_path / "out"]
    code, said = command(*arguments, *out)
    assert code == 2
    assert reason in said


def test_what_was_not_run_is_skipped_in_junit_and_has_no_picture(stored):
    found = [f for fs in check([replace(TASK, solver="elsewhere"), TASK], stored) for f in fs]
    (suite,) = JUnitXml.fromstring(junit(found))
    results = {case.name: case.result for case in suite}
    assert isinstance(results["elsewhere"][0], Skipped)
    assert results["spinner"] == []
    assert pictures(found) == []  # nothing has changed
    assert list(frame_of(found)["verdict"]) == ["not run", "same"]


def test_a_history_that_differs_has_a_picture_where_it_was_stored_before_angles_were(stored):
    """It ended the check with a `KeyError`."""
    kept = read_baseline(TASK.path(stored))
    place = next(c for c in kept.history.columns if c.quantity == "displacement")
    columns = (*kept.history.columns, replace(place, quantity="angle"))
    values = np.column_stack([1.01 * kept.history.values, np.ones(len(kept.history.t))])
    found = checking._compared(TASK, replace(kept.history, columns=columns, values=values), kept, "spinner")
    assert found.verdict == "differs"
    assert len(pictures([found])) == 2
