"""Do the solvers agree? Every pair of them on both base scenes, at the same element, mesh and step."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from anctmm.elements.kinds import flexible
from anctmm.errors import AnctmmError
from anctmm.results.metrics import compare
from anctmm.solvers import registry
from studies.cases import assumptions_of
from studies.engine.accuracy.dynamics import check_mesh
from studies.engine.measuring.clock import records
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Outcome
from studies.engine.running.rows import element_of
from studies.engine.running.trial import Mesh, Trial, mesh_label
from studies.engine.study import Options, Result, StudyError
from studies.engine.tables import Table
from studies.report.plots import GRID, ON_DARK, ON_PALE, Picture, picture
from studies.scenes import BaseScene, moving_scenes

ELEMENTS = flexible()
#: Those that a quick run takes, of solvers that have any of ours: each further one is some 20 s of compiling.
QUICK_ELEMENTS = ("cable",)
LEFT_OUT = "quintic and shear elements of the solvers that have cables."
#: Mesh by the element and the number of bodies, by whether the run is quick: shear elements converge slowly, and models
#: can be distinguished only if meshes do not matter.
MESHES: dict[bool, dict[str, dict[int, Mesh]]] = {
    False: {
        "cable": {1: (16,), 3: (4, 16, 4)},
        "shear": {1: (128,), 3: (16, 64, 16)},
        "quintic": {1: (8,), 3: (1, 4, 1)},
    },
    True: {
        "cable": {1: (8,), 3: (2, 8, 2)},
        "shear": {1: (32,), 3: (4, 16, 4)},
        "quintic": {1: (4,), 3: (1, 4, 1)},
    },
}
#: Step by whether the run is quick, s.
STEP = {False: 2e-3, True: 5e-3}
#: Status of what a solver does not offer.
UNSUPPORTED = "unsupported"
#: Of a solver that has explicit steps only, s.
EXPLICIT_STEP = 5e-6
#: Differences up to here are what Newton's tolerances and rounding leave.
SAME = 1e-6


@dataclass(frozen=True)
class Runs:
    """All runs of one scene."""

    base: BaseScene
    outcomes: tuple[Outcome, ...]

    def of(self, solver: str) -> Mapping[str, Outcome]:
        """A solver's runs by the element it really used."""
        mine = [o for o in self.outcomes if o.case.solver == solver]
        return {element_of(solver, o.case.element): o for o in mine}


def trials(options: Options) -> list[Trial]:
    """Runs of all kinds that the study needs."""
    solvers = options.solvers or registry.names()
    return [case for base in moving_scenes() for case in _cases(base, solvers, options)]


def run(options: Options, runner: Runner) -> Result:
    """Run the study."""
    solvers = list(options.solvers or registry.names())
    runner.prepare(trials(options))
    runs = [Runs(b, tuple(runner.sweep(_cases(b, solvers, options), timed=False))) for b in moving_scenes()]
    pairs = pd.DataFrame([line for r in runs for line in _pairs(r, solvers)])
    square = matrix(pairs, solvers)
    said = findings(pairs)
    notes = (
        "Largest distance of the probes' histories over all times, relative to the largest displacement; the largest "
        "over the base scenes and elements that both solvers have. Empty: none, or a run that did not end well.",
        "The same element, mesh and step in both; shear elements on a finer mesh than cables.",
        "Rods of Reissner's kind (exudyn-reissner, pyelastica) and frames (opensees) have elements of their "
        "own, on shear elements' mesh: their figure is the difference of two models, or of two discretisations, on "
        "these meshes.",
        f"A solver without implicit steps takes explicit ones of {EXPLICIT_STEP:g} s; a quick run leaves it at its "
        "refusal.",
    )
    return Result(
        name="agreement",
        title="Do the solvers agree?",
        question="The same scene, element, mesh and step by every solver: do they compute the same motion?",
        findings=said,
        assumptions=tuple(dict.fromkeys(a for b in moving_scenes() for a in assumptions_of(b))),
        tables=(
            Table("matrix", "Agreement of the solvers", square.reset_index(), notes),
            Table("pairs", "Agreement by scene and element", pairs, notes),
        ),
        pictures=(drawing(square),) if len(solvers) > 1 else (),
        answers=said[:1],
        left_out=LEFT_OUT if options.quick and options.element is None else "",
    )


def _cases(base: BaseScene, solvers: Iterable[str], options: Options) -> list[Trial]:
    sizes = (1, len(base.scene.beams))
    fitting = [m for m in options.meshes or () if len(m) in sizes]
    for mesh in options.meshes or ():
        if len(mesh) not in (1, 3):
            check_mesh(base.scene, mesh)
    dt = options.steps[0] if options.steps else STEP[options.quick]
    if options.element not in (None, *ELEMENTS):
        raise StudyError(f"--element is {options.element!r}; solvers are compared with {', '.join(ELEMENTS)}")
    if options.integrator not in (None, "generalized-alpha", "zhai"):
        raise StudyError(
            f"--integrator is {options.integrator!r}; solvers are compared with generalized-alpha or zhai"
        )
    cases = []
    for element, solver in product([options.element] if options.element else ELEMENTS, solvers):
        used = element_of(solver, element)
        if used != element and (used in ELEMENTS or element != "shear"):
            continue  # one run with its own element is enough
        if _lacks(solver, element) or (used in ELEMENTS and used not in _compared(options)):
            continue
        mesh = fitting[0] if fitting else MESHES[options.quick][element][len(base.scene.beams)]
        implicit = (options.quick or _has_implicit(solver)) and options.integrator != "zhai"
        cases.append(Trial(
            base.scene, solver, mesh, element=element, integrator="generalized-alpha" if implicit else "zhai",
            dt=dt if implicit else EXPLICIT_STEP, t_end=base.duration, output_dt=base.interval,
        ))  # fmt: skip
    return cases


