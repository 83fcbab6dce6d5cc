"""Ratios to Exudyn at like settings, and to a global solver by method: the same elements, mesh and step."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.jit.compiling import kernel
from anctmm.recursion.split import split_factors
from anctmm.results.metrics import compare
from anctmm.results.solution import Solution
from anctmm.solve import solve
from reference import exudyn_cable, global_dae
from reference.global_dae import explicit as dae_explicit
from reference.global_dae.model import Model
from studies.benchmark.kernels import parts, repeat_element_forces, repeat_forces, repeat_scalars
from studies.engine.measuring.clock import (
    Effort,
    Sampler,
    Samples,
    between,
    figures,
    marched,
    more_than_noise,
    ratio,
    repeated,
    sampled_in_turn,
)
from studies.engine.measuring.setting import explicit_run, stable_step
from studies.engine.running.trial import Mesh, mesh_label
from studies.engine.tables import Table
from studies.scenes import BaseScene, cantilever_fall, four_bar

Array = NDArray[np.float64]

QUADRATURE = "reduced"
CANTILEVER_SIZES = (8, 32, 128)
IMPLICIT_DT = 1e-3
#: Newton's tolerance of ANC-TMM at like settings: of positions relative to the length, of gradients absolute.
NEWTON_TOLERANCE = 1e-7
FOUR_BARS: tuple[Mesh, ...] = ((2, 8, 2), (8, 32, 8))
SUMMED, ELEMENTS = "elastic forces, summed", "element forces"
OURS, EXUDYN, DENSE, SPARSE = "anctmm", "exudyn-cable", "dense-refactor", "sparse-factored-once"


def mesh_of(base: BaseScene, mesh: Mesh) -> Any:
    """A mesh as discretisations take it."""
    names = [body.name for body in base.scene.beams]
    return mesh[0] if len(mesh) == 1 else dict(zip(names, mesh, strict=True))


# --- Exudyn -------------------------------------------------------------------------------------------------


def exudyn_at_like_settings(effort: Effort, samples: Samples) -> Table:
    """The same cables, mesh, quadrature and steps by ANC-TMM and by Exudyn."""
    fall, bar = cantilever_fall(), four_bar()
    rows = [_explicit_row(fall, n, effort, samples) for n in CANTILEVER_SIZES]
    rows += [_implicit_row(fall, (n,), effort, samples) for n in CANTILEVER_SIZES]
    rows += [_implicit_row(bar, mesh, effort, samples) for mesh in FOUR_BARS]
    notes = (
        "ns: CPU time of an element and step (explicit: one force evaluation a step in both codes), median of "
        "runs in turn; ratio: Exudyn's over ANC-TMM's, median over the rounds.",
        f"Both codes with cables, quadrature {QUADRATURE!r}; explicit: Zhai with ψ = φ = ½ is Exudyn's "
        f"VelocityVerlet; implicit: generalized-α, spectral radius 0.9, steps of {IMPLICIT_DT:g} s. Exudyn: fast "
        "module, one thread, modified Newton, the faster of its dense and sparse solvers, no files; tolerances "
        "1e-7 relative, 1e-9 N or what rounding leaves.",
        "difference: of the two histories, relative as errors are; they solve the same equations.",
    )
    return Table("exudyn", "Beside Exudyn, at like settings", pd.DataFrame(rows), notes)


def _explicit_row(base: BaseScene, n: int, effort: Effort, samples: Samples) -> dict[str, Any]:
    options = {"element": "cable", "quadrature": QUADRATURE}
    dt = stable_step(base.scene, n, options)
    run = explicit_run(base.scene, n, round(effort.steps * 4e5 / n), dt, **options)
    return _race(base, (n,), run, effort, samples)


def _implicit_row(base: BaseScene, mesh: Mesh, effort: Effort, samples: Samples) -> dict[str, Any]:
    t_end = 0.2 if effort.quick else 1.0
    run = Discretisation(
        mesh=mesh_of(base, mesh), element="cable", quadrature=QUADRATURE, dt=IMPLICIT_DT, t_end=t_end,
        output_dt=base.interval, newton_tolerance=NEWTON_TOLERANCE,
    )  # fmt: skip
    return _race(base, mesh, run, effort, samples)


def _race(
    base: BaseScene, mesh: Mesh, run: Discretisation, effort: Effort, samples: Samples
) -> dict[str, Any]:
    elements = sum(mesh) if len(mesh) > 1 else mesh[0] * len(base.scene.beams)
    runs: dict[str, list[Solution]] = {OURS: [], EXUDYN: []}
    samplers = {
        OURS: marched(lambda: solve(base.scene, run), elements, runs[OURS]),
        EXUDYN: marched(lambda: exudyn_cable.solve(base.scene, run), elements, runs[EXUDYN]),
    }
    part = f"exudyn, {base.scene.name}, {run.integrator}, {mesh_label(mesh)}"
    found = sampled_in_turn(part, samplers, effort.rounds, samples)
    mine, theirs = runs[OURS][0], runs[EXUDYN][0]
    ours, peer = figures(found[OURS]), figures(found[EXUDYN])
    implicit = not run.explicit
    return {
        "scene": base.scene.name,
        "integrator": run.integrator,
        "elements": mesh_label(mesh),
        "dt": run.dt,
        "steps": mine.cost.steps,
        "ns_anctmm": ours["ns"],
        "spread_anctmm": ours["spread"],
        "ns_exudyn": peer["ns"],
        "spread_exudyn": peer["spread"],
        "repeats": ours["repeats"],
        "ratio": ratio(found[EXUDYN], found[OURS]),
        "newton_anctmm": mine.cost.newton_iterations / mine.cost.steps if implicit else np.nan,
        "newton_exudyn": theirs.cost.newton_iterations / max(theirs.cost.steps, 1) if implicit else np.nan,
        "difference": compare(theirs, mine, base.probes).error,
        "status": _both(mine, theirs),
    }


def _both(*solutions: Solution) -> str:
    """What went wrong with whom, or that nothing did."""
    bad = [f"{s.solver} {s.status}" for s in solutions if not s.status.ok]
    return "; ".join(bad) if bad else "ok"


# --- the global solver ----------------------------------------------------------------------------------------


def methods(effort: Effort, samples: Samples) -> Table:
    """Explicit four-bar by ANC-TMM and by the equations with multipliers, and where each one's time goes."""
    rows = []
    for mesh in FOUR_BARS:
        rows += _method_rows(four_bar(), mesh, effort, samples)
    notes = (
        "The same shear elements, force kernels, integrator and step; ns_step: CPU time of one step of the whole "
        "mechanism, median of runs in turn, by the difference of a run and one three times as long, so that start-up "
        "is left out; ratio: over ANC-TMM's, median over the rounds.",
        "ns_forces: elastic forces, by the kernels that all three share (ANC-TMM's sweep reads them element by "
        "element, the global solver has them summed first); ns_algebra: accelerations (and multipliers) "
        "from forces, of ANC-TMM both sweeps; ns_rest: update, drive, projection onto the constraints and what else "
        "a step does. Both parts were timed alone, the rest is the difference, none where "
        "it is lost in noise.",
        "ratio_algebra: ns_algebra over ANC-TMM's. dense-refactor over sparse-factored-once is what exploiting "
        "sparsity and a constant matrix gains in any solver; sparse-factored-once over ANC-TMM is what is left for "
        "the recursion.",
        "difference: of the histories, relative as errors are.",
    )
    return Table("methods", "Beside the global solver: where the time goes", pd.DataFrame(rows), notes)


