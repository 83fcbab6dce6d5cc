"""Motion of quintic cables beside the global DAE: every joint, load and mixture of kinds, explicit and implicit.

Interpreted, for what `test_random_scenes` says.
"""

import json
import os
import subprocess
import sys

import planted
import quintic_against_dae

SCRIPT = planted.TABLE.with_name("quintic_against_dae.py")
#: Largest difference of a coordinate, m or 1, that rounding and Newton's tolerance may make.
ALLOWED = {"zhai": 1e-13, "generalized-alpha": 1e-9}


def test_motions_are_those_of_the_global_dae():
    done = subprocess.run(
        [sys.executable, SCRIPT],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(planted.ROOT)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert len(found) == 2 * len(quintic_against_dae.SCENES)
    for name, (ends, apart) in found.items():
        assert ends == "ok ok", name
        assert apart < ALLOWED[name.rpartition(": ")[2]], (name, apart)
