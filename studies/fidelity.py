"""Which beams of a case may be cables or rigid bars: error and cost of each choice against the detailed model."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import nan
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from anctmm.model.case import Case
from anctmm.model.scene import Beam, Scene
from anctmm.validation import FrozenMapping
from studies.cases import assumptions_of
from studies.engine.files import file_name
from studies.engine.meshes import step_below
from studies.engine.refinement import Refined, Refinement
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Picture, Result, StudyError
from studies.engine.tables import BUILD, Table, milliseconds
from studies.engine.timing import least
from studies.engine.trials import EXPLICIT, Trial, explicit_limit
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
    "Each kind of element has a mesh and an implicit step of its own, whose part of the error is below "
    f"{SHARE:g} of the smallest target error; explicit steps are a safe part of the choice's own stability limit.",
    "A rigid beam is a thin bar: no rotary inertia of its section, as the cable.",
)
CHEAPEST = (
    "target: for model, mesh and step together; a choice counts if its error and the uncertainty of the detailed model "
    "together are below it. gain: CPU time of the detailed model over that of the choice."
)
ALONE = "All other beams are as detailed as they can be. enough_for: the smallest target error that it meets."
EVERY = "error: difference to the detailed model at the probes; it holds all: model, mesh and step."

#: A kind for each beam, in the scene's order.
Kinds = tuple[str, ...]


def run(options: Options, runner: Runner) -> Result:
    """Run the study of a case; StudyError if it has no beams."""
    case = options.case
    if not case.scene.beams:
        raise StudyError(f"case {case.name!r} has no beam; at least one is needed to choose its element")
    smallest = options.error or SMALLEST[options.quick]
    targets = (*(t for t in TARGETS if t > 1.01 * smallest), smallest)
    choices = Choices.of(case.scene, kinds_of(case.scene))
    refined = dict[str, Refined]()
    for kind in choices.kinds:
        runner.heading = f"{case.name}, mesh and step of {kind} beams: "
        refined[kind] = Refinement(case, runner, element=kind).refined(SHARE * smallest)
    rows = _rows(case, choices, refined, runner, choices.first())
    ok = rows[rows["status"] == "ok"]
    worst = ok.groupby("element")["error"].max().to_dict()
    known = {pair: worst.get("/".join(choices.alone(*pair)), nan) for pair in choices.pairs}
    if more := [k for k in choices.best(known, targets) if "/".join(k) not in set(rows["element"])]:
        rows = pd.concat([rows, _rows(case, choices, refined, runner, more)], ignore_index=True)
    rows["gain"] = rows[rows["model"] == rows["model"].iloc[0]]["cpu_s"].min() / rows["cpu_s"]
    alone = pd.DataFrame(_simplified(rows, choices, targets))
    cheapest = pd.DataFrame([_cheapest(rows, target) for target in targets])
    model, sentence = _finding(rows, cheapest)
    question = f"{case.name}: which beams may be modelled more simply?"
    return Result(
        name="fidelity", title="Fidelity", question="Which beam must be modelled how finely, and what is saved?",
        findings=(sentence,), assumptions=(*PHYSICS, *assumptions_of(case), *_remarks(case, refined)),
        tables=(
            Table("cheapest", "The cheapest model under a target error", cheapest, (CHEAPEST,)),
            Table("beams", "One beam simplified at a time", alone, (ALONE,)),
            Table("choices", "Every choice of kinds", rows, (EVERY, BUILD)),
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
        groups: dict[Any, list[int]] = {}
        for k, beam in enumerate(beams):
            groups.setdefault(_size(beam) if len(beams) > MOST_UNITS else k, []).append(k)
        units = sorted(map(tuple, groups.values()), key=lambda unit: -beams[unit[0]].length * len(unit))
        return cls(tuple(beam.name for beam in beams), tuple(sorted(units[:MOST_UNITS])), kinds)

    def alone(self, unit: int, kind: str) -> Kinds:
        """One unit of a kind, all others as detailed as can be."""
        return tuple(kind if k in self.units[unit] else self.kinds[0] for k in range(len(self.names)))

    @property
    def pairs(self) -> list[tuple[int, str]]:
        """Each unit with each simpler kind."""
        return list(product(range(len(self.units)), self.kinds[1:]))

    def first(self) -> list[Kinds]:
        """Choices to try before anything is known, the detailed one first."""
        uniform = [(kind,) * len(self.names) for kind in self.kinds]
        return list(dict.fromkeys([*uniform, *(self.alone(*pair) for pair in self.pairs)]))

    def best(self, error: Mapping[tuple[int, str], float], targets: Sequence[float]) -> list[Kinds]:
        """Combinations of simplified units whose errors alone sum up to no more than a target."""
        return list(dict.fromkeys(self._below(error, *pair) for pair in product(targets, self.kinds[:-1])))

    def _below(self, error: Mapping[tuple[int, str], float], target: float, base: str) -> Kinds:
        kinds, taken = [base] * len(self.names), dict[int, float]()
        simpler = self.kinds[self.kinds.index(base) + 1 :]
        for e, unit, kind in sorted((e, *pair) for pair, e in error.items() if pair[1] in simpler):
            # a later kind of a unit is simpler, and has a larger error
            if sum(taken.values()) - taken.get(unit, 0.0) + e <= target:
                taken[unit] = e
                kinds = [kind if k in self.units[unit] else old for k, old in enumerate(kinds)]
        return tuple(kinds)

    def label(self, unit: int) -> str:
        """The beams of a unit in words."""
        name, *equal = (self.names[k] for k in self.units[unit])
        return name + (f" and {len(equal)} equal ones" if equal else "")

    def words(self, kinds: Kinds) -> str:
        """A choice in words."""
        usual = max(dict.fromkeys(kinds), key=kinds.count)
        own = [(self.label(k), kinds[unit[0]]) for k, unit in enumerate(self.units)]
        others = [f"{beams} {kind}" for beams, kind in own if kind != usual]
        return f"{usual}, but {', '.join(others)}" if others else usual


def _rows(
    case: Case, choices: Choices, refined: Mapping[str, Refined], runner: Runner, every: Sequence[Kinds]
) -> pd.DataFrame:
    """Rows of choices, the detailed one first: of implicit and of explicit steps; of equilibria one.

    Each kind is on the mesh and moves by the step that its own refinement found.
    """
    reference, runner.heading = refined[choices.kinds[0]], f"{case.name}, choices: "
    planned = [(kinds, trial) for kinds in every for trial in _trials(case, choices, refined, kinds)]
    planned = [(k, t) for k, t in planned if t.integrator != EXPLICIT or t.work <= MOST_WORK[runner.quick]]
    solutions = runner.solve_many(trial for _, trial in planned)
    rows = pd.DataFrame([
        {
            "scene": case.name, "model": choices.words(kinds), "element": "/".join(kinds),
            "integrator": trial.integrator, "elements": trial.cut, "dofs": solution.dofs, "dt": trial.dt,
            "error": reference.error_of(solution), "reference_error": reference.uncertainty, "cpu_s": nan,
            "build_s": nan, "status": str(solution.status),
        }
        for (kinds, trial), solution in zip(planned, solutions, strict=True)
    ])  # fmt: skip
    good = [k for k, solution in enumerate(solutions) if solution.status.ok]
    costs = map(least, runner.time_in_turn([planned[k][1] for k in good]))
    rows.update(pd.DataFrame(list(costs), index=good))
    return rows


def _trials(case: Case, choices: Choices, refined: Mapping[str, Refined], kinds: Kinds) -> Iterator[Trial]:
    """An implicit run (an equilibrium), and an explicit one of a motion."""
    mesh = tuple(refined[kind].trial.mesh[k] for k, kind in enumerate(kinds))
    element = FrozenMapping(zip(choices.names, kinds, strict=True))
    reached = {found.trial.dt for kind, found in refined.items() if kind in kinds and found.reached}
    dt = min(reached or {found.trial.dt for found in refined.values()})
    implicit = Trial.of(case, mesh=mesh, element=element, dt=dt)
    yield implicit
    if not case.static:
        dt = step_below(case, min(explicit_limit(implicit), 1e-3 * case.duration))
        yield replace(implicit, integrator=EXPLICIT, dt=dt)


def _remarks(case: Case, refined: Mapping[str, Refined]) -> Iterator[str]:
    """Sentences on this scene."""
    for kind, found in refined.items():
        if not found.reached:
            yield f"{case.name}, {kind} beams: mesh and step are not fine enough, as {found.reason}."
    if "shear" not in refined:
        locked = "with Poisson's ratio above 0 shear elements bend too stiffly (thickness locking)"
        yield f"{case.name}: {locked}, so that cables are the detailed model here."


def _simplified(rows: pd.DataFrame, choices: Choices, targets: Sequence[float]) -> Iterator[dict[str, Any]]:
    """Error and gain of each beam simplified alone; those that fail have no time, and are the last."""
    for unit, kind in choices.pairs:
        best = rows[rows["element"] == "/".join(choices.alone(unit, kind))].sort_values("cpu_s").iloc[0]
        bound = best["error"] + best["reference_error"]
        yield {
            "scene": best["scene"], "beam": choices.label(unit), "kind": kind,
            **best[["model", "error", "reference_error", "gain"]],
            "enough_for": min((t for t in targets if bound <= t), default=nan), "status": best["status"],
        }  # fmt: skip


def _cheapest(rows: pd.DataFrame, target: float) -> dict[Any, Any]:
    """The cheapest choice whose error, with the uncertainty of the detailed model, is below a target."""
    able = rows[(rows["error"] + rows["reference_error"] <= target) & (rows["cpu_s"] > 0.0)]
    found = ["model", "integrator", "elements", "dt", "error", "reference_error", "cpu_s", "gain", "status"]
    best = able.sort_values("cpu_s")[found].head(1).to_dict("records")
    none = {"scene": rows["scene"].iloc[0], "target": target, "status": "no choice is sure to meet it"}
    return none | (best[0] if best else {})


def _finding(rows: pd.DataFrame, cheapest: pd.DataFrame) -> tuple[str, str]:
    """The simplest model that meets the smallest target, and a sentence on it."""
    met, detailed, scene = cheapest[cheapest["status"] == "ok"], rows["model"].iloc[0], rows["scene"].iloc[0]
    if met.empty:
        return "none", f"{scene}: no model meets any target error."
    best = met.iloc[-1]
    takes = f"{best['model']} ({best['integrator']}), {milliseconds(best['cpu_s'])}"
    away = f"{best['error']:.1g} ± {best['reference_error']:.1g} from {detailed}"
    slower = f"{away}, which takes {best['gain']:.2g} times as long"
    why = "no simpler model meets it" if best["model"] == detailed else slower
    return str(best["model"]), f"{scene}: for a target error of {best['target']:g}: {takes}; {why}."


def _picture(scene: str, rows: pd.DataFrame) -> Picture:
    """Error of each choice against its CPU time."""
    shown = rows[(rows["error"] > 0.0) & (rows["cpu_s"] > 0.0)]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, (integrator, own) in enumerate(shown.groupby("integrator", sort=False)):
            axes.plot(own["cpu_s"], own["error"], "os^"[k % 3], label=str(integrator))
        floor(axes, float(rows["reference_error"].max()))
        log_axes(figure, [axes], [("CPU time of the steps (s)", "error of the model")])

    caption = f"{scene}: error of each choice of kinds against its CPU time; a marker is a model."
    return picture(f"fidelity_{file_name(scene)}", caption, draw, (6.8, 3.8))


def _size(beam: Beam) -> tuple[float, ...]:
    s, m = beam.section, beam.material
    return (s.area, s.second_moment, m.E, m.density, m.poisson, m.damping, round(beam.length, 12))
