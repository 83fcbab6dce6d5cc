"""What a command says of its work: what runs now, and how long the rest may take, also in a log without a terminal."""

import re

import pytest
from rich.console import Console
from typer.testing import CliRunner
from user_cases import DOUBLE_PENDULUM

from studies.cases import cases_in
from studies.cli import app
from studies.command_line import progress
from studies.command_line.progress import Log, shortened, spoken
from studies.engine.runner import Runner
from studies.engine.running.trial import Trial


class Clock:
    """Seconds that pass when told."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def log(clock):
    said: list[str] = []
    made = Log(said.append, clock)
    made.said = said
    return made


def test_a_part_that_is_finished_is_a_line(log, clock):
    for k in range(4):
        log.started(f"run {k}", k, 4)
        clock.now += 1.0
        log.done(f"run {k}", k + 1, 4)
    assert log.said == ["[4 s] run 3: done, 4 of 4 in 4 s"]


def test_what_is_brief_is_not_told(log, clock):
    for k in range(100):
        log.started("run", k, 100)
        clock.now += 0.01
        log.done("run", k + 1, 100)
    assert log.said == []


def test_a_long_part_says_what_runs_and_what_is_left(log, clock):
    for k in range(6):
        log.started(f"run {k}", k, 6)
        clock.now += 20.0
        log.done(f"run {k}", k + 1, 6)
    assert log.said[0] == "[20 s] run 0: 1 of 6 done, 2 min left"
    assert log.said[3] == "[80 s] run 3: 4 of 6 done, 40 s left"
    assert log.said[-1] == "[2 min] run 5: done, 6 of 6 in 2 min"
    clock.now += 60.0
    log.started("next", 0, 3)
    assert log.said[-1] == "[3 min] next is running, 0 of 3 done"


def test_the_first_of_many_tell_nothing_of_what_is_left(log, clock):
    for k, seconds in enumerate((120.0, 20.0, 20.0)):  # the first one compiles
        log.started(f"run {k}", k, 20)
        clock.now += seconds
        log.done(f"run {k}", k + 1, 20)
    assert log.said[0] == "[2 min] run 0: 1 of 20 done"
    assert log.said[1] == "[2 min] run 1: 2 of 20 done, 21 min left"


def test_a_runner_says_what_begins(tmp_path):
    (case,) = cases_in(DOUBLE_PENDULUM)
    said = []
    runner = Runner(None, repeats=1, on_start=lambda *told: said.append(("starts", *told)),
                    on_done=lambda trial, *told: said.append(("done", *told)))  # fmt: skip
    trials = [Trial(case.scene, "anctmm", (n,), dt=1e-2, t_end=0.02, output_dt=0.01) for n in (1, 2)]
    runner.sweep(trials)
    assert [(what, *counts) for what, *_, done, total in said for counts in [(done, total)]] == [
        ("starts", 0, 2), ("done", 1, 2), ("starts", 1, 2), ("done", 2, 2),
    ]  # fmt: skip
    assert said[0][1] == "double-pendulum · anctmm 1 cable generalized-alpha"
    said.clear()
    runner.jobs([("a job", lambda: 1, lambda error: 2)], "")
    assert said == [("starts", "a job", 0, 1)]


def test_a_log_without_a_terminal_has_a_line_for_each_part(monkeypatch, tmp_path):
    """A real command whose output goes nowhere that could show a bar."""
    monkeypatch.setattr(progress, "BRIEF", 0.0)
    monkeypatch.delenv("COLUMNS", raising=False)  # lines are broken where a width is stated
    arguments = ["study", "convergence", DOUBLE_PENDULUM, "--quick", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0
    lines = [line for line in done.stderr.splitlines() if line.startswith("anctmm: [")]
    finished = [line for line in lines if not re.search(r"\d+ of \d+ done", line)]  # a slow part says so
    assert finished
    done_in = r"anctmm: \[\d+ (s|min)\] double-pendulum: .* in \d+ (s|min)"
    assert not [line for line in finished if not re.fullmatch(done_in, line)]


def test_a_terminal_has_no_log():
    terminal = Console(force_terminal=True)
    log = Log.on(terminal)
    with terminal.capture() as captured:
        log.now("something")
    assert captured.get() == ""


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.2, "0 s"), (99.0, "99 s"), (100.0, "2 min"), (3600.0, "60 min"), (7200.0, "2.0 h")],
)
def test_times_are_spoken(seconds, text):
    assert spoken(seconds) == text


def test_a_label_leaves_room_for_the_bar():
    assert shortened("x" * 100, 80) == "x" * 33 + "…"
    assert shortened("short", 80) == "short"
