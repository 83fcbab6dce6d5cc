"""Meshes, steps, references and targets of a case's trade, from its refinement with each element."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import TypeVar

from anctmm.elements.kinds import KINDS
from anctmm.model.case import Case
from studies.engine.meshes import halfway
from studies.engine.places import place_texts
from studies.engine.refinement import Reference, Refined, Refinement, Setup, rests
from studies.engine.runner import Runner
from studies.engine.study import Options, StudyError, check_mesh
from studies.engine.trials import Mesh

#: Target errors; the smallest by default, by whether the run is quick.
TARGETS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
SMALLEST = {False: 1e-5, True: 1e-3}
#: Part of the smallest target error that a reference may be uncertain by.
SHARE = 0.3
#: Errors in target errors: of levels too coarse for the largest, and fine enough for the smallest; levels at least.
COARSE, FINE, FEWEST = 4.0, 0.1, 3
#: Steps at most.
MOST_STEPS = 5

Level = TypeVar("Level")


@dataclass(frozen=True)
class Levels:
    """Settings to try on a case.

    Parameters
    ----------
    case : Case
    meshes : mapping of element to tuple of Mesh
        From coarse to fine.
    steps : tuple of float
        From long to short, s.
    references : mapping of element to Reference
    targets : tuple of float
        From the largest to the smallest.
    """

    case: Case
    meshes: Mapping[str, tuple[Mesh, ...]]
    steps: tuple[float, ...]
    references: Mapping[str, Reference]
    targets: tuple[float, ...]

    def reference_of(self, element: str) -> Reference:
        """The reference of an element, or of another one with the same continuum."""
        alike = (e for e in self.references if KINDS[e].continuum == KINDS[element].continuum)
        return self.references[element if element in self.references else next(alike, element)]


def levels_of(case: Case, options: Options, runner: Runner) -> Levels:
    """Refine a case with each element, and use the levels of the refinement as the settings to try.

    Raises
    ------
    StudyError
        If a mesh does not fit, or none of the probes moves.
    """
    for mesh in options.meshes or ():
        check_mesh(case.scene, mesh)
    smallest = options.error or SMALLEST[options.quick]
    targets = (*(target for target in TARGETS if target > 1.01 * smallest), smallest)
    runner.heading = f"{case.name}, reference: "
    found = {
        e: Refinement(case, Setup(element=e), runner).refined(SHARE * smallest) for e in models(case, options)
    }
    _check_moves(case, list(found.values()))
    meshes = {e: options.meshes or _meshes(run, targets, options.quick) for e, run in found.items()}
    if "cable" in meshes and not options.quick and case.scene.beams:  # of high order: coarser meshes suffice
        meshes["quintic"] = options.meshes or meshes["cable"][: (len(meshes["cable"]) + 1) // 2]
    return Levels(
        case,
        {e: those for e, those in meshes.items() if options.element in (None, e)},
        options.steps or _steps(next(iter(found.values())), targets, options.quick),
        {element: run.reference for element, run in found.items()},
        targets,
    )


def models(case: Case, options: Options) -> tuple[str, ...]:
    """Elements whose refined runs are references: one of each continuum asked for."""
    if options.element:
        return ("cable" if options.element == "quintic" else options.element,)
    return ("cable",) if options.quick or not case.scene.beams else ("cable", "shear")


def _check_moves(case: Case, found: Sequence[Refined]) -> None:
    complete = [run.solution for run in found if run.solution.status.ok]
    if complete and all(rests(solution, probe) for solution in complete for probe in case.probes):
        raise StudyError(
            f"case {case.name!r} has probes {', '.join(place_texts(case.probes).values())}, none of which moves; "
            f"errors are those of displacements, and a place that moves is needed"
        )


def _meshes(run: Refined, targets: Sequence[float], quick: bool) -> tuple[Mesh, ...]:
    """Meshes of the levels up to that of a reference, and those halfway between them."""
    if not run.solution.status.ok or not isfinite(run.error):
        return (run.levels.mesh_at(0),)
    levels = [run.levels.mesh_at(i) for i in range(run.i + 1)]
    if quick:
        return worth_trying(levels, run.mesh.error, run.levels.setup.mesh_order, targets)
    between = [halfway(run.levels.case, mesh) for mesh in levels[:-1]] if run.levels.chooses_mesh else []
    return tuple(sorted({*levels, *filter(None, between)}, key=sum))


def _steps(run: Refined, targets: Sequence[float], quick: bool) -> tuple[float, ...]:
    """Steps of the levels down to that of a reference, and those of two thirds, as whole parts of the output."""
    levels = [run.levels.dt_at(run.i, j) for j in range(run.j + 1)]
    if quick:
        return worth_trying(levels, run.step.error, run.levels.setup.step_order, targets)
    counts = [round(run.levels.case.interval / dt) for dt in levels[-MOST_STEPS:]]
    counts += [3 * n // 2 for n in counts if n % 2 == 0]
    return tuple(run.levels.case.interval / n for n in sorted(counts))


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
