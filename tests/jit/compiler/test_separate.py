"""Kernels that are compiled apart from their callers."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import small_kernels
from numba.core import config
from small_kernels import apart, wrong

from anctmm.jit.compiling import embedded, separate, uncompiled

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")

#: 8 Σ x² + ½ Σ (2x)² of 1, 2, 3.
ANSWER = 10.0 * 14.0
SCRIPT = """
import numpy as np
from small_kernels import apart, between, caller, doubled
{before}
print(caller(np.arange(1.0, 4.0)))
for one in apart, doubled, between, caller:
    print(one.py_func.__name__, len(one.overloads), sum(one.stats.cache_misses.values()))
"""


def run(cache, before=""):
    """What another process answers, and how many signatures of each kernel it has and has compiled."""
    paths = [str(Path(small_kernels.__file__).parent), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(before=before)],
        env=os.environ | {"ANCTMM_CACHE": str(cache), "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert "not readable" not in done.stderr
    answer, *lines = done.stdout.splitlines()
    return float(answer), {name: (int(had), int(made)) for name, had, made in map(str.split, lines)}


def test_callers_link_none_of_its_code(tmp_path):
    looked = """
from anctmm.jit.compiler.addresses import called_in
assert caller(np.arange(1.0, 4.0)) == 140.0
for one in caller, between:
    (found,) = one.overloads.values()
    assert called_in(found.library._final_module)
    names = [f.name for f in found.library.get_defined_functions()]
    assert not any("apart" in name or "doubled" in name for name in names), names
assert apart(np.arange(1.0, 4.0), 0.5) == 7.0  # Python may call it
assert not is_callee(next(iter(apart.overloads.values())))
"""
    assert run(tmp_path, f"from anctmm.jit.compiler.kernels import is_callee{looked}")[0] == ANSWER


def test_other_processes_read_it_from_disk_with_its_callers(tmp_path):
    assert run(tmp_path) == (
        ANSWER,
        {"apart": (1, 1), "doubled": (1, 1), "between": (1, 1), "caller": (1, 1)},
    )
    assert run(tmp_path) == (
        ANSWER,
        {"apart": (1, 0), "doubled": (1, 0), "between": (0, 0), "caller": (1, 0)},
    )


@pytest.mark.parametrize("gone", ["apart", "doubled"])
def test_one_that_is_gone_from_the_disk_is_compiled_again(gone, tmp_path):
    run(tmp_path)
    (file,) = tmp_path.rglob(f"small_kernels.{gone}-*.kernel")
    file.unlink()
    answer, made = run(tmp_path)
    assert answer == ANSWER
    assert [name for name, (_, new) in made.items() if new] == [gone]


@pytest.mark.parametrize("gone", ["between", "caller"])
def test_new_callers_find_what_is_on_disk(gone, tmp_path):
    run(tmp_path)
    for file in tmp_path.rglob("small_kernels.caller-*.kernel"):
        file.unlink()
    for file in tmp_path.rglob(f"small_kernels.{gone}-*.kernel"):
        file.unlink()
    answer, made = run(tmp_path)
    assert answer == ANSWER
    assert {name for name, (_, new) in made.items() if new} == {gone, "caller"}


def test_python_may_have_called_its_callers_parts_before(tmp_path):
    before = "x = np.arange(1.0, 4.0); assert apart(x, 1.0) == 14.0; assert between(x) == 112.0"
    assert run(tmp_path, before)[0] == ANSWER
    assert run(tmp_path, before)[0] == ANSWER


def test_what_it_returns_is_what_its_annotation_says():
    with pytest.raises(TypeError, match="wrong returns float64, and is to return int64"):
        wrong(np.ones(1))


def nothing_told(x: float):  # type: ignore[no-untyped-def]
    """No annotation."""
    return x


def an_array(x: float) -> np.ndarray:
    """None of what kernels may return."""
    return np.ones(1) * x


@pytest.mark.parametrize(("function", "told"), [(nothing_told, "nothing"), (an_array, "numpy.ndarray")])
def test_what_it_may_return_is_told(function, told):
    with pytest.raises(
        TypeError, match=rf"kernel {function.__name__} is to return .*{told}.*; allowed: .*float"
    ):
        separate(function)(1.0)


def test_it_stands_in_a_module():
    def inner(x: float) -> float:
        return x

    with pytest.raises(TypeError, match="inner: other processes find separate kernels in modules alone"):
        separate(inner)(1.0)


def test_without_the_compiler_the_function_itself_is_run():
    assert uncompiled(apart)(np.arange(1.0, 4.0), 0.5) == 7.0
    assert embedded is not separate
