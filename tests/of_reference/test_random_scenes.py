"""Random scenes: no answer is "ok" and wrong. Graphs and mechanisms against the global DAE, graphs against Exudyn.

A thousand are tried by `python tests/helpers/scenes/random_against.py`.
"""

import pytest
from random_against import AGREE, WRONG, judge


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("peer", "count", "kind"),
    [
        ("global-dae", 60, "graphs"),
        ("global-dae", 40, "mechanisms"),
        ("exudyn-cable", 20, "graphs"),
    ],
)
def test_no_answer_is_ok_and_wrong(peer, count, kind):
    found = [judge(seed, peer, kind) for seed in range(count)]
    assert [verdict for verdict in found if verdict.verdict == WRONG] == []
    locked = kind == "mechanisms"  # many mechanisms that are drawn lock, and say so
    assert sum(verdict.verdict == AGREE for verdict in found) >= (0.5 if locked else 0.75) * count, found
