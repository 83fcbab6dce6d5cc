"""The benchmark measures what it says: counts, accuracy and structure are asserted, never a time."""

import numpy as np
import pandas as pd
import pytest
from small_studies import small_bench
from typer.testing import CliRunner

import anctmm as at
from anctmm.jit.compiling import kernel
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.solve import solve
from reference import global_dae
from studies import cli
from studies.benchmark import additions as bench_additions
from studies.benchmark import calls as bench_calls
from studies.benchmark import first as bench_first
from studies.benchmark import kernels as bench_kernels
from studies.benchmark import required
from studies.benchmark import study as bench
from studies.benchmark.kernels import EXPLICIT, IMPLICIT
from studies.benchmark.length import Long, acceleration_check, clamped_digits, memory, support_check
from studies.benchmark.peak import counted, kernel_operations, operations
from studies.benchmark.peers import DENSE, EXUDYN, OURS, SPARSE
from studies.benchmark.precision import Point, Setting, contenders, cost_at, front, promising
from studies.benchmark.required import MOST_BYTES, MOST_RATIO
from studies.benchmark.topology import JOINTS, Framework
from studies.engine.measuring.clock import Effort, Samples, between, figures, ratio, sampled_in_turn
from studies.engine.measuring.setting import CABLES, SHEAR, VARIANTS, explicit_run, row_of_beams, stable_step
from studies.engine.tables import MOST_ROWS

TABLES = {
    "requirements", "kernels", "peak", "exudyn", "equal_error", "work_precision", "methods", "length", "direct",
    "digits", "additions", "calls", "topology", "first", "samples",
}  # fmt: skip


@kernel
def _polynomial(x, y):
    for i in range(len(x)):
        y[i] = 3.0 - x[i] * x[i] / 2.0


def _point(error: float, cpu_s: float, mesh: int = 8, dt: float = 1e-3, code: str = OURS) -> Point:
    setting = Setting(code, "generalized-alpha", (mesh,), dt, "full", (("newton_tolerance", 1e-5),))
    return Point(setting, error, error, cpu_s, "ok")


@pytest.fixture(scope="module")
def small():
    """The whole benchmark at the smallest sizes."""
    with small_bench():
        return bench.bench(quick=True)


def test_contestants_take_turns_and_every_sample_is_kept():
    order, samples = [], Samples()

    def sampler(name):
        return lambda: order.append(name) or float(len(order))

    found = sampled_in_turn("part", {"a": sampler("a"), "b": sampler("b")}, 3, samples)
    assert order == ["a", "b"] * 4  # the first round is not measured
    assert found == {"a": [3.0, 5.0, 7.0], "b": [4.0, 6.0, 8.0]}
    assert [row["ns"] for row in samples.rows] == [3.0, 5.0, 7.0, 4.0, 6.0, 8.0]
    assert figures(found["a"]) == {"ns": 5.0, "spread": pytest.approx(0.8), "repeats": 3}
    assert ratio([2.0, 9.0, 8.0], [1.0, 3.0, 2.0]) == 3.0


def _of_times(times):
    """Runs that take the given CPU times, one after the other."""
    left = iter(times)
    scene, rest = row_of_beams(1, 1), Energy.unknown(1)
    return lambda n: Solution("made up", scene, None, np.zeros(1), {}, rest, Cost(cpu_s=next(left), steps=n))


def test_steps_are_timed_by_the_difference_of_a_run_and_a_longer_one():
    seen = []
    assert between(_of_times([1.0, 5.0]), 10, 4, seen)() == pytest.approx(1e9 * 4.0 / (20 * 4))
    assert [s.cost.steps for s in seen] == [10, 30]
    pairs = [1.0, 5.0, 9.0, 2.0, 1.0, 6.0]  # other work has held up the second pair's short run
    assert between(_of_times(pairs), 10, 4, seen, again=3)() == pytest.approx(1e9 * 4.0 / (20 * 4))


def test_a_time_lost_in_noise_is_left_out_and_not_counted():
    lost = between(_of_times([3.0, 2.0]), 10, 4, [])()
    assert np.isnan(lost)
    assert figures([lost, 5.0, 7.0]) == {"ns": 6.0, "spread": pytest.approx(1 / 3), "repeats": 2}
    assert np.isnan(figures([lost])["ns"])
    assert figures([lost])["repeats"] == 0
    assert ratio([lost, 6.0, 8.0], [1.0, 3.0, lost]) == 2.0
    assert np.isnan(ratio([lost], [1.0]))


