"""How does an error fall with mesh and step, and how many digits of each value are correct?"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import inf, isfinite, nan
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from anctmm.elements.kinds import KINDS
from anctmm.errors import AnctmmError
from anctmm.model.case import Case
from anctmm.model.joints import Clamp, Weld
from reference.exact import solve_static as exact_static
from studies.cases import assumptions_of
from studies.engine.files import file_name
from studies.engine.refinement import MESH, STEP, Refined, Refinement, Setup, offer_of
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Picture, Result, StudyError, check_fits, check_taken
from studies.engine.tables import Table
from studies.engine.trials import NO_BEAMS, Mesh, mesh_label
from studies.engine.values import OUTPUTS_NOTE, Reading, at_joints, at_probes, values_of
from studies.report.plots import DASHES, MARKERS, as_picture, log_axes, picture

#: Error to which mesh and step are refined; by whether the run is quick.
TARGETS = {False: 1e-5, True: 1e-3}
#: Observed order of a mesh below which it is taken to be the first.
FIRST_ORDER = 1.5
NOTES = {
    "mesh": "error: difference to the finest mesh by the same step, plus the estimate of the finest mesh's own error "
    "(Richardson's, 1.5 times, or, where the order is not that of theory, twice the difference to the mesh before). "
    "order: observed, of two differences of meshes that follow each other.",
    "step": "error and order as over the mesh, of steps on the finest mesh.",
    "values": "digits: the value to the first digit of its uncertainty. uncertainty: estimated for that value from "
    "coarser meshes and steps; orders above 2 are not counted on.",
    "forces": "Of all output times the largest; of an equilibrium the last. A moment is that on the first place of a "
    "joint. Forces follow accelerations, and converge more slowly than places.",
    "exact": "Equilibria of a clamped beam against the exact solution of the continuum that the element tends to: "
    "difference of the probes' displacements, relative, beside its estimate.",
}
TITLES = {
    "mesh": "Error over the mesh", "step": "Error over the step", "values": "Values and their uncertainty",
    "forces": "Joint forces", "exact": "Equilibria against exact solutions",
}  # fmt: skip


def run(options: Options, runner: Runner) -> Result:
    """Run the study of a case: cables, and of whole studies shear elements, too, if no element is requested.

    Raises
    ------
    StudyError
        If meshes or steps do not fit the case, or nothing is refined, or an integrator is given where nothing moves.
    """
    check_taken(options, "convergence")
    case = options.case
    check_fits(options, case)
    meshes, steps = given_levels(case, options)
    target = options.error or (inf if meshes and steps else TARGETS[options.quick])
    runner.heading = f"{case.name}: "
    found = [
        Refinement(case, setup, runner, meshes, steps).refined(target) for setup in setups(options, case)
    ]
    tables = {
        "mesh": _table("mesh", found, lambda f: _levels(f, MESH)),
        "step": _table("step", found, lambda f: _levels(f, STEP)),
        "values": _table("values", found, lambda f: value_rows(f, at_probes)),
        "forces": _table("forces", found, lambda f: value_rows(f, at_joints)),
        "exact": _table("exact", found, exact_rows),
    }
    if tables["exact"].frame.empty:
        del tables["exact"]
    name, caption = f"configurations_{file_name(case.name)}", f"{case.name}: configurations and energies."
    drawn = [as_picture(name, caption, f.solution.plot()) for f in found if len(f.solution.t)]
    return Result(
        name="convergence", title="Convergence and joint forces",
        question="How does the error fall with mesh and step, and how far is each value from the exact one?",
        findings=tuple(finding(f) for f in found), assumptions=assumptions_of(case), tables=tuple(tables.values()),
        pictures=(*drawn[:1], *_picture(case.name, tables["mesh"].frame, tables["step"].frame)),
        answers=tuple(answers(found[0])), shown=tuple(tables), good=any(f.solution.status.ok for f in found),
    )  # fmt: skip


def setups(options: Options, case: Case) -> list[Setup]:
    """Each solver with each element of its own once: without beams all are the same."""
    several = not options.quick and bool(case.scene.beams)
    elements = (options.element,) if options.element else ("cable", "shear") if several else ("cable",)
    integrator = options.integrator or Setup.integrator
    solvers = options.solvers or (Setup.solver,)
    every = [Setup(solver, element, integrator) for solver in solvers for element in elements]
    return list({(setup.solver, setup.own_element): setup for setup in reversed(every)}.values())[::-1]


def given_levels(case: Case, options: Options) -> tuple[tuple[Mesh, ...], tuple[float, ...]]:
    """Meshes from coarse to fine, and steps (s) from long to short, of a case; none where none are given.

    Raises
    ------
    StudyError
        If one mesh is not finer than another, or there is nothing to compare.
    StepError
        If a step does not divide the interval of output.
    """
    each = [mesh * len(case.scene.beams) if len(mesh) == 1 else mesh for mesh in options.meshes or ()]
    meshes, steps = tuple(sorted(each, key=sum)), tuple(sorted(options.steps or (), reverse=True))
    for coarse, fine in pairwise(meshes):
        if not all(n > before for n, before in zip(fine, coarse, strict=True)):
            raise StudyError(
                f"--elements has {mesh_label(coarse)} and {mesh_label(fine)}; the finer of two meshes needs more "
                f"elements of each beam of {case.name!r}: an order is observed over meshes that are finer everywhere"
            )
    if meshes and steps and options.error:
        raise StudyError(
            f"--error is {options.error:g} beside --elements and --dt; leave one of these out, to be chosen for it"
        )
    if len(meshes) == 1 and (len(steps) == 1 or case.static):
        raise StudyError(
            f"--elements is {mesh_label(meshes[0])} alone{'' if case.static else ', and --dt one step'}: nothing "
            f"converges; at least two of one of them are needed (`anctmm run` does a single run)"
        )
    for level in range(len(steps)):
        Refinement(case, Setup(), Runner(), meshes, steps).trial(0, level).run()
    return meshes, steps


# --- tables --------------------------------------------------------------------------------------------------


def _table(
    name: str, found: Sequence[Refined], rows_of: Callable[[Refined], Iterator[dict[str, Any]]]
) -> Table:
    frame = pd.DataFrame([row for one in found for row in rows_of(one)])
    return Table(name, TITLES[name], frame, (NOTES[name], *([OUTPUTS_NOTE] if name == "values" else [])))


def _about(found: Refined) -> dict[str, str]:
    trial = found.trial
    element = found.levels.setup.own_element if trial.scene.beams else NO_BEAMS
    return {
        "scene": trial.scene.name, "solver": trial.solver, "element": element, "integrator": trial.integrator,
    }  # fmt: skip


def _levels(finest: Refined, axis: int) -> Iterator[dict[str, Any]]:
    """Rows of meshes, or of steps, from coarse to fine: the difference to the finest, and that one's own error."""
    levels, last = finest.levels, (finest.i, finest.j)[axis]
    rest, refined = (finest.mesh, finest.step)[axis].error, (levels.refines_mesh, levels.refines_step)[axis]
    for k in range(last + 1) if refined else ():
        place = (k, finest.j) if axis == MESH else (finest.i, k)
        solution, trial, order = (
            levels.solution(*place),
            levels.trial(*place),
            levels.part(*place, axis).order,
        )
        error = rest if k == last else rest + levels.difference(solution, finest.solution)
        yield {
            **_about(finest), "elements": trial.cut, "dofs": solution.dofs, "dt": trial.dt,
            "error": error if isfinite(error) else nan, "order": order, "status": str(solution.status),
        }  # fmt: skip


