"""The error of time stepping of a run, beside a finer run."""

from collections.abc import Callable
from dataclasses import replace

from anctmm.discretise.discretisation import Discretisation
from anctmm.results.metrics import error_between
from anctmm.results.solution import Solution

#: Part of the steps in the finer run.
STEP = 0.5


def verified(solve: Callable[[Discretisation], Solution], solution: Solution) -> Solution:
    """A solution with the error of time stepping: its difference to that of a finer run, which `solve` gives.

    With a tolerance that has more outputs, too, as steps end there. Of a fixed step by Richardson's extrapolation: at
    order p the finer run has 2⁻ᵖ of the error.
    """
    run, factor = solution.run, 1.0
    assert run is not None  # every run of ANC-TMM has one
    if run.tolerance is not None:
        finer = replace(run, tolerance=0.1 * run.tolerance, output_dt=STEP * run.exact_dt)
    else:
        finer = replace(run, dt=STEP * run.dt, output_dt=run.dt if run.output_dt is None else run.output_dt)
        factor = 1.0 / (1.0 - STEP**run.method.order)
    return replace(solution, error_estimate=factor * error_between(solution, solve(finer)))
