"""Old place."""

from collections.abc import Iterable, Sequence

from anctmm.model.scene import Probe
from anctmm.results.metrics import compare
from anctmm.results.solution import Solution


def uncertainty_of(best: Solution, coarser: Iterable[Solution], probes: Sequence[Probe]) -> float:
    """Sum of the differences of a fine run to one of a coarser mesh and one of a longer step."""
    return sum(compare(other, best, probes).error for other in coarser)
