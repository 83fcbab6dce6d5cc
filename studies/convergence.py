"""How does an error fall with mesh and step, and how many digits of each value are correct?"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import pairwise, product
from math import inf, isfinite, nan
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from anctmm.elements.kinds import KINDS
from anctmm.errors import AnctmmError
from anctmm.model.case import Case
from reference.exact import solve_static as exact_static
from studies.cases import assumptions_of
from studies.engine.files import file_name
from studies.engine.meshes import Mesh, mesh_label
from studies.engine.refinement import MESH, STEP, Refined, Refinement
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Picture, Result, StudyError, check_fits
from studies.engine.tables import Table
from studies.engine.trials import IMPLICIT, NO_BEAMS, OURS, offer_of
from studies.engine.values import OUTPUTS_NOTE, at_joints, rows_of, values_of
from studies.report.plots import DASHES, MARKERS, as_picture, log_axes, picture

#: Error to which mesh and step are refined; by whether the run is quick.
TARGETS = {False: 1e-5, True: 1e-3}
#: Tables by name: title, rows of a refined run, and notes.
TABLES: dict[str, tuple[Any, ...]] = {
    "mesh": (
        "Error over the mesh", lambda found: _levels(found, MESH),
        "error: difference to the finest mesh by the same step, plus the estimate of that mesh's own error. order: "
        "observed, of two differences of meshes that follow each other.",
    ),
    "step": (
        "Error over the step", lambda found: _levels(found, STEP), "As over the mesh, of steps on the finest mesh.",
    ),
    "values": (
        "Values and their uncertainty", lambda found: rows_of(values_of(found)),
        "digits: the value to the first digit of its uncertainty, which is estimated from coarser meshes and steps.",
        OUTPUTS_NOTE,
    ),
    "forces": (
        "Joint forces", lambda found: rows_of(values_of(found, at_joints), "joint"),
        "Of all output times the largest; of an equilibrium the last. A moment is that on the first place of a joint.",
    ),
    "exact": (
        "Equilibria against exact solutions", lambda found: exact_rows(found),
        "Difference of the probes' displacements to the exact solution of the continuum that the element tends to, "
        "relative, beside its estimate.",
    ),
}  # fmt: skip


def run(options: Options, runner: Runner) -> Result:
    """Run the study of a case: cables, and of whole studies shear elements, too, if no element is requested."""
    case, quick = options.case, options.quick
    check_fits(options, case)
    meshes, steps = given_levels(case, options)
    target = options.error or (inf if meshes and steps else TARGETS[quick])
    usual = ("cable", "shear") if case.scene.beams and not quick else ("cable",)
    elements = (options.element,) if options.element else usual
    runner.heading = f"{case.name}: "
    levels: dict[tuple[str, str], Refinement] = {}  # each solver with each element of its own once
    for solver, element in product(options.solvers or (OURS,), elements):
        setting: Any = {"solver": solver, "element": element, "integrator": options.integrator or IMPLICIT}
        one = Refinement(case, runner, meshes, steps, **setting)
        levels.setdefault((solver, one.plain.used), one)
    found = [one.refined(target) for one in levels.values()]
    frames = {name: pd.DataFrame([row for one in found for row in _rows(name, one)]) for name in TABLES}
    tables = [Table(n, TABLES[n][0], f, TABLES[n][2:]) for n, f in frames.items() if n != "exact" or len(f)]
    name, caption = f"configurations_{file_name(case.name)}", f"{case.name}: configurations and energies."
    drawn = [as_picture(name, caption, f.solution.plot()) for f in found if len(f.solution.t)]
    return Result(
        name="convergence", title="Convergence and joint forces",
        question="How does the error fall with mesh and step, and how far is each value from the exact one?",
        findings=tuple(map(finding, found)), assumptions=assumptions_of(case), tables=tuple(tables),
        pictures=(*drawn[:1], *_picture(case.name, frames["mesh"], frames["step"])),
        answers=tuple(answers(found[0])), shown=tuple(t.name for t in tables),
        good=any(f.solution.status.ok for f in found),
    )  # fmt: skip


def given_levels(case: Case, options: Options) -> tuple[tuple[Mesh, ...], tuple[float, ...]]:
    """Meshes from coarse to fine, and steps (s) from long to short, of a case; none where none are given.

    StudyError if one mesh is not finer than another, or nothing can be compared; StepError if a step does not fit.
    """
    each = [mesh * len(case.scene.beams) if len(mesh) == 1 else mesh for mesh in options.meshes or ()]
    meshes, steps = tuple(sorted(each, key=sum)), tuple(sorted(options.steps or (), reverse=True))
    for coarse, fine in pairwise(meshes):
        if not all(n > before for n, before in zip(fine, coarse, strict=True)):
            two = f"--elements has {mesh_label(coarse)} and {mesh_label(fine)}"
            raise StudyError(f"{two}; meshes that are finer everywhere are needed to observe an order")
    if len(meshes) == 1 and (len(steps) == 1 or case.static):
        alone = f"--elements is {mesh_label(meshes[0])} alone{'' if case.static else ', and --dt one step'}"
        raise StudyError(f"{alone}: nothing converges; at least two of one of them are needed")
    for level in range(len(steps)):
        Refinement(case, Runner(), meshes, steps).trial(0, level).run()
    return meshes, steps


# --- tables --------------------------------------------------------------------------------------------------


def _rows(table: str, found: Refined) -> Iterator[dict[str, Any]]:
    """Rows of a table."""
    trial = found.trial
    about = {
        "scene": trial.scene.name, "solver": trial.solver, "element": trial.used if trial.scene.beams else NO_BEAMS,
        "integrator": trial.integrator,
    }  # fmt: skip
    yield from (about | row for row in TABLES[table][1](found))


def _levels(finest: Refined, axis: int) -> Iterator[dict[str, Any]]:
    """Rows of meshes, or of steps, from coarse to fine: the difference to the finest, and that one's own error."""
    levels, last = finest.levels, (finest.i, finest.j)[axis]
    rest = (finest.mesh, finest.step)[axis].error
    for k in range(last + 1) if levels.refines[axis] else ():
        i, j = (k, finest.j) if axis == MESH else (finest.i, k)
        solution, trial, order = levels.solution(i, j), levels.trial(i, j), levels.part(i, j, axis).order
        error = rest if k == last else rest + levels.difference(solution, finest.solution)
        yield {
            "elements": trial.cut, "dofs": solution.dofs, "dt": trial.dt,
            "error": error if isfinite(error) else nan, "order": order, "status": str(solution.status),
        }  # fmt: skip


