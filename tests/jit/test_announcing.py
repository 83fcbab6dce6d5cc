"""What is said of compiling: once at its beginning, once at its end, also by processes that work together."""

import os
import re
import subprocess
import sys

import pytest
from numba.core import config

from anctmm.jit.announcing import Compiling

SOURCE = '''
import time

from anctmm.jit import announcing
from anctmm.jit.compiling import kernel
from numba.extending import overload

announcing.PATIENCE = 0.1


def slow(x):
    """Takes long to compile."""


@overload(slow)
def _slow(x):
    time.sleep(0.5)
    return lambda x: 2.0 * x


@kernel
def one(x):
    return slow(x)


@kernel
def two(x):
    return slow(x) + 1.0


def jobs():
    return [lambda: one(1.0), lambda: two(1.0)]
'''
HERE = "print([job() for job in jobs()])"
COPIES = """
from studies.engine.running.processes import side_by_side
print([found for _, found in sorted(side_by_side(jobs(), 2))])
"""
WORKERS = """
import kernels
from studies.engine.running.pool import WorkerPool
with WorkerPool(2) as pool:
    found = [pool.submit(one, 1.0), pool.submit(two, 1.0)]
    print([f.result() for f in found])
"""
AFTER = HERE + COPIES


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")
@pytest.mark.parametrize(
    ("program", "processes"),
    [(HERE, 1), (COPIES, 2), (WORKERS, 2), (AFTER, 1)],
    ids=["here", "copies", "workers", "after"],
)
def test_the_beginning_and_the_whole_are_said_once(program, processes, tmp_path):
    """However many processes compile; those that end before the others count too."""
    (tmp_path / "kernels.py").write_text(SOURCE)
    script = tmp_path / "script.py"
    script.write_text(
        f"from kernels import *\nif __name__ == '__main__':\n{re.sub('^', '    ', program.strip(), flags=re.M)}\n"
    )
    environment = {**os.environ, "ANCTMM_CACHE": str(tmp_path / "cache"), "TMPDIR": str(tmp_path)}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, [str(tmp_path), *sys.path]))
    run = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True, timeout=240
    )
    assert run.returncode == 0, run.stderr
    assert set(run.stdout.splitlines()) == {"[2.0, 3.0]"}
    begun, whole = run.stderr.splitlines()
    assert begun.startswith("anctmm: compiling kernels.")
    found = re.fullmatch(r"anctmm: 2 kernels were compiled in (\d+\.\d) s(, the sum of 2 processes)?", whole)
    assert found, whole
    assert float(found[1]) >= 0.5
    assert bool(found[2]) == (processes == 2)
    assert not list(tmp_path.glob("anctmm-compiling-*"))


def test_where_no_word_can_be_left_each_process_tells_for_itself(monkeypatch, capsys):
    def refused(prefix):
        raise PermissionError(prefix)

    monkeypatch.setattr("tempfile.mkdtemp", refused)
    one = Compiling(seconds=2.0, kernels=1)
    one.together()
    one._say("a.kernel")
    one.total()
    begun, whole = capsys.readouterr().err.splitlines()
    assert begun.startswith("anctmm: compiling a.kernel and other kernels")
    assert whole == "anctmm: 1 kernel was compiled in 2.0 s"
