"""Error measures on histories made by hand, whose differences are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from samples import bar

import anctmm as at
from anctmm import solve
from anctmm.errors import SolverError, UnknownNameError
from anctmm.model.scene import Clamp, Force
from anctmm.results.fields import LagrangeField
from anctmm.results.metrics import common_times, compare, history_error
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
    """Whichever probe has them: of 0 and NaN `max` takes what stands first, and a run without numbers agreed."""
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


def test_largest_difference_is_that_of_one_time():
    """Not of one component over the times, and of no more than there is."""
    off = moved([0.0, 1.0, 2.0], STILL, [[0, 0], [0.3, 3.4], [3, 4.4]])
    assert compare(off, THEIRS, ["bar.end"]).largest == pytest.approx(0.5 / 5.0)


def test_scale_is_that_of_one_time_and_cost_counts_however_small():
    """The reference stays 5 m away, so that no other norm of it is 5 m."""
    away = moved([0.0, 1.0, 2.0], STILL, [[0, 0], [4, 3], [4, 3]], cpu_s=0.5)
    near = moved([0.0, 1.0, 2.0], STILL, [[0, 0], [4, 3], [4, 2]], cpu_s=0.25)
    result = compare(near, away, ["bar.end"])
    assert result.largest == pytest.approx(1.0 / 5.0)
    assert result.cost_ratio == 0.5
    small = [moved(m.t, STILL, 0.1 * m.displacement("bar.end")) for m in (near, away)]
    assert compare(*small, ["bar.end"]).largest == pytest.approx(1.0 / 5.0)


def test_a_reference_at_rest_and_one_without_cost():
    rest = moved([0.0, 1.0, 2.0], STILL, STILL, cpu_s=0.0)
    result = compare(OURS, rest, ["bar.end"])
    assert result.error == pytest.approx(math.sqrt(34.0))
    assert math.isnan(result.largest)
    assert math.isnan(result.cost_ratio)


@pytest.mark.parametrize("many", [False, True], ids=["few", "many"])
def test_only_common_times_are_compared(many):
    """Ours has every second time of the reference and some of its own, all but rounding; in both searches."""
    n = 3001 if many else 31
    theirs = np.linspace(0.0, 3.0, n)
    ours = np.sort(np.concatenate([theirs[::2] * (1.0 + 1e-13), theirs[1:-1:20] + 0.3 * theirs[1]]))
    path = np.stack([theirs, np.zeros(n)], axis=1)
    common = np.isin(np.round(ours, 9), np.round(theirs, 9))
    # far off where there is nothing to compare
    found = np.stack([ours, np.where(common, 0.0, 100.0)], axis=1)
    one = moved(ours, np.zeros_like(found), found)
    two = moved(theirs, np.zeros_like(path), path)
    assert (len(ours) * len(theirs) >= 4_000_000) == many
    result = compare(one, two, ["bar.end"])
    assert result.common == (n + 1) // 2
    assert result.error < 1e-12
    assert compare(two, one, ["bar.end"]).common == result.common
    short = moved(theirs[: n // 2], path[: n // 2] * 0.0, path[: n // 2], status=Status("diverged", "early"))
    assert compare(two, short, ["bar.end"]).common == n // 2


def test_times_are_common_to_a_part_of_the_longer_history():
    long, short = np.array([0.0, 1.0, 3.0]), np.array([0.0, 1.0 + 2e-9])
    for pair in ((long, short), (short, long)):
        assert [list(places) for places in common_times(*pair)] == [[0, 1], [0, 1]]
    assert len(common_times(long, short + 2e-9)[0]) == 1
    brief = np.array([0.0, 1e-3])  # a difference of a nanosecond is much there
    assert len(common_times(brief, brief + 1e-9)[0]) == 0
    assert [len(places) for places in common_times(brief[:0], brief)] == [0, 0]
    assert [len(places) for places in common_times(brief, brief[:0])] == [0, 0]


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
    apart = moved([0.0, 0.7], STILL[:2], STILL[:2], status=cut.status)
    for pair in ((apart, THEIRS), (THEIRS, apart)):
        assert compare(*pair, ["bar.end"]).common == 1
    empty = moved([], STILL[:0], STILL[:0], status=cut.status)
    for pair in ((empty, THEIRS), (THEIRS, empty)):
        nothing = compare(*pair, ["bar.end", "bar.start"])
        assert nothing.common == 0
        assert len(nothing.by_probe) == 2
        assert all(math.isnan(x) for x in (nothing.error, nothing.largest, *nothing.by_probe.values()))


@pytest.mark.parametrize("noise", [0.0, 1e-17, -3e-16, 1e-14])
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_rounding_at_a_held_probe_is_no_error(noise, offset):
    """Of a support that moves by roundings the difference counts, m, and not its part of them."""
    size = noise * max(1.0, offset)
    path = [[0, 0], [0, 3], [3, 4]]
    held = moved(THEIRS.t, [[0, 0], [size, 0], [0, -size]], path, offset=offset)
    still = moved(THEIRS.t, 0.5 * np.array([[0, 0], [size, 0], [0, -size]]), path, offset=offset)
    for pair in ((held, still), (still, held)):
        result = compare(*pair, ["bar.end", "bar.start"])
        assert result.error <= 2.0 * abs(size) + 4e-16 * max(1.0, offset)
        alone = compare(*pair, ["bar.start"])
        assert math.isnan(alone.largest)
        assert alone.error == result.by_probe["bar.start"]
    let_go = moved(THEIRS.t, [[0, 0], [0.1, 0], [0.2, 0]], path, offset=offset)
    assert compare(let_go, held, ["bar.start"]).error == pytest.approx(0.2)


def test_small_motion_is_compared_as_any():
    small = [moved(m.t, STILL, 1e-10 * m.displacement("bar.end")) for m in (OURS, THEIRS)]
    assert compare(*small, ["bar.end"]).error == pytest.approx(math.sqrt(1 / 3) / 5.0, rel=1e-4)


def test_a_run_that_diverges_after_its_first_output_has_no_error():
    whole = solve(bar([Clamp("bar.start")], [Force("bar.end", (0.0, 1.0))]), mesh=2, dt=1e-2, t_end=0.1)
    cut = whole.until(1, Status("diverged", "at once", time=1e-2))
    for pair in ((cut, whole), (whole, cut)):
        result = compare(*pair, ["bar.end", ("bar", 0.5)])
        assert result.common == 1
        assert math.isnan(result.error)
        assert all(math.isnan(x) for x in result.by_probe.values())
        assert not result.complete
    assert compare(whole.until(2, cut.status), whole, ["bar.end"]).error == 0.0


def test_whole_runs_need_two_common_times():
    apart = moved([0.0, 0.7, 1.4], STILL, STILL)
    with pytest.raises(SolverError, match="have 1 common output times; at least 2 are needed"):
        compare(apart, THEIRS, ["bar.end"])
    two = moved([0.0, 1.4], STILL[:2], STILL[:2])
    with pytest.raises(SolverError, match="have 1 common output times; at least 2 are needed"):
        compare(apart, moved([0.0, 1.0], STILL[:2], STILL[:2]), ["bar.end"])
    assert compare(apart, two, ["bar.end"]).common == 2
    halves = moved([0.0, 1.5, 2.0], STILL, STILL)
    assert compare(halves, THEIRS, ["bar.end"]).common == 2
    single = moved([0.0], STILL[:1], STILL[:1])  # one output: nothing else could be common
    assert compare(single, THEIRS, ["bar.end"]).common == 1


def test_probes_are_those_of_the_scene():
    with pytest.raises(SolverError, match="probes is empty; a list of at least one probe is needed"):
        compare(OURS, THEIRS, [])
    with pytest.raises(UnknownNameError, match="body 'rod'"):
        compare(OURS, THEIRS, ["rod.end"])


def test_equilibria_are_not_compared_with_a_motion():
    """A load factor of 1 is no time of 1 s."""
    beam = at.Beam("beam", (0.0, 0.0), (1.0, 0.0), at.Circle(0.02), at.Material(E=5e6, density=1100.0))
    scene = at.Scene("bent", [beam], [at.Clamp("beam.start")], [at.Force("beam.end", (0.0, -0.1))])
    rest, moved = at.solve_static(scene, mesh=1), at.solve(scene, mesh=1, dt=0.1, t_end=1.0)
    for one, other in ((rest, moved), (moved, rest)):
        with pytest.raises(
            SolverError, match=r"equilibria at load factors.*; two of one kind|motion.*; two of one kind"
        ):
            at.compare(one, other, probes=["beam.end"])


def beam_of(length, height=0.02, name="beam"):
    return at.Beam(name, (0.0, 0.0), (length, 0.0), at.Rectangle(0.02, height), at.Material(1e7, 1000.0))


def swinging(body, *loads, gravity=(0.0, -9.81)):
    return at.Scene("swing", [body], [at.Pin("beam.start")], loads, gravity)


def test_solutions_of_two_scenes_are_not_compared():
    options = {"mesh": 1, "element": "rigid", "dt": 0.01, "t_end": 0.02}
    short, long = (at.solve(swinging(beam_of(length)), **options) for length in (0.5, 0.7))
    for one, other in ((short, long), (long, short)):
        with pytest.raises(
            SolverError, match=r"probe 'beam.end' is at \(0\.\d, 0\.0\) m in scene 'swing' of the s"
        ):
            compare(one, other, ["beam.end"])
        assert compare(one, other, ["beam.start"]).error < 1e-15  # where it stands, both are alike
    with pytest.raises(
        SolverError, match=r"probe \('beam', 0.5\) is at \(0.25, 0.0\) m .* and at \(0.35, 0.0\) m"
    ):
        compare(short, long, ["beam.start", ("beam", 0.5)])
    rounded = at.solve(swinging(beam_of(0.5 + 1e-13)), **options)
    assert compare(rounded, short, ["beam.end"]).error < 1e-9


def test_meshes_elements_kinds_and_loads_may_differ():
    options = {"dt": 0.01, "t_end": 0.02}
    fine = at.solve(swinging(beam_of(0.5)), mesh=4, **options)
    rod = at.RigidBody("beam", 0.2, 0.2 * 0.5**2 / 12, (0.25, 0.0), {"start": (0.0, 0.0), "end": (0.5, 0.0)})
    others = [
        at.solve(swinging(beam_of(0.5)), mesh=1, element="rigid", **options),
        at.solve(swinging(rod), **options),
        at.solve(swinging(beam_of(0.5, 0.03), at.Force("beam.end", (0.1, 0.2))), mesh=1, **options),
    ]
    for other in others:
        assert 0.0 < compare(other, fine, ["beam.end"]).error < 0.5


def test_what_starts_deformed_is_compared_by_where_its_scene_stands():
    """Equilibria of two meshes, and motions that start there, are as far apart as the meshes are coarse."""
    scene = at.Scene("sag", [beam_of(0.5)], [at.Clamp("beam.start")], gravity=(0.0, -9.81))
    pulled = at.Scene("pulled", scene.bodies, scene.joints, [at.Force("beam.end", (0.0, 0.05))], (0.0, -9.81))
    rests = [at.solve_static(scene, mesh=mesh) for mesh in (1, 4)]
    assert 0.0 < compare(*rests, ["beam.end"]).error < 0.5
    runs = [
        at.solve(pulled, mesh=m, dt=0.01, t_end=0.02, start=rest)
        for m, rest in zip((1, 4), rests, strict=True)
    ]
    assert np.abs(runs[0].position("beam.end")[0] - runs[1].position("beam.end")[0]).max() > 1e-7
    assert 0.0 < compare(*runs, ["beam.end"]).error < 0.5
