"""A sweep that `test_interruption.py` runs in processes of their own, to kill them.

Arguments: directory of the finished runs, log, and what shall happen. Each line of the log is one thing done:
"ran 7" when the solver has done mesh 7, "kept 7" once its result is kept; what is kept is printed at the end.
"""

import os
import signal
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import typer
from shared_sweep import SCENE, write

from anctmm.results.fields import HermiteField
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from studies.cli import sweeping
from studies.engine.runner import Runner
from studies.engine.running.trial import product
from studies.engine.storage import files

MESHES = range(1, 13)
#: s, of a run: long enough for a process to be killed in the middle of one.
PAUSE = 0.05


def cases():
    """Twelve runs."""
    return product(SCENE, ["slow"], [(n,) for n in MESHES], [0.05], t_end=1.0, output_dt=0.1)


def slow(log, scene, run):
    """A solver that takes its time and answers with half a megabyte."""
    if run.t_end < 1.0:  # the warm-up
        return answer(scene, run)
    time.sleep(PAUSE)
    write(log, f"ran {run.mesh}")
    return answer(scene, run)


def answer(scene, run):
    """Numbers that are the mesh's own."""
    t = np.arange(0.0, 1.01, 0.1)
    coordinates = np.random.default_rng(run.mesh).standard_normal((len(t), 1500, 2, 2))
    fields = {body.name: HermiteField(coordinates, body.length) for body in scene.bodies}
    return Solution(
        "slow", scene, run, t, fields, Energy.unknown(len(t)), Cost(1.0, 1.0, run.steps), Status(), 4
    )


def die_while_writing(n):
    """Be killed with half of the n-th file written."""
    usual, opened = os.fdopen, []

    class Half:
        def __init__(self, handle, mode):
            self.file = usual(handle, mode)

        def __enter__(self):
            opened.append(self)
            return self

        def __exit__(self, *error):
            self.file.close()

        def write(self, data):
            if len(opened) < n:
                return self.file.write(data)
            self.file.write(data[: len(data) // 2])
            self.file.flush()
            return os.kill(os.getpid(), signal.SIGKILL)

    files.os.fdopen = Half


def sweep(runner, log):
    """Run all cases and print what came of them."""
    runner.resolve = lambda name: partial(slow, log)
    runner.on_done = lambda case, done, total: write(log, f"kept {case.mesh[0]}")
    runner.key = lambda case: repr(case)
    for outcome in runner.sweep(cases()):
        print(outcome.case.mesh[0], repr(float(outcome.solution.position("beam", 1.0).sum())))


def main(directory, log, what):
    """Sweep, and be killed or interrupted."""
    if what == "interruptible":
        # what runs in the background of a shell ignores SIGINT, and so do its children: this one shall not
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.environ["ANCTMM_CACHE"] = directory
        try:
            with sweeping(True) as runner:
                sweep(runner, log)
        except typer.Exit as stop:
            sys.exit(stop.exit_code)
    else:
        if what.startswith("die"):
            die_while_writing(int(what[3:]))
        sweep(Runner(Path(directory), repeats=1), log)


if __name__ == "__main__":
    main(*sys.argv[1:])
