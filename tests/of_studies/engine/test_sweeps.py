"""Sweeps that workers share: each run once, the same bits, whatever dies; times by themselves, afterwards, in turn."""

import os
import signal
import subprocess
import sys
import threading
from collections import Counter
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import shared_sweep
from shared_sweep import LIMIT, cases, done, numbers, runner, wait_until
from typer.testing import CliRunner

from anctmm.errors import SolverError
from anctmm.model.scene import Force
from studies.cli import app
from studies.engine.runner import Runner
from studies.engine.running.pool import WorkerDied, WorkerPool
from studies.engine.running.team import SweepError, team
from studies.engine.running.trial import product
from studies.engine.running.turns import Turns
from studies.engine.running.worker import NotSendable, OtherCode, packed_run, work
from studies.engine.storage import provenance
from studies.scenes import cantilever_fall


def begun_twice(log):
    return {n: count for n, count in Counter(n for n, _ in done(log)).items() if count > 1}


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """What one process computes."""
    return numbers(runner(tmp_path_factory.mktemp("serial")).sweep(cases(20)))


# --- sharing -------------------------------------------------------------------------------------------------


def test_workers_share_a_sweep_and_compute_every_run_once(tmp_path, serial):
    with team(2) as helpers:
        mine = runner(tmp_path, helpers, meet=2)
        outcomes = mine.sweep(cases(20), timed=False)
    assert numbers(outcomes) == serial
    assert begun_twice(tmp_path / "log") == {}
    shared = Counter(process for _, process in done(tmp_path / "log"))
    assert len(shared) == 2
    assert os.getpid() not in shared
    assert mine.computed == 20
    faults = [o for o in outcomes if not o.solution.status.ok]
    assert [str(o.solution.status) for o in faults] == [
        f"failed: ValueError: a fault at {n}" for n in (7, 14)
    ]


def test_what_workers_computed_is_kept_for_any_machine(tmp_path, serial, monkeypatch):
    with team(2) as helpers:
        runner(tmp_path, helpers).sweep(cases(6), timed=False)
    monkeypatch.setenv(provenance.NAMED, "another machine")
    again = runner(tmp_path).sweep(cases(6), timed=False)
    assert numbers(again) == serial[:6]
    assert len(done(tmp_path / "log")) == 6
    assert all(np.isnan(o.solution.cost.cpu_s) for o in again)


def test_without_a_store_solutions_are_held_for_the_session(tmp_path, serial):
    with team(2) as helpers:
        mine = runner(tmp_path, helpers, repeats=2)
        mine.cache = mine._store.directory = None
        assert numbers(mine.sweep(cases(4), timed=False)) == serial[:4]
        assert numbers(mine.sweep(cases(4), timed=False)) == serial[:4]
    assert len(done(tmp_path / "log")) == 4


def test_two_sessions_with_workers_share_their_runs(tmp_path, serial):
    """The second one begins while the first is at work, and is told."""
    found, notes = {}, []

    def session(name):
        with team(2) as helpers:
            mine = runner(tmp_path, helpers, pause=0.05, note=notes.append)
            found[name] = numbers(mine.sweep(cases(20), timed=False))

    both = [threading.Thread(target=session, args=(name,)) for name in "ab"]
    for thread in both:
        thread.start()
    for thread in both:
        thread.join(LIMIT)
    assert found == {"a": serial, "b": serial}
    # those that fail are not kept: each session finds that out for itself
    assert set(begun_twice(tmp_path / "log")) <= {7, 14}


def test_scenes_with_functions_are_sent_and_not_kept(tmp_path):
    slope = 2.0
    pulled = replace(shared_sweep.SCENE, loads=(Force("beam.end", lambda t: (0.0, -slope * t)),))
    with team(2) as helpers:
        mine = runner(tmp_path, helpers)
        mine.key = lambda *cases: ""
        outcomes = mine.sweep(cases(3, pulled), timed=False)
    assert [o.solution.status for o in outcomes] == ["ok"] * 3
    assert all(o.solution.scene is pulled for o in outcomes)
    assert os.getpid() not in {process for _, process in done(tmp_path / "log")}
    assert not list((tmp_path / "runs").glob("*.run"))


