"""The paper's four-bar: accuracy and cost over solvers, elements, integrators, meshes and steps."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from anctmm.results.solution import Solution
from studies.convergence.step_convergence import step_rates, step_sweep
from studies.engine import tables
from studies.engine.accuracy.dynamics import (
    REISSNER,
    Fine,
    Plan,
    Scheme,
    Sweep,
    cases_of,
    quick_plan,
    samples,
    sweep,
    with_references,
)
from studies.engine.runner import Runner
from studies.engine.running.trial import Mesh, Trial, mesh_label
from studies.engine.study import Options, Result
from studies.engine.tables import Table
from studies.four_bar.half_turn import half_turn
from studies.four_bar.paper_table import BASELINE, contest, paper_table
from studies.report import error_pictures, mechanism_pictures
from studies.report.animation import Film, film
from studies.report.configurations import configurations
from studies.report.plots import Picture
from studies.scenes import four_bar

OURS = ("anctmm", "global-dae")
#: The cable is about two orders better on a mesh than the shear element, so its meshes begin coarser.
SHEAR_MESHES: tuple[Mesh, ...] = ((2, 8, 2), (4, 16, 4), (8, 32, 8))
CABLE_MESHES: tuple[Mesh, ...] = ((1, 4, 1), (2, 8, 2), (4, 16, 4))
#: What is said about lines of the paper's table, with the time per step and the ratio to the dense solver's.
GAINS = {
    "ANC-TMM, explicit": "Explicit ANC–TMM takes {:.3g} µs a step, {:.3g} times less than ordinary ANCF with "
    "a dense matrix solved anew each step (published: 7.8).",
    "ordinary ANCF, at its best": "Ordinary ANCF, factored once, takes {:.3g} µs a step, {:.3g} times less "
    "than its dense form.",
}
SNAPSHOTS = (0.0, 0.5, 0.8, 1.0, 1.2, 1.5, 2.0)


def implicit_steps(mesh: Mesh) -> tuple[float, ...]:
    """Steps of the implicit runs, s: the same for every mesh."""
    return (1e-2, 5e-3, 2.5e-3, 1.25e-3)


def explicit_steps(mesh: Mesh) -> tuple[float, ...]:
    """Three steps below the stability limit, which falls with the crank's elements, s."""
    largest = 2e-5 if max(mesh) <= 8 else 1e-5 if max(mesh) <= 16 else 5e-6
    return (largest, largest / 2, largest / 4)


FULL = Plan(
    schemes=(
        Scheme("shear", "full", "zhai", OURS, SHEAR_MESHES, explicit_steps),
        Scheme(
            "shear",
            "full",
            "generalized-alpha",
            (*OURS, "global-dae-dense", "exudyn-reissner"),
            SHEAR_MESHES,
            implicit_steps,
        ),
        Scheme("cable", "full", "zhai", OURS, CABLE_MESHES, explicit_steps),
        Scheme(
            "cable",
            "full",
            "generalized-alpha",
            (*OURS, "global-dae-dense", "exudyn-cable"),
            CABLE_MESHES,
            implicit_steps,
        ),
        Scheme(
            "cable", "reduced", "generalized-alpha", (*OURS, "exudyn-cable"), CABLE_MESHES, implicit_steps
        ),
    ),
    references={
        "shear": Fine(
            ("global-dae", "anctmm"), (32, 128, 32), (16, 64, 16), 2.5e-4, 5e-4, "generalized-alpha"
        ),
        "cable": Fine(
            ("global-dae", "anctmm"), (16, 64, 16), (8, 32, 8), 1.25e-4, 2.5e-4, "generalized-alpha"
        ),
    },
)
QUICK = Plan(
    schemes=(
        Scheme("shear", "full", "zhai", OURS, SHEAR_MESHES[:1], lambda mesh: (1e-5,)),
        Scheme("shear", "full", "zhai", OURS[:1], SHEAR_MESHES[1:2], lambda mesh: (1e-5,)),
        Scheme(
            "shear",
            "full",
            "generalized-alpha",
            (*OURS, "exudyn-reissner"),
            SHEAR_MESHES[:2],
            lambda mesh: (5e-3, 1.25e-3),
        ),
        Scheme(
            "cable",
            "full",
            "generalized-alpha",
            (*OURS, "exudyn-cable"),
            CABLE_MESHES[:2],
            lambda mesh: (5e-3, 1.25e-3),
        ),
    ),
    references={
        "shear": Fine(("anctmm",), (16, 64, 16), (8, 32, 8), 1.25e-3, 2.5e-3, "generalized-alpha"),
        "cable": Fine(("anctmm",), (4, 16, 4), (2, 8, 2), 5e-4, 1e-3, "generalized-alpha"),
    },
)

