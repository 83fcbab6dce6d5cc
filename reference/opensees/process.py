"""Run of an analysis by OpenSees in a separate process, and its output, even if the process crashes."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.adapters import not_installed

Array = NDArray[np.float64]

WORKER = Path(__file__).with_name("worker.py")
#: Packages of OpenSees, of which one is needed; the same numbers were found by both.
PACKAGES = ("opensees", "openseespy")
#: Linear algebra inside OpenSees on one thread, as everywhere here.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@dataclass(frozen=True)
class Analysis:
    """What an analysis has left.

    Times (s) or load factors, (n,); displacements along x and y (m) and rotations (rad), (n, nodes, 3), and their
    rates, None in statics; steps done; processor and wall time of the steps, and processor time of the whole process,
    s; why it ended before its end, empty if it did not.
    """

    t: Array
    displacements: Array
    velocities: Array | None
    steps: int
    cpu: float
    wall: float
    whole: float
    trouble: str


def analyse(job: dict[str, Any]) -> Analysis:
    """Do a job of `reference.opensees.frame` in a process of its own.

    Raises
    ------
    UnsupportedError
        If OpenSees is not installed, or cannot be loaded.
    """
    with TemporaryDirectory(prefix="opensees-") as folder:
        ended = subprocess.run(
            [sys.executable, "-P", str(WORKER), folder],
            input=json.dumps(job), text=True, errors="replace", capture_output=True, env=os.environ | ONE_THREAD,
            check=False,
        )  # fmt: skip
        said = ended.stderr.strip().splitlines()[-1:]
        if "ImportError" in ended.stderr:
            raise not_installed(PACKAGES, said[0])
        rows, end_file = Path(folder, "rows"), Path(folder, "end.json")
        numbers = np.fromfile(rows) if rows.exists() else np.empty(0)
        end = json.loads(end_file.read_text()) if ended.returncode == 0 and end_file.exists() else None
    t, states = _histories(job, numbers)
    velocities = None if job["static"] else states[:, 1]
    if end is None:
        trouble = f"the process of OpenSees was ended with exit code {ended.returncode}: {' '.join(said)}"
        nan = float("nan")
        return Analysis(t, states[:, 0], velocities, max(len(t) - 1, 0), nan, nan, nan, trouble)
    trouble = "OpenSees' Newton iteration did not converge" if end["code"] else ""
    return Analysis(t, states[:, 0], velocities, end["steps"], end["cpu"], end["wall"], end["whole"], trouble)


def _histories(job: dict[str, Any], numbers: Array) -> tuple[Array, Array]:
    """Times, (n,), and states, (n, 1 or 2, nodes, 3), as far as they are whole and finite."""
    shape = (1 if job["static"] else 2, len(job["nodes"]), 3)
    width = 1 + int(np.prod(shape))
    rows = numbers[: len(numbers) // width * width].reshape(-1, width)
    rows = rows[np.logical_and.accumulate(np.isfinite(rows).all(axis=1))]
    return rows[:, 0], rows[:, 1:].reshape(-1, *shape)
