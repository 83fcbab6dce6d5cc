"""What a newcomer waits for: whole processes with a first result, where no kernel is kept yet and where all are.

Times are those of a whole process, with Python's own start: of the clock, as the user waits, and of the processor, with
that of a second process that compiles beside the first one.
"""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd

from studies.benchmark.newcomer import NOTHING, STEPS
from studies.engine.measuring.clock import Effort, Samples, figures
from studies.engine.tables import Table

#: Scenes of `newcomer`; of a quick run. Rounds.
SCENES, QUICK_SCENES = ("beam", "tree", "plate", "spring"), ("beam",)
INTEGRATORS = tuple(STEPS)
ROUNDS, QUICK_ROUNDS = 3, 1
#: Kernels at the beginning of a process; a command that runs nothing.
EMPTY, KEPT, LIST = "none", "all", "anctmm list"
_NEWCOMER, _LIST = ("-m", "studies.benchmark.newcomer"), ("-m", "studies", "list")
_ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Process:
    """What one process took.

    Parameters
    ----------
    wall_s, cpu_s : float
        CPU time with that of processes that it began; NaN where the system does not tell.
    told : dict
        What it printed, see `newcomer.ran`; of a process that failed its `status` alone.
    files : int
        Kernels that were kept when it ended.
    """

    wall_s: float
    cpu_s: float
    told: dict[str, Any]
    files: int = 0


def first_results(effort: Effort, samples: Samples) -> Table:
    """Wall and CPU times of whole processes, with kernels to be compiled and without."""
    scenes, rounds = (QUICK_SCENES, QUICK_ROUNDS) if effort.quick else (SCENES, ROUNDS)
    found: dict[tuple[str, str, str], list[Process]] = {}
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else np.nan
    with TemporaryDirectory(prefix="anctmm-first-") as place:
        process(
            (*_NEWCOMER, NOTHING, "-"), place
        )  # brings files into memory, and keeps bytecode if Python may
        for _ in range(rounds):
            found.setdefault((LIST, "-", "-"), []).append(process(_LIST, place))
            for integrator in INTEGRATORS:
                for scene in scenes:
                    for kernels, one in zip((EMPTY, KEPT), _twice(scene, integrator), strict=True):
                        found.setdefault((scene, integrator, kernels), []).append(one)
    rows = [_row(*key, processes, load, samples) for key, processes in found.items()]
    notes = (
        "Each row: fresh processes of Python that load anctmm, build a scene and solve it (of `anctmm list`: the "
        "command), medians; rounds in turn. kernels_before: none, an empty directory of kernels; all, the same again.",
        "wall_s: as the user waits; cpu_s: of the process and of a second one that compiles beside it; spread: of "
        "the wall time. What is asked is asked of two processors that nobody else uses: load is the machine's before "
        "(processes that run or wait). Where it is as large as the number of processors no second process is begun.",
        "kernels, compile_s: compiled for the process itself, and how long it waited for that; files: kernels kept "
        "at its end, those of the second process and those that are parts of others among them.",
        "bytecode: whether Python keeps that of anctmm's modules (not where PYTHONDONTWRITEBYTECODE is set and no "
        "installer has made it): without it each process takes some 0.7 to 1 s more.",
    )
    return Table("first", "First results of a newcomer", pd.DataFrame(rows), notes)


def _twice(scene: str, integrator: str) -> tuple[Process, Process]:
    """A process that begins without kernels, and the same again."""
    with TemporaryDirectory(prefix="anctmm-first-") as place:
        one, two = (process((*_NEWCOMER, scene, integrator), place) for _ in range(2))
    return one, two


def process(arguments: Sequence[str], place: str) -> Process:
    """Run Python with arguments.

    Parameters
    ----------
    arguments : sequence of str
    place : str
        Directory of its kernels.
    """
    path = os.pathsep.join(filter(None, (str(_ROOT), os.environ.get("PYTHONPATH"))))
    environment = os.environ | {"ANCTMM_CACHE": place, "PYTHONPATH": path}
    cpu, begin = _children(), perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, check=False
    )
    wall, cpu = perf_counter() - begin, _children() - cpu
    files = sum(1 for _ in Path(place).rglob("*.kernel"))
    return Process(wall, cpu if cpu > 0.0 else np.nan, _told(done), files)


def _children() -> float:
    """CPU time of all processes that this one has begun and that have ended, s."""
    times = os.times()
    return times.children_user + times.children_system


def _told(done: "subprocess.CompletedProcess[str]") -> dict[str, Any]:
    """What a process printed; its last words if it failed."""
    if done.returncode:
        words = done.stderr.strip().splitlines() or ["nothing said"]
        return {"status": f"exit code {done.returncode}: {words[-1]}"}
    last = (done.stdout.strip().splitlines() or [""])[-1]
    told: dict[str, Any] = json.loads(last) if last.startswith("{") else {"status": "ok"}
    return told


def _row(
    scene: str, integrator: str, kernels: str, processes: Sequence[Process], load: float, samples: Samples
) -> dict[str, Any]:
    """Medians of the processes of one kind."""
    name = f"{scene}, {integrator}, kernels before: {kernels}"
    wall, cpu = ([1e9 * getattr(p, what) for p in processes] for what in ("wall_s", "cpu_s"))
    samples.keep("first, wall time of a process", name, wall)
    samples.keep("first, CPU time of a process", name, cpu)
    told = processes[-1].told
    shown, bytecode = figures(wall), told.get("bytecode")
    bad = [p.told["status"] for p in processes if p.told["status"] != "ok"]
    return {
        "scene": scene, "integrator": integrator, "kernels_before": kernels,
        "wall_s": 1e-9 * shown["ns"], "cpu_s": 1e-9 * figures(cpu)["ns"], "spread": shown["spread"],
        "repeats": shown["repeats"], "kernels": told.get("kernels", np.nan),
        "compile_s": float(np.median([p.told.get("compile_s", np.nan) for p in processes])),
        "files": processes[-1].files if kernels in (EMPTY, KEPT) else np.nan, "steps": told.get("steps", np.nan),
        "bytecode": "-" if bytecode is None else "kept" if bytecode else "not kept", "load": load,
        "status": bad[0] if bad else "ok",
    }  # fmt: skip
