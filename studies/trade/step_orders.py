"""Observed order of the steps of a reference, on a coarse mesh and on its own: whether the motion is smooth."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from math import log2, nan
from typing import Any

from anctmm.model.case import Case
from anctmm.results.metrics import compare
from studies.engine.accuracy.dynamics import Fine, fine_run
from studies.engine.runner import Runner
from studies.engine.running.trial import Mesh, mesh_label

#: How often the coarsest step is halved until it is that of the reference.
HALVED = 3
COLUMNS = ("scene", "with", "integrator", "elements", "dt", "difference", "order", "status")
NOTES = (
    "difference: to the run with twice the step; order: log2 of the ratio to the difference before.",
    "Drives that are smooth keep order 4. A sudden release does not, on a fine mesh: mode k of a released beam has the "
    "amplitude k⁻⁵ and a frequency ~ k², so that what a step h does not resolve is an error ~ h², whatever the method; "
    "a coarse mesh has no such modes.",
)


def step_orders(
    base: Case, element: str, fine: Fine, meshes: Sequence[Mesh], runner: Runner
) -> Iterator[dict[str, Any]]:
    """Rows for each mesh: differences of runs by a reference's settings, with its step, twice it, and so on.

    Parameters
    ----------
    base : Case
    element : str
        Whose reference it is.
    fine : Fine
    meshes : sequence of tuple of int
    runner : Runner
    """
    best = fine_run(base, element, fine)
    for mesh in meshes:
        runs = [replace(best, mesh=mesh, dt=2**k * fine.dt) for k in range(HALVED, -1, -1)]
        runner.compute(runs)
        before = nan
        for twice, run in pairwise(runs):
            one, other = runner.solve(twice).solution, runner.solve(run).solution
            bad = next((s.status for s in (one, other) if not s.status.ok), None)
            difference = nan if bad else compare(one, other, base.probes).error
            yield {
                "scene": base.scene.name, "with": run.element, "integrator": run.integrator,
                "elements": mesh_label(mesh), "dt": run.dt, "difference": difference,
                "order": log2(before / difference) if before > 0.0 and difference > 0.0 else nan,
                "status": str(bad or other.status),
            }  # fmt: skip
            before = difference
