"""Which beams of a case may be cables or rigid bars: error and cost of each choice against the detailed model."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, product
from math import nan
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from anctmm.model.case import Case
from anctmm.model.scene import Beam, Scene
from anctmm.validation import FrozenMapping
from studies.cases import assumptions_of
from studies.engine.files import file_name
from studies.engine.meshes import explicit_limit, step_below
from studies.engine.refinement import EXPLICIT, Refined, Refinement, Setup
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Picture, Result, StudyError
from studies.engine.tables import BUILD, Table, milliseconds, records
from studies.engine.timing import least
from studies.engine.trials import Trial
from studies.report.plots import floor, log_axes, picture

#: Kinds of model, the detailed one first.
MODELS = ("shear", "cable", "rigid")
#: Target errors of a model; the smallest by default, by whether the run is quick.
TARGETS = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3)
SMALLEST = {False: 1e-3, True: 1e-2}
#: Part of the smallest target error that mesh and step of each kind may add.
SHARE = 0.3
#: Elements times steps of an explicit run at most, by whether the run is quick.
MOST_WORK = {False: 4e6, True: 3e5}
#: Beams, or groups of equal beams, that are chosen one by one, at most.
MOST_UNITS = 8
PHYSICS = (
    "Each kind of element is on a mesh, and moves by an implicit step, that were refined until their part of the error "
    f"is below {SHARE:g} of the smallest target error; explicit steps are a safe part of the choice's own stability "
    "limit.",
    "A rigid beam is a thin bar: no rotary inertia of its section, as the cable.",
)
NOTES = {
    "cheapest": "target: for model, mesh and step together; a choice counts if its error and the uncertainty of the "
    "detailed model together are below it. gain: CPU time of the detailed model over that of the choice.",
    "beams": "model: kinds of the run, all other beams as detailed as they can be (welds do not join shear elements to "
    "cables). enough_for: the smallest target error that it meets.",
    "choices": "error: difference to the detailed model at the probes; it holds all: model, mesh and step.",
}

#: A kind for each beam, in the scene's order.
Kinds = tuple[str, ...]


def run(options: Options, runner: Runner) -> Result:
    """Run the study of a case that has beams.

    Raises
    ------
    StudyError
        If it has none.
    """
    case = options.case
    if not case.scene.beams:
        raise StudyError(f"case {case.name!r} has no beam; at least one is needed to choose its element")
    smallest = options.error or SMALLEST[options.quick]
    targets = (*(t for t in TARGETS if t > 1.01 * smallest), smallest)
    choices = Choices.of(case.scene, kinds_of(case.scene))
    refined = dict[str, Refined]()
    for kind in choices.kinds:
        runner.heading = f"{case.name}, mesh and step of {kind} beams: "
        refined[kind] = Refinement(case, Setup(element=kind), runner).refined(SHARE * smallest)
    models = Models(case, choices, refined, runner, MOST_WORK[options.quick])
    rows = _with_gain(models.rows(choices.first()))
    alone = pd.DataFrame(_simplified(case, rows, choices, targets))
    known = {(row["unit"], row["kind"]): row["error"] for row in records(alone) if row["status"] == "ok"}
    more = [kinds for kinds in choices.best(known, targets) if "/".join(kinds) not in set(rows["element"])]
    if more:
        rows = _with_gain(pd.concat([rows, models.rows(more)], ignore_index=True))
    alone = alone.drop(columns="unit")
    cheapest = pd.DataFrame([_cheapest(rows, target) for target in targets])
    model, sentence = _finding(case, rows, cheapest)
    question = f"{case.name}: which beams may be modelled more simply?"
    return Result(
        name="fidelity", title="Fidelity", question="Which beam must be modelled how finely, and what is saved?",
        findings=(sentence,), assumptions=(*PHYSICS, *assumptions_of(case), *_remarks(case, refined)),
        tables=(
            Table("cheapest", "The cheapest model under a target error", cheapest, (NOTES["cheapest"],)),
            Table("beams", "One beam simplified at a time", alone, (NOTES["beams"],)),
            Table("choices", "Every choice of kinds", rows, (NOTES["choices"], BUILD)),
        ),
        pictures=(_picture(case.name, rows),) if (rows["error"] > 0.0).any() else (),
        answers=(Answer(question, model, sentence),), shown=("cheapest", "beams"),
        good=bool(rows["status"].eq("ok").any()),
    )  # fmt: skip


def kinds_of(scene: Scene) -> Kinds:
    """Kinds to choose from: shear elements that bend too stiffly are no measure of others."""
    return MODELS[1:] if any(beam.material.poisson > 0.0 for beam in scene.beams) else MODELS


@dataclass(frozen=True)
class Choices:
    """Choices of a kind for each beam."""

    names: tuple[str, ...]  # of the beams
    units: tuple[tuple[int, ...], ...]  # places of the beams that are chosen together
    kinds: Kinds  # the detailed one first

    @classmethod
    def of(cls, scene: Scene, kinds: Kinds) -> "Choices":
        """Each beam alone; of many beams those of one section, material and length together, the longest first."""
        beams = scene.beams
        units: list[tuple[int, ...]] = [(k,) for k in range(len(beams))]
        if len(beams) > MOST_UNITS:
            order = sorted(range(len(beams)), key=lambda k: (_size(beams[k]), k))
            units = [tuple(group) for _, group in groupby(order, key=lambda k: _size(beams[k]))]
            units = sorted(sorted(units, key=lambda u: -beams[u[0]].length * len(u))[:MOST_UNITS])
        return cls(tuple(beam.name for beam in beams), tuple(units), kinds)

    def alone(self, unit: int, kind: str) -> Kinds:
        """One unit of a kind, all others as detailed as can be."""
        return tuple(kind if k in self.units[unit] else self.kinds[0] for k in range(len(self.names)))

    def first(self) -> list[Kinds]:
        """Choices to try before anything is known, the detailed one first."""
        uniform = [(kind,) * len(self.names) for kind in self.kinds]
        alone = [self.alone(*pair) for pair in product(range(len(self.units)), self.kinds[1:])]
        return list(dict.fromkeys([*uniform, *alone]))

    def best(self, error: Mapping[tuple[int, str], float], targets: Sequence[float]) -> list[Kinds]:
        """Combinations of simplified units whose errors alone sum up to no more than a target."""
        found = [self._sum_below(error, target, base) for target in targets for base in self.kinds[:-1]]
        return list(dict.fromkeys(found))

    def _sum_below(self, error: Mapping[tuple[int, str], float], target: float, base: str) -> Kinds:
        kinds, taken = [base] * len(self.names), dict[int, float]()
        simpler = self.kinds[self.kinds.index(base) + 1 :]
        allowed = [(e, unit, kind) for (unit, kind), e in error.items() if kind in simpler]
        for e, unit, kind in sorted(allowed):  # a later kind of a unit is simpler, and has a larger error
            if sum(taken.values()) - taken.get(unit, 0.0) + e <= target:
                taken[unit] = e
                for k in self.units[unit]:
                    kinds[k] = kind
        return tuple(kinds)

    def words(self, kinds: Kinds) -> str:
        """A choice in words."""
        usual = max(dict.fromkeys(kinds), key=kinds.count)
        parts = []
        for kind in dict.fromkeys(k for k in kinds if k != usual):
            those = [name for name, k in zip(self.names, kinds, strict=True) if k == kind]
            more = f" and {len(those) - 4} more" if len(those) > 4 else ""
            parts.append(f"{', '.join(those[:4])}{more} {kind}")
        return f"{usual}, but {'; '.join(parts)}" if parts else usual if len(kinds) == 1 else f"all {usual}"


@dataclass(frozen=True)
class Models:
    """Runs of choices, each kind on the mesh and by the step that its own refinement found."""

    case: Case
    choices: Choices
    refined: Mapping[str, Refined]  # by kind
    runner: Runner
    most_work: float  # of an explicit run, elements times steps

    def rows(self, every: Sequence[Kinds]) -> pd.DataFrame:
        """Rows of choices: of implicit and of explicit steps; of equilibria one."""
        reference = self.refined[self.choices.kinds[0]]
        planned = [(kinds, trial) for kinds in every for trial in self._trials(kinds)]
        self.runner.heading = f"{self.case.name}, choices: "
        trials = [trial for _, trial in planned]
        solutions = self.runner.solve_many(trials)
        good = [k for k, s in enumerate(solutions) if s.status.ok]
        costs = self.runner.time_in_turn([trials[k] for k in good]) if good else []
        times = {k: vars(least(samples)) for k, samples in zip(good, costs, strict=True)}
        return pd.DataFrame([
            {
                "scene": self.case.name, "model": self.choices.words(kinds), "element": "/".join(kinds),
                "integrator": trial.integrator, "elements": trial.cut, "dofs": solution.dofs, "dt": trial.dt,
                "error": reference.error_of(solution), "reference_error": reference.uncertainty,
                **{name: times[k][name] if k in times else nan for name in ("cpu_s", "build_s")},
                "status": str(solution.status),
            }
            for k, ((kinds, trial), solution) in enumerate(zip(planned, solutions, strict=True))
        ])  # fmt: skip

    def _trials(self, kinds: Kinds) -> Iterator[Trial]:
        """An implicit run (an equilibrium), and an explicit one where that does not take too long."""
        mesh = tuple(self.refined[kind].trial.mesh[k] for k, kind in enumerate(kinds))
        element = FrozenMapping(zip(self.choices.names, kinds, strict=True))
        reached = {found.trial.dt for kind, found in self.refined.items() if kind in kinds and found.reached}
        dt = min(reached or {found.trial.dt for found in self.refined.values()})
        implicit = Trial.of(self.case, Setup.solver, mesh, element=element, dt=dt)
        yield implicit
        if not self.case.static:
            limit = explicit_limit(self.case, implicit.by_body, element=element)
            dt = step_below(self.case, min(limit, 1e-3 * self.case.duration))
            explicit = replace(implicit, integrator=EXPLICIT, dt=dt)
            yield from (explicit,) if explicit.work <= self.most_work else ()


def _with_gain(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows with the time of the detailed model, which is the first, over theirs."""
    return rows.assign(gain=rows[rows["model"] == rows["model"].iloc[0]]["cpu_s"].min() / rows["cpu_s"])