def _compared(options: Options) -> Sequence[str]:
    """Our elements that solvers are compared with."""
    if options.element is not None:
        return (options.element,)
    return QUICK_ELEMENTS if options.quick else ELEMENTS


def _lacks(solver: str, element: str) -> bool:
    """Whether a solver says that it does not have an element."""
    try:
        return bool(registry.offer_of(registry.load(solver)).lacking([element]))
    except AnctmmError:
        return False  # whatever is wrong with it, its row will say


def _has_implicit(solver: str) -> bool:
    try:
        return "generalized-alpha" in registry.offer_of(registry.load(solver)).integrators
    except AnctmmError:
        return True  # whatever is wrong with it, its row will say


def _pairs(runs: Runs, solvers: list[str]) -> Iterable[dict[str, Any]]:
    """A line for each pair and each element both have; of a pair without one, for each pair of their elements."""
    for a, b in combinations(solvers, 2):
        mine, theirs = runs.of(a), runs.of(b)
        common = [(e, e) for e in mine if e in theirs]
        for i, j in common or [(i, j) for i in mine for j in theirs]:
            one, other = mine[i].solution, theirs[j].solution
            bad = [f"{s.solver or name} {s.status}" for name, s in ((a, one), (b, other)) if not s.status.ok]
            compared = None if bad else compare(other, one, runs.base.probes)
            case, meshes = mine[i].case, (mesh_label(o.case.mesh) for o in (mine[i], theirs[j]))
            yield {
                "scene": runs.base.scene.name, "solver": a, "other": b, "element": i if i == j else f"{i} / {j}",
                "elements": " / ".join(dict.fromkeys(meshes)), "dt": case.dt,
                "difference": compared.largest if compared else float("nan"),
                "rms": compared.error if compared else float("nan"),
                "same_element": i == j and i in ELEMENTS, "status": "; ".join(bad) or "ok",
            }  # fmt: skip


def matrix(pairs: pd.DataFrame, solvers: list[str]) -> pd.DataFrame:
    """The largest difference of each pair, symmetric; NaN on the diagonal and where a run did not end well.

    What a solver cannot represent, and says so, is left out.
    """
    square = pd.DataFrame(np.nan, index=pd.Index(solvers, name="solver"), columns=solvers)
    if pairs.empty:
        return square
    asked = pairs[~pairs["status"].str.contains(f" {UNSUPPORTED}")]
    for (a, b), lines in asked.groupby(["solver", "other"], sort=False):
        square.loc[a, b] = square.loc[b, a] = lines["difference"].max(skipna=False)
    return square


def findings(pairs: pd.DataFrame) -> tuple[str, ...]:
    """Sentences from the pairs."""
    if pairs.empty:
        return ()
    known = pairs[pairs["same_element"] & pairs["difference"].notna()]
    said = []
    if len(known):
        worst = records(known.sort_values("difference"))[-1]
        count = len(set(known["solver"]) | set(known["other"]))
        said.append(
            f"The {count} solvers that share an element agree on both scenes to {worst['difference']:.1e} of the "
            f"largest displacement (the worst: {worst['solver']} and {worst['other']}, {worst['element']}, "
            f"{worst['scene']}), so that they differ in cost, not in accuracy."
        )  # fmt: skip
    first = pairs["solver"] == pairs["solver"].iloc[0]  # the others differ by as much
    apart = pairs[first & ~pairs["same_element"] & pairs["difference"].notna()]
    said += [
        f"{r['scene']}: {r['solver']} and {r['other']} ({r['element']}) differ by {r['difference']:.2g}: "
        "two models or two discretisations."
        for r in records(apart.drop_duplicates(["scene", "other"]))
    ]
    return tuple(said)


def drawing(square: pd.DataFrame) -> Picture:
    """The matrix as coloured cells with their numbers."""
    names, values = list(square.columns), square.to_numpy(float)
    known = values[np.isfinite(values) & (values > 0)]
    low, high = (max(known.min(), 1e-16), known.max()) if known.size else (1e-16, 1.0)
    norm, colours = LogNorm(low, max(high, 10 * low)), mpl.colormaps["viridis"]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        shown = np.where(np.isfinite(values), np.maximum(values, low), np.nan)
        axes.pcolormesh(
            np.ma.masked_invalid(shown), norm=norm, cmap=colours, edgecolor=GRID, linewidth=1.5, alpha=1
        )
        for i, j in np.ndindex(values.shape):
            if not np.isfinite(values[i, j]):
                words, ink = ("same" if i == j else "–"), "#7f7f87"
            else:
                red, green, blue, _ = colours(norm(shown[i, j]))
                ink = ON_PALE if 0.3 * red + 0.59 * green + 0.11 * blue > 0.5 else ON_DARK
                words = f"{values[i, j]:.0e}".replace("e-", "e−")
            axes.text(j + 0.5, i + 0.5, words, ha="center", va="center", color=ink)
        axes.set_xticks(np.arange(len(names)) + 0.5, names, rotation=20, ha="right")
        axes.set_yticks(np.arange(len(names)) + 0.5, names)
        axes.tick_params(length=0)
        axes.grid(False)
        axes.invert_yaxis()
        for spine in axes.spines.values():
            spine.set_visible(False)

    caption = (
        "Largest relative difference of the histories of each pair of solvers over the base scenes that both can run, "
        "at the same element, mesh and step. Dark: alike; bright: apart. Rods of Reissner's kind are another model."
    )
    return picture("agreement", caption, draw, (6.4, 1.3 + 0.5 * len(names)))
