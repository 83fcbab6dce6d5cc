"""Static cantilevers: convergence to the exact solutions of the continua the elements discretise."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from anctmm.errors import AnctmmError
from anctmm.model.scene import Probe
from anctmm.results.solution import Solution
from anctmm.solvers import registry
from anctmm.solvers.capabilities import Offer
from reference.exact import solve_static
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Outcome, Reference
from studies.engine.running.rows import element_of, row, rows_frame
from studies.engine.running.trial import STATIC, Mesh, Trial, product
from studies.engine.study import Options
from studies.engine.tables import Table
from studies.scenes import BaseScene

#: Continua that have exact solutions, as `reference.exact` calls them.
LIMITS = ("elastica", "reissner", "director")
#: Errors below this are rounding, whatever the mesh: no order is read from them.
ROUNDING = 1e-10
#: Times the level at which the errors of a solver stop falling, or three times rounding: errors above are of the mesh.
CLEAR = 10.0


@dataclass(frozen=True)
class StaticScheme:
    """Element and quadrature, with who runs them on which meshes."""

    element: str
    quadrature: str
    solvers: tuple[str, ...]
    meshes: tuple[Mesh, ...]


@dataclass(frozen=True)
class StaticSweep:
    """Outcomes of static runs with the exact solution of each."""

    outcomes: tuple[Outcome, ...]
    references: tuple[Reference, ...]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row a run."""
        return [row(o, r) for o, r in zip(self.outcomes, self.references, strict=True)]

    @property
    def frame(self) -> pd.DataFrame:
        """The rows as a frame, with the number of elements as a number."""
        return rows_frame(self.rows, self.outcomes, [_family(o.case) for o in self.outcomes])


def rest_error(solution: Solution, exact: Solution, probes: Sequence[Probe]) -> float:
    """Largest over the probes of |u − u_exact| / |u_exact| under the full load."""
    pairs = [(solution.displacement(p)[-1], exact.displacement(p)[-1]) for p in probes]
    return max(float(np.linalg.norm(u - v) / np.linalg.norm(v)) for u, v in pairs)


def exact_reference(base: BaseScene, model: str) -> Reference:
    """The exact solution of a continuum for a scene."""
    exact = solve_static(base.scene, model)
    smallest = min(float(np.linalg.norm(exact.displacement(p)[-1])) for p in base.probes)
    shape = next(iter(exact.fields.values())).shape  # type: ignore[attr-defined]
    return Reference(
        f"exact: {model}", lambda s: rest_error(s, exact, base.probes), shape.uncertainty / smallest, exact
    )


def static_sweep(
    bases: Sequence[BaseScene], schemes: Sequence[StaticScheme], options: Options, runner: Runner
) -> StaticSweep:
    """Run scenes × schemes of the requested element, each solver measured against its own continuum."""
    cases: list[Trial] = []
    references: list[Reference] = []
    for base in bases:
        exact = {limit: exact_reference(base, limit) for limit in LIMITS}
        mine = static_cases(base, schemes, options)
        cases += mine
        references += [exact[limit_of(case.solver, case.element)] for case in mine]
    return StaticSweep(tuple(runner.sweep(cases)), tuple(references))


def static_cases(base: BaseScene, schemes: Sequence[StaticScheme], options: Options) -> list[Trial]:
    """Equilibria of a scene by schemes of the requested element.

    A solver asked for by name runs the schemes that list it; one that no scheme lists (another package's) runs those
    whose element it offers in statics, on the full quadrature.
    """
    cases: list[Trial] = []
    schemes = [scheme for scheme in schemes if options.element in (None, scheme.element)]
    for scheme in schemes:
        for solver in _contestants(scheme, schemes, options):
            mine = product(
                base.scene, [solver], options.meshes or scheme.meshes, element=scheme.element,
                quadrature=scheme.quadrature, integrator=STATIC,
            )  # fmt: skip
            cases += [case for case in mine if case not in cases]
    return cases


def limit_of(solver: str, element: str) -> str:
    """The continuum a solver's equilibria tend to; the element's own, if the solver is not there to say."""
    try:
        limits = registry.offer_of(registry.load(solver)).limits
    except AnctmmError:
        limits = {}
    return limits.get(element) or Offer().limits[element]


def _family(case: Trial) -> str:
    """Element among whose rows a case is shown."""
    own = element_of(case.solver, case.element)
    return own if limit_of(case.solver, case.element) == own else case.element


def _contestants(scheme: StaticScheme, schemes: Iterable[StaticScheme], options: Options) -> list[str]:
    if options.solvers is None:
        return list(scheme.solvers)
    listed = {solver for s in schemes for solver in s.solvers}
    return [s for s in options.solvers if s in scheme.solvers or (s not in listed and _offers(s, scheme))]


def _offers(solver: str, scheme: StaticScheme) -> bool:
    """Whether another package's solver takes part; one that cannot be loaded does, to say so."""
    try:
        offer = registry.offer_of(registry.load(solver))
    except AnctmmError:
        offer = Offer()
    return scheme.quadrature == "full" and "statics" not in offer.lacks and scheme.element in offer.limits


def rates(frame: pd.DataFrame) -> Table:
    """Observed orders: log₂ of the error's fall where a mesh was doubled."""
    lines = []
    keys = ["scene", "solver", "element", "quadrature"]
    for values, line in frame[frame["error"] > 0].groupby(keys, sort=False):
        line = line.sort_values("all_elements")
        n, error = line["all_elements"].to_numpy(float), line["error"].to_numpy()
        falling = error[1:] < 0.5 * error[:-1]
        # a solver's own tolerance may stop the fall long before rounding: errors near that level are not of the mesh
        level = np.maximum(error[1:], error[:-1])[~falling].max(initial=3 * ROUNDING)
        sound = (n[1:] == 2 * n[:-1]) & np.logical_and.accumulate(falling) & (error[1:] > CLEAR * level)
        sound = np.flatnonzero(sound)
        orders = np.log2(error[sound] / error[sound + 1])
        last = orders[-1] if orders.size else float("nan")
        between = f"{n[sound[-1]]:g} → {n[sound[-1] + 1]:g}" if sound.size else ""
        lines.append({**dict(zip(keys, values, strict=True)), "smallest_error": error.min(), "order": last,
                      "between_elements": between})  # fmt: skip
    columns = [*keys, "smallest_error", "order", "between_elements"]
    notes = (
        "order: of the last doubling of the mesh whose error is still far above rounding, and above the level at which "
        "errors of the solver stop falling, if they do. The cable tends to the "
        "extensible elastica, the shear element to the director continuum of its own energy, the Reissner peers "
        "to Reissner's rod.",
    )
    found = pd.DataFrame(lines, columns=columns)
    return Table("rates", "Observed orders of the static cantilever", found, notes)
