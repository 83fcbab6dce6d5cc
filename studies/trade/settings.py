"""Settings of a trade: meshes, steps and references by refinement, and every solver with every freedom on them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from math import inf, isinf, nan
from typing import TypeVar

import pandas as pd

from anctmm.elements.kinds import KINDS, QUADRATURES
from anctmm.model.case import Case
from anctmm.model.needs import features_of
from anctmm.solvers import registry
from anctmm.solvers.capabilities import NEWTON_TOLERANCES
from studies.cases import place_name
from studies.engine.meshes import Mesh, StudyError, step_below
from studies.engine.refinement import Refined, Refinement, rests
from studies.engine.runner import Runner
from studies.engine.study import Options
from studies.engine.trials import EXPLICIT, Trial, explicit_limit, offer_of

Level = TypeVar("Level")
#: Target errors; the smallest by default, by whether the run is quick.
TARGETS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
SMALLEST = {False: 1e-5, True: 1e-3}
#: Part of the smallest target error that a reference may be uncertain by.
SHARE = 0.3
#: Levels of mesh and of step of a quick run beside the finest, every second one; steps at most; doublings of the mesh
#: in addition for a solver whose own element is of lower order.
FEWEST, MOST_STEPS, MORE_MESHES = 2, 8, 2
#: Tolerances of the error-controlled steps; of a quick run.
TOLERANCES = {False: (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5), True: (1e-2, 1e-3, 1e-4)}


@dataclass(frozen=True)
class Levels:
    """Meshes, steps, references and targets of a case."""

    case: Case
    meshes: Mapping[str, tuple[Mesh, ...]]  # by element, from coarse to fine
    steps: tuple[float, ...]  # from long to short, s
    references: Mapping[str, Refined]  # by element
    targets: tuple[float, ...]  # from the largest to the smallest

    def reference_of(self, element: str) -> Refined:
        """The reference of an element, or of another one with the same continuum."""
        return self.references[same_continuum(element, self.references)]


def same_continuum(element: str, known: Mapping[str, object]) -> str:
    """The element, of those with references, that has the continuum of another one."""
    same = (e for e in known if e in KINDS and KINDS[e].continuum == KINDS[element].continuum)
    return element if element in known else next(same, element)


def levels_of(case: Case, options: Options, runner: Runner) -> Levels:
    """Refine a case with each element, and use the levels of the refinement as the settings to try.

    StudyError if none of the probes moves.
    """
    quick, smallest = options.quick, options.error or SMALLEST[options.quick]
    targets = (*(target for target in TARGETS if target > 1.01 * smallest), smallest)
    models = ("cable",) if quick or not case.scene.beams else ("cable", "shear")
    if options.element:  # references are of one element of each continuum
        models = ("cable" if options.element == "quintic" else options.element,)
    runner.heading = f"{case.name}, reference: "
    found = {e: Refinement(case, runner, element=e).refined(SHARE * smallest) for e in models}
    _check_moves(case, found)
    meshes = {
        e: options.meshes or _few(run.levels.mesh_at, run.i if run.known else 0, quick)
        for e, run in found.items()
    }
    if "cable" in meshes and not quick and case.scene.beams:  # of high order: coarser meshes suffice
        meshes["quintic"] = options.meshes or meshes["cable"][: (len(meshes["cable"]) + 1) // 2]
    first = found[models[0]]
    steps = options.steps or _few(lambda j: first.levels.dt_at(first.i, j), first.j, quick)[-MOST_STEPS:]
    asked = {e: those for e, those in meshes.items() if options.element in (None, e)}
    return Levels(case, asked, steps, found, targets)


def _check_moves(case: Case, found: Mapping[str, Refined]) -> None:
    complete = [run.solution for run in found.values() if run.solution.status.ok]
    if complete and all(rests(solution, probe) for solution in complete for probe in case.probes):
        probes = ", ".join(map(place_name, case.probes))
        raise StudyError(f"case {case.name!r} has probes {probes}, none of which moves; at least one must")


def _few(at: Callable[[int], Level], last: int, quick: bool) -> tuple[Level, ...]:
    """Levels up to that of a reference; of a quick run the last and some before it, every second one."""
    levels = [at(k) for k in range(last + 1)]
    return tuple(levels[::-2][FEWEST::-1] if quick else levels)


def grid(levels: Levels, options: Options) -> pd.DataFrame:
    """Every solver with every freedom that it offers, on the same meshes with the same steps: a row a setting.

    Columns: trial; tightest (whether the bounds of the iteration are the tightest of the solver); kind (solver, element
    and way to step); round (place in the order of the runs, from coarse to fine). StudyError without any row.
    """
    late = dict(not_timed(levels.case, options))
    solvers = [solver for solver in options.solvers or registry.names() if solver not in late]
    pairs = product(levels.meshes, solvers)
    every = [family for pair in pairs for family in _families(levels, *pair, options)]
    if not every:
        asked = " ".join(filter(None, (options.element, options.integrator))) or "a run"
        raise StudyError(f"{asked} is asked for; no solver of {', '.join(solvers)} offers that")
    rows = [
        {
            "trial": replace(family, mesh=mesh, dt=dt), "tightest": tightest, "round": (k, j),
            "kind": (family.solver, family.element, stepping),
        }
        for family, tightest in every
        for stepping in [family.integrator + (", error-controlled" if family.error_controlled else "")]
        for k, mesh in enumerate(_meshes_of(levels, family, options.quick))
        for j, dt in enumerate(steps_of(levels, replace(family, mesh=mesh)))
    ]  # fmt: skip
    return pd.DataFrame(rows)


def not_timed(case: Case, options: Options) -> Iterator[tuple[str, str]]:
    """Solvers that take part only if they are asked for by name, and why."""
    for solver in () if options.solvers else registry.names():
        if slow := sorted(set(features_of(case.scene)) & offer_of(solver).slow_with):
            things = ", ".join(f.replace("-", " ") for f in slow)
            why = f"its model has {things} for verification and not for speed (as by Python callbacks in each step)"
            yield solver, f"{solver} is not timed: {why}; --solvers {solver} times it all the same."


def _families(levels: Levels, element: str, solver: str, options: Options) -> Iterator[tuple[Trial, bool]]:
    """Runs of a solver and an element without mesh and step, and whether the bounds of the iteration are tightest."""
    offer, quick = offer_of(solver), options.quick
    if (offer.element and element not in offer.limits) or offer.lacking({element}):
        return
    own = KINDS.get(offer.element_of(element))
    rules = own.quadratures if own and own.quadratures and levels.case.scene.beams else QUADRATURES[:1]
    slow = frozenset() if options.solvers else offer.slow_with  # made for verification, and not for speed
    integrators = [i for i in offer.integrators if options.integrator in (None, i) and i not in slow]
    for quadrature, integrator in product(rules[-1:] if quick else rules, integrators):
        plain = Trial.of(levels.case, solver, element=element, quadrature=quadrature, integrator=integrator)
        if integrator == EXPLICIT:
            yield plain, True
            continue
        choices = (tuple(choice.items()) for choice in offer.choices)
        yield from ((replace(plain, options=given), k == 0) for k, given in enumerate(choices))
        newton = ("newton_tolerance", NEWTON_TOLERANCES[-1])
        for tolerance in TOLERANCES[quick]:
            yield replace(plain, options=(("tolerance", tolerance), newton)), True


def _meshes_of(levels: Levels, family: Trial, quick: bool) -> tuple[Mesh, ...]:
    """Meshes from coarse to fine; finer ones where the solver's own element is of lower order."""
    meshes = levels.meshes[family.element]
    order = offer_of(family.solver).order_of(family.element)
    if order >= KINDS[family.element].order or len(meshes) < 2 or quick:
        return meshes
    return (*meshes, *(tuple(2**k * n for n in meshes[-1]) for k in range(1, MORE_MESHES + 1)))


def steps_of(levels: Levels, trial: Trial) -> tuple[float, ...]:
    """Steps on a mesh, s: explicit ones take the largest safe step and half of it; a tolerance has none."""
    if trial.error_controlled:
        return (nan,)
    limit = explicit_limit(trial) if trial.integrator == EXPLICIT else inf
    if isinf(limit):
        return levels.steps
    largest = step_below(levels.case, limit)
    return largest, largest / 2.0
