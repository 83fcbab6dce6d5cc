"""Convergence of a case with mesh and step, and how many digits of its values are correct."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from math import inf, isfinite, nan
from typing import Any

import pandas as pd

from anctmm.model.case import Case
from anctmm.model.joints import Clamp, Weld
from studies.cases import assumptions_of
from studies.convergence.answers import answers
from studies.convergence.given import given_levels
from studies.convergence.joint_forces import at_joints
from studies.convergence.pictures import pictures
from studies.engine.accuracy.digits import OUTPUTS_NOTE, Reading, at_probes, values_of
from studies.engine.accuracy.refinement import Refined, Refinement, Setup
from studies.engine.accuracy.richardson import Part
from studies.engine.pictures import Film, Picture
from studies.engine.runner import Runner
from studies.engine.running.trial import NO_BEAMS
from studies.engine.storage.files import file_name
from studies.engine.study import Options, Result, check_taken, of_case, without_beams, without_motion
from studies.engine.tables import Table
from studies.report.animation import film
from studies.report.configurations import configurations
from studies.scenes import moving_scenes

#: Error to which mesh and step are refined; by whether the run is quick.
TARGETS = {False: 1e-5, True: 1e-3}
#: Observed order of a mesh below which it is taken to be the first.
FIRST_ORDER = 1.5
LEVELS = (
    "scene", "solver", "element", "integrator", "elements", "dofs", "dt", "error", "order", "status",
)  # fmt: skip
VALUES = (
    "scene", "solver", "element", "integrator", "probe", "quantity", "value", "uncertainty", "unit", "digits",
)  # fmt: skip


def run(options: Options, runner: Runner) -> Result:
    """Run the study: cables, and of whole studies shear elements, too, if no element is requested.

    Parameters
    ----------
    options : Options
        Its cases; the two moving base scenes without them.
    runner : Runner

    Raises
    ------
    StudyError
        If meshes or steps are asked for that do not fit the cases, or do not converge to anything, or an integrator
        where nothing moves.
    """
    check_taken(options, "convergence")
    cases = options.cases or tuple(moving_scenes())
    told = without_beams(cases, options) + without_motion(cases, options)
    levels = [given_levels(case, of_case(options, case)) for case in cases]
    target = options.error or (inf if options.meshes and options.steps else TARGETS[options.quick])
    found = []
    for case, (own_meshes, own_steps) in zip(cases, levels, strict=True):
        runner.heading = f"{case.name}: "
        for setup in setups(of_case(options, case), case):
            found.append(Refinement(case, setup, runner, own_meshes, own_steps).refined(target))
    meshes = _table(
        "mesh", "Error over the mesh", (r for f in found for r in mesh_levels(f)), LEVELS, _mesh_notes()
    )
    steps = _table(
        "step", "Error over the step", (r for f in found for r in step_levels(f)), LEVELS, _step_notes()
    )
    values = _table(
        "values",
        "Values and their uncertainty",
        (r for f in found for r in value_rows(f)),
        VALUES,
        _digits(cases),
    )
    forces = _table(
        "forces", "Largest forces in joints and springs", (r for f in found for r in value_rows(f, at_joints)),
        [{"probe": "joint"}.get(c, c) for c in VALUES], _forces(),
    )  # fmt: skip
    findings = (*(finding(f) for f in found), *told)
    return Result(
        name="convergence",
        title="Convergence: which digits are correct",
        question="How does the error fall with mesh and step, and how far is each value from the exact one?",
        findings=findings,
        assumptions=tuple(dict.fromkeys(a for case in cases for a in assumptions_of(case))),
        tables=(values, forces, meshes, steps),
        pictures=(*configurations_of(found), *pictures(meshes.frame, steps.frame)),
        films=tuple(filter(None, map(motion, found))),
        answers=answers(found),
        shown=("mesh", "step", "values", "forces"),
    )


def motion(found: Refined) -> Film | None:
    """The refined run of a case with its first element, to be played."""
    case, solution = found.levels.case, found.solution
    if case.static or found.levels.setup.element != "cable":
        return None
    shown = film(case.name, case.note or found.label, {found.levels.setup.solver: solution})
    return shown and replace(shown, name=file_name(case.name))


def setups(options: Options, case: Case) -> list[Setup]:
    """Who solves with which element, its own once: without beams all are the same."""
    several = not options.quick and bool(case.scene.beams)
    elements = (options.element,) if options.element else ("cable", "shear") if several else ("cable",)
    integrator = options.integrator or Setup.integrator
    found: dict[tuple[str, str], Setup] = {}
    for setup in (Setup(name, e, integrator) for name in options.solvers or ("anctmm",) for e in elements):
        found.setdefault((setup.solver, setup.own_element), setup)
    return list(found.values())


def mesh_levels(found: Refined) -> Iterator[dict[str, Any]]:
    """A row for each mesh up to that of a run, by its step."""
    if found.levels.refines_mesh:
        yield from _levels(found, [(k, found.j) for k in range(found.i + 1)], found.levels.mesh_part)


def step_levels(found: Refined) -> Iterator[dict[str, Any]]:
    """A row for each step down to that of a run, on its mesh."""
    if found.levels.refines_step:
        yield from _levels(found, [(found.i, k) for k in range(found.j + 1)], found.levels.step_part)


def value_rows(found: Refined, read: Reading = at_probes) -> Iterator[dict[str, Any]]:
    """A row for each value at the probes, or in the joints."""
    for value in values_of(found, read):
        place = {"probe" if read is at_probes else "joint": value.probe}
        yield {**_about(found), **vars(value), **place, "digits": value.text}


def configurations_of(found: Sequence[Refined]) -> Iterator[Picture]:
    """A picture of each case that has a run, by its first element."""
    seen = set()
    for refined in found:
        case = refined.levels.case
        if case.name not in seen and len(refined.solution.t):
            seen.add(case.name)
            yield configurations(refined.solution, f"configurations_{file_name(case.name)}")


def finding(found: Refined) -> str:
    """What was found of one case with one element."""
    about = ", ".join(value for value in _about(found).values() if value != NO_BEAMS)
    if not found.solution.status.ok:
        return f"{about}: {found.reason}."
    levels, theory = found.levels, found.levels.setup.mesh_order
    orders = [
        f"{name} {part.order:.2f} (theory {expected:g})"
        for name, part, expected in (
            ("in the mesh", found.mesh, theory),
            ("in the step", found.step, found.levels.setup.step_order),
        )
        if isfinite(part.order)
    ]
    order = f"observed order {' and '.join(orders)}; " if orders else ""
    parts = ", ".join([
        *([f"mesh {found.mesh.error:.1g}"] if levels.case.scene.beams else []),
        *([f"step {found.step.error:.1g}"] if levels.refines_step else []),
    ])  # fmt: skip
    if not parts:
        return f"{about}: there is no mesh or step to refine."
    if not levels.estimates:  # of one mesh, or one step, nothing is known
        given, other = ("mesh", "step") if len(levels.meshes) == 1 else ("step", "mesh")
        parts = f"of the {other} alone; the {given} is the one given"
    told = f"{about}: {order}{found.label} has an estimated error of {found.error:.1g} ({parts})"
    short = "" if found.reached else f", above the target {found.target:g}, as {found.reason}"
    return f"{told}{short}.{_held_stretch(found)}"


def _held_stretch(found: Refined) -> str:
    """What makes a mesh converge at first order only, where that is likely."""
    held = any(isinstance(j, Clamp | Weld) and j.stretch == "held" for j in found.levels.case.scene.joints)
    high = found.levels.setup.mesh_order > FIRST_ORDER
    if not (held and high and found.mesh.order < FIRST_ORDER and found.mesh.error > found.step.error):
        return ""
    return (
        " Where an axial force acts, clamps and welds that hold the stretch leave an error of first order: "
        'stretch="free" in them removes it.'
    )


def _levels(
    finest: Refined, runs: Sequence[tuple[int, int]], part_of: Callable[[int, int], Part]
) -> Iterator[dict[str, Any]]:
    """Rows of runs from coarse to fine: the distance to the finest, and the estimate of what is left on that."""
    levels, rest = finest.levels, part_of(*runs[-1]).error
    for i, j in runs:
        solution, trial, part = levels.solution(i, j), levels.trial(i, j), part_of(i, j)
        error = rest if (i, j) == runs[-1] else rest + levels.difference(solution, finest.solution)
        yield {
            **_about(finest), "elements": trial.cut, "dofs": solution.dofs, "dt": trial.dt,
            "error": error if isfinite(error) else nan, "order": part.order, "status": str(solution.status),
        }  # fmt: skip


def _about(found: Refined) -> dict[str, str]:
    setup, case = found.levels.setup, found.levels.case
    return {
        "scene": case.name, "solver": setup.solver, "element": setup.own_element if case.scene.beams else NO_BEAMS,
        "integrator": "static" if case.static else setup.integrator,
    }  # fmt: skip


def _table(
    name: str, title: str, rows: Iterator[dict[str, Any]], columns: Sequence[str], notes: tuple[str, ...]
) -> Table:
    return Table(name, title, pd.DataFrame(list(rows), columns=list(columns)), notes)


def _mesh_notes() -> tuple[str, ...]:
    return (
        "error: distance to the finest mesh by the same step, and what is left there: Richardson's estimate, 1.5 "
        "times, or, where the order is not that of theory, twice the difference to the mesh before. order: of two "
        "differences of meshes that follow each other; log2 of their ratio where elements are halved.",
    )


def _step_notes() -> tuple[str, ...]:
    return ("error and order as over the mesh, of steps on the finest mesh.",)


def _forces() -> tuple[str, ...]:
    return (
        "Of all output times the largest, which between them may be larger; of an equilibrium what it holds by. A "
        "moment is that on the first place of a joint; what a solver does not give, or equilibrium alone does not "
        "tell, is left out.",
        "digits: as of the values at the probes. Forces follow accelerations, and converge more slowly than places.",
    )


def _digits(cases: Iterable[Case]) -> tuple[str, ...]:
    return (
        "digits: the value to the first digit of its uncertainty. uncertainty: what the differences to coarser meshes "
        "and steps leave for that value, as for errors; orders above 2 are not counted on.",
        *([OUTPUTS_NOTE] if any(not case.static for case in cases) else []),
    )