def _method_rows(base: BaseScene, mesh: Mesh, effort: Effort, samples: Samples) -> list[dict[str, Any]]:
    options = {"element": "shear"}
    dt = stable_step(base.scene, mesh_of(base, mesh), options)
    base_steps = {OURS: 8000, SPARSE: 4000, DENSE: 100}  # that take some 10 ms at 2/8/2
    steps = {m: max(10, round(effort.steps * s * 12 / sum(mesh))) for m, s in base_steps.items()}

    def run(method: str, count: int) -> Solution:
        stretch = explicit_run(base.scene, mesh_of(base, mesh), count, dt, **options)
        if method == OURS:
            return solve(base.scene, stretch)
        return global_dae.solve(base.scene, stretch, linear_algebra=method)

    runs: dict[str, list[Solution]] = {m: [] for m in steps}
    samplers = {m: between(partial(run, m), s, 1, runs[m]) for m, s in steps.items()}
    one = explicit_run(base.scene, mesh_of(base, mesh), 1, dt, **options)
    samplers |= _part_samplers(base, one, effort)
    found = sampled_in_turn(f"methods, {mesh_label(mesh)}", samplers, effort.rounds, samples)
    histories = {m: run(m, 2000 if m != DENSE else 20) for m in steps}
    short = run(OURS, 20)
    errors = {
        m: compare(h, short if m == DENSE else histories[OURS], base.probes).error
        for m, h in histories.items()
    }
    return [_method_row(m, mesh, dt, found, runs[m][1], errors[m]) for m in steps]