LEFT_OUT = (
    "fine meshes and steps, explicit steps of cables, reduced quadrature, and dense matrices except one line."
)

#: The step's error alone is shown on the paper's mesh; by whether the run is quick.
STEP_MESH: Mesh = (2, 8, 2)
STEP_FINE = {False: {"shear": 1.25e-6, "cable": 1.25e-6}, True: {"shear": 1e-5}}
STEP_SCHEMES = {
    False: tuple(
        Scheme(element, "full", integrator, solvers, (), steps)
        for element, peers in (("cable", ("exudyn-cable",)), ("shear", ()))
        for integrator, solvers, steps in (
            ("generalized-alpha", (*OURS, *peers), lambda mesh: (1e-2, 5e-3, 2.5e-3, 1.25e-3, 6.25e-4)),
            ("zhai", OURS, lambda mesh: (2e-5, 1e-5, 5e-6)),
        )
    ),
    True: (Scheme("shear", "full", "generalized-alpha", OURS, (), lambda mesh: (5e-3, 2.5e-3, 1.25e-3)),),
}


def trials(options: Options) -> list[Trial]:
    """Runs of all kinds that the study needs."""
    base, plan = four_bar(), _plan(options)
    return [*with_references(base, plan, cases_of(base, plan, options)), *contest(base, options).values()]


def _plan(options: Options) -> Plan:
    return quick_plan(QUICK, FULL, options) if options.quick else FULL


def run(options: Options, runner: Runner) -> Result:
    """Run the study."""
    base, plan = four_bar(), _plan(options)
    runner.prepare(trials(options))
    swept = sweep(base, plan, options, runner)
    paper = paper_table(base, swept.references, options, runner)
    timed = step_sweep(
        base, STEP_MESH, STEP_FINE[options.quick], STEP_SCHEMES[options.quick], options, runner
    )
    frame = swept.frame
    notes = (
        "The element kinds are two models with own limits: each is measured against its own reference.",
        REISSNER,
    )
    found = [tables.accuracy(swept.rows, notes), tables.cpu_time(swept.rows)]
    found += [step_rates(timed)] if timed.outcomes else []
    found += [table for table in (half_turn(base, options, runner), paper) if table]
    return Result(
        name="four-bar",
        title="The four-bar of the paper",
        question="Crank, soft coupler and follower: what does each solver's accuracy cost, and does the "
        "transfer matrix method gain what the paper says?",
        findings=tuple(findings(frame, paper)),
        assumptions=(*base.assumptions, f"Data: {base.source}."),
        tables=(*found, samples(swept.outcomes)),
        pictures=tuple(pictures(swept, frame, timed)),
        films=films(swept),
        answers=tuple(_paper_answer(paper)),
        left_out=LEFT_OUT if options.quick else "",
    )


def films(swept: Sweep) -> tuple[Film, ...]:
    """The motion, and behind it that of the paper's element on its mesh."""
    caption = (
        "Soft coupler, follower and a crank that turns once in 2 s; behind, the paper's second-order elements on its "
        "mesh, by the error that the tables give them."
    )
    reference = swept.references.get("cable") or next(iter(swept.references.values()), None)
    coarse = swept.solution(element="shear", mesh=STEP_MESH)
    layers = {f"reference: {reference.name}": reference.solution} if reference else {}
    layers |= {f"{mesh_label(STEP_MESH)} shear": coarse}
    found = film("The four-bar", caption, {k: s for k, s in layers.items() if s is not None})
    return (found,) if found else ()


