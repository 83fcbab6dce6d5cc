"""`anctmm check` sees faults that are planted by syntax; all are tried by `tests/helpers/planting/planting.py`."""

import ast

import pytest
from faults import FAULTS
from planting import Fault, NotFound, flip, replace, scale, seen

#: The first fault of each of these kinds, which other tests may not see, and the runs that see it.
SEEN = {
    "stiffness": "small-linkage/",
    "tensions": "small-linkage/",
    "reactions": "small-guided/",
    "saved runs": "small-linkage/",
    "comparisons": "small-driven-row/compared",
    "consistent velocities": "small-started/",
}
SOURCE = "def f(a, b):\n    x = a - b\n    x += 2.0\n    return g(a, b) + -x\n"


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_each_fault_can_be_planted(fault):
    compile(fault.planted(), str(fault.path), "exec")


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (flip(0), "x = a + b"),
        (flip(1), "x -= 2.0"),
        (flip(3), "return g(a, b) + +x"),
        (replace("a - b", "a"), "x = a"),
        (replace("b", "c", 1), "return g(a, c) + -x"),
        (scale("2.0", 3.0), "x += 3.0 * 2.0"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_change_changes_one_place(change, line):
    tree = ast.parse(SOURCE)
    change(tree)
    lines = zip(ast.unparse(ast.parse(SOURCE)).split("\n"), ast.unparse(tree).split("\n"), strict=True)
    assert [new.strip() for old, new in lines if old != new] == [line]


@pytest.mark.parametrize("change", [flip(9), replace("d", "a")])
def test_a_place_that_is_gone_is_named(change):
    with pytest.raises(NotFound):
        change(ast.parse(SOURCE))
    with pytest.raises(NotFound, match="there is no 'nobody'"):
        Fault("", "anctmm.elements.shapes", "nobody", change).planted()


@pytest.mark.parametrize(("kind", "runs"), SEEN.items())
def test_a_planted_fault_is_seen(kind, runs):
    fault = next(fault for fault in FAULTS if fault.kind == kind)
    assert seen(fault, runs)