def test_operations_are_counted_one_by_one():
    assert operations(_polynomial, counted(np.ones(4)), counted(np.zeros(4))) == 4 * 3


def test_operations_of_the_kernels():
    counts = {v.label: kernel_operations(v) for v in VARIANTS}
    forces = {label: c[bench_kernels.ELEMENT_FORCES] for label, c in counts.items()}
    assert forces["cable full"] > forces["cable reduced"] > forces["cable lobatto"] > 100
    assert 300 < forces["shear"] < 900
    for variant in VARIANTS:
        c, rows = counts[variant.label], 6 if variant is SHEAR else 4
        assert c[bench_kernels.UPDATE] == 10 * rows  # six to a position, four to a velocity
        assert c[EXPLICIT] > c[bench_kernels.ACCELERATIONS] > c[bench_kernels.ELEMENT_FORCES]
        assert c[bench_kernels.FACTORIZATION] > c[bench_kernels.TANGENTS] > c[bench_kernels.ELEMENT_FORCES]


@pytest.mark.parametrize("variant", [SHEAR, CABLES[0]], ids=lambda v: v.element)
@pytest.mark.parametrize(("bodies", "elements"), [(1, 3000), (100, 33)])
def test_accelerations_equal_a_banded_direct_solve(variant, bodies, elements):
    row = acceleration_check(row_of_beams(bodies, elements), elements, variant)
    assert row["elements"] == bodies * elements
    assert row["difference"] < 1e-10


@pytest.mark.parametrize("variant", [SHEAR, CABLES[0]], ids=lambda v: v.element)
def test_statics_on_supports_keeps_its_digits(variant):
    row = support_check(300, 10, variant)
    assert row["status"] == "ok"
    assert row["difference"] < 1e-9
    assert row["sag"] < 1e-9


def test_statics_of_a_clamped_beam_loses_digits_with_the_fourth_power():
    few, many = clamped_digits(4), clamped_digits(1024)
    assert few["error_static"] < 1e-11
    assert few["error_recursion"] < 1e-12
    assert few["error_recursion"] < many["error_recursion"] < many["limit"]
    assert many["error_static"] < many["error_banded"]  # Newton's corrections repair what one solve loses


def test_explicit_steps_are_stable_and_need_little_memory():
    scene = row_of_beams(1, 16)
    options = CABLES[1].options()
    run = explicit_run(scene, 16, 2000, stable_step(scene, 16, options), **options)
    assert solve(scene, run).status.ok
    assert 100.0 < memory(Long(SHEAR, "zhai", 1, 20_000))["bytes"] < MOST_BYTES


def test_fronts_and_costs_between_their_points():
    points = [_point(1e-2, 1.0), _point(1e-4, 100.0), _point(1e-3, 200.0), _point(np.nan, 0.1)]
    assert [p.error for p in front(points)] == [1e-2, 1e-4]
    assert cost_at(points, 1e-3) == pytest.approx(10.0)  # a straight line in logarithms
    assert cost_at(points, 1.0) == 1.0  # never beyond the cheapest
    assert np.isnan(cost_at(points, 1e-5))


def test_what_is_near_the_part_of_a_front_that_is_compared_is_timed_again():
    line = [_point(e, c) for e, c in ((0.3, 1.0), (0.1, 2.0), (5e-3, 3.0), (8e-6, 8.0), (2e-6, 20.0))]
    assert [p.error for p in contenders(line)] == [0.1, 5e-3, 8e-6]
    # held up in one run: the last one that is finer costs at most 1.6 times as much
    held_up = [_point(4e-3, 4.7), _point(4e-6, 12.0)]
    behind = [_point(4e-3, 13.0), _point(3e-6, 13.0)]
    assert contenders([*line, *held_up, *behind]) == [*line[1:4], *held_up]
    assert contenders(line[2:3]) == line[2:3]
    assert contenders([_point(np.nan, 1.0)]) == []


def test_settings_far_from_the_fewest_elements_and_steps_are_left_out():
    points = [_point(1e-3, 1.0, mesh=8), _point(1e-3, 1.0, mesh=15), _point(1e-3, 1.0, mesh=40)]
    assert {key[0] for key in promising(points)} == {(8,), (15,)}


