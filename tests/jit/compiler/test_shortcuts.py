"""Shortcuts through numba's compiler: the same code comes out, and numba is left as it was."""

import re
from contextlib import nullcontext

import numpy as np
import pytest
from numba.core import config, types
from numba.core.compiler import run_frontend
from numba.core.postproc import PostProcessor
from numba.core.registry import cpu_target
from numba.extending import intrinsic, overload

from anctmm.jit.compiler import shortcuts as module
from anctmm.jit.compiler.kernels import Kernel
from anctmm.jit.compiler.shortcuts import shortcuts
from anctmm.jit.compiling import OPTIONS, inlined, kernel

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


def scale(x):
    """Chosen by type in kernels."""


@overload(scale, jit_options=OPTIONS, inline="always")
def _scale(x):
    if isinstance(x, types.Float):
        return lambda x: 2.0 * x
    return lambda x: 3 * x


@inlined
def clipped(x, low, high):
    """Several ways out, a loop, and names that its callers have too."""
    for k in range(2):
        if x < low:
            x = low + k * 0.0
        elif x > high:
            return high
    return x


@inlined
def twice(x, k):
    """Inlines another one at two places, with one result for each."""
    a = clipped(x, -1.0, 1.0)
    if k > 2:
        a = clipped(a + x, -2.0, k)
    return a + scale(x)


def total(values, out, more):
    """The kernel."""
    s = 0.0
    for k in range(len(values)):
        if more is not None:
            s -= more[k]
        s += twice(values[k], k) + scale(k)
        out[k] = s
    return s


def fresh():
    """The kernel, never compiled."""
    return Kernel(total, targetoptions={"nopython": True, "boundscheck": None, **OPTIONS})


ARGUMENTS = (np.linspace(-3.0, 3.0, 7), np.zeros(7), None)


def instructions(one):
    """Those of the processor, one after the other; registers and labels are left out, and of jumps their conditions."""
    lines = [line.split() for line in one.inspect_asm(one.signatures[0]).splitlines()]
    found = [
        words[0] for words in lines if words and not words[0].startswith((".", "#")) and ":" not in words[0]
    ]
    return ["j" if word[0] == "j" else word for word in found]


def code(one):
    """LLVM's text of a kernel, without what numba counts."""
    text = one.inspect_llvm(one.signatures[0])
    return re.sub(r"\s+", " ", re.sub(r"[._]?\d+", "#", text[text.index("define") :]))


def expected():
    """By Python."""
    out = np.zeros(7)
    bounds = [np.clip(x, -1.0, 1.0) for x in ARGUMENTS[0]]
    s = 0.0
    for k, (x, a) in enumerate(zip(ARGUMENTS[0], bounds, strict=True)):
        out[k] = s = s + (np.clip(a + x, -2.0, k) if k > 2 else a) + 2.0 * x + 3 * k
    return out


def test_the_code_is_what_numba_makes_of_it_without(monkeypatch):
    """The same instructions one after the other, and the right result."""
    short = fresh()
    short(*ARGUMENTS)
    np.testing.assert_allclose(ARGUMENTS[1], expected(), rtol=0.0, atol=1e-14)
    monkeypatch.setattr("anctmm.jit.compiler.kernels.shortcuts", nullcontext)
    whole = fresh()
    whole(*ARGUMENTS)
    assert instructions(short) == instructions(whole)
    assert len(instructions(short)) > 100


def state():
    """What is put into numba."""
    return [getattr(*place) for place in module._ways]


def test_numba_is_left_as_it_was():
    """Also where a kernel is compiled within another one's compiling, and where compiling fails."""
    before = state()
    with shortcuts():
        during = state()
        with shortcuts():
            assert state() == during
        assert state() == during
    assert before
    assert all(a is not b for a, b in zip(before, during, strict=True))
    assert state() == before

    def wrong(x):
        return x + "a"

    with pytest.raises(Exception, match="No implementation"):
        kernel(wrong)(1.0)
    assert state() == before


def test_the_function_that_is_inlined_stays_as_it_is():
    """What one call makes of it, the next one does not see: numba keeps the implementations of overloads."""
    fresh()(*ARGUMENTS)
    one = fresh()
    one(*ARGUMENTS)
    other = fresh()
    other(*ARGUMENTS)
    assert code(one) == code(other)


