"""What equal error costs: ANC-TMM and Exudyn, each at its best over mesh, step, quadrature, tolerance, integrator."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import ceil
from typing import Any

import numpy as np
import pandas as pd

from anctmm.discretise.discretisation import Discretisation
from anctmm.elements.kinds import QUADRATURES
from anctmm.results.accounting import accounted
from anctmm.results.metrics import compare
from anctmm.results.solution import Cost, Solution
from anctmm.solve import solve
from reference import exudyn_cable
from studies.benchmark.peers import EXUDYN, OURS, mesh_of
from studies.engine.accuracy.references import uncertainty_of
from studies.engine.accuracy.robust import NOTE as ROBUST
from studies.engine.accuracy.robust import robust_errors
from studies.engine.choices import Given, choices_of, written
from studies.engine.measuring.clock import Effort, Samples
from studies.engine.measuring.setting import stable_step
from studies.engine.measuring.timing import in_turn, least, undisturbed
from studies.engine.pareto_front import NEAR, cost_at, excess, front
from studies.engine.running.trial import Mesh, mesh_label
from studies.engine.tables import BUILD, Table
from studies.scenes import STEPS, BaseScene, cantilever_fall, four_bar

#: Errors at which costs are compared.
TARGETS = (1e-2, 1e-3, 1e-4, 1e-5)
#: An explicit run is tried where elements times steps do not exceed this, some 30 ms of ANC-TMM.
MOST_EXPLICIT = 1e6
#: Settings tried with Exudyn: those predicted to cost up to this much more than the cheapest of the same error.
SLACK = 2.0
IMPLICIT, EXPLICIT = "generalized-alpha", "zhai"


@dataclass(frozen=True)
class Race:
    """A scene with the meshes to try and its reference.

    Parameters
    ----------
    base : BaseScene
    meshes : tuple of Mesh
        From coarse to fine.
    explicit : tuple of str
        Codes that can run it explicitly.
    fine, less_fine : Mesh
        Of the reference, and of the run that tells its uncertainty.
    """

    base: BaseScene
    meshes: tuple[Mesh, ...]
    explicit: tuple[str, ...]
    fine: Mesh
    less_fine: Mesh


@dataclass(frozen=True)
class Setting:
    """Everything that may be chosen of a run."""

    code: str
    integrator: str
    mesh: Mesh
    dt: float
    quadrature: str
    shared: Given = ()
    own: Given = ()

    @property
    def elements(self) -> int:
        """Elements of all bodies."""
        return sum(self.mesh)

    @property
    def label(self) -> str:
        """As tables name it."""
        return f"{self.integrator} {mesh_label(self.mesh)} {self.quadrature} dt={self.dt:.3g}, {self.chosen}"

    @property
    def chosen(self) -> str:
        """What else was chosen, as tables name it."""
        return written(self.shared + self.own)


@dataclass(frozen=True)
class Point:
    """A setting with what it gave: errors, CPU time of the steps and of the call beside them, s.

    Parameters
    ----------
    setting : Setting
    error : float
        Robust, see `studies.engine.accuracy.robust`.
    measured_error : float
    cpu_s, build_s : float
    status : str
    spread : float
    repeats : int
    """

    setting: Setting
    error: float
    measured_error: float
    cpu_s: float
    status: str
    spread: float = float("nan")
    repeats: int = 1
    build_s: float = float("nan")


def races(quick: bool) -> list[Race]:
    """The two base scenes."""
    beams: tuple[Mesh, ...] = ((4,), (6,), (8,), (12,), (16,), (24,), (32,), (48,), (64,))
    bars: tuple[Mesh, ...] = (
        (1, 3, 1), (1, 4, 1), (1, 6, 1), (2, 6, 2), (2, 8, 2), (2, 12, 2), (3, 10, 3), (4, 12, 4),
        (4, 16, 4), (6, 24, 6), (8, 32, 8),
    )  # fmt: skip
    both = (OURS, EXUDYN)
    if quick:
        beams, bars = beams[::2], bars[::3]
    return [
        Race(cantilever_fall(), beams, both, (192,), (128,)),
        Race(four_bar(), bars, (OURS,), (16, 64, 16), (12, 48, 12)),
    ]


def equal_error(effort: Effort, samples: Samples) -> tuple[Table, Table]:
    """Tables of the best costs at equal errors, and of the runs they come from."""
    rows: list[dict[str, Any]] = []
    points: list[dict[str, Any]] = []
    for race in races(effort.quick):
        found, uncertainty = explore(race, effort, samples)
        rows += [_at_error(race, found, target, uncertainty) for target in TARGETS]
        points += [_point_row(race, p, uncertainty) for p in found]
    return (
        Table(
            "equal_error", "Beside Exudyn, at equal error, both at their best", pd.DataFrame(rows), _notes()
        ),
        Table("work_precision", "The fronts of error and cost", pd.DataFrame(points), _notes()),
    )


def _notes() -> tuple[str, ...]:
    return (
        "Each code's front: no other of its settings has both a smaller error and a smaller cost. What came within "
        f"{NEAR:g} times of it ran again, both codes in turn; costs are the least of these, interpolated between "
        "neighbours on the front that they have, in "
        "logarithms of error and cost, never beyond its ends (above its largest error its cheapest run counts).",
        f"Tried: meshes, quadratures {', '.join(QUADRATURES)}, steps {', '.join(f'{s:.3g}' for s in STEPS)} s, "
        "and of each code all that it may choose beside them (Newton's tolerances; when Exudyn takes a new tangent); "
        "explicit runs at 0.8 of the stability limit where a code can do them and "
        f"elements × steps are at most {MOST_EXPLICIT:g} (they are far behind). Both codes "
        "have the same elements and generalized-α (spectral radius 0.9) and so the same errors: Exudyn ran every "
        f"setting whose elements × steps are within {SLACK:g}× of the fewest for its error, found with ANC-TMM.",
        "Exudyn: fast module, one thread, the faster of its dense and sparse solvers, no files.",
        "error: over the probes, the largest of RMS in time of |u − u_ref| / max in time of |u_ref|, against a fine "
        "mesh of the same cables; reference_error: its own uncertainty.",
        ROBUST,
        BUILD,
    )


def explore(race: Race, effort: Effort, samples: Samples) -> tuple[list[Point], float]:
    """Fronts of both codes, timed in turn, and the uncertainty of their errors."""
    reference, uncertainty = reference_of(race, effort.quick)
    ours = robust([try_out(race, s, reference) for s in settings(race, OURS, effort.quick)])
    implicit = [p for p in ours if p.setting.integrator == IMPLICIT]
    worth = promising(implicit)
    theirs = robust(
        [try_out(race, s, reference) for s in settings(race, EXUDYN, effort.quick) if _worth(s, worth)]
    )
    chosen: list[Point] = []
    for points in (ours, theirs):
        for kinds in ((IMPLICIT,), (IMPLICIT, EXPLICIT)):
            chosen += contenders([p for p in points if p.setting.integrator in kinds])
    chosen = list(dict.fromkeys(chosen))
    return timed(race, chosen, 2 if effort.quick else 5, samples), uncertainty


def reference_of(race: Race, quick: bool) -> tuple[Solution, float]:
    """A fine run, and the sum of its differences to one of a coarser mesh and one of a coarser step."""
    dt = 1e-4 if quick else 5e-5
    fine = Setting(OURS, IMPLICIT, race.fine, dt, "lobatto", (("newton_tolerance", 1e-10),))
    best, coarser, slower = (
        run_of(race, s) for s in (fine, replace(fine, mesh=race.less_fine), replace(fine, dt=2 * dt))
    )
    return best, uncertainty_of(best, (coarser, slower), race.base.probes)


def settings(race: Race, code: str, quick: bool) -> list[Setting]:
    """All settings of a code; of a quick run, those that are best in a whole one, more or less."""
    steps, part = (STEPS[1::2], 1) if quick else (STEPS, 0)
    chosen = [
        Setting(code, IMPLICIT, mesh, dt, quadrature, shared, own)
        for mesh, quadrature, dt, (shared, own) in product(
            race.meshes, QUADRATURES[part:], steps, choices_of(code)
        )
    ]
    if code in race.explicit:
        marched = [_explicit(race, code, mesh, q) for mesh, q in product(race.meshes, QUADRATURES[part:])]
        chosen += [s for s in marched if s.elements * race.base.duration / s.dt <= MOST_EXPLICIT]
    return chosen


def _explicit(race: Race, code: str, mesh: Mesh, quadrature: str) -> Setting:
    limit = stable_step(
        race.base.scene, mesh_of(race.base, mesh), {"element": "cable", "quadrature": quadrature}
    )
    dt = race.base.interval / ceil(race.base.interval / limit)
    return Setting(code, EXPLICIT, mesh, dt, quadrature)


def run_of(race: Race, setting: Setting) -> Solution:
    """Run a setting."""
    base = race.base
    run = Discretisation(
        mesh=mesh_of(base, setting.mesh), element="cable", quadrature=setting.quadrature,
        integrator=setting.integrator, dt=setting.dt, t_end=base.duration, output_dt=base.interval,
        check_stability=False, **dict(setting.shared),
    )  # fmt: skip
    if setting.code == OURS:
        return solve(base.scene, run)
    return accounted(exudyn_cable.solve)(base.scene, run, **dict(setting.own))


def try_out(race: Race, setting: Setting, reference: Solution) -> Point:
    """One run of a setting: its error and, roughly, its cost."""
    with undisturbed():
        solution = run_of(race, setting)
    error = compare(solution, reference, race.base.probes).error if solution.status.ok else float("nan")
    cost = solution.cost
    return Point(setting, error, error, cost.cpu_s, str(solution.status), build_s=cost.build_s)


def robust(points: Sequence[Point]) -> list[Point]:
    """Points with robust errors."""
    first = {code: choices_of(code)[0] for code in (OURS, EXUDYN)}
    alike = [(s.code, s.integrator, s.mesh, s.dt, s.quadrature) for s in (p.setting for p in points)]
    tightest = [(p.setting.shared, p.setting.own) == first[p.setting.code] for p in points]
    errors = robust_errors(pd.Series([p.measured_error for p in points], dtype=float), alike, tightest)
    return [replace(p, error=float(e)) for p, e in zip(points, errors, strict=True)]


def promising(points: Iterable[Point]) -> set[tuple[Mesh, float, str]]:
    """Meshes, steps and quadratures whose elements × steps are near the fewest for their error."""
    best: dict[tuple[Mesh, float, str], float] = {}
    for p in points:
        key = (p.setting.mesh, p.setting.dt, p.setting.quadrature)
        if np.isfinite(p.error):
            best[key] = min(p.error, best.get(key, np.inf))

    def work(key: tuple[Mesh, float, str]) -> float:
        return sum(key[0]) / key[1]

    return {
        key
        for key, error in best.items()
        if work(key) <= SLACK * min(work(other) for other, e in best.items() if e <= error)
    }


def _worth(setting: Setting, worth: set[tuple[Mesh, float, str]]) -> bool:
    return setting.integrator == EXPLICIT or (setting.mesh, setting.dt, setting.quadrature) in worth


def contenders(points: Sequence[Point]) -> list[Point]:
    """Points near the front, from its last one above the errors compared to its first one below, or no dearer."""
    line = front(points)
    above = [p.error for p in line if p.error > max(TARGETS)]
    below = [p for p in line if p.error <= min(TARGETS)] or line[-1:]
    dearest = NEAR * below[0].cpu_s if below else 0.0
    found = pd.DataFrame({"robust_error": [p.error for p in points], "cpu_s": [p.cpu_s for p in points]})
    near = excess(found) <= NEAR
    return [
        p
        for p, close in zip(points, near, strict=True)
        if close and p.error <= min(above, default=np.inf) and p.cpu_s <= dearest
    ]


def timed(race: Race, points: Sequence[Point], rounds: int, samples: Samples) -> list[Point]:
    """Points with the least of runs in turn."""
    names = {f"{p.setting.code} {p.setting.label}": p for p in points}

    def sampler(p: Point) -> Callable[[], Cost]:
        return lambda: run_of(race, p.setting).cost

    found = in_turn({n: sampler(p) for n, p in names.items()}, rounds)
    for name, costs in found.items():
        samples.keep(f"work-precision, {race.base.scene.name}", name, [1e9 * c.cpu_s for c in costs])
    return [_with_time(p, found[n]) for n, p in names.items()]


def _with_time(p: Point, costs: Sequence[Cost]) -> Point:
    found = least(costs)
    return replace(
        p, cpu_s=found.cpu_s, spread=found.cpu_spread, repeats=found.repeats, build_s=found.build_s
    )


def _at_error(race: Race, points: Sequence[Point], error: float, uncertainty: float) -> dict[str, Any]:
    def cost(code: str, *kinds: str) -> float:
        return cost_at((p for p in points if p.setting.code == code and p.setting.integrator in kinds), error)

    def nearest(code: str) -> Point | None:
        able = [p for p in points if p.setting.code == code and p.error <= error]
        return min(able, key=lambda p: p.cpu_s, default=None)

    costs: Mapping[str, float] = {
        "anctmm_implicit_s": cost(OURS, IMPLICIT),
        "anctmm_best_s": cost(OURS, IMPLICIT, EXPLICIT),
        "exudyn_implicit_s": cost(EXUDYN, IMPLICIT),
        "exudyn_best_s": cost(EXUDYN, IMPLICIT, EXPLICIT),
    }
    return {
        "scene": race.base.scene.name,
        "error": error,
        "reference_error": uncertainty,
        **costs,
        "ratio_implicit": costs["exudyn_best_s"] / costs["anctmm_implicit_s"],
        "ratio_best": costs["exudyn_best_s"] / costs["anctmm_best_s"],
        **{
            f"{name}_{what}": text
            for name, best in (("anctmm", nearest(OURS)), ("exudyn", nearest(EXUDYN)))
            for what, text in (
                ("nearest", best.setting.label if best else "none"),
                ("build_s", best.build_s if best else np.nan),
            )
        },
        "status": "ok" if np.isfinite(list(costs.values())).all() else "not reached by every code",
    }


def _point_row(race: Race, p: Point, uncertainty: float) -> dict[str, Any]:
    s = p.setting
    return {
        "scene": race.base.scene.name, "code": s.code, "integrator": s.integrator, "elements": mesh_label(s.mesh),
        "dt": s.dt, "quadrature": s.quadrature, "chosen": s.chosen, "error": p.measured_error,
        "robust_error": p.error, "reference_error": uncertainty, "cpu_s": p.cpu_s, "build_s": p.build_s,
        "spread": p.spread, "repeats": p.repeats, "status": p.status,
    }  # fmt: skip
