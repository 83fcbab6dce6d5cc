"""Memory is estimated before work; a long run with few outputs takes no more of it than a short one."""

import tracemalloc

import numpy as np
import pytest
from samples import bar, refused

import anctmm as at
from anctmm.discretise import memory
from anctmm.errors import AnctmmError, MemoryLimitError
from anctmm.model.drives import Quintic
from anctmm.model.scene import Clamp, Force
from anctmm.solve import BYTES, solve
from reference import exudyn_cable, exudyn_reissner, global_dae, pyelastica

DRIVEN = bar([Clamp("bar.start", Quintic(1.0, 1.0))], [Force("bar.end", lambda t: (np.sin(t), 0.0 * t))])
HUGE, OFTEN = {"mesh": 2 * 10**9}, {"mesh": 8, "dt": 1e-12, "t_end": 1.0}


def peak(call):
    """Bytes that a call takes at most at once, after one that compiles."""
    call()
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("road", [solve, global_dae.solve])
@pytest.mark.parametrize("integrator", ["zhai", "generalized-alpha"])
def test_a_long_run_with_one_output_takes_no_more_memory_than_a_short_one(road, integrator):
    def run(steps):
        times = {"dt": 1e-6, "t_end": 1e-6 * steps, "output_dt": 1e-6 * steps}
        return peak(lambda: road(DRIVEN, mesh=1, integrator=integrator, **times))

    short, long = run(60_000), run(240_000)
    assert long <= 1.1 * short
    assert long < 16e6


@pytest.mark.parametrize(("integrator", "each"), BYTES.items())
def test_the_estimate_is_what_a_run_takes(integrator, each):
    """Large meshes, and many outputs of a small one."""
    scene = bar([Clamp("bar.start")])
    fixed = {"dt": 1e-9, "check_stability": False, "integrator": integrator}
    taken = peak(lambda: solve(scene, mesh=20_000, t_end=2e-9, output_dt=2e-9, **fixed))
    assert 0.5 < taken / (20_001 * 4 * (each + 2 * memory.HISTORIES * memory.NUMBER)) < 1.3
    taken = peak(lambda: solve(scene, mesh=100, t_end=1.2e-5, **fixed))
    assert 0.5 < taken / (12_001 * (101 * 4 * memory.HISTORIES * memory.NUMBER + memory.ENERGIES)) < 1.3


@pytest.mark.parametrize(
    ("options", "word"), [({**HUGE, "output_dt": 1.0}, "coarser mesh"), (OFTEN, "larger output_dt")]
)
def test_too_much_memory_is_refused_by_name_before_any_work(options, word):
    with refused(MemoryLimitError, ["scene 'bar'", "free", word]):
        solve(bar([Clamp("bar.start")]), **{"t_end": 1.0, "dt": 1e-3, **options})
    assert issubclass(MemoryLimitError, AnctmmError)
    assert issubclass(MemoryLimitError, MemoryError)


def test_too_much_memory_for_equilibria_is_refused_by_name():
    with refused(MemoryLimitError, ["scene 'bar'", "free"]):
        at.solve_static(bar([Clamp("bar.start")]), mesh=1000, load_steps=10**6)


PEERS = [global_dae.solve, exudyn_cable.solve, exudyn_reissner.solve, pyelastica.solve]


@pytest.mark.parametrize("road", PEERS, ids=lambda road: road.__module__)
@pytest.mark.parametrize("options", [HUGE, OFTEN])
def test_too_much_memory_in_a_peer_is_refused_by_name(road, options):
    with pytest.raises(MemoryLimitError, match="are free"):
        road(bar([Clamp("bar.start")]), **{"dt": 1e-6, "t_end": 1e-3, "integrator": "zhai", **options})