def test_every_table_is_whole(small):
    assert {t.name for t in small.tables} == TABLES
    for name in TABLES - {"samples"}:
        frame = small.table(name).frame
        assert not frame.empty
        assert frame["status"].astype(bool).all()
    assert {p.name for p in small.pictures} == {"ratios", "work_precision", "length", "methods"}
    assert len(small.findings) == 1


def test_all_contestants_are_sampled_as_often_and_finish(small):
    raw = small.table("samples").frame
    counts = raw.groupby([raw["part"].str.split(",").str[0], "part", "what"]).size()
    assert set(counts.index.levels[0]) == {
        "kernels", "peak", "exudyn", "work-precision", "methods", "length", "additions", "calls", "topology", "direct",
        "first",
    }  # fmt: skip
    assert (counts.loc["kernels"] == Effort(True).rounds).all()
    assert (counts.loc["length"] == Effort(True).rounds).all()
    kernels = small.table("kernels").frame
    whole = kernels[kernels["kernel"].isin([EXPLICIT, IMPLICIT])]
    assert len(whole) == 2 * 2 * len(VARIANTS)
    assert (whole["status"] == "ok").all()
    implicit = whole[whole["kernel"] == IMPLICIT]
    assert (implicit["newton_per_step"] >= 1.0).all()
    assert (implicit["factorizations_per_step"] > 0.0).all()


def test_contestants_solve_the_same_problem(small):
    exudyn, methods = small.table("exudyn").frame, small.table("methods").frame
    assert (exudyn[exudyn["integrator"] == "zhai"]["difference"] < 1e-8).all()
    assert (exudyn["difference"] < 1e-5).all()
    assert (exudyn["status"] == "ok").all()
    assert set(methods["method"]) == {OURS, SPARSE, DENSE}
    assert (methods["difference"] < 1e-8).all()
    assert (methods["status"] == "ok").all()


def test_equal_error_is_interpolated_from_runs_of_both_codes(small):
    runs, summary = small.table("work_precision").frame, small.table("equal_error").frame
    assert set(runs["code"]) == {OURS, EXUDYN}
    assert (runs["error"] > 0.0).all()
    assert (runs["reference_error"] < 1e-3).all()
    for scene, found in summary.groupby("scene"):
        reached = found[found["status"] == "ok"]
        assert len(reached) >= 2, scene
        assert (reached[["anctmm_implicit_s", "exudyn_best_s", "ratio_best"]] > 0.0).all(axis=None)
        assert (reached["anctmm_best_s"] <= reached["anctmm_implicit_s"]).all()


def test_calls_differ_in_their_numbers_alone(monkeypatch):
    asked = []
    monkeypatch.setattr(bench_calls, "CALLS", 1)
    monkeypatch.setattr(bench_calls, "RUNS", {"generalized-alpha": bench_calls.RUNS["generalized-alpha"]})
    monkeypatch.setattr(bench_calls, "solve", lambda scene, run: asked.append(scene) or solve(scene, run))
    monkeypatch.setattr(bench_calls, "in_new_process", lambda call, *args: call(*args))
    frame, samples = bench_calls.call_costs(Effort(True), found := Samples()).frame, found.rows
    assert set(frame["scene"]) == set(bench_calls.SCENES)
    assert (frame["status"] == "ok").all()
    assert (frame["repeats"] == Effort(True).rounds).all()
    assert (frame[["cpu_s", "build_s"]] > 0.0).all(axis=None)
    assert len(samples) == 2 * len(frame) * Effort(True).rounds
    each = 3 + Effort(True).rounds
    for n in range(len(bench_calls.SCENES)):
        scenes = asked[3 * each * n : 3 * each * (n + 1)]
        assert len({id(scene) for scene in scenes}) == len(set(scenes)) == 1 + 2 * each
        assert len({scene.joints for scene in scenes}) == 1


