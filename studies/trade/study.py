"""The trade of error for time: every setting on both base scenes, the front, and the origin of each error."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import count, product
from typing import Any, NamedTuple, TypeVar

import pandas as pd

from anctmm.model.case import Case
from studies.cases import assumptions_of
from studies.engine.accuracy.dynamics import (
    AS_GIVEN,
    Fine,
    Plan,
    Planned,
    cases_of,
    check_mesh,
    planned,
    quick_plan,
    with_references,
)
from studies.engine.accuracy.robust import robust_errors
from studies.engine.choices import choices_of, written
from studies.engine.measuring.timing import in_turn, least, settled
from studies.engine.pareto_front import NEAR, excess
from studies.engine.runner import Runner
from studies.engine.running.outcomes import Reference, Sample
from studies.engine.running.rows import row, sample_rows
from studies.engine.running.trial import Trial, label_of
from studies.engine.running.turns import at_work
from studies.engine.storage.files import file_name
from studies.engine.study import Options, Result, check_taken, of_case, without_beams
from studies.engine.tables import Table
from studies.trade import pictures as trade_pictures
from studies.trade.advice import advice
from studies.trade.contestants import left_out, said_of, without
from studies.trade.control import error_control
from studies.trade.own_ladder import NothingMovesError, check_first, own_ladder
from studies.trade.plan import Ladder, ladders
from studies.trade.second_road import second_roads
from studies.trade.split import fine_runs, same_mesh, split
from studies.trade.step_orders import step_orders
from studies.trade.tables import (
    Traded,
    answers,
    by_rival,
    findings,
    histories,
    notes,
    on_front,
    orders,
    recommended,
    references,
)

T = TypeVar("T")

#: What settings share that differ in a choice of their solver alone.
ALIKE = ("solver", "family", "quadrature", "integrator", "elements", "dt", "tolerance", "stretch")
#: Rounds in which settings near the front are timed again; by whether the run is quick.
ROUNDS = {False: 5, True: 1}
COLUMNS = (
    "scene", "solver", "element", "quadrature", "integrator", "elements", "dofs", "dt", "tolerance",
    "newton_tolerance", "own", "stretch", "t_end", "steps", "newton_iterations", "error", "robust_error",
    "reference_error", "mesh_error", "step_error", "step_reference_error", "error_from", "cpu_s", "cpu_spread",
    "build_s", "wall_s", "repeats", "in_turn", "excess", "status", "reference",
)  # fmt: skip


def trials(options: Options) -> list[Trial]:
    """Runs of all kinds that the study of the built-in scenes needs; of other cases their references tell first."""
    found: list[Trial] = []
    for ladder in ladders(options.quick) if options.cases is None else []:
        mine, plan = _fitting(ladder.base, options), _plan(ladder, options)
        if mine.meshes != ():
            cases = cases_of(ladder.base, plan, mine)
            found += with_references(ladder.base, plan, cases)
            found += fine_runs(cases, ladder.fine_step, ladder.fine_integrator)
    return found


def run(options: Options, runner: Runner) -> Result:
    """Run the study: of the cases that move, a finding names the others; or else of the two moving base scenes.

    Raises
    ------
    StudyError
        If all cases are static or rest at their probes, or a mesh asked for fits no scene.
    """
    check_taken(options, "trade")
    told = without_beams(options.cases or (), options)
    resting = [case for case in options.cases or () if case.static]
    if len(resting) < len(options.cases or ()):
        options = replace(options, cases=tuple(c for c in options.cases or () if not c.static))
        for case in resting:
            runner.note(_left_out(case))
    every, unmoved = _ladders(options, runner)
    _check_meshes(every, options)
    runner.prepare(trials(options))
    fitting = [(ladder, _fitting(ladder.base, of_case(options, ladder.base))) for ladder in every]
    traded = [measure(ladder, mine, runner) for ladder, mine in fitting if mine.meshes != ()]
    points = pd.concat([t.frame for t in traded], ignore_index=True)
    targets = tuple(sorted({target for ladder in every for target in ladder.targets}, reverse=True))
    best, rivals, known = recommended(points, targets), by_rival(points, targets), references(traded)
    return Result(
        name="trade" if options.cases is None else file_name("-".join(["trade", *(c.name for c in options.cases)])),
        title="Which setting for which error",
        question="Solver, element, quadrature, integrator, mesh and step: what does an error cost, and where does it "
        "come from?",
        findings=(
            *findings(points, best, rivals, known), *(text for t in traded for text in t.said),
            *told, *map(_left_out, resting), *unmoved,
        ),
        assumptions=tuple(dict.fromkeys(a for t in traded for a in assumptions_of(t.base))),
        tables=(
            advice(best.frame, rivals.frame), best, rivals,
            Table("front", "The front: no other setting is both better and cheaper", on_front(points)), known,
            *([orders(traded)] if any(t.orders for t in traded) else []), error_control(points),
            Table("points", "All settings", points, notes([ladder.fine_step for ladder in every])), histories(traded),
            Table("samples", "Raw time samples", pd.DataFrame([s for t in traded for s in t.samples])),
        ),
        pictures=tuple(p for t in traded for p in trade_pictures.pictures(t.base.scene.name, t.frame)),
        answers=tuple(answers(best.frame, rivals.frame)) if len(best.frame) else (),
        left_out=_not_tried(every, options),
    )  # fmt: skip


def _left_out(case: Case) -> str:
    """That a case is none of those studied, and why."""
    return f"{case.name}: left out, as it is a static equilibrium, which has no step to trade error for time."


def _not_tried(every: Sequence[Ladder], options: Options) -> str:
    """What a quick run omits, unless single kinds are requested."""
    if not options.quick or options.element or options.integrator:
        return ""
    elements = sorted({"quintic", "shear"} - {element for ladder in every for element in ladder.beside})
    return ", ".join([
        *([f"{' and '.join(elements)} elements"] if elements else []),
        "most meshes and steps, most explicit runs and steps of fourth order that an error drives.",
    ])  # fmt: skip


def _ladders(options: Options, runner: Runner) -> tuple[list[Ladder], list[str]]:
    """Of the cases asked for; those of the moving base scenes are there already. And why cases are left out.

    Raises
    ------
    NothingMovesError
        If no case is left.
    """
    if options.cases is None:
        return ladders(options.quick), []
    for case, mesh in product(options.cases, options.meshes or ()):
        if case.scene.beams:
            check_mesh(case.scene, mesh)
    by_hand = {} if options.error else {ladder.base: ladder for ladder in ladders(options.quick)}
    cases, unmoved = options.cases, dict[str, str]()

    def tried(make: Callable[..., T], case: Case) -> T | None:
        try:
            return make(case, of_case(options, case), runner)
        except NothingMovesError as error:
            if len(cases) == len(unmoved) + 1:
                raise
            unmoved[case.name] = f"{case.name}: left out; {error}."
            runner.note(unmoved[case.name])
            return None

    # one coarse run of each shows what is wrong before any is refined, which takes minutes
    for case in cases:
        if case not in by_hand:
            tried(check_first, case)
    found = [by_hand.get(case) or tried(own_ladder, case) for case in cases if case.name not in unmoved]
    return [ladder for ladder in found if ladder is not None], list(unmoved.values())


def _plan(ladder: Ladder, options: Options) -> Plan:
    return quick_plan(ladder.plan(True), ladder.plan(False), options) if options.quick else ladder.plan(False)


class Tried(NamedTuple):
    """A setting that was run: its row, and its raw times. Its solution is not kept: there are thousands."""

    case: Trial
    row: dict[str, Any]
    samples: list[dict[str, Any]]


def measure(ladder: Ladder, options: Options, runner: Runner) -> Traded:
    """Run one scene's plan, split the errors, and time what is near the front again, in turn."""
    base, plan = ladder.base, _plan(ladder, options)
    out = left_out(plan, base, options.solvers)
    settings = planned(base, without(plan, out), options, runner)
    tried = _tried(ladder, settings, plan.budget_s, runner)
    cases = [one.case for one in tried]
    frame = pd.DataFrame(
        [one.row for one in tried],
        columns=[c for c in COLUMNS if c not in ("robust_error", "in_turn", "excess")],
    )
    frame["family"] = [case.element for case in cases]
    frame["robust_error"] = _robust(frame, cases)
    again = time_again(cases, frame, ROUNDS[options.quick], runner)
    frame["in_turn"] = [k in again for k in frame.index]
    for k, found in again.items():
        times = vars(least([sample.cost for sample in found]))
        for name in ("cpu_s", "cpu_spread", "build_s", "repeats"):
            frame.loc[k, name] = times[name]
    frame["excess"] = excess(frame)
    samples = [
        *(r | {"round": "sweep"} for one in tried for r in one.samples),
        *(r | {"round": "in turn"} for k, found in again.items() for r in sample_rows(cases[k], found)),
    ]
    said = said_of(base, out)
    traded = Traded(base, frame[[*COLUMNS, "family"]], settings.references, samples, said=said)
    if options.quick:
        return traded
    second = second_roads(base, ladder.second, settings.references, runner)
    return replace(traded, second=second, orders=[*_orders(ladder, settings.references, runner)])


