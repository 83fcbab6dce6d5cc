"""Sweeps on a dask.distributed cluster, whose scheduler and workers the tests start on this machine."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import suppress

import pytest
from shared_sweep import cases, done, numbers, runner, wait_until
from typer.testing import CliRunner

from studies.cli import app
from studies.engine.running import team as teams
from studies.engine.running.team import SweepError, team

pytest.importorskip("distributed", reason="dask.distributed is not installed")

#: A run whose worker dies is given to another once.
SETTINGS = {
    "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1",
    "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "5s",
}


def begin(what, folder, *arguments):
    command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--no-dashboard", *map(str, arguments)]
    paths = {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p and "helpers" not in p)}
    log = (folder / f"{what}.log").open("ab")
    with log:
        return subprocess.Popen(
            command,
            env=os.environ | paths | SETTINGS,
            cwd=folder,
            stdout=log,
            stderr=log,
            start_new_session=True,
        )


def end(process):
    """End a process and those it began."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


class Cluster:
    """A scheduler and so many workers."""

    def __init__(self, folder, workers):
        self.folder, file = folder, folder / "scheduler.json"
        self.scheduler = begin(
            "scheduler", folder, "--host", "127.0.0.1", "--port", 0, "--scheduler-file", file
        )
        self.workers = []
        wait_until(lambda: file.exists() and file.read_text().strip())
        self.address = json.loads(file.read_text())["address"]
        for _ in range(workers):
            self.join()

    def join(self):
        place = self.folder / f"worker{len(self.workers)}"
        place.mkdir()
        self.workers.append(begin("worker", place, self.address, "--nthreads", 1, "--local-directory", place))

    def end(self):
        for process in (*self.workers, self.scheduler):
            end(process)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A cluster of two workers, each with a nanny that begins another where one dies."""
    made = Cluster(tmp_path_factory.mktemp("cluster"), 2)
    yield made
    made.end()


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """What one process computes."""
    return numbers(runner(tmp_path_factory.mktemp("serial")).sweep(cases(20)))


def both_there(helpers):
    wait_until(lambda: helpers.size() == 2)


def test_a_cluster_shares_a_sweep_and_times_are_measured_here(cluster, tmp_path, serial):
    log, told = tmp_path / "log", []
    with team(cluster=cluster.address) as helpers:
        both_there(helpers)
        mine = runner(tmp_path, helpers, meet=2, on_job=lambda label, *_: told.append(label))
        outcomes = mine.sweep(cases(20))
    assert numbers(outcomes) == serial
    theirs, ours = ([n for n, p in done(log) if (p == os.getpid()) == here] for here in (False, True))
    assert sorted(theirs) == list(range(1, 21))
    assert sorted(ours) == sorted(set(range(1, 21)) - {7, 14})  # of those that end well a time each
    assert len({p for _, p in done(log)}) == 3
    first = min(k for k, (_, p) in enumerate(done(log)) if p == os.getpid())
    assert first == 20  # all solutions came before the first time
    timed = [s.interval for o in outcomes for s in o.samples]
    assert len(timed) == 18
    assert max(i.end for i in mine.spread) <= min(i.begin for i in timed)
    begins = f"2 workers of {cluster.address}: cantilever-fall · stub "
    assert [label.startswith(begins) for label in told[:20]] == [True] * 20


def test_a_worker_of_the_cluster_killed_in_the_middle_costs_the_run_it_hit(cluster, tmp_path, serial):
    log = tmp_path / "log"

    def kill():
        wait_until(lambda: len(done(log)) >= 8)
        victim = done(log)[-1][1]
        time.sleep(0.4)  # until its last answer is fetched, and it is in the middle of the next run
        os.kill(victim, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    with team(cluster=cluster.address) as helpers:
        both_there(helpers)
        killer.start()
        outcomes = runner(tmp_path, helpers, pause=0.6).sweep(cases(20), timed=False)
    killer.join()
    assert numbers(outcomes) == serial
    again = {n: count for n, count in Counter(n for n, _ in done(log)).items() if count > 1}
    assert list(again.values()) == [2]
    assert len({p for _, p in done(log)}) >= 2


def test_a_run_that_kills_each_worker_of_the_cluster_is_a_row(cluster, tmp_path, serial):
    with team(cluster=cluster.address) as helpers:
        both_there(helpers)
        outcomes = runner(tmp_path, helpers, pause=0.02, deaths={5: 9}).sweep(cases(8), timed=False)
    assert outcomes[4].solution.status.code == "failed"
    assert "died" in outcomes[4].solution.status.message
    assert Counter(n for n, _ in done(tmp_path / "log"))[5] == 2
    others = [n for k, n in enumerate(numbers(outcomes)) if k != 4]
    assert others == [n for k, n in enumerate(serial[:8]) if k != 4]


def test_a_cluster_that_ends_is_an_error_and_what_was_done_is_kept(tmp_path, serial):
    """The scheduler and its workers are killed in the middle of a sweep, which then goes on without."""
    log, folder = tmp_path / "log", tmp_path / "cluster"
    folder.mkdir()
    cluster = Cluster(folder, 1)

    def kill():
        wait_until(lambda: len(done(log)) >= 5)
        cluster.end()

    killer = threading.Thread(target=kill)
    try:
        with team(cluster=cluster.address) as helpers:
            killer.start()
            mine = runner(tmp_path, helpers, pause=0.1)
            with pytest.raises(SweepError, match=re.escape(cluster.address)):
                mine.sweep(cases(20), timed=False)
    finally:
        killer.join()
    kept = len(list((tmp_path / "runs").glob("*.run")))
    assert kept >= 3
    before = len(done(log))
    assert numbers(runner(tmp_path).sweep(cases(20), timed=False)) == serial
    assert len(done(log)) - before == 20 - kept


def test_a_cluster_that_cannot_be_reached_is_named_before_any_work(tmp_path, monkeypatch):
    monkeypatch.setattr(teams, "PATIENCE", 1.0)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    for address in (f"tcp://127.0.0.1:{port}", "tcp://127.0.0.1:none", "nonsense://x", ""):
        command = ["study", "convergence", "--quick", "--cluster", address, "--out", str(tmp_path)]
        told = CliRunner().invoke(app, command, env={"COLUMNS": "300"})
        assert told.exit_code == 2
        assert f"cluster {address!r} cannot be reached" in told.output
        assert "tcp://host:8786" in told.output
    assert not list(tmp_path.iterdir())


def test_a_cluster_without_workers_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(teams, "PATIENCE", 1.0)
    empty = Cluster(tmp_path, 0)
    try:
        message = rf"{re.escape(empty.address)}.* has no workers; .* dask worker"
        with pytest.raises(SweepError, match=message), team(cluster=empty.address):
            pytest.fail("it must not begin")
    finally:
        empty.end()


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    message = r"cluster 'tcp://x:1' needs dask.distributed, .* pip install 'anctmm\[cluster\]'"
    with pytest.raises(SweepError, match=message), team(cluster="tcp://x:1"):
        pytest.fail("it must not begin")
