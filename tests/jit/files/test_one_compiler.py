"""Processes that need the same kernel at the same time: one compiles it."""

import os
import subprocess
import sys
import threading
import time

import pytest
from numba.core import config

from anctmm.jit.files import one_compiler
from anctmm.jit.files.one_compiler import LOCK, alone, is_taken

SOURCE = '''
import sys, time
from pathlib import Path

from anctmm.jit.compiling import kernel
from numba.extending import overload


def slow(x):
    """Takes long to compile."""


@overload(slow)
def _slow(x):
    Path(sys.argv[1]).touch()  # compiling has begun
    time.sleep(1.0)
    return lambda x: 2.0 * x


@kernel
def inner(x):
    return slow(x)


@kernel
def outer(x):
    return inner(x) + 1.0


if __name__ == "__main__":
    value = globals()[sys.argv[2]](3.0)
    print(value, sum(inner._cache_misses.values()), sum(outer._cache_misses.values()))
'''


@pytest.fixture
def start(tmp_path):
    """Starts a process that calls a kernel, and makes a file where it begins to compile."""
    program = tmp_path / "program.py"
    program.write_text(SOURCE)
    environment = {**os.environ, "ANCTMM_CACHE": str(tmp_path / "cache")}
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
    running = []

    def begin(name, kernel):
        command = [sys.executable, str(program), str(tmp_path / name), kernel]
        running.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment))
        return running[-1]

    yield begin
    for one in running:
        one.kill()
        one.wait()
        one.stdout.close()


def until(happens):
    """Wait for something, not for ever."""
    end = time.monotonic() + 120.0
    while not happens():
        assert time.monotonic() < end
        time.sleep(0.01)


def left(place):
    return list(place.rglob(f"*{LOCK}"))


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")
@pytest.mark.parametrize("second", ["outer", "inner"])
def test_a_kernel_that_another_process_compiles_is_waited_for(start, tmp_path, second):
    """Also where one of the two wants only what the kernel calls."""
    one = start("one", "outer")
    until((tmp_path / "one").exists)
    two = start("two", second)
    assert one.communicate()[0].split() == ["7.0", "1", "1"]
    value, *compiled = two.communicate()[0].split()
    assert (float(value), compiled) == (7.0 if second == "outer" else 6.0, ["0", "0"])
    assert not (tmp_path / "two").exists()
    assert not left(tmp_path)


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")
def test_a_process_that_ends_while_it_compiles_leaves_the_kernel_to_the_next(start, tmp_path):
    one = start("one", "outer")
    until((tmp_path / "one").exists)
    two = start("two", "outer")
    one.kill()
    assert two.communicate()[0].split() == ["7.0", "1", "1"]
    assert not left(tmp_path)


def test_nobody_waits_for_what_is_there_or_kept_nowhere(tmp_path):
    there = tmp_path / "there"
    there.touch()
    for file in (there, None, tmp_path / "gone" / "file"):
        with alone(file):
            assert not left(tmp_path)


def test_where_files_cannot_be_locked_each_compiles_for_itself(tmp_path, monkeypatch):
    def refused(handle, how):
        raise OSError("no locks here")

    with monkeypatch.context() as patch:
        patch.setattr(one_compiler.fcntl, "flock", refused)
        with alone(tmp_path / "file"):
            pass
    monkeypatch.setattr(one_compiler, "fcntl", None)
    with alone(tmp_path / "other"):
        assert not (tmp_path / f"other{LOCK}").exists()


def test_a_process_that_does_not_go_on_is_not_waited_for_for_ever(tmp_path, monkeypatch):
    """Nor is its lock taken away."""
    monkeypatch.setattr(one_compiler, "PATIENCE", 0.1)
    file, inside, done = tmp_path / "file", threading.Event(), threading.Event()

    def hold():
        with alone(file):
            inside.set()
            done.wait(60.0)

    thread = threading.Thread(target=hold)
    thread.start()
    assert inside.wait(60.0)
    with alone(file):
        assert left(tmp_path)
    assert left(tmp_path)
    done.set()
    thread.join()
    assert not left(tmp_path)


def test_a_kernel_is_taken_while_it_is_made_and_when_it_is_there(tmp_path):
    file = tmp_path / "kernel"
    assert not is_taken(file)
    with alone(file):
        assert is_taken(file)
        assert not is_taken(tmp_path / "another")
    assert not is_taken(file)
    (tmp_path / f"kernel{LOCK}").touch()  # left by a process that died
    assert not is_taken(file)
    file.touch()
    assert is_taken(file)
    assert not is_taken(None)