def test_what_is_added_does_not_change_the_motion():
    """So that Newton's corrections, and with them the times, may be compared."""
    for turned in (False, True):
        for integrator in ("zhai", "generalized-alpha"):
            runs = {
                name: bench_additions.runner(scene, integrator, 3)(20)
                for name, scene in bench_additions.scenes(turned).items()
            }
            plain = runs.pop(bench_additions.PLAIN)
            assert len(runs) == 3
            way = np.abs(plain.displacement("beam.end")).max()
            for s in runs.values():
                assert s.status.ok
                assert s.cost.newton_iterations == plain.cost.newton_iterations
                assert s.cost.factorizations == plain.cost.factorizations
                assert np.abs(s.position("beam.end") - plain.position("beam.end")).max() < 1e-6 * way


def test_what_is_added_is_the_median_over_processes(monkeypatch):
    """One process whose code lies badly decides nothing, and no time that is lost in noise does."""
    seen, alone = [], (1000.0, 1200.0, 900.0)
    ratios = {"a grounded spring": (1.01, 1.09, 1.02), "a tip mass": (1.01, float("nan"), 1.03)}

    def found(measured, integrator, elements, rounds, process):
        seen.append((integrator, process))
        of_step = {f"{bench_additions.PLAIN}, axis": alone[process]} | {
            f"{name}, axis": alone[process] * of[process] for name, of in ratios.items()
        }
        status = "diverged: here" if process == 1 else "ok"
        counts = {label: (7, 2, status if "spring" in label else "ok") for label in of_step}
        return bench_additions.Measured({label: [ns] for label, ns in of_step.items()}, of_step, counts)

    monkeypatch.setattr(bench_additions, "PROCESSES", 3)
    monkeypatch.setattr(bench_additions, "in_new_process", found)
    samples = Samples()
    frame = bench_additions.added_costs(Effort(False), samples).frame
    assert seen == [(i, k) for i in bench_additions.STEPS for k in range(3)]
    rows = frame[frame["integrator"] == "zhai"].set_index("added")
    plain, spring, mass = (rows.loc[name] for name in (bench_additions.PLAIN, *ratios))
    assert (plain["ns"], plain["ratio"], plain["processes"]) == (1000.0, 1.0, 3)
    np.testing.assert_allclose(
        spring[["ns", "ratio", "least", "most"]].astype(float), (1010, 1.02, 1.01, 1.09)
    )
    np.testing.assert_allclose(mass[["ratio", "least", "most"]].astype(float), (1.02, 1.01, 1.03))
    assert list(rows["status"]) == ["ok", "diverged: here", "ok"]
    assert len({row["part"] for row in samples.rows}) == len(seen)


def test_processes_that_measure_are_new_ones_and_have_the_arrays_elsewhere(monkeypatch):
    from studies.engine.running import pool

    begun = []
    real = pool.WorkerPool._process
    monkeypatch.setattr(pool.WorkerPool, "_process", lambda self: begun.append(real(self)) or begun[-1])
    for process in range(2):
        found = pool.in_new_process(bench_additions.measured, "zhai", 2, 1, process)
        assert len(found.of_step) == len(found.counts) == 8
        assert len(found.times) == 16
        assert all(len(values) == 1 and values[0] > 0.0 for values in found.times.values())
        assert {status for _, _, status in found.counts.values()} == {"ok"}
    assert len({worker.pid for worker in begun}) == 2


@pytest.mark.parametrize("joints", JOINTS)
def test_chains_have_as_many_beams_and_joints_of_the_same_kind(joints):
    for framework, junctions in ((Framework("tree", joints, 10), 5), (Framework("ladder", joints, 4), 8)):
        scene, chain = framework.scene(), framework.chain.scene()
        assert len(scene.bodies) == len(chain.bodies) == framework.beams == 10
        kinds = {type(joint) for joint in (*scene.joints, *chain.joints)}
        assert kinds == {at.Clamp, JOINTS[joints]}
        assert len(chain.joints) == framework.beams  # with the clamp
        assert len(scene.joints) == junctions + 1
        lengths = [np.hypot(*np.subtract(b.end, b.start)) for b in (*scene.bodies, *chain.bodies)]
        np.testing.assert_allclose(lengths, lengths[0])


