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


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")
def test_the_beginning_and_the_whole_are_said_once(tmp_path):
    program = HERE
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
    found = re.fullmatch(r"anctmm: 2 kernels were compiled in (\d+\.\d) s", whole)
    assert found, whole
    assert float(found[1]) >= 0.5
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
