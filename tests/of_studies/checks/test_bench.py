"""The benchmark: times in turn on made-up solvers, and the smallest forms of its contests."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

import anctmm as at
from studies.benchmark import study as bench
from studies.benchmark.contests import (
    DENSE,
    EXUDYN,
    LENGTHS,
    OURS,
    SPARSE,
    contests,
    lengths,
    scenes,
    stable_step,
)
from studies.benchmark.timing import Sample, in_turn, sampled, summary
from studies.engine.tables import Table

BEAM = at.Beam("beam", (0.0, 0.0), (1.0, 0.0), at.Rectangle(0.02, 0.02), at.Material(5e6, 1100.0))
SCENE = at.Scene("fall", [BEAM], [at.Clamp("beam.start")], gravity=(0.0, -9.81))
RUN = at.Discretisation(2, dt=1e-3, t_end=0.02, output_dt=0.02)


def sample(step_s, corrections=20, call_s=1.0):
    return Sample(10 * step_s, call_s, 10, corrections, 12, "ok")


def test_contestants_run_in_turn_after_an_unmeasured_round():
    order, answer = [], at.solve(SCENE, RUN)
    calls = {name: lambda name=name: (order.append(name), answer)[1] for name in ("a", "b")}
    found = in_turn(calls, 3)
    assert order == ["a", "b"] * 4
    assert {name: len(samples) for name, samples in found.items()} == {"a": 3, "b": 3}
    assert found["a"][0].steps == 20
    assert found["a"][0].dofs == answer.dofs


def test_a_call_is_more_than_its_steps_and_compiling_is_no_part_of_it():
    answer = at.solve(SCENE, RUN)
    slow = replace(answer, cost=replace(answer.cost, cpu_s=0.0, compile_s=1e3))
    assert sampled(lambda: slow).call_s < -900.0
    found = sampled(lambda: at.solve(SCENE, RUN))
    assert 0.0 < found.steps_s <= found.call_s


def test_a_ratio_is_the_median_of_the_rounds():
    """A disturbance of one round moves both, or one ratio of several."""
    base = [sample(1e-6), sample(5e-6), sample(1e-6)]
    other = [sample(3e-6, 40, 2.0), sample(15e-6, 40, 2.0), sample(9e-6, 40, 2.0)]
    row = summary(other, base, 4)
    assert row["ratio_step"] == pytest.approx(3.0)
    assert row["ratio_correction"] == pytest.approx(1.5)  # with twice as many corrections
    assert row["ratio_call"] == pytest.approx(2.0)
    assert row["ns_element_step"] == pytest.approx(9e3 / 4)
    assert row["spread"] == pytest.approx(12.0 / 9.0)


def test_every_contest_runs():
    seen = set()
    for contest in contests(quick=True):
        seen |= {(contest.name, contest.steps, solver) for solver in contest.solvers}
        short = replace(contest.run, t_end=2 * contest.run.dt, output_dt=contest.run.dt)
        assert at.solve(contest.scene, short).status.ok, contest
    assert {solver for *_, solver in seen} == {OURS, EXUDYN, SPARSE, DENSE}
    assert {steps for _, steps, solver in seen if solver == EXUDYN} == {"explicit", "implicit"}


def test_the_longest_beam_has_two_million_coordinates():
    assert 4 * (LENGTHS[-1] + 1) >= 2_000_000
    first = next(islice(lengths(quick=True), 1))
    assert first.elements == 1_000


def test_a_stable_step_is_half_of_the_longest_that_is_not_refused():
    dt = stable_step(SCENE, 2)
    ok = {"integrator": "zhai", "t_end": 10 * dt, "output_dt": 10 * dt}
    assert at.solve(SCENE, mesh=2, dt=dt, **ok).status.ok
    assert [name for name, *_ in scenes(8)] == [
        "hinged chain", "welded tree", "hinged ladder", "chain with springs",
    ]  # fmt: skip


def test_findings_split_the_papers_gain_and_name_the_corrections():
    def row(contest, solver, ratio, corrections=np.nan):
        head = {"contest": contest, "steps_kind": "implicit", "solver": solver, "elements": 12}
        return {
            **head,
            "ratio_step": ratio,
            "ratio_call": 2.0,
            "ratio_correction": corrections,
            "status": "ok",
        }

    table = pd.DataFrame(
        [
            row("four-bar, like settings", EXUDYN, 8.0, 4.0),
            *(row("the paper's", s, r) for s, r in ((OURS, 1.0), (SPARSE, 2.0), (DENSE, 80.0))),
        ]
    )
    long = pd.DataFrame(
        {"steps_kind": "explicit", "elements": [10, 1000], "coordinates": [44, 4004], "ns_element_step": [50.0, 60.0],
         "status": "ok", "contest": "long beam", "solver": OURS}
    )  # fmt: skip
    peers, paper, length = bench.findings(table, long)
    assert "8 to 8 times as long for a step, 2 to 2 times for the whole call" in peers
    assert "by Newton correction 4 to 4 times" in peers
    assert "80 times less" in paper
    assert (
        "Of this 40 times is the gain of a sparse matrix that is factored once, 2 times is the method's"
        in paper
    )
    assert "1.2 times as much as at 44" in length

    class Shown:
        title, findings = "Benchmark", (peers,)

        def table(self, name):
            frame = (
                table.assign(ns_element_step=1.0, spread=0.1, corrections_step=2.0)
                if name == "contests"
                else long
            )
            return Table(name, name, frame)

    console = Console(record=True, width=200)
    frame = long.assign(
        spread=0.1, corrections_step=2.0, ratio_step=1.0, ratio_correction=1.0, ratio_call=1.0
    )
    long = frame
    bench.glance(Shown(), console)
    assert "long beam" in console.export_text()