def value_rows(found: Refined, read: Reading) -> Iterator[dict[str, Any]]:
    """A row for each value at the probes, or in the joints."""
    place = "probe" if read is at_probes else "joint"
    for v in values_of(found, read):
        yield {
            **_about(found), place: v.probe, "quantity": v.quantity, "value": v.value,
            "uncertainty": v.uncertainty, "unit": v.unit, "digits": v.text,
        }  # fmt: skip


def exact_rows(found: Refined) -> Iterator[dict[str, Any]]:
    """Difference of an equilibrium to the exact solution of its continuum, where one is known."""
    setup, case = found.levels.setup, found.levels.case
    limit = offer_of(setup.solver).limits.get(setup.element, KINDS[setup.element].continuum)
    try:
        error = (
            found.levels.difference(found.solution, exact_static(case.scene, limit)) if case.static else inf
        )
    except AnctmmError:
        return
    if isfinite(error):
        about = {**_about(found), "elements": found.trial.cut, "continuum": limit}
        yield {**about, "difference": error, "estimate": found.error, "status": str(found.solution.status)}


# --- sentences -----------------------------------------------------------------------------------------------


def finding(found: Refined) -> str:
    """Result of one setup in a sentence."""
    about = ", ".join(value for value in _about(found).values() if value != NO_BEAMS)
    if not found.solution.status.ok:
        return f"{about}: {found.reason}."
    setup = found.levels.setup
    parts = ("mesh", found.mesh, setup.mesh_order), ("step", found.step, setup.step_order)
    orders = [
        f"in the {what} {part.order:.2f} (theory {theory:g})" for what, part, theory in parts if isfinite(part.order)
    ]  # fmt: skip
    order = f"observed order {' and '.join(orders)}; " if orders else ""
    return f"{about}: {order}{_estimate(found)}.{_held(found)}"


