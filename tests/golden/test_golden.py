"""Each group of answers is the stored one."""

import pytest

from tests.golden.all_groups import GROUPS
from tests.golden.answers import compared, read

STORED = read()


@pytest.mark.parametrize("name", GROUPS)
def test_answers_are_the_stored_ones(name):
    bad = [f"{r.name}: {r.difference} > {r.allowed}" for r in compared(name, STORED) if not r.good]
    assert not bad, "\n".join(bad)


def test_every_stored_group_is_computed():
    assert set(STORED) == set(GROUPS)