def test_what_cannot_be_sent_is_done_here(tmp_path):
    lock = threading.Lock()
    held = replace(shared_sweep.SCENE, loads=(Force("beam.end", lambda t: (0.0, float(lock.locked()))),))
    with pytest.raises(NotSendable, match="lock"):
        packed_run(cases(1, held)[0], None)
    with team(2) as helpers:
        mine = runner(tmp_path, helpers)
        mine.key = lambda *cases: ""
        outcomes = mine.sweep(cases(2, held), timed=False)
    assert [o.solution.status for o in outcomes] == ["ok"] * 2
    assert {process for _, process in done(tmp_path / "log")} == {os.getpid()}


def test_two_hundred_real_runs_are_shared_and_the_same_bits(tmp_path):
    """Of ANC–TMM, with kernels, in worker processes: as many as the issue asks for, short ones."""
    base = cantilever_fall()
    every = product(
        base.scene, ["anctmm"], [(n,) for n in range(1, 21)], [0.005 / k for k in range(5, 15)],
        integrator="generalized-alpha", t_end=0.01, output_dt=0.005,
    )  # fmt: skip
    alone = Runner(tmp_path / "alone", repeats=1).sweep(every, timed=False)
    with team(2) as helpers:
        mine = Runner(tmp_path / "shared", repeats=1, team=helpers)
        shared = mine.sweep(every, timed=False)
    assert len(shared) == 200
    assert numbers(shared) == numbers(alone)
    assert {o.solution.status.code for o in shared} == {"ok"}
    assert all(
        np.array_equal(a.solution.energy.strain, b.solution.energy.strain)
        for a, b in zip(alone, shared, strict=True)
    )
    assert mine.computed == len(mine.spread) == 200
    assert os.getpid() not in {interval.process for interval in mine.spread}


def square(log, n):
    """A job: its number, its process, a number that is none; or an error."""
    shared_sweep.write(log, f"begun {n} {os.getpid()}")
    if n == 3:
        raise SolverError(f"no such luck with {n}")
    return [{"n": n, "square": n * n, "none": float("nan")}]


def test_jobs_are_shared_kept_and_fail_as_in_one_process(tmp_path):
    def swept(folder, helpers, code="code"):
        (tmp_path / folder).mkdir(exist_ok=True)
        call = partial(square, tmp_path / folder / "log")
        jobs = [
            (f"job {n}", partial(call, n), lambda error: f"{type(error).__name__}: {error}") for n in range(6)
        ]
        return repr(Runner(tmp_path / folder / "runs", team=helpers).jobs(jobs, code))

    alone = swept("alone", None)
    with team(2) as helpers:
        assert swept("shared", helpers) == alone
        assert swept("unkept", helpers, code="") == alone
    assert "SolverError: no such luck with 3" in alone
    assert os.getpid() not in {process for _, process in done(tmp_path / "shared" / "log")}
    assert swept("shared", None) == alone
    assert begun_twice(tmp_path / "shared" / "log") == {3: 2}  # what failed was not kept
    assert not list((tmp_path / "unkept").glob("runs/*.run"))


