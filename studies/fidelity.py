"""Which beams of a case may be cables or rigid bars: error and cost of each choice against the detailed model."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, product
from math import inf, isfinite, nan
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from anctmm.model.case import Case
from anctmm.model.scene import Beam, Scene, Weld
from anctmm.validation import FrozenMapping
from studies.cases import assumptions_of
from studies.engine.files import file_name
from studies.engine.meshes import explicit_limit, step_below
from studies.engine.pictures import Picture
from studies.engine.refinement import Reference, Refined, Refinement, Setup
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Result, StudyError, check_taken
from studies.engine.tables import BUILD, Table, milliseconds
from studies.engine.timing import least
from studies.engine.trials import STATIC, Mesh, Trial
from studies.report.plots import PALETTE, floor, legend_below, log_ticks, picture

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
EXPLICIT, IMPLICIT = "zhai", "generalized-alpha"
PHYSICS = (
    "Each kind of element is on a mesh, and moves by an implicit step, that were refined until their part of the error "
    f"is below {SHARE:g} of the smallest target error; explicit steps are a safe part of the choice's own stability "
    "limit.",
    "A rigid beam is a thin bar: no rotary inertia of its section, as the cable.",
)

#: A kind for each beam, in the scene's order.
Kinds = tuple[str, ...]


def run(options: Options, runner: Runner) -> Result:
    """Run the study of a case that has beams.

    Raises
    ------
    StudyError
        If it has none.
    """
    check_taken(options, "fidelity")
    case = options.case
    if not case.scene.beams:
        raise StudyError(f"case {case.name!r} has no beam; at least one is needed to choose its element")
    study = _Study(case, options, runner)
    frame, alone = study.run()
    reference = study.reference
    cheapest = pd.DataFrame(
        [_cheapest(case, frame, reference.uncertainty, t) for t in study.targets]
    ).infer_objects()
    findings = tuple(_findings(case, study, cheapest, alone))
    return Result(
        name="fidelity", title="Fidelity", question="Which beam must be modelled how finely, and what is saved?",
        findings=findings, assumptions=(*PHYSICS, *assumptions_of(case), *study.remarks()),
        tables=(
            Table("cheapest", "The cheapest model under a target error", cheapest, (
                "target: for model, mesh and step together; a choice counts if its error and the uncertainty of the "
                "detailed model together are below it. gain: CPU time of the detailed model over that of the choice.",
            )),
            Table("beams", "One beam simplified at a time", alone, (
                "model: kinds of the run, all other beams as detailed as they can be. enough_for: the smallest target "
                "error that it meets.",
            )),
            Table("choices", "Every choice of kinds", frame, (
                "error: difference to the detailed model at the probes; it holds all: model, mesh and step.", BUILD,
            )),
        ),
        pictures=(_picture(case.name, frame, reference),) if (frame["error"] > 0.0).any() else (),
        answers=(_answer(case, cheapest, findings),), shown=("cheapest", "beams"),
        good=bool(frame["status"].eq("ok").any()),
    )  # fmt: skip


@dataclass(frozen=True)
class Choices:
    """Choices of a kind for each beam.

    Parameters
    ----------
    names : tuple of str
        Of the beams.
    units : tuple of tuple of int
        Places of the beams that are chosen together.
    kinds : tuple of str
        The detailed one first.
    welded : tuple of frozenset of int
        For each beam those that welds join it to, and itself: none of them can be of shear elements beside a cable.
    """

    names: tuple[str, ...]
    units: tuple[tuple[int, ...], ...]
    kinds: tuple[str, ...]
    welded: tuple[frozenset[int], ...]

    @classmethod
    def of(cls, scene: Scene, kinds: Sequence[str]) -> "Choices":
        """Each beam alone; of many beams those of one section, material and length together, the longest first."""
        beams = scene.beams
        units: list[tuple[int, ...]] = [(k,) for k in range(len(beams))]
        if len(beams) > MOST_UNITS:
            order = sorted(range(len(beams)), key=lambda k: (_size(beams[k]), k))
            units = [tuple(group) for _, group in groupby(order, key=lambda k: _size(beams[k]))]
            units = sorted(sorted(units, key=lambda u: -beams[u[0]].length * len(u))[:MOST_UNITS])
        return cls(tuple(beam.name for beam in beams), tuple(units), tuple(kinds), _welded(scene))

    @property
    def detailed(self) -> Kinds:
        """The most detailed kind for all."""
        return self.uniform(self.kinds[0])

    def uniform(self, kind: str) -> Kinds:
        """One kind for all."""
        return (kind,) * len(self.names)

    def first(self) -> list[Kinds]:
        """Choices to try before anything is known, the detailed one first."""
        found = [self.uniform(kind) for kind in self.kinds]
        found += [self.alone(u, kind, base) for base, kind in self._pairs() for u in range(len(self.units))]
        return list(dict.fromkeys(found))

    def alone(self, unit: int, kind: str, base: str) -> Kinds:
        """One unit of a kind, all others of another; a cable beside shear elements with all that welds join it to."""
        inside = set(self.units[unit])
        if (kind, base) == ("cable", "shear"):
            inside = set().union(*(self.welded[k] for k in inside))
        return tuple(kind if k in inside else base for k in range(len(self.names)))

    def best(self, error: Mapping[tuple[int, str], float], targets: Sequence[float]) -> list[Kinds]:
        """Combinations of simplified units whose errors alone sum up to no more than a target.

        Parameters
        ----------
        error : mapping of (unit, kind) to float
            Where it alone is of that kind; others cannot be.
        targets : sequence of float
        """
        found = [self._sum_below(error, target, base) for target in targets for base in self.kinds[:-1]]
        return [kinds for kinds in dict.fromkeys(found) if self._can_be(kinds)]

    def _sum_below(self, error: Mapping[tuple[int, str], float], target: float, base: str) -> Kinds:
        kinds, taken = list(self.uniform(base)), dict[int, float]()
        simpler = self.kinds[self.kinds.index(base) + 1 :]
        options = sorted(
            (e, -self.kinds.index(kind), u, kind) for (u, kind), e in error.items() if kind in simpler
        )
        for e, _, unit, kind in options:  # a later kind of a unit is simpler, and has a larger error
            if sum(taken.values()) - taken.get(unit, 0.0) + e <= target:
                taken[unit] = e
                for k in self.units[unit]:
                    kinds[k] = kind
        return tuple(kinds)

    def words(self, kinds: Kinds) -> str:
        """A choice in words."""
        if len(set(kinds)) == 1:
            return f"all {kinds[0]}" if len(kinds) > 1 else kinds[0]
        usual = max(dict.fromkeys(kinds), key=kinds.count)
        parts = []
        for kind in dict.fromkeys(k for k in kinds if k != usual):
            those = [name for name, k in zip(self.names, kinds, strict=True) if k == kind]
            more = f" and {len(those) - 4} more" if len(those) > 4 else ""
            parts.append(f"{', '.join(those[:4])}{more} {kind}")
        return f"{usual}, but {'; '.join(parts)}"

    def _can_be(self, kinds: Kinds) -> bool:
        """Whether no weld joins shear elements to cables."""
        return all(len({kinds[k] for k in those} - {"rigid"}) < 2 for those in self.welded)

    def _pairs(self) -> Iterator[tuple[str, str]]:
        """A kind of all others with each simpler one."""
        for k, base in enumerate(self.kinds):
            yield from ((base, kind) for kind in self.kinds[k + 1 :])


class _Study:
    """Runs of one case."""

    def __init__(self, case: Case, options: Options, runner: Runner) -> None:
        self.case, self.runner, self.quick = case, runner, options.quick
        smallest = options.error or SMALLEST[options.quick]
        self.targets = (*(t for t in TARGETS if t > 1.01 * smallest), smallest)
        self.locking = [beam for beam in case.scene.beams if beam.material.poisson > 0.0]
        # shear elements that bend too stiffly are no measure of others
        self.choices = Choices.of(case.scene, MODELS[1:] if self.locking else MODELS)
        self.refined: dict[str, Refined] = {}
        for kind in self.choices.kinds:
            runner.heading = f"{case.name}, mesh and step of {kind} beams: "
            self.refined[kind] = Refinement(case, Setup(element=kind), runner).refined(SHARE * smallest)

    @property
    def reference(self) -> Reference:
        """The detailed model on its mesh and by its step, with the error of these."""
        best = self.refined[self.choices.kinds[0]].reference
        return replace(best, name=f"{self.choices.words(self.choices.detailed)}, {best.name}")

    def run(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """A row for each choice and integrator; and one for each beam simplified alone."""
        rows = self._rows(self.choices.first())
        tried = {row["element"] for row in rows}
        best = self.choices.best(self._alone(rows), self.targets)
        rows += self._rows([kinds for kinds in best if "/".join(kinds) not in tried])
        frame = pd.DataFrame(rows).drop(columns="kinds")
        detailed = frame[frame["model"] == self.choices.words(self.choices.detailed)]["cpu_s"].min()
        frame["gain"] = detailed / frame["cpu_s"]
        return frame, pd.DataFrame(self._beams(rows, detailed))

    def remarks(self) -> Iterator[str]:
        """Sentences on this scene."""
        for kind, found in self.refined.items():
            if not found.reached:
                yield f"{self.case.name}, {kind} beams: mesh and step are not fine enough, as {found.reason}."
        if self.locking:
            nu = max(beam.material.poisson for beam in self.locking)
            factor = (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
            yield (
                f"{self.case.name}: with Poisson's ratio {nu:g} shear elements bend too stiffly by {factor:.3g} on any "
                f"mesh (thickness locking), so that cables are the detailed model here."
            )
        yield (
            f"{self.case.name}: {len(self.choices.units)} beams or groups of equal beams were simplified one at a "
            f"time, then together where their errors sum up to less than a target error."
        )

    def _rows(self, every: Sequence[Kinds]) -> list[dict[str, Any]]:
        """Rows of choices: of implicit and of explicit steps; of equilibria one."""
        planned = [(kinds, trial) for kinds in every for trial in self._trials(kinds)]
        self.runner.heading = f"{self.case.name}, choices: "
        trials = [trial for _, trial in planned]
        solutions = self.runner.solve_many(trials)
        good = [k for k, s in enumerate(solutions) if s.status.ok]
        costs = (
            dict(zip(good, self.runner.time_in_turn([trials[k] for k in good]), strict=True)) if good else {}
        )
        rows = []
        for k, ((kinds, trial), solution) in enumerate(zip(planned, solutions, strict=True)):
            timing = least(costs[k]) if k in costs else None
            rows.append({
                "scene": self.case.name, "model": self.choices.words(kinds), "element": "/".join(kinds),
                "integrator": trial.integrator, "elements": trial.cut, "dofs": solution.dofs, "dt": trial.dt,
                "error": self.reference.error_of(solution), "reference_error": self.reference.uncertainty,
                "cpu_s": timing.cpu_s if timing else nan, "build_s": timing.build_s if timing else nan,
                "status": str(solution.status), "kinds": kinds,
            })  # fmt: skip
        return rows

    def _trials(self, kinds: Kinds) -> Iterator[Trial]:
        if self.case.static:
            yield self._trial(kinds, STATIC, nan)
            return
        steps = [self.refined[kind].trial.dt for kind in set(kinds) if self.refined[kind].reached]
        yield self._trial(kinds, IMPLICIT, min(steps, default=min(f.trial.dt for f in self.refined.values())))
        element = dict(zip(self.choices.names, kinds, strict=True))
        mesh = dict(zip(self.choices.names, self._mesh(kinds), strict=True))
        limit = explicit_limit(self.case, mesh, element=element)
        explicit = self._trial(kinds, EXPLICIT, step_below(self.case, min(limit, 1e-3 * self.case.duration)))
        if explicit.work <= MOST_WORK[self.quick]:
            yield explicit

    def _trial(self, kinds: Kinds, integrator: str, dt: float) -> Trial:
        element = FrozenMapping(zip(self.choices.names, kinds, strict=True))
        case = self.case
        return Trial(
            case.scene,
            Setup.solver,
            self._mesh(kinds),
            element,
            "full",
            integrator,
            dt,
            case.duration,
            case.interval,
        )

    def _mesh(self, kinds: Kinds) -> Mesh:
        return tuple(self.refined[kind].trial.mesh[k] for k, kind in enumerate(kinds))

    def _simplified(self, unit: int, kind: str) -> list[str]:
        """Models in which one unit alone is of a kind, the detailed one first."""
        bases = self.choices.kinds[: self.choices.kinds.index(kind)]
        return [self.choices.words(self.choices.alone(unit, kind, base)) for base in bases]

    def _alone(self, rows: Sequence[dict[str, Any]]) -> dict[tuple[int, str], float]:
        """Error of the most detailed model in which one unit is simpler."""
        errors: dict[str, float] = {}
        for line in rows:
            if line["status"] == "ok":
                errors[line["model"]] = min(line["error"], errors.get(line["model"], inf))
        found = {}
        for unit, kind in product(range(len(self.choices.units)), self.choices.kinds[1:]):
            if model := next((m for m in self._simplified(unit, kind) if m in errors), None):
                found[unit, kind] = errors[model]
        return found

    def _beams(self, rows: Sequence[dict[str, Any]], detailed: float) -> list[dict[str, Any]]:
        """Error and gain of each beam simplified alone, or why it cannot be."""
        sure = self.reference.uncertainty
        lines = []
        for (unit, those), kind in product(enumerate(self.choices.units), self.choices.kinds[1:]):
            names = [self.choices.names[k] for k in those]
            name = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} equal ones"
            mine = [line for m in self._simplified(unit, kind) for line in rows if line["model"] == m]
            good = [line for line in mine if line["status"] == "ok"]
            about = {"scene": self.case.name, "beam": name, "kind": kind}
            if not good:
                lines.append({**about, "status": mine[0]["status"] if mine else "not tried"})
                continue
            best = min((g for g in good if g["model"] == good[0]["model"]), key=lambda line: line["cpu_s"])
            enough = min((t for t in self.targets if best["error"] + sure <= t), default=nan)
            lines.append({
                **about, "model": best["model"], "error": best["error"], "reference_error": sure,
                "gain": detailed / best["cpu_s"], "enough_for": enough, "status": "ok",
            })  # fmt: skip
        return lines


def _cheapest(case: Case, frame: pd.DataFrame, sure: float, target: float) -> dict[str, Any]:
    """The cheapest choice that meets a target error."""
    good = frame[(frame["error"] + sure <= target) & frame["status"].eq("ok")]
    line = {"scene": case.name, "target": target}
    if good.empty:
        return line | {"status": "no model meets it"}
    best = good.sort_values("cpu_s").iloc[0]
    names = ("model", "integrator", "elements", "dt", "error", "cpu_s", "build_s", "gain")
    return line | {name: best[name] for name in names} | {"reference_error": sure, "status": "ok"}


def _answer(case: Case, cheapest: pd.DataFrame, findings: Sequence[str]) -> Answer:
    met = cheapest[cheapest["status"].eq("ok")]
    figure = "none" if met.empty else str(met["model"].iloc[-1])
    take = findings[0].removeprefix(f"{case.name}: ")
    return Answer(
        f"{case.name}: which beams may be modelled more simply?", figure, f"{take[:1].upper()}{take[1:]}"
    )


def _findings(case: Case, study: _Study, cheapest: pd.DataFrame, alone: pd.DataFrame) -> Iterator[str]:
    """The answer, and a sentence on each beam."""
    lines = cheapest[cheapest["status"].eq("ok")]
    if lines.empty:
        yield f"{case.name}: no model meets any target error; {study.reference.name}."
        return
    best, sure = lines.iloc[-1], study.reference.uncertainty
    detailed = study.choices.words(study.choices.detailed)
    by = "" if case.static else f" with {best['integrator']}"
    take = f"{case.name}: for a target error of {best['target']:g}: {best['model']}{by}, {milliseconds(best['cpu_s'])}"
    if best["model"] == detailed:
        yield f"{take}; no simpler model meets it (uncertainty {sure:.1g})."
    else:
        away = f"{best['error']:.1g} ± {sure:.1g} from {detailed}"
        yield f"{take}; {away}, which takes {best['gain']:.2g} times as long."
    for beam, rows in alone.groupby("beam", sort=False):
        yield f"{case.name}, {beam}: {'; '.join(_alone_text(line) for line in rows.to_dict('records'))}."


def _alone_text(line: Mapping[Any, Any]) -> str:
    if line["status"] != "ok":
        return f"{line['kind']} cannot be ({line['status']})"
    enough = line["enough_for"]
    verdict = f"enough for {enough:g}" if enough == enough else "too much for any target error"
    return f"as {line['kind']} the result differs by {line['error']:.1g}, {verdict}"


def _picture(scene: str, frame: pd.DataFrame, reference: Reference) -> Picture:
    """Error of each choice against its CPU time."""
    shown = frame[(frame["error"] > 0.0) & (frame["cpu_s"] > 0.0)]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, (integrator, rows) in enumerate(shown.groupby("integrator", sort=False)):
            axes.plot(
                rows["cpu_s"],
                rows["error"],
                "os^"[k % 3],
                color=PALETTE[k],
                label=str(integrator),
                markersize=5,
            )
        axes.set(xscale="log", yscale="log", xlabel="CPU time of the steps (s)", ylabel="error of the model")
        if isfinite(reference.uncertainty):
            floor(axes, pd.Series([reference.uncertainty]))
        log_ticks(axes.xaxis, *axes.get_xlim())
        log_ticks(axes.yaxis, *axes.get_ylim())
        legend_below(figure, [axes], 2)

    caption = (
        f"{scene}: error of each choice of kinds against its CPU time; every marker is a model of all beams."
    )
    return picture(f"fidelity_{file_name(scene)}", caption, draw, (6.8, 3.8))


def _welded(scene: Scene) -> tuple[frozenset[int], ...]:
    """For each beam those that a row of welds joins it to, and itself."""
    place = {beam.name: k for k, beam in enumerate(scene.beams)}
    groups = [{k} for k in place.values()]
    for joint in scene.joints:
        if isinstance(joint, Weld):
            ends = [place[n] for n in {scene.place(e).body.name for e in joint.ends} if n in place]
            together = set().union(*(groups[k] for k in ends)) if ends else set()
            for k in together:
                groups[k] = together
    return tuple(frozenset(group) for group in groups)


def _size(beam: Beam) -> tuple[float, ...]:
    s, m = beam.section, beam.material
    return (s.area, s.second_moment, m.E, m.density, m.poisson, m.damping, round(beam.length, 12))
