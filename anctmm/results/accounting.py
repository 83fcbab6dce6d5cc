"""Cost of a call besides its steps: building the system and the solution, and compilation."""

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from math import isnan
from time import process_time
from typing import ParamSpec

from anctmm.kernels.announcing import compiling
from anctmm.results.solution import Cost, Solution

P = ParamSpec("P")


def accounted(solve: Callable[P, Solution]) -> Callable[P, Solution]:
    """The same solver, whose solutions also say `build_s` and `compile_s`, unless they say it already."""

    @wraps(solve)
    def call(*arguments: P.args, **options: P.kwargs) -> Solution:
        began, compiled = process_time(), compiling.cpu_seconds
        found = solve(*arguments, **options)
        cost = getattr(found, "cost", None)
        if not isinstance(cost, Cost) or not isnan(cost.build_s):
            return found
        compile_s = compiling.cpu_seconds - compiled
        build_s = process_time() - began - compile_s - cost.cpu_s
        return found.with_cost(replace(cost, build_s=max(build_s, 0.0), compile_s=compile_s))

    return call
