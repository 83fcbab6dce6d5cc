"""Every study of the report, and the benchmark, in the smallest form that still runs all of its code."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from studies.benchmark import additions, first, kernels, length, peers, precision, topology
from studies.benchmark.peers import EXUDYN, OURS
from studies.benchmark.precision import Race
from studies.engine.study import Options
from studies.scenes import cantilever_fall, four_bar

#: With runs that end well, runs that diverge and a solver that refuses.
SMALL = {
    "four-bar": Options(quick=True, meshes=((2, 8, 2),), steps=(5e-3,), solvers=("anctmm",)),
    "cantilever": Options(quick=True, meshes=((8,),), steps=(1e-2,), solvers=("anctmm",)),
    "agreement": Options(quick=True, meshes=((16,),), steps=(5e-3,), solvers=("anctmm", "global-dae", "pyelastica")),
    "trade": Options(quick=True, meshes=((1, 3, 1), (4,)), steps=(1e-2,), solvers=("anctmm",)),
    "extremes": Options(quick=True),
    "fidelity": Options(quick=True),
    "published": Options(quick=True),
}  # fmt: skip


def _races(quick: bool) -> list[Race]:
    return [
        Race(cantilever_fall(), ((8,), (16,), (32,)), (OURS, EXUDYN), (64,), (48,)),
        Race(four_bar(), ((1, 4, 1), (2, 8, 2)), (OURS,), (4, 16, 4), (3, 12, 3)),
    ]


@contextmanager
def small_bench() -> Iterator[None]:
    """In the context a quick benchmark has the smallest sizes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "SIZES", (1, 4, 8))
        patch.setattr(peers, "CANTILEVER_SIZES", (8,))
        patch.setattr(peers, "FOUR_BARS", ((2, 8, 2),))
        patch.setattr(additions, "ELEMENTS", 8)
        patch.setattr(length, "SHEAR_LENGTHS", (10, 1000))
        patch.setattr(length, "CABLE_LENGTHS", (10, 1000))
        patch.setattr(topology, "QUICK_TREE", 7)
        patch.setattr(topology, "QUICK_RUNGS", (3, 4))
        patch.setattr(first, "INTEGRATORS", ("zhai",))
        patch.setattr(precision, "races", _races)
        patch.setattr(precision, "STEPS", (1e-2, 5e-3, 2e-3, 2e-3))
        yield
