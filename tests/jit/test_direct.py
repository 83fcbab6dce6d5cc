"""Calls past numba's look at types: same results, and what other types would do."""

import numpy as np
import pytest

import anctmm as at
from anctmm.jit.compiling import kernel
from anctmm.jit.direct import Checking, Direct
from anctmm.jit.interpreting import interpreted


@kernel
def total(count, values):
    found = 0.0
    for k in range(count):
        found += values[k]
    return found


@kernel
def refuses(values):
    if values[0] < 0.0:
        raise ValueError("negative")
    return values[0]


def test_results_are_the_same_at_each_call():
    direct = Direct(total)
    for values in (np.arange(4.0), np.arange(7.0) ** 2):
        assert direct(len(values), values) == total(len(values), values)


def test_python_runs_the_function_itself():
    direct, values = Direct(total), np.arange(4.0)
    with interpreted():
        assert direct(4, list(values)) == 6.0  # a list is no array: no kernel takes it
    assert direct(4, values) == 6.0
    with interpreted():
        assert direct(4, list(values)) == 6.0


@pytest.mark.parametrize("other", [np.arange(8.0)[::2], np.arange(4), np.ones((4, 1))])
def test_other_types_are_seen_where_they_are_checked(other):
    assert Checking.on  # in all tests
    direct = Direct(total)
    direct(4, np.arange(4.0))
    with pytest.raises(TypeError, match=r"total: .* instead of"):
        direct(4, other)


def test_exceptions_of_a_kernel_reach_the_caller():
    direct = Direct(refuses)
    assert direct(np.ones(1)) == 1.0
    for _ in range(2):
        with pytest.raises(ValueError, match="negative"):
            direct(-np.ones(1))
    assert direct(np.ones(1)) == 1.0


@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha", "esdirk"])
@pytest.mark.parametrize("tolerance", [None, 1e-2])
def test_scenes_alike_share_an_entry(integrator, tolerance):
    if integrator == "zhai" and tolerance:
        pytest.skip("explicit steps have no tolerance")
    steps = {"tolerance": tolerance} if tolerance else {"dt": 2e-5 if integrator == "zhai" else 2e-3}
    found = []
    for length in (1.0, 2.0, 1.0):
        beam = at.Beam("arm", (0, 0), (length, 0), at.Circle(0.02), at.Material(E=5e6, density=1100.0))
        scene = at.Scene("beam", [beam], [at.Pin("arm.start")], gravity=(0, -9.81))
        run = at.solve(scene, mesh=2, t_end=0.02, output_dt=0.01, integrator=integrator, **steps)
        assert run.status.ok
        found.append(run.displacement("arm.end"))
    assert np.array_equal(found[0], found[2])
    assert not np.array_equal(found[0], found[1])