def _paper_answer(paper: Table | None) -> list[str]:
    """What is left of the published gain."""
    if paper is None:
        return []
    by = {line["method"]: line for line in paper.frame.to_dict("records")}
    dense, best, ours = (by.get(m) for m in (BASELINE, "ordinary ANCF, at its best", "ANC-TMM, explicit"))
    if not (dense and best and ours) or not ours["ratio_per_step"] > 0:
        return []
    gain, rest = ours["ratio_per_step"], ours["ratio_per_step"] / best["ratio_per_step"]
    return [
        f"An explicit ANC–TMM step takes {tables.times(gain)} times less time than ordinary ANCF with a dense "
        f"matrix solved anew (published: {ours['published_ratio']:.2g}), but "
        f"{tables.times(rest)} times less than ordinary ANCF whose sparse matrix is "
        "factored once: the method is a fast way to solve the same equations, not another answer."
    ]


def findings(frame: pd.DataFrame, paper: Table | None) -> list[str]:
    """Sentences from the tables."""
    said = []
    for element in ("shear", "cable"):
        mine = frame[
            (frame["element"] == element) & (frame["quadrature"].isin(["full", "-"])) & (frame["error"] > 0)
        ]
        if mine.empty:
            continue
        finest = mine.sort_values("dt").drop_duplicates("elements").sort_values("all_elements")
        errors = ", ".join(f"{e} → {v:.2g}" for e, v in zip(finest["elements"], finest["error"], strict=True))
        said.append(
            f"{element.capitalize()} elements, error at the smallest step by mesh: {errors} "
            f"(reference known to {mine['reference_error'].max():.1g})."
        )
    if failures := len(tables.failed(frame)):
        said.append(f"{failures} of {len(frame)} runs did not end well; their rows say why.")
    return said + (_paper_findings(paper.frame) if paper else [])


def _paper_findings(frame: pd.DataFrame) -> list[str]:
    said = []
    lines: dict[str, Any] = {line["method"]: line for line in frame.to_dict("records")}
    for method, text in GAINS.items():
        line = lines.get(method)
        if line and line["ratio_per_step"] > 0:
            said.append(text.format(line["us_per_step"], line["ratio_per_step"]))
    return said


def pictures(swept: Sweep, frame: pd.DataFrame, timed: Sweep) -> list[Picture]:
    """What moved, and how wrong it was at what cost."""
    drawn: list[Picture] = []
    curves = _curves(swept)
    if curves:
        drawn += [mechanism_pictures.joint(curves), mechanism_pictures.deflection(curves)]
    if whole := [s for s in curves.values() if s.status.ok]:
        drawn.insert(0, mechanism_pictures.crank_angle(whole[-1]))
        caption = "Configurations of the mechanism (Fig. 8 of the paper); triangles: ground pivots."
        drawn.append(configurations(whole[-1], "configurations", SNAPSHOTS, caption))
    steps = timed.frame if timed.outcomes else None
    drawn += error_pictures.of_sweep(frame, steps, mesh_label(STEP_MESH))
    return drawn


def _curves(swept: Sweep) -> Mapping[str, Solution]:
    """One solver's meshes of the shear element (or of what there is), then the reference."""
    moved = [o for o in swept.outcomes if len(o.solution.t) > 1]
    cases = [o.case for o in sorted(moved, key=lambda o: not o.solution.status.ok)]  # whole ones first
    if not cases:
        return {}
    element = "shear" if any(c.element == "shear" for c in cases) else cases[0].element
    mine = [c for c in cases if c.element == element]
    curves = {}
    for mesh in dict.fromkeys(c.mesh for c in mine):
        solver = next(c.solver for c in mine if c.mesh == mesh)
        solution = swept.history(element=element, mesh=mesh, solver=solver)
        assert solution is not None
        curves[f"{solver}, {mesh_label(mesh)} {element}"] = solution
    reference = swept.references[element]
    return curves | ({f"reference: {reference.name}": reference.solution} if reference.solution else {})
