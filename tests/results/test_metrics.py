"""Error measures on histories made by hand, whose differences are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from samples import bar

import anctmm as at
from anctmm.errors import SolverError
from anctmm.results.fields import LagrangeField
from anctmm.results.metrics import compare, history_error
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status

SCENE = bar()
START, END = np.array([0.0, 0.0]), np.array([0.6, 0.8])


def moved(t, start, end, cpu_s=1.0, status=None, offset=0.0):
    """A bar whose ends have moved by given displacements, (n, 2), at times t."""
    t, start, end = (np.asarray(x, dtype=float) for x in (t, start, end))
    field = LagrangeField(np.stack([START + start, END + end], axis=1) + offset)
    cost, status = Cost(cpu_s=cpu_s), status or Status()
    return Solution("by hand", SCENE, None, t, {"bar": field}, Energy.unknown(len(t)), cost, status)


STILL = np.zeros((3, 2))
#: Reference: the end goes 0, 3, 5 m away; the other differs from it by 0, 0, 1 m and by 0, 2, 0 m at the start.
THEIRS = moved([0.0, 1.0, 2.0], STILL, [[0, 0], [0, 3], [3, 4]], cpu_s=4.0)
OURS = moved([0.0, 1.0, 2.0], [[0, 0], [2, 0], [0, 0]], [[0, 0], [0, 3], [3, 5]], cpu_s=2.0)


def test_error_is_the_root_mean_square_over_the_largest_displacement():
    u, v = np.array([[0.0, 0.0], [3.0, 0.0]]), np.array([[0.0, 4.0], [3.0, -4.0]])
    assert history_error(u, v) == pytest.approx(4.0 / 5.0)
    assert history_error(v, v) == 0.0
    assert history_error(0.1 * u, 0.1 * v) == pytest.approx(4.0 / 5.0)
    at_rest = np.zeros((2, 2))  # the error is then the largest difference itself, m
    assert history_error(v, at_rest) == 5.0


def test_comparison_takes_the_worst_probe_and_its_own_scale():
    result = compare(OURS, THEIRS, ["bar.end", ("bar", 0.0)])
    assert result.by_probe == pytest.approx({"bar.end": math.sqrt(1 / 3) / 5.0, ("bar", 0.0): 2.0})
    assert result.error == 2.0
    assert result.largest == pytest.approx(2.0 / 5.0)  # one scale for all probes
    assert result.cost_ratio == 0.5
    assert result.common == 3
    assert result.statuses == (OURS.status, THEIRS.status)
    assert result.complete


@pytest.mark.parametrize("probes", [["bar.end", "other.end"], ["other.end", "bar.end"]])
@pytest.mark.parametrize("lost", [math.nan, math.inf])
def test_numbers_that_are_not_finite_are_no_agreement(probes, lost):
    """Whichever probe has them."""
    other = replace(SCENE.bodies[0], name="other")
    scene = replace(SCENE, bodies=(*SCENE.bodies, other))
    whole = replace(THEIRS, scene=scene, fields=dict.fromkeys(("bar", "other"), THEIRS.fields["bar"]))
    nodes = np.full_like(THEIRS.fields["bar"].positions, lost)
    nodes[0] = THEIRS.fields["bar"].positions[0]
    broken = replace(whole, fields={**whole.fields, "other": LagrangeField(nodes)})
    with np.errstate(invalid="ignore"):
        for result in (compare(broken, whole, probes), compare(whole, broken, probes)):
            assert not math.isfinite(result.error)
            assert not math.isfinite(result.largest)
            assert result.by_probe["bar.end"] == 0.0


def test_a_run_cut_short_is_compared_up_to_its_end():
    cut = moved([0.0, 1.0], STILL[:2], [[0, 0], [0, 4]], status=Status("diverged", "at 2 s"))
    result = compare(cut, THEIRS, ["bar.end"])
    assert result.common == 2
    assert result.error == pytest.approx(math.sqrt(0.5) / 3.0)
    assert not result.complete
    first = compare(moved([0.0], STILL[:1], STILL[:1], status=cut.status), THEIRS, ["bar.end"])
    assert first.common == 1
    assert math.isnan(first.error)  # its displacement from the first output is 0 whatever it did
    assert math.isnan(first.largest)
    empty = moved([], STILL[:0], STILL[:0], status=cut.status)
    for pair in ((empty, THEIRS), (THEIRS, empty)):
        nothing = compare(*pair, ["bar.end", "bar.start"])
        assert nothing.common == 0
        assert len(nothing.by_probe) == 2
        assert all(math.isnan(x) for x in (nothing.error, nothing.largest, *nothing.by_probe.values()))


def test_equilibria_are_not_compared_with_a_motion():
    """A load factor of 1 is no time of 1 s."""
    rest = replace(OURS, static=True)
    for pair in ((rest, THEIRS), (THEIRS, rest)):
        with pytest.raises(SolverError, match="two of one kind are needed"):
            at.compare(*pair, probes=["bar.end"])


def test_solutions_of_two_scenes_are_not_compared():
    longer = replace(SCENE.bodies[0], end=(1.2, 1.6))
    other = replace(THEIRS, scene=replace(SCENE, bodies=(longer,)))
    for pair in ((other, THEIRS), (THEIRS, other)):
        with pytest.raises(SolverError, match=r"probe 'bar.end' is at \(\d\.\d, \d\.\d\) m in scene 'bar'"):
            compare(*pair, ["bar.end"])
        assert compare(*pair, ["bar.start"]).error == 0.0