def test_a_fault_in_a_job_of_a_worker_is_raised_and_a_job_that_kills_is_a_row(tmp_path):
    with team(2) as helpers:
        mine = Runner(tmp_path / "runs", team=helpers)
        with pytest.raises(ZeroDivisionError):
            mine.jobs([("fault", lambda: 1 // 0, str)], "code")
        (row,) = mine.jobs([("kills", lambda: os.kill(os.getpid(), signal.SIGKILL), str)], "code")
    assert "signal 9" in row


# --- what dies -----------------------------------------------------------------------------------------------


def test_a_killed_worker_costs_the_run_it_hit(tmp_path, serial):
    with team(2) as helpers:
        mine = runner(tmp_path, helpers, deaths={3: 1, 11: 1})
        outcomes = mine.sweep(cases(20), timed=False)
    assert numbers(outcomes) == serial
    assert begun_twice(tmp_path / "log") == {3: 2, 11: 2}
    assert len({process for _, process in done(tmp_path / "log")}) >= 3


def test_a_worker_killed_from_outside_in_the_middle(tmp_path, serial):
    def kill():
        wait_until(lambda: len(done(log)) >= 6)
        os.kill(done(log)[-1][1], signal.SIGKILL)

    log = tmp_path / "log"
    killer = threading.Thread(target=kill)
    with team(2) as helpers:
        killer.start()
        outcomes = runner(tmp_path, helpers, pause=0.05).sweep(cases(20), timed=False)
    killer.join()
    assert numbers(outcomes) == serial
    assert sum(begun_twice(log).values()) <= 2
    assert len(done(log)) <= 21


def test_a_run_that_kills_each_worker_is_a_row_with_the_reason(tmp_path, serial):
    with team(2) as helpers:
        outcomes = runner(tmp_path, helpers, deaths={5: 9}).sweep(cases(8), timed=False)
    bad = outcomes[4].solution.status
    assert bad.code == "failed"
    assert "signal 9" in bad.message
    assert begun_twice(tmp_path / "log") == {5: 2}
    others = [n for k, n in enumerate(numbers(outcomes)) if k != 4]
    assert others == [n for k, n in enumerate(serial[:8]) if k != 4]
    repaired = runner(tmp_path).sweep(cases(8), timed=False)  # it was not kept
    assert numbers(repaired) == serial[:8]


ASKS = """
import sys
from shared_sweep import cases, runner
from studies.engine.running.team import team

with team(2) as helpers:
    runner(sys.argv[1], helpers, pause=0.2).sweep(cases(20), timed=False)
"""


def test_workers_end_with_who_asks_and_nothing_finished_is_lost(tmp_path, serial):
    """A script without `if __name__ == "__main__"`, killed in the middle."""
    log = tmp_path / "log"
    (tmp_path / "asks.py").write_text(ASKS)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    asking = subprocess.Popen([sys.executable, tmp_path / "asks.py", tmp_path], env=environment)
    wait_until(lambda: len(list((tmp_path / "runs").glob("*.run"))) >= 4)
    asking.kill()
    asking.wait()
    wait_until(lambda: not any(alive(process) for _, process in done(log)))
    kept = len(list((tmp_path / "runs").glob("*.run")))
    before = len(done(log))
    outcomes = runner(tmp_path).sweep(cases(20), timed=False)
    assert numbers(outcomes) == serial
    assert len(done(log)) - before == 20 - kept


def alive(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_an_interrupt_ends_the_workers_and_keeps_what_is_done(tmp_path, serial):
    def told(label, count, total):
        if count == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), team(2) as helpers:
        runner(tmp_path, helpers, pause=0.05, on_job=told).sweep(cases(20), timed=False)
    assert not any(alive(process) for _, process in done(tmp_path / "log"))
    assert len(list((tmp_path / "runs").glob("*.run"))) >= 4
    outcomes = runner(tmp_path).sweep(cases(20), timed=False)
    assert numbers(outcomes) == serial
    assert sum(begun_twice(tmp_path / "log").values()) <= 2 * (4 + 2)  # were out; and two fail each time


def test_the_pool_gives_up_only_the_call_whose_process_died():
    with WorkerPool(2) as pool:
        futures = [
            pool.submit(os.kill, 0, 0),
            pool.submit(os._exit, 7),
            pool.submit(abs, -3),
            pool.submit(int, "x"),
        ]
        assert futures[0].result(LIMIT) is None
        with pytest.raises(WorkerDied, match="exit code 7"):
            futures[1].result(LIMIT)
        assert futures[2].result(LIMIT) == 3
        with pytest.raises(ValueError, match="invalid literal"):
            futures[3].result(LIMIT)
        assert len(pool.processes) <= 2
    assert pool.processes == ()


# --- times ---------------------------------------------------------------------------------------------------


def overlap(one, other):
    return one.machine == other.machine and one.begin < other.end and other.begin < one.end


def test_no_time_is_taken_while_another_run_is_at_work(tmp_path):
    """Intervals of all runs of two sessions at once, one of them with workers, that use one store."""
    sessions = {}

    def session(name, first, workers):
        with team(workers) as helpers:
            mine = runner(tmp_path, helpers, pause=0.02, repeats=2)
            every = [replace(c, mesh=(first + c.mesh[0],)) for c in cases(6)]
            sessions[name] = mine, mine.sweep(every)

    both = [threading.Thread(target=session, args=a) for a in (("a", 100, 2), ("b", 200, None))]
    for thread in both:
        thread.start()
    for thread in both:
        thread.join(LIMIT)
    outcomes = [o for _, found in sessions.values() for o in found if o.solution.status.ok]
    timed = [s.interval for o in outcomes for s in o.samples]
    shared = [interval for mine, _ in sessions.values() for interval in mine.spread]
    assert len(timed) == 2 * len(outcomes) >= 20
    assert len(shared) == 6
    assert {i.process for i in timed} == {os.getpid()}
    assert os.getpid() not in {i.process for i in shared}
    everything = [*timed, *shared]
    assert not [(a, b) for a in timed for b in everything if a is not b and overlap(a, b)]


def test_turns_hold_between_processes_and_are_given_back_by_the_dead(tmp_path):
    """A process that runs together with others keeps whoever measures waiting, until it is killed."""
    turns = Turns.of(tmp_path, pytest.fail)
    program = (
        "import sys, time; from studies.engine.running.turns import Turns\n"
        f"with Turns({turns.name!r}).together():\n    print('has it', flush=True)\n    time.sleep(600)"
    )
    other = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert other.stdout.readline() == "has it\n"
    got = threading.Event()

    def measure():
        with turns.alone():
            got.set()

    waiting = threading.Thread(target=measure)
    waiting.start()
    with Turns.of(tmp_path / "other", pytest.fail).alone():  # of another store
        assert not got.wait(0.3)
    other.kill()
    other.communicate()
    assert got.wait(LIMIT)
    waiting.join()


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="this system pins no process")
def test_times_are_taken_on_one_core_and_it_is_given_back(tmp_path):
    seen, before = [], os.sched_getaffinity(0)
    mine = runner(tmp_path)
    solve = mine.resolve("stub")

    def look(scene, run):
        seen.append((run.t_end < 1.0, os.sched_getaffinity(0)))
        return solve(scene, run)

    mine.resolve = lambda name: look
    mine.sweep(cases(2))
    assert [len(cores) == 1 for warms_up, cores in seen if not warms_up] == [True, True]
    assert os.sched_getaffinity(0) == before


def test_a_run_whose_time_is_not_known_is_timed_later_and_computed_no_more(tmp_path, serial):
    with team(2) as helpers:
        runner(tmp_path, helpers).sweep(cases(6), timed=False)
    assert len(done(tmp_path / "log")) == 6
    later = runner(tmp_path, repeats=3).sweep(cases(6))
    assert numbers(later) == serial[:6]
    assert [process for _, process in done(tmp_path / "log")[6:]] == [os.getpid()] * 18
    assert [[c.cpu_s for c in o.costs] for o in later] == [[1e-3 * n] * 3 for n in range(1, 7)]
    runner(tmp_path, repeats=3).sweep(cases(6))
    assert len(done(tmp_path / "log")) == 24


def test_times_of_two_machines_are_never_mixed(tmp_path, monkeypatch):
    for name in ("one", "two", "one"):
        monkeypatch.setenv(provenance.NAMED, name)
        outcomes = runner(tmp_path, repeats=2).sweep(cases(3))
        assert {s.interval.machine for o in outcomes for s in o.samples} == {name}
        assert [len(o.samples) for o in outcomes] == [2, 2, 2]
    # solutions once; times once on each machine, the first of which gave the solutions
    assert Counter(n for n, _ in done(tmp_path / "log")) == {1: 4, 2: 4, 3: 4}


# --- code, options -------------------------------------------------------------------------------------------


def test_a_worker_with_other_code_is_refused():
    mine = runner("unused")
    errand = mine._errand(cases(1)[0])
    assert set(errand.code) == {"studies.engine.running.trial"}
    with pytest.raises(OtherCode, match=r"source of studies\.engine\.running\.trial"):
        work(replace(errand, code=dict.fromkeys(errand.code, "edited")))
    with pytest.raises(OtherCode, match="numpy 0 is needed"):
        work(replace(errand, software="numpy 0"))


#: Drives of a module that only this process has on its path, and what that imports from another.
NEIGHBOURS = {
    "farther": "RATE = 0.1\n\n\ndef turned(rate, t):\n    return rate * t * t, 2 * rate * t, 2 * rate\n",
    "neighbour": "from dataclasses import dataclass\n\nimport farther\nfrom farther import turned\n\n\n"
    "@dataclass(frozen=True)\nclass Turn:\n    rate: float\n\n"
    "    def __call__(self, t):\n        return farther.turned(self.rate, t)\n\n\n"
    "def turn(t):\n    return turned(farther.RATE, t)\n",
}


@pytest.mark.parametrize("drive", ["neighbour.Turn(0.1)", "neighbour.turn", "lambda t: neighbour.turn(t)"])
def test_code_that_workers_cannot_find_goes_along(drive, tmp_path, monkeypatch):
    """Modules beside a user's file: of functions they did not, and the sweep ended with ModuleNotFoundError."""
    for name, text in NEIGHBOURS.items():
        (tmp_path / f"{name}.py").write_text(text)
    with monkeypatch.context() as patch:
        patch.syspath_prepend(tmp_path)
        import neighbour
    angle = eval(drive, {"__name__": "<run_path>", "neighbour": neighbour})
    joint = replace(shared_sweep.SCENE.joints[0], angle=angle)
    driven = replace(shared_sweep.SCENE, joints=(joint,))
    with team(2) as helpers:
        (outcome,) = runner(tmp_path, helpers).sweep(cases(1, driven), timed=False)
    for name in NEIGHBOURS:
        del sys.modules[name]
    assert outcome.solution.status.ok
    assert os.getpid() not in {process for _, process in done(tmp_path / "log")}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--workers", "0"], "--workers has '0'; allowed are whole numbers from 1"),
        (["--workers", "-2"], "--workers has '-2'"),
        (["--workers", "two"], "--workers has 'two'"),
        (["--workers", "1.5"], "--workers has '1.5'"),
        (["--workers", "2", "--cluster", "tcp://x:1"], "workers are 2 beside cluster 'tcp://x:1'"),
    ],
)  # fmt: skip
def test_options_are_refused_by_name_before_any_work(options, said, tmp_path):
    for command in (["study", "convergence", "--quick"], ["report", "--quick"]):
        out = tmp_path / "out"
        told = CliRunner().invoke(app, [*command, *options, "--out", str(out)], env={"COLUMNS": "200"})
        assert told.exit_code == 2
        assert said in " ".join(told.output.split())
        assert not list(out.glob("*")) if out.exists() else True


@pytest.mark.parametrize("workers", [0, -1, 1.5, True, "2"])
def test_a_team_of_no_such_number_is_refused(workers):
    with pytest.raises(SweepError, match="whole number from 1 on"), team(workers):
        pytest.fail("it must not begin")


def test_progress_says_how_many_workers(tmp_path):
    told = []
    with team(2) as helpers:
        mine = runner(tmp_path, helpers, on_job=lambda *what: told.append(what))
        mine.sweep(cases(3), timed=False)
    assert {label for label, _, _ in told} == {
        f"2 workers: cantilever-fall · stub {n} cable generalized-alpha" for n in (1, 2, 3)
    }
    assert [(count, total) for _, count, total in told] == [(1, 3), (2, 3), (3, 3)]
    with team(1) as helpers:
        assert helpers is None
