"""Run of an analysis by OpenSees in a separate process, and its output, even if the process crashes."""

import json
import os
import signal
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
#: Lines of what OpenSees has printed that a message repeats.
LINES = 3


@dataclass(frozen=True)
class Analysis:
    """What an analysis has left.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times (s) or load factors.
    displacements : ndarray, shape (n, nodes, 3)
        Along x and y (m), and rotations (rad).
    velocities : ndarray, shape (n, nodes, 3), or None
        Their rates, of a motion.
    steps : int
        Steps done.
    cpu, wall, whole : float
        Processor and wall time of the steps, and processor time of the whole process, s.
    trouble : str
        Why it ended before its end; empty if it did not.
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
        if "ImportError" in ended.stderr:
            raise not_installed(PACKAGES, _last_lines(ended.stderr))
        rows = Path(folder, "rows")
        numbers = np.fromfile(rows) if rows.exists() else np.empty(0)
        end_file = Path(folder, "end.json")
        end = json.loads(end_file.read_text()) if ended.returncode == 0 and end_file.exists() else None
    return _read(job, numbers, end, ended)


def _read(
    job: dict[str, Any], numbers: Array, end: dict[str, Any] | None, ended: subprocess.CompletedProcess[str]
) -> Analysis:
    nodes, parts = len(job["nodes"]), 1 if job["static"] else 2
    width = 1 + 3 * nodes * parts
    rows = numbers[: len(numbers) // width * width].reshape(-1, width)
    finite = np.isfinite(rows).all(axis=1)
    rows = rows[: len(rows) if finite.all() else int(np.argmin(finite))]
    states = rows[:, 1:].reshape(len(rows), parts, nodes, 3)
    velocities = None if job["static"] else states[:, 1]
    if end is None:
        nan = float("nan")
        trouble = f"the process of OpenSees was ended {_by_what(ended)}"
        return Analysis(rows[:, 0], states[:, 0], velocities, max(len(rows) - 1, 0), nan, nan, nan, trouble)
    trouble = "" if not end["code"] else "OpenSees' Newton iteration did not converge"
    return Analysis(
        rows[:, 0], states[:, 0], velocities, end["steps"], end["cpu"], end["wall"], end["whole"], trouble
    )


def _by_what(ended: subprocess.CompletedProcess[str]) -> str:
    told = _last_lines(ended.stderr)
    said = f": {told}" if told else ""
    if ended.returncode < 0:
        return f"by signal {-ended.returncode} ({signal.strsignal(-ended.returncode)}){said}"
    return f"with exit code {ended.returncode}{said}"


def _last_lines(text: str) -> str:
    lines = [" ".join(line.split()) for line in text.splitlines() if line.strip()]
    return "; ".join(lines[-LINES:])
