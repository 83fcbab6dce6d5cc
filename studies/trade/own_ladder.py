"""Meshes, steps and references of a user's case, all derived from its refinement."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from math import isfinite
from typing import TypeVar

from anctmm.elements.kinds import KINDS
from anctmm.model.case import Case
from anctmm.model.needs import needs
from anctmm.results.solution import Solution
from studies.engine.accuracy.dynamics import check_kinds
from studies.engine.accuracy.refinement import Refined, Refinement, Setup
from studies.engine.accuracy.resting import rests
from studies.engine.place_texts import place_texts
from studies.engine.runner import Runner
from studies.engine.running.trial import Mesh
from studies.engine.study import Options, StudyError
from studies.trade.plan import HIGH, NEWTON, TARGETS, Ladder

#: Smallest target error by default; by whether the run is quick.
SMALLEST = {False: 1e-5, True: 1e-3}
#: Part of the smallest target error that a reference may be uncertain by.
SHARE = 0.3
#: Errors in target errors: of what is too coarse for the largest, and fine enough for the smallest; levels at least.
COARSE, FINE, FEWEST = 4.0, 0.2, 3
#: Target error below which a reference of cables is one by high order in space and time, where the scene allows it:
#: meshes and steps of lower order would need more and more elements and steps.
HIGH_BELOW = 1e-5
#: Elements that may be requested, and the element of each model whose refined run is the reference by default.
ELEMENTS, REFERENCES = ("cable", "quintic", "shear"), ("cable", "shear")
#: Who finds such a reference.
FINEST = Setup(element="quintic", integrator=HIGH, stretch="free", options=(("newton_tolerance", NEWTON),))
#: Steps, and elements of the solver with a dense matrix, at most.
MOST_STEPS, MOST_DENSE = 6, 24

Level = TypeVar("Level")


class NothingMovesError(StudyError):
    """At no probe of a case is there a displacement to be measured."""


def own_ladder(case: Case, options: Options, runner: Runner) -> Ladder:
    """Refine a case with each requested element, and use the levels of the refinement as the settings to try.

    Parameters
    ----------
    case : Case
    options : Options
        Its `error` is the smallest target error, its `element` the only one wanted.
    runner : Runner

    Raises
    ------
    StudyError
        If the case is static: no step trades error for time there; or if nothing is run with the element and the
        integrator asked for.
    NothingMovesError
        If none of its probes moves.
    """
    check_asked(case, options)
    smallest = options.error or SMALLEST[options.quick]
    high = smallest < HIGH_BELOW and not _jointed_inside(case)
    with _headed(runner, f"{case.name}, reference: "):
        found = {
            element: Refinement(case, Setup(element=element), runner).refined(
                SHARE * (HIGH_BELOW if high and element == "cable" else smallest)
            )
            for element in ELEMENTS
            if options.element == element or (options.element is None and element in _models(case))
        }
        _check_moves(case, [run.solution for run in found.values()])
        references = {element: run.reference for element, run in found.items()}
        if high and "cable" in found:
            finest = Refinement(case, FINEST, runner).refined(SHARE * smallest)
            if finest.error < found["cable"].error:
                references["cable"] = finest.reference
    of = {element: meshes(run, element == "cable" and not options.quick) for element, run in found.items()}
    stepped = next(iter(found.values()))
    steps = tuple(stepped.levels.dt_at(stepped.i, j) for j in range(stepped.j + 1))[-MOST_STEPS:]
    targets = (*(target for target in TARGETS if target > 1.01 * smallest), smallest)
    if options.quick:
        of = {
            element: worth_trying(of[element], run.mesh.error, KINDS[element].order, targets)
            for element, run in found.items()
        }
        steps = worth_trying(steps, stepped.step.error, stepped.levels.setup.step_order, targets)
    cables = of.get("cable", ())
    return Ladder(
        case,
        cables,
        of.get("quintic") or _of_high_order(case, cables),
        of.get("shear", ()),
        tuple(m for m in cables if sum(m) <= MOST_DENSE)[-2:],
        ("global-dae", "exudyn-cable"),
        references,
        fine_step=min(run.trial.dt for run in found.values()),
        steps=steps,
        quick_steps=steps,
        targets=targets,
    )


def check_first(case: Case, options: Options, runner: Runner) -> None:
    """Refuse what `own_ladder` refuses, as far as one coarse run shows it; parameters and errors are the same."""
    check_asked(case, options)
    levels = Refinement(case, Setup(element=options.element or "cable"), runner)
    with _headed(runner, f"{case.name}, first: "):
        # a level that is needed for the reference anyhow
        _check_moves(case, [levels.solution(int(levels.chooses_mesh), int(levels.chooses_step))])


@contextmanager
def _headed(runner: Runner, heading: str) -> Iterator[None]:
    """Runs that are told under a heading; of several cases the last one's name stood before the runs of all."""
    outer, runner.heading = runner.heading, heading
    try:
        yield
    finally:
        runner.heading = outer


