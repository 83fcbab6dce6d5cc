"""Probes at rest: their displacements say nothing about the error of a run, but some of them rotate."""

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import ResultError
from anctmm.model.scene import Probe
from anctmm.results.metrics import common_times, rounding_at
from anctmm.results.solution import Solution

#: Angle, rad, below which a place that rests does not turn.
TURNED = 1e-6


def rests(solution: Solution, probe: Probe) -> bool:
    """Whether a probe moves by no more than rounding."""
    way = np.linalg.norm(solution.displacement(probe), axis=1).max(initial=0.0)
    return bool(way <= rounding_at(solution, probe))


def turn_at_rest(solution: Solution, probe: Probe) -> NDArray[np.float64] | None:
    """Angles of a probe that turns and does not move, rad; None of any other, and where the solver keeps none."""
    if not rests(solution, probe):
        return None
    try:
        angle = solution.angle(probe)
    except ResultError:
        return None
    return angle if np.abs(angle).max(initial=0.0) > TURNED else None


def turned_apart(one: Solution, other: Solution, probe: Probe, static: bool = False) -> float:
    """How far the angles of a probe that rests are apart, over the largest: RMS in time, of equilibria at the last.

    Zero of a probe that moves, or does not turn in the second solution, and where a solver keeps no angles.
    """
    known = turn_at_rest(other, probe)
    if known is None:
        return 0.0
    try:
        found = one.angle(probe)
    except ResultError:
        return 0.0
    mine, theirs = common_times(one.t, other.t)
    apart = found[mine] - known[theirs]
    size = float(np.abs(known[theirs]).max())
    return float(abs(apart[-1]) if static else np.sqrt(np.mean(apart**2))) / size
