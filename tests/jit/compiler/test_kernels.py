"""Kernels that are called by kernels, by Python, and by both."""

import numpy as np
import pytest
from numba.core import config

from anctmm.jit.compiler import kernel_files
from anctmm.jit.compiler.kernels import is_callee
from anctmm.jit.compiling import embedded, kernel, uncompiled, vectorized

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


def make():
    """New kernels of the same code, as another process has them: an inner one, and one that calls it."""

    def inner(x, y):
        for i in range(len(x)):
            y[i] += 2.0 * x[i]
        return y[0]

    inner = kernel(inner)

    def part(x):
        return x + 1.0

    part = embedded(part)

    def outer(x, y):
        return part(inner(x, y))

    return inner, part, kernel(outer)


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_files, "directory", lambda: tmp_path)
    return tmp_path


def arrays():
    return np.arange(1.0, 4.0), np.zeros(3)


def only(function):
    (found,) = function.overloads.values()
    return found


def test_what_only_kernels_call_has_no_machine_code():
    inner, part, outer = make()
    assert outer(*arrays()) == 3.0
    assert is_callee(only(inner))
    assert is_callee(only(part))
    assert not is_callee(only(outer))
    name = only(inner).fndesc.llvm_func_name
    assert not only(inner).library.codegen._engine.is_symbol_defined(
        only(inner).fndesc.llvm_cpython_wrapper_name
    )
    assert name in {f.name for f in only(inner).library.get_defined_functions()}


def test_python_may_call_it_afterwards():
    inner, part, outer = make()
    outer(*arrays())
    x, y = arrays()
    assert inner(x, y) == 2.0
    assert y.tolist() == [2.0, 4.0, 6.0]
    assert part(1.5) == 2.5
    assert not is_callee(only(inner))
    assert not is_callee(only(part))
    assert inner._cache_misses.total() == 1  # its code was not made anew


def test_a_caller_links_what_python_called_before():
    inner, _, outer = make()
    assert inner(*arrays()) == 2.0
    assert outer(*arrays()) == 3.0


def test_both_forms_are_read_from_disk(place):
    make()[2](*arrays())
    assert len(list(place.glob("*.kernel"))) == 2
    inner, _, outer = make()
    assert outer(*arrays()) == 3.0
    assert outer._cache_hits.total() == 1
    assert not inner.overloads  # nothing of it is needed
    assert inner(*arrays()) == 2.0
    assert inner._cache_hits.total() == 1
    again, _, _ = make()
    assert again(*arrays()) == 2.0
    assert again._cache_hits.total() == 1


@pytest.mark.parametrize("first", ["inner", "another"])
def test_another_caller_reads_what_the_first_one_kept(first):
    make()[2](*arrays())
    inner, _, _ = make()

    def another(x, y):
        return 10.0 * inner(x, y)

    another = kernel(another)
    if first == "inner":
        assert inner(*arrays()) == 2.0
    assert another(*arrays()) == 20.0
    assert inner._cache_hits.total() == 1
    assert inner(*arrays()) == 2.0
    assert another(*arrays()) == 20.0


def test_without_the_compiler_the_function_itself_is_run():
    inner, _, _ = make()
    assert uncompiled(inner)(*arrays()) == 2.0
    assert uncompiled(uncompiled(inner)) is uncompiled(inner)


def test_one_code_serves_all_numbers_that_callers_write():
    """A flag or a row that is written in a call is an argument like one that is computed."""

    def inner(more, k, x):
        return 2.0 * x[k] if more else x[k]

    inner = kernel(inner)

    def outer(x, k):
        return inner(True, 0, x) + inner(False, 1, x) + inner(k > 1, k, x)

    assert kernel(outer)(arrays()[0], 2) == 2.0 + 2.0 + 6.0
    assert len(inner.overloads) == 1


def test_types_of_local_variables_are_a_mapping():
    """The oldest numba that is allowed inlines nothing without one."""
    assert kernel(lambda x: x).locals == {}


def test_a_kernel_that_is_optimised_by_itself_has_files_of_its_own():
    """Old files were taken for the new kernel, whose loop stayed scalar."""

    def double(x, y):
        for i in range(len(x)):
            y[i] = 2.0 * x[i]

    x, y = arrays()
    kinds = kernel(double), vectorized(double)
    for one in kinds:
        one(x, y)
        np.testing.assert_array_equal(y, 2.0 * x)
    (types,) = kinds[0].overloads
    assert len({one._cache.file_of(types) for one in kinds}) == 2