@pytest.mark.parametrize("joints", JOINTS)
@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
def test_frameworks_move_as_by_the_global_solver(integrator, joints):
    for framework in (
        Framework("tree", joints, 7),
        Framework("ladder", joints, 3),
        Framework("chain", joints, 3),
    ):
        ours, theirs = (framework.runner(s, integrator)(20) for s in (solve, global_dae.solve))
        assert ours.status.ok
        assert theirs.status.ok
        way = np.abs(ours.displacement(f"{ours.scene.bodies[-1].name}.end")).max()
        for body in ours.scene.bodies:
            apart = ours.position(f"{body.name}.end") - theirs.position(f"{body.name}.end")
            assert np.abs(apart).max() < 2e-5 * way + 1e-13  # what Newton's tolerance leaves


def test_the_same_of_trees_and_ladders_is_compared(small):
    frame = small.table("topology").frame
    assert (frame["status"] == "ok").all()
    assert len(frame) == 2 * 2 * 3
    assert set(frame["scene"]) == {"tree", "ladder"}
    implicit = frame["integrator"] != "zhai"
    for name in ("newton_per_step", "newton_chain", "newton_dae"):
        assert (frame[name].notna() == implicit).all(), name
    timed = frame["ratio"].notna()  # of times so short, other work of the machine may hide one
    assert (frame["ratio_iteration"].notna() == (implicit & timed)).all()
    assert (frame.loc[implicit, ["newton_per_step", "newton_chain", "newton_dae"]] >= 1.0).all(axis=None)


def test_first_results_are_of_fresh_processes_that_compile(small):
    frame = small.table("first").frame.set_index("kernels_before")
    assert (frame["status"] == "ok").all()
    before, after = frame.loc["none"], frame.loc["all"]
    assert before["kernels"] > 0
    assert before["files"] >= before["kernels"]
    assert after["kernels"] == 0
    assert after["files"] == before["files"]
    assert before["steps"] == after["steps"] > 0
    assert frame.loc["-", "scene"] == "anctmm list"


def test_a_second_process_compiles_nothing(tmp_path):
    """A spring's measure was compiled again in each process that looked at the stability limit."""
    one, two = (
        bench_first.process(("-m", "studies.benchmark.newcomer", "spring", "zhai"), str(tmp_path))
        for _ in range(2)
    )
    assert one.told["status"] == two.told["status"] == "ok"
    assert one.told["kernels"] > two.told["kernels"] == 0


def test_a_process_that_fails_says_so_in_its_row(tmp_path):
    found = bench_first.process(("-c", "raise SystemExit('no such thing')"), str(tmp_path))
    assert found.told == {"status": "exit code 1: no such thing"}


def _ladders(*ratios):
    """A table of ladders with these ratios."""
    rows = [
        {"scene": "ladder", "integrator": "zhai", "joints": "hinged", "beams": 28 * 10**k, "ratio_length": ratio,
         "status": "ok"} for k, ratio in enumerate(ratios)
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_lengths_of_ladders_are_compared_by_the_largest_and_the_least():
    (line,) = required._lengths_of_ladders(_ladders(1.2, 1.0, 1.8))
    assert (line["found"], line["required"]) == (1.8, MOST_RATIO)
    (lost,) = required._lengths_of_ladders(_ladders(1.2, float("nan")))  # in noise: not met
    assert np.isnan(lost["found"])


def test_requirements_are_judged_by_their_sense(small):
    frame = small.table("requirements").frame
    at_least = frame["sense"] == "at least"
    assert (frame[at_least]["met"] == (frame[at_least]["found"] >= frame[at_least]["required"])).all()
    assert (frame[~at_least]["met"] == (frame[~at_least]["found"] <= frame[~at_least]["required"])).all()
    assert frame["what"].is_unique
    accelerations = frame[frame["what"].str.startswith("accelerations")]
    assert len(accelerations) == 3
    assert accelerations["met"].all()


def test_command_writes_tables_and_pictures(small, tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "bench", lambda quick, say: small)
    shown = CliRunner().invoke(cli.app, ["bench", "--quick", "--out", str(tmp_path)])
    assert shown.exit_code == 0, shown.output
    assert "Required and found" in shown.output
    names = {path.name for path in (tmp_path / "bench").iterdir()}
    short = {t.name for t in small.tables if len(t.frame) <= MOST_ROWS}
    assert "requirements" in short
    assert {f"{t}.csv" for t in TABLES} | {f"{t}.md" for t in short} <= names
    assert {"machine.json", "length.svg", "ratios.svg", "work_precision.svg", "methods.svg"} <= names
    assert not pd.read_csv(tmp_path / "bench" / "requirements.csv").empty
