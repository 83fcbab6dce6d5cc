"""Rows of tables: a run with its settings, its error and its cost, and its raw time samples."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from anctmm.elements.kinds import KINDS, kind_of
from anctmm.errors import AnctmmError
from anctmm.solvers import registry
from studies.engine.measuring.timing import summarise
from studies.engine.running.outcomes import Outcome, Reference, Sample
from studies.engine.running.trial import STATIC, Trial

#: Of a run's row.
COLUMNS = (
    "scene", "solver", "element", "quadrature", "integrator", "elements", "dofs", "dt", "t_end", "steps",
    "newton_iterations", "error", "reference_error", "reference", "cpu_s", "cpu_spread", "build_s", "wall_s",
    "repeats", "status",
)  # fmt: skip


def element_of(solver: str, asked: str) -> str:
    """Name of the element that a solver uses for a requested one; the requested one if the solver is not installed."""
    try:
        return registry.offer_of(registry.load(solver)).element_of(asked)
    except AnctmmError:
        return asked


def order_of(solver: str, asked: str) -> float:
    """Order in space of the element that a solver uses for a requested one; its own if the solver is not installed."""
    try:
        return registry.offer_of(registry.load(solver)).order_of(asked)
    except AnctmmError:
        return KINDS[asked].order


def _quadrature_shown(case: Trial) -> str:
    """The quadrature of a case as tables show it; none for bodies of different kinds."""
    return (
        "-" if isinstance(case.element, Mapping) else kind_of(case.element).quadrature_shown(case.quadrature)
    )


def row(outcome: Outcome, reference: Reference) -> dict[str, Any]:
    """The tidy row of a run. A run cut short has no error."""
    case, solution, timing = outcome.case, outcome.solution, summarise(outcome.costs)
    return {
        "scene": case.scene.name,
        "solver": case.solver,
        "element": element_of(case.solver, case.element),
        "quadrature": _quadrature_shown(case),
        "integrator": case.integrator,
        "elements": case.cut,
        "dofs": solution.dofs,
        "dt": case.dt,
        "t_end": case.t_end if case.integrator != STATIC else float("nan"),
        "steps": solution.cost.steps,
        "newton_iterations": solution.cost.newton_iterations,
        "error": reference.error_of(solution) if solution.status.ok else float("nan"),
        "reference_error": reference.uncertainty,
        "reference": reference.name,
        "cpu_s": timing.cpu_s,
        "cpu_spread": timing.cpu_spread,
        "build_s": timing.build_s,
        "wall_s": timing.wall_s,
        "repeats": timing.repeats,
        "status": str(solution.status),
    }


def rows_frame(
    rows: Sequence[dict[str, Any]], outcomes: Sequence[Outcome], families: Sequence[str]
) -> pd.DataFrame:
    """Rows as a frame, with the number of all elements and the element whose reference they have."""
    return pd.DataFrame(rows, columns=list(COLUMNS)).assign(
        all_elements=[sum(o.case.mesh) for o in outcomes],
        family=list(families),
    )


def sample_rows(case: Trial, samples: Sequence[Sample]) -> list[dict[str, Any]]:
    """The raw time samples of a case."""
    names = ("solver", "element", "quadrature", "integrator")
    about = {"scene": case.scene.name, **{n: getattr(case, n) for n in names}}
    about |= {"elements": case.cut, "dt": case.dt}
    times = ("cpu_s", "build_s", "wall_s")
    return [
        {
            **about, "sample": k, **{t: getattr(s.cost, t) for t in times},
            "machine": s.interval.machine, "began": s.interval.begin, "ended": s.interval.end,
        }
        for k, s in enumerate(samples)
    ]  # fmt: skip