def check_asked(case: Case, options: Options) -> None:
    """Refuse a case without motion, and elements and integrators that nothing is run with.

    Raises
    ------
    StudyError
    """
    if options.element not in (None, *ELEMENTS):
        raise StudyError(
            f"--element is {options.element!r}; a trade is measured with {' or '.join(ELEMENTS)}, each against a "
            f"refined run of its own: `anctmm study fidelity` shows what rigid beams cost and save"
        )
    if case.static:
        raise StudyError(
            f"case {case.name!r} is a static equilibrium; a motion (t_end) is needed to trade error for time: "
            f"`anctmm study convergence` shows its errors over the mesh"
        )
    _check_kinds(case, options)


def _check_kinds(case: Case, options: Options) -> None:
    """Refuse an element and an integrator that nothing will be run with, before any reference is refined."""
    mesh = ((1,),)
    outline = Ladder(
        case, mesh, _of_high_order(case, mesh), mesh, (), (), {},
        fine_step=case.interval, steps=(case.interval,), quick_steps=(case.interval,),
    )  # fmt: skip
    check_kinds(case, outline.plan(options.quick).schemes, options)


def _check_moves(case: Case, found: Iterable[Solution]) -> None:
    """Refuse a case at whose probes nothing is to be measured."""
    whole = [solution for solution in found if solution.status.ok]
    if whole and all(rests(solution, probe) for solution in whole for probe in case.probes):
        probes = ", ".join(place_texts(case.probes).values())
        raise NothingMovesError(
            f"case {case.name!r} has probes {probes}, none of which moves; errors are "
            f"those of displacements, and a place that moves is needed"
        )


def _models(case: Case) -> tuple[str, ...]:
    """Elements of the models that are compared: without beams there is one model."""
    return REFERENCES if case.scene.beams else REFERENCES[:1]


def _of_high_order(case: Case, cable_meshes: tuple[Mesh, ...]) -> tuple[Mesh, ...]:
    """Meshes of quintic cables: the coarser ones of cables; none where joints act between the ends of a beam."""
    few = _jointed_inside(case) or not case.scene.beams
    return () if few else cable_meshes[: (len(cable_meshes) + 1) // 2]


def _jointed_inside(case: Case) -> bool:
    """Whether joints act between the ends of beams, where elements of high order have no node for them."""
    return any(feature == "interior-joints" for feature, _ in needs(case.scene))


def meshes(found: Refined, halfway: bool) -> tuple[Mesh, ...]:
    """Meshes of the levels up to that of a reference, and those halfway between them."""
    if not found.solution.status.ok or not isfinite(found.error):
        return (found.levels.mesh_at(0),)
    levels = [found.levels.mesh_at(i) for i in range(found.i + 1)]
    between = [tuple(3 * n // 2 for n in mesh) for mesh in levels[1:-1]] if halfway else []
    return tuple(sorted({*levels, *between}, key=sum))


def worth_trying(
    levels: Sequence[Level], finest: float, order: float, targets: Sequence[float]
) -> tuple[Level, ...]:
    """Levels whose own error is near target errors, from coarse to fine, each half of the one before.

    Left out are those that are too coarse for the largest target, and those that are finer than one that is good enough
    for the smallest.

    Parameters
    ----------
    levels : sequence
        Meshes or steps.
    finest : float
        Error of the last of them.
    order : float
        By which errors fall.
    targets : sequence of float
    """
    errors = [finest * 2.0 ** (order * k) for k in reversed(range(len(levels)))]
    first = next((k for k, error in enumerate(errors) if error <= COARSE * max(targets)), len(levels) - 1)
    last = next((k for k, error in enumerate(errors) if error <= FINE * min(targets)), len(levels) - 1)
    first = max(0, min(first, last - FEWEST + 1))
    return tuple(levels[first : max(last, min(first + FEWEST, len(levels)) - 1) + 1])