def _remarks(case: Case, refined: Mapping[str, Refined]) -> Iterator[str]:
    """Sentences on this scene."""
    for kind, found in refined.items():
        if not found.reached:
            yield f"{case.name}, {kind} beams: mesh and step are not fine enough, as {found.reason}."
    if "shear" not in refined:
        nu = max(beam.material.poisson for beam in case.scene.beams)
        factor = (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
        yield (
            f"{case.name}: with Poisson's ratio {nu:g} shear elements bend too stiffly by {factor:.3g} on any mesh "
            f"(thickness locking), so that cables are the detailed model here."
        )


def _simplified(
    case: Case, rows: pd.DataFrame, choices: Choices, targets: Sequence[float]
) -> Iterator[dict[str, Any]]:
    """Error and gain of each beam simplified alone, or why it cannot be."""
    for (unit, those), kind in product(enumerate(choices.units), choices.kinds[1:]):
        others = f" and {len(those) - 1} equal ones" if len(those) > 1 else ""
        about = {"scene": case.name, "beam": choices.names[those[0]] + others, "unit": unit, "kind": kind}
        runs = rows[rows["element"] == "/".join(choices.alone(unit, kind))].sort_values("cpu_s")
        best = runs.iloc[0]  # those that fail have no time, and are the last
        if best["status"] != "ok":
            yield {**about, "status": best["status"]}
            continue
        bound = best["error"] + best["reference_error"]
        enough = min((t for t in targets if bound <= t), default=nan)
        found = {name: best[name] for name in ("model", "error", "reference_error", "gain")}
        yield {**about, **found, "enough_for": enough, "status": "ok"}


def _cheapest(rows: pd.DataFrame, target: float) -> dict[str, Any]:
    """The cheapest choice whose error, with the uncertainty of the detailed model, is below a target."""
    able = rows[(rows["error"] + rows["reference_error"] <= target) & (rows["cpu_s"] > 0.0)]
    about = {"scene": rows["scene"].iloc[0], "target": target}
    if able.empty:
        return {**about, "status": "no choice is sure to meet it"}
    best = able.sort_values("cpu_s").iloc[0]
    names = ("model", "integrator", "elements", "dt", "error", "reference_error", "cpu_s", "gain", "status")
    return {**about, **{name: best[name] for name in names}}


def _finding(case: Case, rows: pd.DataFrame, cheapest: pd.DataFrame) -> tuple[str, str]:
    """The simplest model that meets the smallest target, and a sentence on it."""
    met = cheapest[cheapest["status"] == "ok"]
    if met.empty:
        return "none", f"{case.name}: no model meets any target error."
    best, detailed = met.iloc[-1], rows["model"].iloc[0]
    sure, by = best["reference_error"], "" if case.static else f" with {best['integrator']}"
    away = f"{best['error']:.1g} ± {sure:.1g} from {detailed}, which takes {best['gain']:.2g} times as long"
    none = f"no simpler model meets it (uncertainty {sure:.1g})"
    return str(best["model"]), (
        f"{case.name}: for a target error of {best['target']:g}: {best['model']}{by}, {milliseconds(best['cpu_s'])}; "
        f"{none if best['model'] == detailed else away}."
    )


def _picture(scene: str, rows: pd.DataFrame) -> Picture:
    """Error of each choice against its CPU time."""
    shown = rows[(rows["error"] > 0.0) & (rows["cpu_s"] > 0.0)]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, (integrator, own) in enumerate(shown.groupby("integrator", sort=False)):
            axes.plot(own["cpu_s"], own["error"], "os^"[k % 3], label=str(integrator))
        floor(axes, float(rows["reference_error"].max()))
        log_axes(figure, [axes], [("CPU time of the steps (s)", "error of the model")])

    caption = (
        f"{scene}: error of each choice of kinds against its CPU time; every marker is a model of all beams."
    )
    return picture(f"fidelity_{file_name(scene)}", caption, draw, (6.8, 3.8))


def _size(beam: Beam) -> tuple[float, ...]:
    s, m = beam.section, beam.material
    return (s.area, s.second_moment, m.E, m.density, m.poisson, m.damping, round(beam.length, 12))
