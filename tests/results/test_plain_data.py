"""Results are data: what is written comes back the same, and reading runs no code."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays, scalar_dtypes

import anctmm as at
from anctmm.discretise.discretisation import NOT_GIVEN
from anctmm.results.export.plain_data import NotPlain, describe, rebuild

NUMBERS = scalar_dtypes().filter(lambda dtype: dtype.kind in "biufc")
SHAPES = array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3)
SINGLE = st.none() | st.booleans() | st.integers() | st.floats() | st.text() | arrays(NUMBERS, SHAPES)
KEYS = st.text() | st.integers() | st.tuples(st.text(), st.floats(allow_nan=False))
PLAIN = st.recursive(
    SINGLE,
    lambda inside: st.lists(inside, max_size=4) | st.tuples(inside, inside) | st.dictionaries(KEYS, inside),
    max_leaves=12,
)


def same(a, b):
    """Equal in type and value, down to the last bit of NaN's sign."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray | np.generic):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return same(list(a.items()), list(b.items()))
    return repr(a) == repr(b)


@settings(max_examples=40, deadline=None)
@given(PLAIN)
def test_data_comes_back_the_same(value):
    assert same(rebuild(*describe(value)), value)


def test_a_discretisation_still_knows_what_was_not_given():
    run = at.Discretisation(mesh={"bar": 2}, tolerance=1e-3, t_end=1.0)
    back = rebuild(*describe(run))
    assert back == run
    assert type(back.dt) is type(NOT_GIVEN)
    assert hash(back.mesh) == hash(run.mesh)


@pytest.mark.parametrize("value", [object(), np, type, np.array([object()]), iter([]), b"x"])
def test_what_is_no_data_is_refused(value):
    with pytest.raises(NotPlain):
        describe({"key": [value]})


@dataclass(frozen=True)
class Thing:
    one: int


def test_a_class_with_other_fields_is_refused():
    text, arrays_of = describe(Thing(1))
    with pytest.raises(NotPlain, match="has other fields now"):
        rebuild(text.replace("one", "two"), arrays_of)