def exact_rows(found: Refined) -> Iterator[dict[str, Any]]:
    """Difference of an equilibrium to the exact solution of its continuum, where one is known."""
    trial, case = found.trial, found.levels.case
    limit = offer_of(trial.solver).limits.get(trial.element, KINDS[trial.element].continuum)
    with suppress(AnctmmError):
        error = (
            found.levels.difference(found.solution, exact_static(case.scene, limit)) if case.static else inf
        )
        if isfinite(error):
            yield {
                "elements": trial.cut, "continuum": limit, "difference": error, "estimate": found.error,
                "status": str(found.solution.status),
            }  # fmt: skip


# --- sentences -----------------------------------------------------------------------------------------------


def finding(found: Refined) -> str:
    """Result of one setup in a sentence."""
    if not found.solution.status.ok:
        return f"{found.levels.case.name}: {found.reason}."
    named = zip(("mesh", "step"), (found.mesh, found.step), found.levels.orders, strict=True)
    orders = [f"in the {n} {part.order:.2f} (theory {o:g})" for n, part, o in named if isfinite(part.order)]
    order = f"observed order {' and '.join(orders)}; " if orders else ""
    return f"{found.levels.case.name}: {order}{found.trial.label}, {found.estimate}."


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
    yield Answer(question, value.text, f"{value.probe}, {value.quantity}; {found.estimate}.")
    forces = [v for v in values_of(found, at_joints) if v.unit == "N" and not v.probe.startswith("spring")]
    if forces:
        largest = max(forces, key=lambda v: abs(v.value))
        take = f"In {largest.probe}, {largest.quantity}."
        yield Answer(f"{name}: what is the largest force in a joint?", largest.text, take)


def _picture(scene: str, meshes: pd.DataFrame, steps: pd.DataFrame) -> Iterator[Picture]:
    """Error over the mesh and over the step."""
    every: Sequence[Any] = [(meshes, "dofs", "unknown coordinates"), (steps, "dt", "time step (s)")]
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