def answers(found: Refined) -> Iterator[Answer]:
    """Cards of a case, by the first of its setups: the largest displacement with its digits, the largest force."""
    name = found.levels.case.name
    question = f"{name}: how many digits are correct?"
    if not found.solution.status.ok:
        yield Answer(question, "none", f"{found.reason}.")
        return
    values = values_of(found)
    moved = [v for v in values if v.quantity.startswith("largest displacement")] or values
    value = max(moved, key=lambda v: abs(v.value))
    yield Answer(question, value.text, f"{value.probe}, {value.quantity}. {_estimate(found)}.")
    forces = [v for v in values_of(found, at_joints) if v.unit == "N" and not v.probe.startswith("spring")]
    if any(not abs(v.value) <= v.uncertainty for v in forces):
        largest = max(forces, key=lambda v: abs(v.value))
        take = f"In {largest.probe}, {largest.quantity}."
        yield Answer(f"{name}: what is the largest force in a joint?", largest.text, take)


def _estimate(found: Refined) -> str:
    """The estimated error of a complete run in words, and why it is above its target."""
    if not found.parts:
        return "there is no mesh or step to refine"
    given = "" if found.levels.estimates else "; the other is the one given, and its error is not known"
    short = "" if found.reached else f", above the target {found.target:g}, as {found.reason}"
    return f"{found.label} has an estimated error of {found.error:.1g} ({found.parts}{given}){short}"


def _held(found: Refined) -> str:
    """Reason of a mesh that converges at first order only, where that is likely."""
    held = any(isinstance(j, Clamp | Weld) and j.stretch == "held" for j in found.levels.case.scene.joints)
    high = found.levels.setup.mesh_order > FIRST_ORDER
    if not (held and high and found.mesh.order < FIRST_ORDER and found.mesh.error > found.step.error):
        return ""
    return (
        " Where an axial force acts, clamps and welds that hold the stretch leave an error of first order: "
        'stretch="free" in them removes it.'
    )


def _picture(scene: str, meshes: pd.DataFrame, steps: pd.DataFrame) -> Iterator[Picture]:
    """Error over the mesh and over the step."""
    every = [(meshes, "dofs", "unknown coordinates"), (steps, "dt", "time step (s)")]
    panels = [(rows[rows["error"] > 0.0], column, label) for rows, column, label in every if len(rows)]
    panels = [panel for panel in panels if len(panel[0]) > 1]

    def draw(figure: Figure) -> None:
        row = list(figure.subplots(1, len(panels), squeeze=False)[0])
        for axes, (rows, column, _) in zip(row, panels, strict=True):
            groups = rows.groupby(["solver", "element", "integrator"], sort=False)
            for k, (names, line) in enumerate(groups):
                look = {"marker": MARKERS[k % len(MARKERS)], "linestyle": DASHES[k % len(DASHES)]}
                about = ", ".join(str(name) for name in names if name != NO_BEAMS)
                axes.plot(line[column], line["error"], label=about, markersize=4, **look)
        log_axes(figure, row, [(label, "relative error") for _, _, label in panels])

    caption = f"{scene}: error over mesh and step; the finest point of each line is an estimate."
    if panels:
        yield picture(f"convergence_{file_name(scene)}", caption, draw, (7.2, 3.6))
