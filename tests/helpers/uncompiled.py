"""A script of this folder in a process of its own, in which Python runs all kernels."""

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent


def said_by(script: str, *arguments: object) -> str:
    """What a script prints; it must end well.

    Parameters
    ----------
    script : str
        Name of the file.
    *arguments : object
        Words of its command line.
    """
    done = subprocess.run(
        [sys.executable, HERE / script, *map(str, arguments)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(HERE.parents[1])},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