def _tried(ladder: Ladder, settings: Planned, budget_s: float | None, runner: Runner) -> list[Tried]:
    """All settings, run, in their order."""
    fine = same_mesh(settings, ladder.fine_step, ladder.fine_integrator, runner)
    found = {}
    for place, outcome in runner.each(settings.cases, budget_s):
        case = outcome.case
        told = row(outcome, settings.reference_of(case)) | _asked(case, ladder.base)
        told |= split(settings, outcome, fine)
        found[place] = Tried(case, told, sample_rows(case, outcome.samples))
    return [found[place] for place in sorted(found)]


def _orders(ladder: Ladder, references: Mapping[str, Reference], runner: Runner) -> Iterator[dict[str, Any]]:
    """Observed orders of the steps of references with a second method: on the coarsest mesh and on their own."""
    for element in ladder.second:
        fine = ladder.references[element]
        if element in references and isinstance(fine, Fine):
            yield from step_orders(ladder.base, element, fine, (ladder.finest[0], fine.mesh), runner)


def time_again(
    every: Sequence[Trial], frame: pd.DataFrame, rounds: int, runner: Runner
) -> Mapping[int, Sequence[Sample]]:
    """Times of the settings near the front of their solver, which take their samples in turn; by their row."""
    near = pd.concat([excess(own) for _, own in frame.groupby("solver", sort=False)]) <= NEAR
    chosen = near.index[near].sort_values()
    cases = {int(k): every[k] for k in chosen}

    began, total = count(), rounds * len(cases)

    def sampler(case: Trial) -> Callable[[], Sample]:
        solver = runner.resolve(case.solver)

        def once() -> Sample:
            with at_work() as interval:
                return Sample(case.solve(solver).cost, interval)

        def sample() -> Sample:
            label, k = f"times in turn: {label_of(case)}", next(began)
            runner.on_start(label, k, total)
            found = settled(once, runner.short)
            runner.on_job(label, k + 1, total)
            return found

        return sample

    def sample() -> dict[int, list[Sample]]:
        warm = {str(k): partial(runner.warm_up, case) for k, case in cases.items()}
        with runner.alone():
            found = in_turn({str(k): sampler(case) for k, case in cases.items()}, rounds, warm)
        return {int(k): samples for k, samples in found.items()}

    key = runner.key(*cases.values())
    return runner.remember(key and f"trade's costs in turn, {rounds} rounds|{key}", sample)  # type: ignore[no-any-return]


