"""References confirmed by an independent method: another solver and integrator, and possibly another mesh."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan

from anctmm.model.case import Case
from anctmm.results.metrics import compare
from studies.engine.accuracy.dynamics import Fine, fine_run
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Reference
from studies.engine.running.trial import mesh_label


@dataclass(frozen=True)
class Second:
    """The result of the independent method for a reference.

    Parameters
    ----------
    name : str
        Solver and settings; why there is none, where it failed.
    apart : float
        Difference to the reference; NaN where it failed.
    """

    name: str = "-"
    apart: float = nan


def second_roads(
    base: Case, roads: Mapping[str, Fine], references: Mapping[str, Reference], runner: Runner
) -> Mapping[str, Second]:
    """The references of a scene by an independent method, each by the first solver of its finest settings.

    Parameters
    ----------
    base : Case
    roads : mapping of str to Fine
        By element of the reference.
    references : mapping of str to Reference
    runner : Runner
    """
    found = {}
    for element, road in roads.items():
        reference = references.get(element)
        if reference is None or reference.solution is None:
            continue
        run = fine_run(base, element, road)
        solution = runner.solve(run).solution
        name = f"{run.solver} {run.element} {run.integrator} {mesh_label(run.mesh)} dt={run.dt:g}"
        if solution.status.ok:
            apart = compare(solution, reference.solution, base.probes).error
            found[element] = Second(name, apart)
        else:
            found[element] = Second(f"{name}: {solution.status}")
    return found