def test_where_variables_live_is_found_when_asked_for():
    """As numba finds it in advance."""
    plain = run_frontend(total)
    PostProcessor(plain).run()
    with shortcuts():
        PostProcessor(found := run_frontend(total)).run()
        assert not found.block_entry_vars
        for label, block in found.blocks.items():
            assert found.get_block_entry_vars(block) == plain.get_block_entry_vars(plain.blocks[label])
    assert any(plain.get_block_entry_vars(block) for block in plain.blocks.values())


def test_generators_are_left_to_numba():
    """What lives at a `yield` is asked for at once."""

    def count(n):
        for k in range(n):
            yield k * n

    with shortcuts():
        found = run_frontend(count)
    assert found.generator_info.state_vars


def test_types_of_operators_are_found_once(monkeypatch):
    """And what an operator has no answer for is refused each time."""
    asked = []
    monkeypatch.setattr(module, "_operators", {})
    monkeypatch.setattr(
        module,
        "_call_type",
        lambda function, *rest: asked.append(function.typing_key) or before(function, *rest),
    )
    before = types.Function.get_call_type
    fresh()(*ARGUMENTS)
    operators = [one for one in asked if getattr(one, "__module__", "") == "_operator"]
    assert operators
    assert len(operators) == len(module._operators)
    assert any(one is range for one in asked)


def loops_and_numbers(matrix, deep, marks, low, size, begin):
    """Numbers of arrays of several kinds, at indices of several kinds, and ranges of one, two and three numbers."""
    s = 0.0
    again = range(size)
    for k in again:
        s += matrix[k, k - 1] * low[k]
        for m in range(begin, k):
            deep[m, -1, np.uint64(k)] += s * matrix[-1, m]
            if marks[m]:
                deep[m, 0, k] = m
        for m in range(k, -1, -1):
            low[m] = low[m] + m
            marks[-m] = m % 3 == 0
    for k in range(len(low) - 3, begin):
        s -= k
    row = matrix[1]
    again = range(1, 9, size + 1)
    for k in again:
        s += row[k % 3]
    return s


@pytest.mark.parametrize(("size", "begin"), [(3, 1), (4, -2), (0, 9), (1, 4)])
def test_numbers_of_arrays_and_ranges_are_those_of_python(size, begin):
    """Also before an array's beginning, in single precision, and of ranges that are empty or go back."""

    def arguments():
        numbers = np.linspace(-1.0, 2.0, 60)
        matrix, deep = numbers[:16].reshape(4, 4).copy(), numbers.reshape(4, 3, 5).copy()
        return matrix, deep, np.arange(5) % 2 == 0, np.arange(5, dtype=np.float32), size, begin

    compiled, plain = arguments(), arguments()
    one = Kernel(loops_and_numbers, targetoptions={"nopython": True, "boundscheck": None, **OPTIONS})
    np.testing.assert_allclose(one(*compiled), loops_and_numbers(*plain), rtol=1e-14)
    for found, expected_there in zip(compiled[:4], plain[:4], strict=True):
        np.testing.assert_allclose(found, expected_there, rtol=1e-14)


def test_numbers_of_arrays_and_ranges_are_the_code_that_numba_makes(monkeypatch):
    """Instruction by instruction."""

    def compiled():
        one = Kernel(loops_and_numbers, targetoptions={"nopython": True, "boundscheck": None, **OPTIONS})
        matrix, deep, marks, low = (
            np.ones((4, 4)),
            np.ones((4, 3, 5)),
            np.ones(5, bool),
            np.ones(5, np.float32),
        )
        one(matrix, deep, marks, low, 3, 1)
        return one

    short = instructions(compiled())
    monkeypatch.setattr("anctmm.jit.compiler.kernels.shortcuts", nullcontext)
    assert short == instructions(compiled())


def test_what_is_told_to_numba_later_is_known():
    """numba puts new intrinsics into a list that it loads as an additional one, and asks for them at every call."""
    target = cpu_target.target_context
    with shortcuts():
        target.refresh()
        for k in range(3):

            @intrinsic
            def number(context, x, k=k):
                return x(x), lambda context, builder, signature, arguments: arguments[0]

            _, made = number._defn(None, types.int64)
            next(iter(target._registries)).lower(made, types.int64)(made)
            target.refresh()
            assert target._defns[made].versions, k
