"""A sweep that tests share among workers: a solver that says what it does, and may die, wherever it runs."""

import os
import signal
import time
from functools import partial
from pathlib import Path

import numpy as np

from anctmm.results.fields import HermiteField
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from studies.engine.runner import Runner
from studies.engine.running.trial import product
from studies.scenes import cantilever_fall

SCENE = cantilever_fall().scene
#: Longest wait for what workers do, s.
LIMIT = 120.0


def cases(count, scene=SCENE):
    """Runs of one kind."""
    return product(scene, ["stub"], [(n,) for n in range(1, count + 1)], [0.05], t_end=1.0, output_dt=0.1)


def write(log, line):
    """One line at once, whoever else writes."""
    handle = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.write(handle, f"{line}\n".encode())
    os.close(handle)


def lines(log):
    """Words of each line written so far."""
    return [line.split() for line in log.read_text().splitlines()] if log.exists() else []


def done(log):
    """Mesh and process of each run that was begun, without those that only warm up."""
    return [(int(n), int(process)) for what, n, process in lines(log) if what == "begun"]


def stub(log, pause, deaths, meet, scene, run):
    """A solver: numbers that are the mesh's own. On a mesh of `deaths` it is killed as often as that says.

    It ends when runs were begun by `meet` processes.
    """
    warms_up = run.t_end < 1.0
    write(log, f"{'warm' if warms_up else 'begun'} {run.mesh} {os.getpid()}")
    if not warms_up:
        tried = sum(n == run.mesh for n, _ in done(log))
        if tried <= deaths.get(run.mesh, 0):
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(pause)
        while len({process for _, process in done(log)}) < meet:
            time.sleep(0.01)
        if run.mesh % 7 == 0:
            raise ValueError(f"a fault at {run.mesh}")
    t = np.arange(0.0, 1.01, 0.1)
    coordinates = np.random.default_rng(run.mesh).standard_normal((len(t), 50, 2, 2))
    fields = {body.name: HermiteField(coordinates, body.length) for body in scene.bodies}
    cost = Cost(1e-3 * run.mesh, 1e-3, run.steps, 2 * run.steps)
    return Solution("stub", scene, run, t, fields, Energy.unknown(len(t)), cost, Status(), 4)


def resolver(log, pause=0.0, deaths=None, meet=1):
    """Who finds that solver."""
    return lambda name: partial(stub, log, pause, deaths or {}, meet)


def runner(folder, team=None, **options):
    """A runner with that solver, its log and its store in a folder."""
    given = {key: options.pop(key) for key in ("pause", "deaths", "meet") if key in options}
    made = Runner(
        Path(folder) / "runs", resolve=resolver(Path(folder) / "log", **given), team=team,
        **{"repeats": 1, "short": 0.0, "note": lambda text: None} | options,
    )  # fmt: skip
    made.key = repr  # the stub is code of a test
    return made


def numbers(outcomes):
    """All that a sweep computed, without what it cost."""
    return [
        (
            o.case.mesh, o.solution.t.tobytes(), str(o.solution.status), o.solution.dofs,
            o.solution.cost.steps, o.solution.cost.newton_iterations,
            {name: field.coordinates.tobytes() for name, field in o.solution.fields.items()},
        )
        for o in outcomes
    ]  # fmt: skip


def wait_until(true):
    """Until a function says so."""
    until = time.monotonic() + LIMIT
    while not true():
        assert time.monotonic() < until
        time.sleep(0.005)
