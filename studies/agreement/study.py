"""Do the solvers agree? Every pair of them on both base scenes, at the same element, mesh and step."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import Any

import numpy as np
import pandas as pd

from anctmm.elements.kinds import flexible
from anctmm.model.case import Case
from anctmm.model.needs import needs
from anctmm.results.metrics import compare
from anctmm.results.solution import Solution
from anctmm.solvers import registry
from anctmm.solvers.capabilities import Offer
from anctmm.validation import one_of
from studies.cases import assumptions_of
from studies.engine.runner import Runner
from studies.engine.study import Options, Result
from studies.engine.tables import Table, records
from studies.engine.trials import EXPLICIT, Trial, offer_of
from studies.scenes import moving_scenes

#: Elements of each beam by the element, of the cantilever and of the four-bar: shear elements converge slowly.
MESHES = {"cable": ((16,), (4, 16, 4)), "quintic": ((8,), (1, 4, 1)), "shear": ((128,), (16, 64, 16))}
QUICK = {**MESHES, "cable": ((8,), (2, 8, 2)), "shear": ((32,), (4, 16, 4))}
#: Step, s, by whether the run is quick; and of a solver that has explicit steps only.
STEP, EXPLICIT_STEP = {False: 2e-3, True: 5e-3}, 5e-6
NOTES = (
    "Largest distance of the probes' histories over all times, relative to the largest displacement, at the same "
    "element, mesh and step. Empty: no common element, or a run that did not end well.",
    "Solvers with elements of their own run on the mesh of shear elements: their figure is the difference of two "
    f"models or discretisations. A solver without implicit steps takes explicit ones of {EXPLICIT_STEP:g} s.",
)


def agreement(
    quick: bool = False, solvers: Sequence[str] | None = None, runner: Runner | None = None, **asked: Any
) -> pd.DataFrame:
    """A row for each scene, each pair of solvers and each element that both have.

    A solver takes part where it declares the features of the scene and the element. `asked` may have element,
    integrator, dt (s) and mesh (elements of each beam) in the place of the study's own.
    """
    if asked.get("element") is not None:
        one_of("--element", asked["element"], flexible())
    rows: list[dict[str, Any]] = []
    for case in moving_scenes():
        names = solvers or registry.names()
        trials = [trial for name in names for trial in _trials(case, name, quick, asked)]
        found: dict[str, dict[str, Solution]] = {name: {} for name in names}
        for trial, solution in zip(trials, (runner or Runner()).solve_many(trials), strict=True):
            if solution.status.code != "unsupported":
                found[trial.solver][trial.used] = solution
        for (a, mine), (b, theirs) in combinations(found.items(), 2):
            shared = [(element, element) for element in mine if element in theirs]
            rows += [
                {
                    "scene": case.name, "solver": a, "other": b, "element": i if i == j else f"{i} / {j}",
                    **_difference(case, mine[i], theirs[j]), "same_element": i == j and i in flexible(),
                }
                for i, j in shared or product(mine, theirs)
            ]  # fmt: skip
    return pd.DataFrame(rows)


def _trials(case: Case, solver: str, quick: bool, asked: Mapping[str, Any]) -> Iterator[Trial]:
    """Runs of a solver with each element; none where it lacks a feature of the scene."""
    offer = offer_of(solver)
    integrator = asked.get("integrator") or offer.integrators[0]
    explicit = integrator == EXPLICIT
    dt = asked.get("dt") or (EXPLICIT_STEP if explicit else STEP[quick])
    features = {integrator, *(feature for feature, _ in needs(case.scene))}
    for element in () if explicit and quick else _elements(offer, asked.get("element"), quick):
        mesh = asked.get("mesh") or (QUICK if quick else MESHES)[element][len(case.scene.beams) > 1]
        if not offer.lacking({*features, element}):
            yield Trial.of(case, solver, mesh, element=element, integrator=integrator, dt=dt)


def _elements(offer: Offer, asked: str | None, quick: bool) -> Iterator[str]:
    """Elements to be asked for: each that a solver has; of one with its own that of shear elements, for their mesh."""
    for element in [asked] if asked else MESHES:
        used = offer.element_of(element)
        own = used not in flexible()
        few = quick and not asked and not own and element != "cable"
        if not few and element == ("shear" if own else used):
            yield element


def _difference(case: Case, one: Solution, other: Solution) -> dict[str, Any]:
    """Of two solutions, or why it is not known."""
    if bad := [str(solution.status) for solution in (one, other) if not solution.status.ok]:
        return {"difference": np.nan, "rms": np.nan, "status": "; ".join(bad)}
    found = compare(other, one, case.probes)
    return {"difference": found.largest, "rms": found.error, "status": "ok"}


def matrix(pairs: pd.DataFrame, solvers: Sequence[str]) -> pd.DataFrame:
    """The largest difference of each pair, symmetric; NaN where there is none."""
    square = pd.DataFrame(np.nan, index=pd.Index(solvers, name="solver"), columns=list(solvers))
    for (a, b), lines in pairs.groupby(["solver", "other"], sort=False) if len(pairs) else ():
        square.loc[a, b] = square.loc[b, a] = lines["difference"].max(skipna=False)
    return square


def findings(pairs: pd.DataFrame) -> tuple[str, ...]:
    """Sentences from the pairs."""
    known = pairs[pairs["same_element"] & pairs["difference"].notna()] if len(pairs) else pairs
    if known.empty:
        return ()
    worst = known.sort_values("difference").iloc[-1]
    count = len({*known["solver"], *known["other"]})
    other = pairs[~pairs["same_element"] & (pairs["solver"] == pairs["solver"].iloc[0])]
    agree = (
        f"The {count} solvers that share an element agree on both scenes to {worst['difference']:.1e} of the largest "
        f"displacement (the worst: {worst['solver']} and {worst['other']}, {worst['element']}, {worst['scene']})."
    )
    lines = records(other.dropna(subset="difference").drop_duplicates(["scene", "other"]))
    told = ("{scene}: {solver} and {other} ({element}) differ by {difference:.2g}".format(**r) for r in lines)
    return agree, *(f"{text}: two models or two discretisations." for text in told)


def run(options: Options, runner: Runner) -> Result:
    """The study as `anctmm study agreement` runs it."""
    solvers = list(options.solvers or registry.names())
    asked: dict[str, Any] = {"element": options.element, "integrator": options.integrator}
    asked |= {"dt": options.steps[0]} if options.steps else {}
    asked |= {"mesh": options.meshes[0][:1]} if options.meshes else {}
    pairs = agreement(options.quick, solvers, runner, **asked)
    square, sentences = matrix(pairs, solvers), findings(pairs)
    return Result(
        "agreement", "Do the solvers agree?",
        "The same scene, element, mesh and step by every solver: do they compute the same motion?",
        sentences, tuple(dict.fromkeys(a for b in moving_scenes() for a in assumptions_of(b))),
        (
            Table("matrix", "Agreement of the solvers", square.reset_index(), NOTES),
            Table("pairs", "Agreement by scene and element", pairs, NOTES),
        ),
        answers=sentences[:1], left_out="quintic and shear elements of the solvers that have cables.",
    )  # fmt: skip