def _robust(frame: pd.DataFrame, cases: Sequence[Trial]) -> pd.Series:
    """Errors of the rows, none smaller than with the tightest of its solver's choices."""
    alike = frame[list(ALIKE)].astype(str).itertuples(index=False, name=None)
    first = {solver: choices_of(solver)[0] for solver in {case.solver for case in cases}}
    tightest = [(case.options, case.own) == first[case.solver] for case in cases]
    return robust_errors(frame["error"], list(alike), tightest)


def _asked(case: Trial, base: Case) -> dict[str, Any]:
    asked = dict(case.options)
    bounds = {name: asked.get(name, float("nan")) for name in ("tolerance", "newton_tolerance")}
    stretch = AS_GIVEN if case.scene == base.scene else "free"
    return bounds | {"own": written(case.own), "stretch": stretch}


def _fitting(base: Case, options: Options) -> Options:
    """The options with those meshes only that fit a scene: the two have different numbers of bodies."""
    if options.meshes is None:
        return options
    sizes = (1, len(base.scene.beams))
    return replace(options, meshes=tuple(m for m in options.meshes if len(m) in sizes))


def _check_meshes(every: Sequence[Ladder], options: Options) -> None:
    sizes = {1, *(len(ladder.base.scene.beams) for ladder in every)}
    for mesh in options.meshes or ():
        if len(mesh) not in sizes:
            check_mesh(every[0].base.scene, mesh)
