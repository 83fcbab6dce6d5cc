"""Compiled kernels on disk: found again by another process, checked, and removed when nobody wants them."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numba
import pytest

from anctmm.jit.compiler import kernel_files
from anctmm.jit.compiler.kernel_files import DAYS, ENDING, ROOM, VERSIONS, remove_earlier, remove_unused

SOURCE = '''
"""A docstring."""
from anctmm.jit.compiling import kernel


@kernel
def inner(x):
    """A docstring."""
    return 2.0 * x


@kernel
def outer(x):
    return inner(x) + 1.0


def report():
    print(outer(3.0), sum(outer._cache_hits.values()), sum(outer._cache_misses.values()))
'''


@pytest.fixture
def run(tmp_path):
    """What a process reports that imports a module as it is now, beside the kernels of those before it."""

    def reported(source):
        (tmp_path / "edited.py").write_text(source)
        environment = {**os.environ, "ANCTMM_CACHE": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
        environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
        command = [sys.executable, "-c", "import edited; edited.report()"]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        return done.stdout.split()

    return reported


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="there are no kernels without a compiler")
def test_a_changed_docstring_compiles_nothing_and_a_changed_callee_or_option_does(run):
    assert run(SOURCE) == ["7.0", "0", "1"]
    assert run(SOURCE.replace("A docstring", "Another one,\n\nlonger")) == ["7.0", "1", "0"]
    assert run(SOURCE.replace("2.0 * x", "3.0 * x")) == ["10.0", "0", "1"]
    assert run(SOURCE) == ["7.0", "1", "0"]
    merged = SOURCE.replace("import kernel", "import kernel, merged").replace(
        "@kernel\ndef outer", "@merged\ndef outer"
    )
    assert run(merged) == ["7.0", "0", "1"]  # compiled in another way: another kernel


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="there are no kernels without a compiler")
def test_what_is_inlined_in_kernels_is_kept_where_python_calls_it(run):
    source = SOURCE.replace("import kernel", "import inlined, kernel").replace(
        "@kernel\ndef outer", "@inlined\ndef outer"
    )
    assert [run(source), run(source)] == [["7.0", "0", "1"], ["7.0", "1", "0"]]


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="there are no kernels without a compiler")
def test_files_of_another_layout_are_replaced_without_a_word(tmp_path):
    environment = {**os.environ, "ANCTMM_CACHE": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    (tmp_path / "edited.py").write_text(SOURCE)

    def run():
        command = [sys.executable, "-c", "import edited; edited.report()"]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        return done.stdout.split(), "readable" in done.stderr

    assert run() == (["7.0", "0", "1"], False)
    for file in tmp_path.rglob(f"*{ENDING}"):
        file.write_bytes(b"anctmm kernel 1\n" + bytes(100))
    assert run() == (["7.0", "0", "1"], False)
    assert run() == (["7.0", "1", "0"], False)


def test_directories_of_earlier_layouts_are_removed(tmp_path):
    names = ["kernels", "kernels-0a1b2c", "kernels-0a1b2c-99ff", "kernels-of-mine", "runs", "kernels-77"]
    for name in names:
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_bytes(b"")
        os.utime(tmp_path / name, (1.0, 1.0))
    os.utime(tmp_path / "kernels-77")  # in use
    remove_earlier(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"kernels", "kernels-of-mine", "runs", "kernels-77"}


def fill(place, name, days, size=10):
    path = place / f"{name}{ENDING}"
    path.write_bytes(bytes(size))
    os.utime(path, (NOW - days * 86_400.0,) * 2)
    return path


NOW = 2_000_000_000.0


def test_old_versions_of_a_kernel_are_removed_and_the_last_few_kept(tmp_path):
    versions = [fill(tmp_path, f"a.march-kind-{k:02}", days=k) for k in range(VERSIONS + 3)]
    another = [fill(tmp_path, f"a.march-other-{k:02}", days=k) for k in range(2)]
    remove_unused(tmp_path, NOW)
    assert [p.exists() for p in versions] == [True] * VERSIONS + [False] * 3
    assert all(p.exists() for p in another)


def test_what_is_not_used_for_long_is_removed(tmp_path):
    old, new = fill(tmp_path, "a.f-kind-1", DAYS + 1), fill(tmp_path, "a.g-kind-1", DAYS - 1)
    unfinished = tmp_path / f"x{kernel_files.UNFINISHED}"
    unfinished.write_bytes(b"")
    os.utime(unfinished, (NOW - 2 * 86_400.0,) * 2)
    remove_unused(tmp_path, NOW)
    assert (old.exists(), new.exists(), unfinished.exists()) == (False, True, False)


def test_the_longest_unused_go_where_all_take_too_much_room(tmp_path, monkeypatch):
    assert ROOM >= 1 << 28
    monkeypatch.setattr(kernel_files, "ROOM", 35)
    files = [fill(tmp_path, f"a.f{k}-kind-1", days=k) for k in range(5)]
    remove_unused(tmp_path, NOW)
    assert [p.exists() for p in files] == [True, True, True, False, False]


def test_processes_that_remove_and_write_side_by_side_do_not_fail(tmp_path):
    def work(number):
        for k in range(60):
            kernel_files.write_whole(tmp_path / f"a.f{number % 2}-kind-{k:03}{ENDING}", bytes([number]) * 100)
            remove_unused(tmp_path)

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(work, range(4)))
    left = list(tmp_path.iterdir())
    assert len(left) <= 2 * VERSIONS
    assert all(len(set(p.read_bytes())) == 1 for p in left)
