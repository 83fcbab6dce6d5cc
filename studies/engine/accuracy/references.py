"""References for errors: a fine run and its own uncertainty."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from anctmm.model.scene import Probe
from anctmm.results.metrics import compare
from anctmm.results.solution import Solution
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Reference
from studies.engine.running.trial import Trial, mesh_label


def uncertainty_of(best: Solution, coarser: Iterable[Solution], probes: Sequence[Probe]) -> float:
    """How well a fine run is known: the sum of its differences to one of a coarser mesh and one of a coarser step."""
    return sum(compare(other, best, probes).error for other in coarser)


def refined_reference(
    runner: Runner, fine: Trial, coarser: Sequence[Trial], probes: Sequence[Probe], solvers: Sequence[str]
) -> Reference:
    """The finest run of the first of several solvers that can do it.

    Parameters
    ----------
    runner : Runner
        Runs them.
    fine : Trial
        Its `solver` does not matter.
    coarser : sequence of Trial
        The same with a coarser mesh, and with a coarser step: the reference's uncertainty is the sum of its
        differences to them.
    probes : sequence
        Where to compare.
    solvers : sequence of str
        Names in the order of preference.
    """
    reason = "no solver given"
    for name in solvers:
        runs = [replace(c, solver=name) for c in (fine, *coarser)]
        runner.compute(runs)
        best, *others = (runner.solve(run).solution for run in runs)
        bad = [s.status for s in (best, *others) if not s.status.ok]
        if bad:
            reason = f"{name} {bad[0]}"
            continue
        uncertainty = uncertainty_of(best, others, probes)
        label = f"{name} {fine.integrator} {mesh_label(fine.mesh)} dt={fine.dt:g}"
        return Reference(label, lambda s, best=best: compare(s, best, probes).error, uncertainty, best)  # type: ignore[misc]
    return Reference(f"none: {reason}", lambda s: float("nan"), float("nan"))
