"""Named tuples that kernels are handed by their address."""

import pickle
import re
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import typeof
from numba.core import config, types
from numba.core.errors import TypingError

from anctmm.jit.by_address import by_address
from anctmm.jit.compiler.address_types import ByAddress
from anctmm.jit.compiler.kernels import Kernel
from anctmm.jit.compiling import OPTIONS, allocating_kernel
from anctmm.jit.files.code_digest import signature_text

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


@by_address
class Inner(NamedTuple):
    matrix: Any
    scale: Any
    absent: Any = None


@by_address
class Outer(NamedTuple):
    flag: Any
    inner: Any
    values: Any
    size: Any
    count: Any


class Plain(NamedTuple):
    """One that kernels make."""

    first: Any
    second: Any


def outer(n=4):
    """Numbers, arrays of one and of two dimensions, a tuple, and one that is not there."""
    matrix = np.arange(3.0 * n).reshape(n, 3).T
    return Outer(True, Inner(matrix, 0.5), np.arange(float(n)), (0, 0, 7), n)


def total(one, out):
    """Reads all of them, by name, by place, and taken apart."""
    flag, inner, values, size, count = one
    s = 1000.0 if flag else 0.0
    if one.inner.absent is None:
        s += 1.0
    for i in range(inner[0].shape[0]):
        for k in range(count):
            s += one.inner.matrix[i, k] * inner.scale * (i + 1)
            out[k] += values[k] + one[-1] + len(size) + size[2]
    both = Plain(inner, 2.0)
    return s + both.first.matrix[1, 1] * both.second + one[1][1]


def fresh(function):
    """A kernel that was never compiled."""
    return Kernel(function, targetoptions={"nopython": True, "boundscheck": None, **OPTIONS})


def test_kernels_read_what_python_put_there():
    """As Python reads it, at two sizes with one code."""
    one = fresh(total)
    for n in (4, 6):
        compiled, plain = np.zeros(n), np.zeros(n)
        assert one(outer(n), compiled) == total(outer(n), plain)
        np.testing.assert_array_equal(compiled, plain)
    assert len(one.signatures) == 1


def test_a_call_hands_over_one_address():
    """Not the numbers of all arrays; and tells that nobody writes there."""
    one = fresh(total)
    one(outer(), np.zeros(4))
    (arguments,) = re.findall(
        r"define [^\n]*test_by_address[^\n]*?total[^\n(]*\(([^\n]*)\)", one.inspect_llvm(one.signatures[0])
    )[:1]
    assert "noalias" in arguments
    assert "dereferenceable" in arguments
    # the result, the error, the tuple, and the seven numbers of `out`; not 33
    assert len(arguments.split(",")) < 20


def test_a_kernel_may_write_into_arrays_that_overlap():
    """What is written into one array is read in the other; only the tuple itself is constant."""

    def shift(one):
        for k in range(len(one.values) - 1):
            one.inner.matrix[0, k] = one.values[k] + 1.0
        return one.values[-1]

    line = np.zeros(5)
    overlapping = Outer(True, Inner(line[1:].reshape(1, 4), 1.0), line, (0,), 5)
    assert fresh(shift)(overlapping) == 4.0
    np.testing.assert_array_equal(line, np.arange(5.0))


def test_other_types_are_other_code():
    """Where a member has another type, or is there at all."""
    one = fresh(total)
    one(outer(), np.zeros(4))
    there = outer()._replace(inner=outer().inner._replace(absent=1.0))
    assert one(there, np.zeros(4)) == one(outer(), np.zeros(4)) - 1.0
    assert len(one.signatures) == 2


def test_a_name_that_it_does_not_have_is_refused():
    """When it is compiled, as with other tuples."""
    with pytest.raises(TypingError, match="nowhere"):
        fresh(lambda one: one.nowhere)(outer())
    with pytest.raises(TypingError, match="out of range"):
        fresh(lambda one: one[5])(outer())


def test_what_is_no_number_is_refused():
    """By Python's call: nothing is read that was not put there."""
    with pytest.raises(TypingError, match="Cannot determine"):
        fresh(total)(outer()._replace(count=object()), np.zeros(4))


def test_code_that_is_called_with_other_types_says_so():
    """Not by numba's dispatcher, which finds the types first: nothing is read that is no array."""
    one = fresh(total)
    one(outer(), np.zeros(4))
    (compiled,) = one.overloads.values()
    with pytest.raises(TypeError, match="Outer: a member is no array"):
        compiled.entry_point(outer()._replace(values=1.0), np.zeros(4))
    with pytest.raises(ValueError, match="four"):
        compiled.entry_point(outer()._replace(count="four"), np.zeros(4))


def test_an_array_that_is_given_back_is_still_there():
    """A kernel that takes memory counts who holds an array."""
    given = outer()

    def member(one):
        return one.inner.matrix

    before = sys.getrefcount(given.inner.matrix)
    back = allocating_kernel(member)(given)
    np.testing.assert_array_equal(back, given.inner.matrix)
    assert np.shares_memory(back, given.inner.matrix)
    del back
    after = sys.getrefcount(given.inner.matrix)
    assert after == before


def test_types_are_equal_in_another_process():
    """Kernels that are kept on disk are found by their types."""
    kind = typeof(outer())
    assert isinstance(kind, ByAddress)
    again = pickle.loads(pickle.dumps(kind))
    assert again == kind
    assert hash(again) == hash(kind)
    assert kind != typeof(outer()._replace(count=0.5))


def test_kernels_that_were_handed_numbers_are_not_taken_for_these():
    """Those that an earlier version of this package has kept on disk, or one that hands tuples over otherwise."""
    kind = typeof(outer().inner)
    numbas = types.NamedTuple(kind.types, kind.instance_class)
    assert str(numbas) == str(kind)
    assert signature_text((kind,)) != signature_text((numbas,))
