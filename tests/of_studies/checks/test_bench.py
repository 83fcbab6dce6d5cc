"""The benchmark: times in turn on made-up solvers, the smallest forms of its items, and two checkouts."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

import anctmm as at
from studies.benchmark import study as bench
from studies.benchmark.scenes import DENSE, EXUDYN, LENGTHS, OURS, SPARSE, items, sampled

ROOT = Path(__file__).parents[3]
BEAM = at.Beam("beam", (0.0, 0.0), (1.0, 0.0), at.Rectangle(0.02, 0.02), at.Material(5e6, 1100.0))
SCENE = at.Scene("fall", [BEAM], [at.Clamp("beam.start")], gravity=(0.0, -9.81))
RUN = at.Discretisation(2, dt=1e-3, t_end=0.02, output_dt=0.02)


def test_a_call_is_more_than_its_steps_and_compiling_is_no_part_of_it():
    answer = at.solve(SCENE, RUN)
    slow = replace(answer, cost=replace(answer.cost, cpu_s=0.0, compile_s=1e3))
    assert sampled(lambda: slow)["call_s"] < -900.0
    found = sampled(lambda: at.solve(SCENE, RUN))
    assert 0.0 < found["steps_s"] <= found["call_s"]
    assert (found["steps"], found["coordinates"]) == (20, answer.dofs)


def test_a_ratio_is_the_median_of_the_rounds():
    """A disturbance of one round moves both, or one ratio of several; a refusal is a row."""

    def calls(step_s, call_s=1.0):
        times = iter([step_s[0], *step_s])  # the first is to see whether it runs, and to warm up
        sample = {"call_s": call_s, "steps": 10, "corrections": 20, "coordinates": 12, "status": "ok"}
        return lambda: {**sample, "steps_s": 10 * next(times)}

    contestants = {
        "a": calls([1e-6, 5e-6, 1e-6]), "b": calls([3e-6, 15e-6, 9e-6], 2.0), "c": "not timed",
    }  # fmt: skip
    item = replace(next(items(quick=True)), elements=4)
    table, raw = bench.measured([item], lambda item: contestants, 3, str)
    first, row, refused = table.to_dict("records")
    assert (len(raw), first["solver"], first["ratio_step"], refused["status"]) == (6, "a", 1.0, "not timed")
    assert (row["ratio_step"], row["ratio_call"]) == pytest.approx((3.0, 2.0))
    assert row["ns_element_step"] == pytest.approx(9e3 / 4)
    assert row["spread"] == pytest.approx(12.0 / 9.0)
    console = Console(record=True, width=200)
    bench.show(table, "both", console)
    assert "not timed" in console.export_text()


def test_every_item_runs():
    every = list(items())
    assert len({item.name for item in every}) == len(every)
    assert {name for item in every for name in item.solvers} == {OURS, EXUDYN, SPARSE, DENSE}
    assert 4 * (LENGTHS[-1] + 1) >= 2_000_000
    for item in every:
        if item.elements <= 1000:
            run = item.run()
            short = replace(run, t_end=2 * run.dt, output_dt=run.dt)
            # two steps of a drive that begins slowly move nothing by more than rounding
            assert at.solve(item.made(), short).status.code in ("ok", "imprecise"), item


def test_two_checkouts_are_timed_in_turn():
    command = [sys.executable, "-m", "studies.benchmark", str(ROOT), "--quick", "--repeats", "1", "--only"]
    done = subprocess.run(
        [*command, "clamped beam, like settings, 8 elements, implicit"],
        cwd=ROOT, capture_output=True, text=True, check=False, env={**os.environ, "COLUMNS": "160"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert {"here", "other"} <= set(done.stdout.split())
    done = subprocess.run([*command, "nothing"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, "fits no item" in done.stderr) == (2, True)
