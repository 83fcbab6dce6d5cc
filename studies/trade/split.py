"""The parts of the error from mesh and step: a run compared with a fine step on its own mesh."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from anctmm.elements.kinds import KINDS
from anctmm.model.scene import Scene
from anctmm.results.metrics import compare
from anctmm.results.solution import Solution
from studies.engine.accuracy.dynamics import Planned
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Outcome
from studies.engine.running.rows import element_of
from studies.engine.running.trial import Mesh, Trial

#: One error outweighs the other when it is this many times larger.
OUTWEIGHS = 2.0
#: Newton's tolerance of the runs by a fine step: what it leaves is far below their error.
NEWTON = 1e-10
Place = tuple[Scene, str, str, Mesh]


@dataclass(frozen=True)
class SameMesh:
    """A fine step on one mesh, and how well that step's own error is known."""

    solution: Solution
    uncertainty: float


def same_mesh(planned: Planned, dt: float, integrator: str, runner: Runner) -> Mapping[Place, SameMesh]:
    """Runs of ANC-TMM with a fine step, s, on every mesh of a sweep; meshes that it cannot run are left out."""
    fine = fine_runs(planned.cases, dt, integrator)
    coarser = [replace(case, dt=2 * dt) for case in fine]
    found = {o.case: o.solution for o in runner.sweep([*fine, *coarser], timed=False)}
    return {
        _place(case): SameMesh(found[case], compare(found[twice], found[case], planned.base.probes).error)
        for case, twice in zip(fine, coarser, strict=True)
        if found[case].status.ok and found[twice].status.ok
    }


def fine_runs(cases: Sequence[Trial], dt: float, integrator: str) -> list[Trial]:
    """Runs of ANC-TMM with a fine step, s, on the meshes of cases."""
    return list(dict.fromkeys(_fine(case, dt, integrator) for case in cases if not other_model(case)))


def other_model(case: Trial) -> bool:
    """Whether a solver's element is none of ours: a fine step of ours then says nothing of its mesh."""
    return element_of(case.solver, case.element) not in KINDS


def split(planned: Planned, outcome: Outcome, fine: Mapping[Place, SameMesh]) -> dict[str, Any]:
    """A run's error of the mesh, of the step, and which outweighs the other; NaN and "-" where not known."""
    beside = None if other_model(outcome.case) else fine.get(_place(outcome.case))
    nan = float("nan")
    if beside is None or not outcome.solution.status.ok:
        return {"mesh_error": nan, "step_error": nan, "step_reference_error": nan, "error_from": "-"}
    mesh = planned.reference_of(outcome.case).error_of(beside.solution)
    step = compare(outcome.solution, beside.solution, planned.base.probes).error
    return {
        "mesh_error": mesh,
        "step_error": step,
        "step_reference_error": beside.uncertainty,
        "error_from": weigh(mesh, step),
    }


def weigh(mesh: float, step: float) -> str:
    """Which error outweighs the other: "mesh", "step", or "both" if none does."""
    if mesh > OUTWEIGHS * step:
        return "mesh"
    return "step" if step > OUTWEIGHS * mesh else "both"


def _place(case: Trial) -> Place:
    return case.scene, case.element, case.quadrature, case.mesh


def _fine(case: Trial, dt: float, integrator: str) -> Trial:
    options = (("newton_tolerance", NEWTON),)
    return replace(case, solver="anctmm", integrator=integrator, dt=dt, options=options, own=())