def _method_row(
    method: str, mesh: Mesh, dt: float, found: dict[str, list[float]], solution: Solution, error: float
) -> dict[str, Any]:
    median = {name: figures(values)["ns"] for name, values in found.items()}
    step = figures(found[method])
    # forces and sweeps of ANC-TMM are one pass
    recursion = more_than_noise(median[f"{OURS} algebra"] - median[ELEMENTS])
    forces, algebra = (
        (median[ELEMENTS], recursion) if method == OURS else (median[SUMMED], median[f"{method} algebra"])
    )
    return {
        "method": method,
        "elements": mesh_label(mesh),
        "dt": dt,
        "steps": solution.cost.steps,
        "ns_step": step["ns"],
        "spread": step["spread"],
        "repeats": step["repeats"],
        "ratio": ratio(found[method], found[OURS]),
        "ns_forces": forces,
        "ns_algebra": algebra,
        "ns_rest": more_than_noise(step["ns"] - forces - algebra),
        "share_forces": forces / step["ns"],
        "ratio_algebra": algebra / recursion,
        "difference": error,
        "status": str(solution.status),
    }


def _part_samplers(base: BaseScene, run: Discretisation, effort: Effort) -> dict[str, Sampler]:
    """Samplers of the elastic forces, and of each method's way from forces to accelerations (ours with the forces)."""
    chain = Chain(base.scene, run)
    p, work = parts(chain, chain.bodies.reference()), np.zeros_like(chain.bodies.reference())
    factors = split_factors(chain)
    samplers = {
        SUMMED: repeated(lambda k: repeat_forces(k, p.q, p.tables, work), 1, effort.stretch),
        ELEMENTS: repeated(lambda k: repeat_element_forces(k, p.q, p.tables), 1, effort.stretch),
        f"{OURS} algebra": repeated(lambda k: repeat_scalars(k, p, factors), 1, effort.stretch),
    }
    for method in (SPARSE, DENSE):
        solver = dae_explicit.Zhai(Model.of(base.scene, run), method == DENSE, True)
        solver.prepare()
        samplers[f"{method} algebra"] = repeated(_solves(solver), 1, effort.stretch)
    return samplers


def _solves(solver: dae_explicit.Zhai) -> Callable[[int], object]:
    s = solver.state
    return lambda k: repeat_solve(k, solver.factors, solver.constant, s.right, s.left, s.scratch, s.dense)


@kernel
def repeat_solve(
    repeats: int,
    factors: dae_explicit.Factors,
    constant: dae_explicit.Constant,
    right: Array,
    left: Array,
    scratch: Array,
    dense: Array,
) -> None:
    """Accelerations and multipliers of the global solver from forces."""
    for _ in range(repeats):
        dae_explicit.solve(factors, constant, right, left, scratch, dense)
