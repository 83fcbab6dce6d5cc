"""Stored histories of small scenes beside the global DAE: NUMBA_DISABLE_JIT=1 python small_against_dae.py

Prints as JSON, by task, how far the displacements lie apart, relative to the largest but 1 m at least; and by limit of
the step, how the global DAE ends below and above it.
"""

import json
from dataclasses import replace

import numpy as np

from studies.regression.check import BASELINES
from studies.regression.history import read_baseline
from studies.regression.scenes import FromRest, Static, Task, tasks_of
from studies.regression.small_watches import LIMITS, small_watches
from studies.regression.tolerance import simulate


def main() -> None:
    """Both tables."""
    tasks = [t for t in tasks_of(small_watches()) if t.solver == "anctmm" and _taken(t)]
    apart = {t.name: _apart(t) for t in tasks if t.ends == "ok"}
    ends = {
        name: [_status(t) for t in tasks if t.run_name.endswith(f"-limit-{name}")]
        for name in LIMITS
        if name != "rigid"
    }
    print(json.dumps([apart, ends]))


def _taken(task: Task) -> bool:
    """Whether the global DAE takes a task: no tolerance, path, start, rigid bars or implicit damping."""
    run = task.run
    if isinstance(run, Static):
        return task.times is not None
    if isinstance(run, FromRest):
        return False
    rigid = "rigid" in {kind for _, kind in run.of(task.scene).values()}
    if run.tolerance is not None or rigid or "loose" in task.run_name:
        return False
    return run.integrator == "zhai" or not any(b.material.damping for b in task.scene.beams)


def _apart(task: Task) -> float:
    stored = read_baseline(task.path(BASELINES)).history.of_quantity("displacement")
    found = simulate(replace(task, solver="global-dae"))
    if not found.status.ok:
        raise SystemExit(f"{task.name}: {found.status}")
    mine = np.concatenate([found.displacement(probe) for probe in task.probes], axis=1)
    return float(np.abs(mine - stored).max() / max(1.0, np.abs(stored).max()))


def _status(task: Task) -> str:
    return simulate(replace(task, solver="global-dae")).status.code


if __name__ == "__main__":
    main()
