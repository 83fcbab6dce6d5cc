"""Checks of a finished history that determine its status: what is wrong, where and when.

All run after the steps, at the outputs, so that steps cost nothing. After what is fatal (the run has diverged or does
not keep a joint) the history ends. A complete history may be inaccurate (too much energy was created, or a load or a
drive changed between the steps) or imprecise (too few digits are left).
"""

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from anctmm.results.checks.constraints import constraint_findings
from anctmm.results.checks.energy import energy_findings
from anctmm.results.checks.finding import FATAL, Finding
from anctmm.results.checks.histories import break_findings, drive_findings
from anctmm.results.checks.precision import precision_findings
from anctmm.results.checks.shapes import STRETCH_LIMIT, inside_out, shape_findings
from anctmm.results.solution import Solution
from anctmm.results.status import Status

__all__ = ["STRETCH_LIMIT", "checked", "inside_out"]


def checked(
    solution: Solution, *, static: bool = False, energies: bool = True, rests: bool = False
) -> Solution:
    """The solution as far as nothing speaks against it, its status saying what does.

    It is cut before the first output that no run of the scene could have, with the status "diverged" or "failed", or
    whole with the status "inaccurate" or "imprecise". `static`: its times are load factors; `energies`: they are exact
    enough to tell whether a run has made some; `rests`: the scene begins in a stable equilibrium and does not move.
    """
    motion = not static and solution.status.ok and solution.t.size > 0
    if not static and not solution.status.ok and solution.run is not None and solution.run.explicit:
        return solution  # an unstable step shows in all checks; its solver knows it best
    checks: list[Callable[[Solution], Iterable[Finding]]] = [shape_findings, constraint_findings]
    checks += [break_findings, drive_findings] if motion else []
    checks += [energy_findings] if motion and energies else []
    with np.errstate(all="ignore"):  # of a run that has diverged, numbers may be too large for any formula
        found = [finding for check in checks for finding in check(solution)]
        if motion and not found:
            found = list(precision_findings(solution, rests))
    if not found:
        return solution
    fatal = [finding for finding in found if finding.code in FATAL]
    first = min(fatal or found, key=lambda finding: finding.output)
    status = _status(solution, first, static)
    return solution.until(first.output, status) if fatal else replace(solution, status=status)


def _status(solution: Solution, finding: Finding, static: bool) -> Status:
    run, when = solution.run, float(solution.t[finding.output])
    step = None
    if not static and run is not None and run.tolerance is None:
        step = int(run.output_steps[finding.output])
    message = finding.message.replace("{when}", f"load factor {when:.6g}" if static else f"t = {when:.6g} s")
    return Status(finding.code, message, when, step, finding.body, finding.element)
