"""Which beams of a case may be cables or rigid bars, what each choice costs, and how far it is from the richest."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite, nan
from typing import Any

import pandas as pd

from anctmm.errors import AnctmmError
from anctmm.model.case import Case
from anctmm.validation import FrozenMapping
from studies.cases import assumptions_of
from studies.engine.accuracy.refinement import Refined, Refinement, Setup
from studies.engine.answers import Answer
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Reference
from studies.engine.running.rows import row
from studies.engine.running.trial import STATIC, Mesh, Trial, mesh_label
from studies.engine.storage.files import file_name
from studies.engine.study import Options, Result, StudyError
from studies.engine.tables import ACCURACY, BUILD, Table, cpu_time, milliseconds
from studies.fidelity.case_pictures import cost_picture
from studies.fidelity.choices import Choices, Kinds, said
from studies.fidelity.steps import MARGIN, stable_step, step_under

#: Target errors of a model, from large to small; the smallest by default, by whether the run is quick.
TARGETS = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3)
SMALLEST = {False: 1e-3, True: 1e-2}
#: Part of the smallest target error that mesh and step of each kind may add.
SHARE = 0.3
#: Elements times steps of an explicit run at most, by whether the run is quick.
MOST_WORK = {False: 4e6, True: 3e5}
KINDS = ("shear", "cable", "rigid")
EXPLICIT, IMPLICIT = "zhai", "generalized-alpha"
PHYSICS = (
    "Each kind of element is on a mesh, and moves by an implicit step, that were refined until their part in the error "
    f"is below {SHARE:g} of the smallest target error; explicit steps are {MARGIN:g} of the choice's own stability "
    "limit.",
    "A rigid beam is a thin bar: no rotary inertia of its section, as the cable.",
)


@dataclass(frozen=True)
class Studied:
    """What was found of one case.

    Parameters
    ----------
    case : Case
    choices : Choices
    reference : Reference
        The richest model, refined.
    frame : DataFrame
        A row for each choice and integrator.
    beams : DataFrame
        A row for each beam, or group of equal beams, and each poorer kind of it alone.
    targets : tuple of float
    remarks : tuple of str
        What the reader must know of this scene.
    """

    case: Case
    choices: Choices
    reference: Reference
    frame: pd.DataFrame
    beams: pd.DataFrame
    targets: tuple[float, ...]
    remarks: tuple[str, ...]


def run(options: Options, runner: Runner) -> Result:
    """Run the study of the cases that have beams; a finding names the others.

    Raises
    ------
    StudyError
        If no case has a beam.
    """
    given = options.cases or ()
    cases = [case for case in given if case.scene.beams]
    if not cases:
        names = ", ".join(repr(case.name) for case in given)
        raise StudyError(
            f"{'case' if len(given) == 1 else 'cases'} {names} {'has' if len(given) == 1 else 'have'} no beam; at "
            f"least one is needed to choose its element"
        )
    left_out = (
        f"{case.name}: left out, as it has no beam to choose an element for."
        for case in given
        if not case.scene.beams
    )
    studied = [_Study(case, options, runner).studied() for case in cases]
    frame = pd.concat([s.frame for s in studied], ignore_index=True)
    cheapest = pd.DataFrame([line for s in studied for line in cheapest_lines(s)]).infer_objects()
    findings = (*(text for s in studied for text in _findings(s, cheapest)), *left_out)
    times: Any = frame.drop(columns=["model", "stable_dt", "gain"]).to_dict("records")
    tables = (
        Table("cheapest", "The cheapest model under a target error", cheapest, _cheapest_notes()),
        Table(
            "beams", "Each beam alone made poorer", pd.concat([s.beams for s in studied], ignore_index=True),
            _beam_notes(),
        ),
        Table(
            "choices", "Every choice of kinds: distance to the richest model",
            frame[["model", *(c for c in ACCURACY if c != "model"), "stable_dt", "gain"]],
            _notes(),
        ),
        cpu_time(times, PHYSICS),
    )  # fmt: skip
    return Result(
        name=file_name("-".join(["fidelity", *(case.name for case in cases)])),
        title="Fidelity: model only what a scene requires",
        question="Which beam must be modelled how finely, and what is saved where less will do?",
        findings=findings,
        assumptions=(
            *PHYSICS, *dict.fromkeys(a for case in cases for a in assumptions_of(case)),
            *(text for s in studied for text in s.remarks),
        ),
        tables=tables,
        pictures=tuple(filter(None, (cost_picture(s.case.name, s.frame, s.reference.uncertainty) for s in studied))),
        answers=tuple(_answer(s, cheapest) for s in studied),
        shown=("cheapest", "beams"),
    )  # fmt: skip


class _Study:
    """Runs of one case."""

    def __init__(self, case: Case, options: Options, runner: Runner) -> None:
        self.case, self.runner, self.quick = case, runner, options.quick
        smallest = options.error or SMALLEST[options.quick]
        self.targets = (*(t for t in TARGETS if t > 1.01 * smallest), smallest)
        self.locking = [beam for beam in case.scene.beams if beam.material.poisson > 0.0]
        # shear elements that bend too stiffly are no measure of others
        self.choices = Choices.of(case.scene, KINDS[1:] if self.locking else KINDS)

    def studied(self) -> Studied:
        """Runs of all choices, and what they say."""
        first = self.choices.first()
        if self.locking:
            first.append(self.choices.uniform("shear"))
        rows = self._rows(first)
        if not self.choices.all_tried:
            best = self.choices.best(self._alone(rows), self.targets)
            rows += self._rows([kinds for kinds in best if kinds not in first])
        frame = pd.DataFrame(rows, columns=["model", *ACCURACY, "cpu_spread", "repeats", "newton_iterations",
                                            "stable_dt"])  # fmt: skip
        richest = frame[frame["model"] == self._said(self.choices.richest)]["cpu_s"].min()
        frame["gain"] = richest / frame["cpu_s"]
        return Studied(
            self.case, self.choices, self.reference, frame, self._beams(rows, richest), self.targets,
            tuple(self._remarks()),
        )  # fmt: skip

    @cached_property
    def refined(self) -> dict[str, Refined]:
        """By kind, the coarsest mesh and longest step that are fine enough."""
        found = {}
        for kind in dict.fromkeys((*self.choices.kinds, *(("shear",) if self.locking else ()))):
            self.runner.heading = f"{self.case.name}, mesh and step of {kind} beams: "
            found[kind] = Refinement(self.case, Setup(element=kind), self.runner).refined(
                SHARE * self.targets[-1]
            )
        return found  # fmt: skip

    @cached_property
    def reference(self) -> Reference:
        """The richest model on its mesh and by its step, with what these may have left in it."""
        best = self.refined[self.choices.kinds[0]]
        if not best.solution.status.ok or not isfinite(best.error):
            return best.reference
        model = self._said(self.choices.richest)
        return Reference(
            f"{model}, {best.label}", lambda s: best.levels.difference(s, best.solution), best.error, best.solution
        )  # fmt: skip

    def _rows(self, every: Sequence[Kinds]) -> list[dict[str, Any]]:
        """Rows of choices, two each: of implicit and of explicit steps; of equilibria one."""
        limits = {kinds: self._limit(kinds) for kinds in every}
        planned = [(kinds, trial) for kinds in every for trial in self._trials(kinds, limits[kinds])]
        self.refined  # noqa: B018  its heading comes first
        self.runner.heading = f"{self.case.name}, choices: "
        outcomes = iter(self.runner.sweep([trial for _, trial in planned if isinstance(trial, Trial)]))
        rows = []
        for kinds, trial in planned:
            own = {"model": self._said(kinds), "element": "/".join(kinds), "stable_dt": limits[kinds]}
            if isinstance(trial, Trial):
                rows.append({**row(next(outcomes), self.reference), **own})
            else:
                about = {
                    "scene": self.case.name,
                    "solver": "anctmm",
                    "quadrature": "-",
                    "integrator": EXPLICIT,
                    "elements": mesh_label(self._mesh(kinds)),
                }
                rows.append({**about, "reference": self.reference.name, **own, "status": trial})
        return rows

    def _limit(self, kinds: Kinds) -> float:
        """Largest stable explicit step of a choice, s; NaN where there is none."""
        if self.case.static:
            return nan
        try:
            return stable_step(self.case.scene, self._mesh(kinds), kinds)
        except AnctmmError:  # the run itself says what cannot be
            return nan

    def _trials(self, kinds: Kinds, limit: float) -> Iterator[Trial | str]:
        """Runs of a choice; a text says why one is not done."""
        if self.case.static:
            yield self._trial(kinds, STATIC, nan)
            return
        yield self._trial(kinds, IMPLICIT, self._implicit_step(kinds))
        if limit == limit:
            dt = step_under(self.case, MARGIN * limit)
            work = sum(self._mesh(kinds)) * self.case.duration / dt
            most = MOST_WORK[self.quick]
            tried = work <= most
            yield (
                self._trial(kinds, EXPLICIT, dt)
                if tried
                else (f"not run: {work:.1e} elements times steps, more than {most:.1g}")
            )

    def _trial(self, kinds: Kinds, integrator: str, dt: float) -> Trial:
        element: Any = FrozenMapping(zip(self.choices.names, kinds, strict=True))
        return Trial(
            self.case.scene, "anctmm", self._mesh(kinds), element, "full", integrator, dt, self.case.duration,
            self.case.interval,
        )  # fmt: skip

    def _mesh(self, kinds: Kinds) -> Mesh:
        return tuple(self.refined[kind].trial.mesh[k] for k, kind in enumerate(kinds))

    def _implicit_step(self, kinds: Kinds) -> float:
        """The shortest of the steps that its kinds need."""
        steps = [self.refined[kind].trial.dt for kind in set(kinds) if self.refined[kind].reached]
        return min(steps, default=min(found.trial.dt for found in self.refined.values()))

    def _said(self, kinds: Kinds) -> str:
        return said(kinds, self.choices.names)

    def _alone(self, rows: Sequence[dict[str, Any]]) -> dict[tuple[int, str], float]:
        """Distance of the richest model in which one unit is poorer; else of the richest one in which it may be."""
        errors: dict[str, float] = {}
        for line in rows:
            if line["status"] == "ok":
                errors[line["model"]] = min(line["error"], errors.get(line["model"], inf))
        found = {}
        for unit in range(len(self.choices.units)):
            for k, kind in enumerate(self.choices.kinds[1:], 1):
                tried = [self._said(self.choices.alone(unit, kind, base)) for base in self.choices.kinds[:k]]
                if model := next((t for t in tried if t in errors), None):
                    found[unit, kind] = errors[model]
        return found

    def _beams(self, rows: Sequence[dict[str, Any]], richest: float) -> pd.DataFrame:
        """What a beam alone changes, or why it cannot be."""
        lines = []
        for unit, those in enumerate(self.choices.units):
            for k, kind in enumerate(self.choices.kinds[1:], 1):
                tried = [self._said(self.choices.alone(unit, kind, base)) for base in self.choices.kinds[:k]]
                mine = [line for base in tried for line in rows if line["model"] == base]
                good = [line for line in mine if line["status"] == "ok"]
                name = said_names([self.choices.names[i] for i in those])
                about = {"scene": self.case.name, "beam": name, "kind": kind}
                if not good:
                    why = mine[0]["status"] if mine else "not tried"
                    lines.append({**about, "status": why})
                    continue
                good = [line for line in good if line["model"] == good[0]["model"]]
                best = min(good, key=lambda line: line["cpu_s"])
                lines.append({
                    **about, "model": best["model"], "distance": best["error"],
                    "known_to": self.reference.uncertainty,
                    "gain": richest / best["cpu_s"], "enough_for": self._enough(best["error"]), "status": "ok",
                })  # fmt: skip
        columns = ["scene", "beam", "kind", "model", "distance", "known_to", "gain", "enough_for", "status"]
        return pd.DataFrame(lines, columns=columns)

    def _enough(self, error: float) -> float:
        """The smallest target error that a distance is below, with what is not known of it; NaN if it is too large."""
        return min((t for t in self.targets if error + self.reference.uncertainty <= t), default=nan)

    def _remarks(self) -> Iterator[str]:
        for kind, found in self.refined.items():
            if not found.reached:
                yield f"{self.case.name}, {kind} beams: mesh and step are not fine enough, as {found.reason}."
        if self.locking:
            beam = max(self.locking, key=lambda b: b.material.poisson)
            nu = beam.material.poisson
            factor = (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
            yield (
                f"{self.case.name}: with Poisson's ratio {nu:g} of {beam.name} shear elements bend too stiffly by "
                f"{factor:.3g} on any mesh (thickness locking), so cables are the richest model here."
            )
        if not self.choices.all_tried:
            yield (
                f"{self.case.name}: {len(self.choices.units)} beams or groups of equal beams were made poorer one at a "
                f"time, then together where their distances sum up to less than a target error."
            )
        left = len(self.choices.names) - sum(map(len, self.choices.units))
        if left:
            yield f"{self.case.name}: {left} beams in smaller groups were not made poorer alone."


def said_names(names: Sequence[str]) -> str:
    """Names of beams that are chosen together."""
    return names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} like it"


def cheapest_lines(studied: Studied) -> Iterator[dict[str, Any]]:
    """For each target error the cheapest choice that meets it for sure."""
    frame, sure = studied.frame, studied.reference.uncertainty
    for target in studied.targets:
        good = frame[(frame["error"] + sure <= target) & frame["status"].eq("ok")]
        line = {"scene": studied.case.name, "target_error": target}
        if good.empty:
            yield line | {
                "status": f"no model: {studied.reference.name}" if sure != sure else "no model is as near"
            }
            continue
        best = good.sort_values("cpu_s").iloc[0]
        names = ("model", "integrator", "elements", "dt", "error", "cpu_s", "build_s", "gain")
        yield line | {name: best[name] for name in names} | {"status": "ok"}


def _answer(studied: Studied, cheapest: pd.DataFrame) -> Answer:
    """What the page begins with: the cheapest model for the smallest target error that one meets."""
    name = studied.case.name
    met = cheapest[(cheapest["scene"] == name) & cheapest["status"].eq("ok")]
    figure = "none" if met.empty else str(met["model"].iloc[-1])
    take = next(_findings(studied, cheapest)).removeprefix(f"{name}: ")
    return Answer(
        f"{name}: which beams may be modelled more simply?", figure, f"{take[:1].upper()}{take[1:]}"
    )


def _findings(studied: Studied, cheapest: pd.DataFrame) -> Iterator[str]:
    """The answer, and a sentence on each beam."""
    name = studied.case.name
    lines = cheapest[(cheapest["scene"] == name) & cheapest["status"].eq("ok")]
    richest = said(studied.choices.richest, studied.choices.names)
    if lines.empty:
        yield f"{name}: no model meets any target error; {studied.reference.name}."
        return
    best, sure = lines.iloc[-1], studied.reference.uncertainty
    by = "" if studied.case.static else f" with {best['integrator']}"
    took = milliseconds(best["cpu_s"])
    take = f"{name}: for a target error of {best['target_error']:g} take {best['model']}{by}, {took}"
    if best["model"] == richest:
        yield f"{take}: nothing poorer is as near; it is itself known to {sure:.1g}."
    else:
        away = f"{best['error']:.1g} ± {sure:.1g} from {richest}"
        yield f"{take}: {away}, which takes {best['gain']:.2g} times as long."
    for beam, rows in studied.beams.groupby("beam", sort=False):
        yield f"{name}, {beam}: {'; '.join(_alone_text(line) for line in rows.to_dict('records'))}."


def _alone_text(line: Mapping[Any, Any]) -> str:
    if line["status"] != "ok":
        return f"{line['kind']} cannot be ({line['status']})"
    enough = line["enough_for"]
    verdict = f"enough for {enough:g}" if enough == enough else "too far for any target error"
    return f"as {line['kind']} the result differs by {line['distance']:.1g}, {verdict}"


def _notes() -> tuple[str, ...]:
    return (
        "model: kind of each beam. error: distance to the richest model at the case's probes, the largest of RMS in "
        "time of |u − u_ref| / max in time of |u_ref| (of an equilibrium, of its displacement); it holds all: model, "
        "mesh and step.",
        "reference_error: estimate of what mesh and step leave in the richest model itself, by Richardson.",
        "stable_dt: 2/ω_max of the linearised scene, s. gain: CPU time of the richest model over this one's.",
        BUILD,
    )


def _cheapest_notes() -> tuple[str, ...]:
    return (
        "target_error: that of model, mesh and step together; a choice counts if its distance and the uncertainty of "
        "the richest model together are below it.",
        "gain: CPU time of the richest model by its cheaper integrator over that of the choice.",
    )


def _beam_notes() -> tuple[str, ...]:
    return (
        "model: what was run, all other beams as rich as can be. enough_for: the smallest target error that it meets.",
    )
