"""The cantilever: large deflections against exact solutions, and a fall under gravity."""

import pandas as pd

from anctmm.results.solution import Solution
from studies.cantilever import pictures as cantilever_pictures
from studies.cantilever.force_cost import force_cost
from studies.cantilever.shear_limits import WARNING, shear_limits
from studies.cantilever.statics import StaticScheme, StaticSweep, rates, static_cases, static_sweep
from studies.convergence.step_convergence import step_rates, step_sweep
from studies.engine import tables
from studies.engine.accuracy.dynamics import (
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
from studies.report import error_pictures
from studies.report.animation import Film, film
from studies.report.plots import Picture
from studies.scenes import TIP_FORCES, BaseScene, cantilever_end_moment, cantilever_fall, cantilever_tip_force

OURS = ("anctmm", "global-dae")
ALL = (*OURS, "exudyn-cable")
PEER_NOTE = (
    "exudyn-reissner and pyelastica are rods of Reissner's kind, with shear and with EA, GA, EI as the other elements "
    "have them: measured against Reissner's exact rod at rest, and Exudyn's finest when falling. PyElastica steps "
    "explicitly, in three dimensions, each step called from Python; its equilibria are relaxed motions. opensees: "
    "frames that follow their chords, of the cable's continuum; nonlinear beams at rest, linear ones when falling."
)
PICTURED = "cantilever-force-3"
SNAPSHOTS = (0.0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0)


def implicit_steps(mesh: Mesh) -> tuple[float, ...]:
    """Steps of the implicit runs, s."""
    return (2e-3, 1e-3, 5e-4)


def cable_steps(mesh: Mesh) -> tuple[float, ...]:
    """Explicit steps of the cable, s: bounded by the axial wave, so they halve with the elements."""
    largest = 5e-5 if max(mesh) <= 8 else 2.5e-5 if max(mesh) <= 16 else 1.25e-5
    return (largest, largest / 2, largest / 4)


def shear_steps(mesh: Mesh) -> tuple[float, ...]:
    """Explicit steps of the shear element, s: bounded by the thickness mode, whatever the mesh."""
    return (2e-6, 1e-6, 5e-7)


def peer_steps(mesh: Mesh) -> tuple[float, ...]:
    """Steps of PyElastica, s: bounded by its sections' inertia, whatever the mesh."""
    return (5e-6, 2.5e-6)


CABLE_MESHES: tuple[Mesh, ...] = ((8,), (16,), (32,))
#: The shear element needs many more elements for this thin beam: second order only.
SHEAR_MESHES: tuple[Mesh, ...] = ((16,), (32,), (64,))
#: Statics; the cable is at rounding where the shear element begins to converge.
CABLE_REST: tuple[Mesh, ...] = ((4,), (8,), (16,), (32,), (64,), (128,))
SHEAR_REST: tuple[Mesh, ...] = ((16,), (32,), (64,), (128,), (256,))
#: Rods of Reissner's kind; PyElastica's relaxation of so thin a beam takes a hundred thousand steps on the coarsest.
REISSNER_REST: tuple[Mesh, ...] = ((4,), (8,), (16,), (32,))
PEERS = ("exudyn-reissner", "pyelastica")
#: Frames that follow their chords, of the cable's continuum; of second order in motion.
FRAMES = ("opensees",)
FRAME_MESHES: tuple[Mesh, ...] = ((32,), (64,), (128,))
STATIC_SCHEMES = (
    StaticScheme("cable", "full", ALL, CABLE_REST),
    StaticScheme("cable", "reduced", ALL, CABLE_REST),
    StaticScheme("cable", "lobatto", ALL, CABLE_REST),
    StaticScheme("cable", "full", FRAMES, CABLE_REST),
    StaticScheme("shear", "full", OURS, SHEAR_REST),
    StaticScheme("shear", "full", PEERS, REISSNER_REST),
)
QUICK_STATIC_SCHEMES = (
    StaticScheme("cable", "full", ALL, CABLE_REST[:4]),
    StaticScheme("cable", "full", FRAMES, CABLE_REST[:2]),
    StaticScheme("shear", "full", OURS, SHEAR_REST[:4]),
    StaticScheme("shear", "full", PEERS[:1], REISSNER_REST[:2]),
)
#: In a quick run that names its solver: each equilibrium is relaxed for seconds, and compiling PyElastica takes
#: longer than compiling all others of the study.
QUICK_RELAXED = StaticScheme("shear", "full", PEERS[1:], REISSNER_REST[:2])
LEFT_OUT = (
    "three of the five loads, PyElastica, reduced and Lobatto quadrature, and falls by OpenSees, by explicit steps of "
    "others and by shear elements of others."
)
FULL = Plan(
    schemes=(
        Scheme("cable", "full", "zhai", ALL, CABLE_MESHES, cable_steps),
        Scheme(
            "cable", "full", "generalized-alpha", (*ALL, "global-dae-dense"), CABLE_MESHES, implicit_steps
        ),
        Scheme("cable", "reduced", "generalized-alpha", ALL, CABLE_MESHES, implicit_steps),
        Scheme("cable", "full", "generalized-alpha", FRAMES, FRAME_MESHES, implicit_steps),
        Scheme("shear", "full", "zhai", OURS, SHEAR_MESHES, shear_steps),
        Scheme(
            "shear",
            "full",
            "generalized-alpha",
            (*OURS, "global-dae-dense", "exudyn-reissner"),
            SHEAR_MESHES,
            implicit_steps,
        ),
        Scheme("shear", "full", "zhai", ("pyelastica",), CABLE_MESHES, peer_steps),
    ),
    references={
        "cable": Fine(("exudyn-cable", "global-dae", "anctmm"), (128,), (64,), 2e-6, 4e-6),
        "shear": Fine(("global-dae", "anctmm"), (512,), (256,), 1.25e-4, 2.5e-4, "generalized-alpha"),
        "reissner": Fine(("exudyn-reissner",), (128,), (64,), 1.25e-4, 2.5e-4, "generalized-alpha"),
    },
)
QUICK = Plan(
    schemes=(
        Scheme("cable", "full", "zhai", ("anctmm",), CABLE_MESHES[:2], lambda mesh: (2e-5,)),
        Scheme("cable", "full", "generalized-alpha", ALL, CABLE_MESHES[:2], lambda mesh: (2e-3, 1e-3)),
        Scheme(
            "shear", "full", "generalized-alpha", ("anctmm",), SHEAR_MESHES[:2], lambda mesh: (2e-3, 1e-3)
        ),
    ),
    references={
        "cable": Fine(("anctmm",), (64,), (32,), 2.5e-4, 5e-4, "generalized-alpha"),
        "shear": Fine(("anctmm",), (256,), (128,), 5e-4, 1e-3, "generalized-alpha"),
    },
)

#: The step's error alone is shown on one mesh; by whether the run is quick.
STEP_MESH: Mesh = (16,)
STEP_FINE = {False: {"cable": 1.25e-6, "shear": 1e-6}, True: {"cable": 1e-5}}
STEP_SCHEMES = {
    False: (
        Scheme(
            "cable", "full", "generalized-alpha", ALL, (), lambda mesh: (1e-2, 5e-3, 2.5e-3, 1.25e-3, 6.25e-4)
        ),
        Scheme("cable", "full", "zhai", ALL, (), lambda mesh: (2e-5, 1e-5, 5e-6)),
        Scheme(
            "shear",
            "full",
            "generalized-alpha",
            OURS,
            (),
            lambda mesh: (1e-2, 5e-3, 2.5e-3, 1.25e-3, 6.25e-4),
        ),
    ),
    True: (Scheme("cable", "full", "generalized-alpha", ALL, (), lambda mesh: (5e-3, 2.5e-3, 1.25e-3)),),
}


def trials(options: Options) -> list[Trial]:
    """Runs of all kinds that the study needs; those of its slowest solver last."""
    base, plan = cantilever_fall(), _plan(options)
    falls = with_references(base, plan, cases_of(base, plan, options))
    return [*falls, *static_cases(cantilever_tip_force(TIP_FORCES[2]), _static_schemes(options), options)]


def _static_schemes(options: Options) -> tuple[StaticScheme, ...]:
    if not options.quick:
        return STATIC_SCHEMES
    return QUICK_STATIC_SCHEMES if options.solvers is None else (*QUICK_STATIC_SCHEMES, QUICK_RELAXED)


def _plan(options: Options) -> Plan:
    return quick_plan(QUICK, FULL, options) if options.quick else FULL


def run(options: Options, runner: Runner) -> Result:
    """Run the study; equilibria have no integrator, and stand beside the falls of any."""
    fall_base, plan = cantilever_fall(), _plan(options)
    runner.prepare(trials(options))  # refuses what it does not know, before any work
    bases = [cantilever_tip_force(load) for load in TIP_FORCES] + [cantilever_end_moment()]
    loaded = [bases[2], bases[4]] if options.quick else bases
    rest = static_sweep(loaded, _static_schemes(options), options, runner)
    fallen = sweep(fall_base, plan, options, runner)
    timed = step_sweep(
        fall_base, STEP_MESH, STEP_FINE[options.quick], STEP_SCHEMES[options.quick], options, runner
    )
    orders = rates(rest.frame)
    of_shear = (
        [shear_limits(options, runner), force_cost(runner, 5)] if options.element in (None, "shear") else []
    )
    rows = rest.rows + fallen.rows
    static_note = "Static rows: one load case each, |u − u_exact| / |u_exact|, the largest over the probes."
    return Result(
        name="cantilever",
        title="The cantilever",
        question="Do the elements tend to what theory says, how fast, and what does a fall cost?",
        findings=tuple(findings(rest.frame, orders.frame, fallen.frame, *(t.frame for t in of_shear))),
        assumptions=tuple(dict.fromkeys(a for b in (*bases, fall_base) for a in b.assumptions)),
        tables=(
            tables.accuracy(rows, (static_note, WARNING, PEER_NOTE)), tables.cpu_time(rows, (WARNING,)), orders,
            *of_shear, *([step_rates(timed)] if timed.outcomes else ()),
            samples(rest.outcomes + fallen.outcomes),
        ),
        pictures=tuple(pictures(bases, rest, fallen, timed)),
        films=films(fallen),
        left_out=LEFT_OUT if options.quick and options.solvers is None else "",
    )  # fmt: skip


def films(fallen: Sweep) -> tuple[Film, ...]:
    """The fall, and behind it that of the coarsest mesh."""
    caption = "A soft beam, clamped on the left, released straight and at rest. Behind: the coarsest mesh of the sweep."
    reference = fallen.references.get("cable") or next(iter(fallen.references.values()), None)
    coarse = {o.case.mesh for o in fallen.outcomes if o.case.element == "shear" and o.solution.status.ok}
    layers = {f"reference: {reference.name}": reference.solution} if reference else {}
    if coarse:
        mesh = min(coarse)
        layers[f"{mesh_label(mesh)} shear"] = fallen.solution(element="shear", mesh=mesh)
    found = film("The falling cantilever", caption, {k: s for k, s in layers.items() if s is not None})
    return (found,) if found else ()


def findings(
    rest: pd.DataFrame, orders: pd.DataFrame, fallen: pd.DataFrame,
    limits: pd.DataFrame | None = None, cost: pd.DataFrame | None = None,
) -> list[str]:  # fmt: skip
    """Sentences from the tables."""
    said = []
    for element in ("cable", "shear"):
        mine = orders[(orders["element"] == element) & orders["order"].notna()]
        errors = rest[(rest["element"] == element) & (rest["error"] > 0)].sort_values("error")
        if len(mine):
            said.append(
                f"At rest, {element} elements tend to their continuum with {_orders(mine)}; "
                f"smallest error {errors['error'].iloc[0]:.1e} with {errors['elements'].iloc[0]} elements."
            )
    said += _of_limits(limits) if limits is not None else []
    said += _of_cost(cost) if cost is not None else []
    if failures := len(tables.failed(fallen)):
        said.append(f"{failures} of {len(fallen)} falls did not end well; their rows say why.")
    return said


def _orders(lines: pd.DataFrame) -> str:
    """Ranges of observed orders, by quadrature where there are several."""
    ranges = lines.groupby("quadrature", sort=False)["order"].agg(["min", "max"])
    texts = [
        f"{least:.2f}{f' to {most:.2f}' if f'{least:.2f}' != f'{most:.2f}' else ''}"
        + (f" ({rule} quadrature)" if len(ranges) > 1 else "")
        for rule, least, most in ranges.itertuples()
    ]
    return f"orders {', '.join(texts)}"


def _of_limits(limits: pd.DataFrame) -> list[str]:
    """What the shear element tends to."""
    said = []
    for case, lines in limits[limits["measured"] > 0].groupby("case", sort=False):
        last = lines.iloc[-1]
        said.append(
            f"Shear element, {case}: tip over {last['tip_over']} is {last['measured']:.4f} "
            f"with {last['elements']} elements; theory ({last['theory']}) says {last['predicted']:.4f}."
        )
    return [*said, WARNING]


def _of_cost(cost: pd.DataFrame) -> list[str]:
    """What the shear element's forces cost."""
    ns = {
        line["evaluation"]: line["ns_per_element"]
        for line in cost.to_dict("records")
        if line["form"] == "compiled"
    }
    return [
        f"The paper's invariant matrices take {ns['invariant matrices']:.3g} ns an element force, "
        f"the quadrature {ns['quadrature, 5 points']:.3g} ns."
    ]


def pictures(bases: list[BaseScene], rest: StaticSweep, fallen: Sweep, timed: Sweep) -> list[Picture]:
    """Shapes, convergence and cost."""
    drawn = []
    if pairs := _rest_pairs(bases, rest):
        drawn.append(cantilever_pictures.rest_shapes(pairs))
    if (rest.frame["error"] > 0).any():
        drawn.append(_static_convergence(rest.frame))
    element, reference = next(
        ((e, r.solution) for e, r in fallen.references.items() if r.solution), ("", None)
    )
    if reference is not None:
        drawn.append(cantilever_pictures.fall(reference, SNAPSHOTS))
        curves = _curves(fallen, element)
        drawn += [cantilever_pictures.tip_errors(curves, reference)] if curves else []
    steps = timed.frame if timed.outcomes else None
    drawn += error_pictures.of_sweep(fallen.frame, steps, mesh_label(STEP_MESH))
    return drawn


def _static_convergence(frame: pd.DataFrame) -> Picture:
    caption = (
        f"Static convergence to the exact continuum of each element ({PICTURED}): extensible elastica for the cable, "
        "director continuum of Green strains for the shear element, which needs many elements for so thin a beam, "
        "Reissner's rod for the peers of its kind."
    )
    return error_pictures.over_mesh(frame[frame["scene"] == PICTURED], "static_convergence", caption)


def _rest_pairs(bases: list[BaseScene], rest: StaticSweep) -> list[tuple[str, Solution, Solution | None]]:
    pairs: list[tuple[str, Solution, Solution | None]] = []
    for base in bases:
        mine = [
            (o, r) for o, r in zip(rest.outcomes, rest.references, strict=True)
            if o.case.scene == base.scene and o.case.element == "cable" and o.solution.status.ok
        ]  # fmt: skip
        if mine:
            outcome, reference = max(mine, key=lambda pair: pair[0].case.mesh)
            assert reference.solution is not None
            pairs.append(
                (base.assumptions[-1].rstrip(".").split(", ")[-1], reference.solution, outcome.solution)
            )
    return pairs


def _curves(fallen: Sweep, element: str) -> dict[str, Solution]:
    found = [o for o in fallen.outcomes if o.case.element == element and len(o.solution.t) > 1]
    curves = {}
    for mesh in dict.fromkeys(o.case.mesh for o in found):
        # whole runs first; of those the smallest step
        mine = [o for o in found if o.case.mesh == mesh]
        case, solution = min(
            ((o.case, o.solution) for o in mine), key=lambda pair: (not pair[1].status.ok, pair[0].dt)
        )
        curves[f"{case.solver}, {mesh_label(mesh)} {element}, dt = {case.dt:g} s"] = solution
    return curves
