"""Nothing is compiled anew in each process: what Python calls is kept, or run by Python."""

import ast
import threading
from pathlib import Path

import numpy as np
import pytest
from numba.core import config

import anctmm
from anctmm.jit.compiling import embedded, uncompiled
from anctmm.jit.interpreting import here

ROOT = Path(anctmm.__file__).parents[1]
#: Decorators of all kernels, and of those that are not kept: they are compiled with their callers.
KERNELS = {"kernel", "allocating_kernel", "inlined", "embedded", "shared", "separate", "merged"}
NOT_KEPT = {"embedded", "shared"}


@embedded
def _inner(x):
    return 2.0 * x[0]


@embedded
def _outer(x):
    return _inner(x) + 1.0


def _decorators(function):
    """Names of the decorators of a function, of those that are called, too."""
    called = [d.func if isinstance(d, ast.Call) else d for d in function.decorator_list]
    return {d.id for d in called if isinstance(d, ast.Name)}


def _modules():
    """Syntax of each module by its name."""
    paths = [path for room in ("anctmm", "reference") for path in (ROOT / room).rglob("*.py")]
    return {
        ".".join(p.relative_to(ROOT).with_suffix("").parts): ast.parse(p.read_text("utf-8")) for p in paths
    }


def _functions(tree):
    return [part for part in tree.body if isinstance(part, ast.FunctionDef)]


def test_python_calls_no_kernel_that_is_not_kept():
    """A spring's measure was compiled again in each explicit run, what springs add to statics in each search."""
    modules = _modules()
    not_kept = {
        name: {f.name for f in _functions(tree) if _decorators(f) & NOT_KEPT}
        for name, tree in modules.items()
    }
    assert sum(map(len, not_kept.values())) > 100
    found = []
    for name, tree in modules.items():
        known = set(not_kept[name])
        for part in ast.walk(tree):
            if isinstance(part, ast.ImportFrom):
                known |= {one.asname or one.name for one in part.names} & not_kept.get(part.module, set())
        of_kernels = KERNELS | {"overload", "chosen_by_types", "intrinsic"}
        for part in tree.body:
            if isinstance(part, ast.FunctionDef | ast.ClassDef) and not _decorators(part) & of_kernels:
                calls = (one.func for one in ast.walk(part) if isinstance(one, ast.Call))
                named = {called.id for called in calls if isinstance(called, ast.Name)}
                found += [f"{name}.{part.name} calls {one}" for one in named & known]
    assert not found


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="nothing is compiled")
def test_python_runs_what_an_uncompiled_function_calls_and_in_this_thread_alone():
    seen = []

    def look(x):
        thread = threading.Thread(target=lambda: seen.append(here.on))
        thread.start()
        thread.join()
        seen.append(here.on)
        return _inner(x)

    x = np.ones(1)
    assert uncompiled(look)(x) == 2.0
    assert uncompiled(_outer)(x) == 3.0
    assert seen == [False, True]
    assert not here.on
    assert not _inner.kernel.overloads
    assert not _outer.kernel.overloads
    with pytest.raises(IndexError):
        uncompiled(_outer)(np.ones(0))
    assert not here.on
