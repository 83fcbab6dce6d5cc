"""Richardson's estimate on errors that are known: any order, levels of any spacing."""

from itertools import pairwise
from math import isnan

import pytest

from studies.engine.richardson import SAFETY, UNSURE, Spacing, left_in, part_of

SIZES = {
    "halved": (4.0, 2.0, 1.0),
    "1-2-5": (5.0, 2.0, 1.0),
    "2-3-5": (1 / 2, 1 / 3, 1 / 5),
    "close": (1.3, 1.1, 1.0),
}


def levels(name, order, constant=0.3):
    """Values on levels from fine to coarse, and their spacing."""
    sizes = SIZES[name]
    before, last = (coarse / fine for coarse, fine in pairwise(sizes))
    return [constant * (h / sizes[-1]) ** order for h in reversed(sizes)], Spacing(last, before)


@pytest.mark.parametrize("name", SIZES)
@pytest.mark.parametrize("order", [1.0, 2.0, 4.0])
def test_the_order_and_what_is_left_are_found(name, order):
    (fine, middle, coarse), spacing = levels(name, order)
    part = part_of(middle - fine, coarse - middle, order, spacing)
    assert part.order == pytest.approx(order)
    assert part.sure
    assert part.error == pytest.approx(SAFETY * fine)  # the exact value is 0


@pytest.mark.parametrize("name", SIZES)
def test_a_number_is_believed_to_second_order(name):
    for order in (1.0, 2.0, 4.0):
        numbers, spacing = levels(name, order)
        part = part_of(numbers[1] - numbers[0], numbers[2] - numbers[1], order, spacing)
        found = left_in(numbers, part)
        assert found >= SAFETY * numbers[0] * (1 - 1e-9)
        if order <= 2.0:
            assert found == pytest.approx(SAFETY * numbers[0])


def test_what_does_not_converge_as_theory_says_is_doubled():
    part = part_of(0.1, 0.1, 2.0, Spacing())
    assert part.order == pytest.approx(0.0, abs=1e-6)
    assert not part.sure
    assert part.error == UNSURE * 0.1


def test_without_a_third_level_there_is_no_order():
    part = part_of(0.1, float("nan"), 2.0, Spacing(3.0))
    assert isnan(part.order)
    assert part.error == pytest.approx(UNSURE * 0.1 / 2.0)
    assert part_of(float("inf"), 0.1, 2.0, Spacing()).error == float("inf")
