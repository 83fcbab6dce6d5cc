"""What each kernel costs: nanoseconds of an element and call, and of whole steps."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables, block_tangents, elastic_forces
from anctmm.discretise.chain import Chain
from anctmm.discretise.methods import GeneralizedAlpha
from anctmm.elements.dispatch import element_forces
from anctmm.elements.force_blocks import BLOCK
from anctmm.elements.tangent_blocks import TANGENT_BLOCK, TANGENT_BUFFER
from anctmm.forces.actuation import DrivenClamps, actuation_of
from anctmm.forces.loads import Loads
from anctmm.integrators import zhai as explicit
from anctmm.jit.compiling import kernel
from anctmm.model.scene import Scene
from anctmm.recursion import accelerations, riccati
from anctmm.recursion.riccati import BlockFactors, Links
from anctmm.recursion.split import SplitFactors, split_factors
from anctmm.results.solution import Solution
from anctmm.solve import solve
from studies.engine.measuring.clock import (
    Effort,
    Sampler,
    Samples,
    figures,
    marched,
    repeated,
    sampled_in_turn,
)
from studies.engine.measuring.setting import (
    SHEAR,
    VARIANTS,
    Variant,
    bent_arc,
    explicit_run,
    implicit_run,
    row_of_beams,
    stable_step,
)
from studies.engine.tables import Table

Array = NDArray[np.float64]

SIZES = (8, 32, 128, 1024)
#: Step of the implicit runs, s.
IMPLICIT_DT = 1e-3
ELEMENT_FORCES, FORCES = "element forces", "elastic forces, summed"
TANGENTS, SPLIT_SWEEP = "tangents", "sweeps, split"
BLOCK_SWEEP, FACTORIZATION, UPDATE = "sweeps, blocks", "tangents and factorization", "update"
ACCELERATIONS, EXPLICIT, IMPLICIT = "accelerations", "explicit step", "implicit step"


class Parts(NamedTuple):
    """A chain in a bent state, as kernels take it: coordinates, external forces, accelerations, and the rest."""

    q: Array
    f: Array
    a: Array
    tables: Tables
    clamps: DrivenClamps
    loads: Loads
    links: Links


def parts(chain: Chain, q: Array) -> Parts:
    """Arrays of a chain at coordinates q, (rows, nodes)."""
    actuation = actuation_of(chain)
    return Parts(
        q,
        chain.dead_load,
        np.zeros_like(q),
        chain.bodies.tables(),
        actuation.clamps(),
        actuation.loads(),
        riccati.links(chain),
    )


def accelerations_of(chain: Chain, q: Array, split: bool) -> Array:
    """Accelerations of a chain at coordinates q under its dead load, in either form of the recursion, (rows, nodes)."""
    p = parts(chain, q)
    if split:
        repeat_scalars(1, p, split_factors(chain))
    else:
        accelerations.by_blocks(
            q, p.f, p.tables, p.clamps, riccati.mass_factors(chain), np.zeros_like(q), p.a
        )
    return p.a


@kernel
def repeat_element_forces(repeats: int, q: Array, t: Tables) -> None:
    """Forces of all elements, a block at a time, not yet summed at the nodes."""
    first, formulations, kinds, constants, _, buffer = t
    for _ in range(repeats):
        for b in range(len(kinds)):
            elements = first[b + 1] - 1 - first[b]
            for start in range(0, elements, BLOCK):
                count = min(BLOCK, elements - start)
                element_forces(formulations, kinds[b], q, first[b] + start, count, constants[b], buffer)


@kernel
def repeat_forces(repeats: int, q: Array, t: Tables, f: Array) -> None:
    """Elastic forces of all nodes."""
    first, formulations, kinds, constants, _, buffer = t
    for _ in range(repeats):
        elastic_forces(formulations, q, first, kinds, constants, buffer, f)


@kernel
def repeat_tangents(repeats: int, q: Array, t: Tables, buffer: Array) -> None:
    """Tangents of all elements, a block at a time."""
    first, formulations, kinds, constants, _, _ = t
    for _ in range(repeats):
        for b in range(len(kinds)):
            elements = first[b + 1] - 1 - first[b]
            for start in range(0, elements, TANGENT_BLOCK):
                count = min(TANGENT_BLOCK, elements - start)
                block_tangents(formulations, q, first[b] + start, count, kinds[b], constants[b], buffer)


@kernel
def repeat_scalars(repeats: int, p: Parts, factors: SplitFactors) -> None:
    """Elastic forces, forward and backward sweep of the split form."""
    for _ in range(repeats):
        accelerations.by_scalars(p.tables, p.clamps, factors, p.q, p.f, p.a)


@kernel
def repeat_sweeps(repeats: int, factors: BlockFactors, load: Array, x: Array) -> None:
    """Forward and backward sweep of blocks; a load of zeros stays zero, and costs what any load does."""
    for _ in range(repeats):
        riccati.sweep(factors, load, x)


@kernel
def repeat_factorization(repeats: int, mass: float, p: Parts, values: Array, factors: BlockFactors) -> None:
    """Tangents and factorization of mass · M + K_T."""
    for _ in range(repeats):
        riccati.factorize(p.q, p.tables, p.links, mass, 1.0, p.loads, values, factors)


@kernel
def repeat_update(
    repeats: int, q: Array, v: Array, a: Array, before: Array, numbers: explicit.Numbers
) -> None:
    """Zhai's update of all components."""
    for _ in range(repeats):
        explicit.update(q, v, a, before, numbers)


def compile_solvers() -> None:
    """Run both integrators with both elements, a few steps."""
    scene = row_of_beams(1, 2)
    for variant in VARIANTS[:2]:
        solve(scene, explicit_run(scene, 2, 2, 1e-6, **variant.options()))
        solve(scene, implicit_run(scene, 2, 2, 1e-6, **variant.options()))


def kernel_costs(effort: Effort, samples: Samples) -> Table:
    """Time of every kernel and step, by element, quadrature and number of elements."""
    rows = []
    for n in SIZES[1:3] if effort.quick else SIZES:
        for variant in VARIANTS:
            rows += _rows(variant, n, effort, samples)
    notes = (
        "ns: CPU time of an element and call, median of samples in turn; spread: (largest − smallest) / median.",
        f"Steps are those of a clamped beam under gravity; implicit ones of {IMPLICIT_DT:g} s, whose Newton "
        "iterations and factorizations stand beside them. Kernels are timed on a bent arc.",
        f"{SPLIT_SWEEP}: by difference, accelerations less element forces, which are one pass. {FORCES}: into one "
        "array of all nodes, as the implicit solver and the global one have them.",
        f"{FACTORIZATION}, {BLOCK_SWEEP}: once a factorization and once an iteration of an implicit step.",
    )
    return Table("kernels", "Cost of the kernels, per element and call", pd.DataFrame(rows), notes)


def _rows(variant: Variant, n: int, effort: Effort, samples: Samples) -> list[dict[str, Any]]:
    runs: dict[str, list[Solution]] = {EXPLICIT: [], IMPLICIT: []}
    samplers = kernel_samplers(variant, n, effort) | step_samplers(variant, n, effort, runs)
    found = sampled_in_turn(f"kernels, {variant.label}, {n} elements", samplers, effort.rounds, samples)
    if ACCELERATIONS in found:
        pairs = zip(found[ACCELERATIONS], found[ELEMENT_FORCES], strict=True)
        found[SPLIT_SWEEP] = [a - f for a, f in pairs]
    about = {"element": variant.element, "quadrature": variant.quadrature, "elements": n}
    return [{"kernel": name, **about, **figures(v), **_counts(runs.get(name))} for name, v in found.items()]


def _counts(runs: list[Solution] | None) -> dict[str, Any]:
    if not runs:
        return {"newton_per_step": np.nan, "factorizations_per_step": np.nan, "status": "ok"}
    cost, implicit = runs[0].cost, runs[0].cost.newton_iterations > 0
    return {
        "newton_per_step": cost.newton_iterations / cost.steps if implicit else np.nan,
        "factorizations_per_step": cost.factorizations / cost.steps if implicit else np.nan,
        "status": str(runs[0].status),
    }


def kernel_samplers(variant: Variant, n: int, effort: Effort) -> dict[str, Sampler]:
    """Samplers of the kernels alone, on a bent arc of n elements."""
    scene = row_of_beams(1, n)
    chain = Chain(scene, implicit_run(scene, n, 1, IMPLICIT_DT, **variant.options()))
    q = bent_arc(n + 1, chain.bodies.rows)
    p, work, buffer = parts(chain, q), np.zeros_like(q), np.zeros(TANGENT_BUFFER)
    blocks = riccati.block_factors(chain)
    mass = GeneralizedAlpha(0.9).of_step(IMPLICIT_DT).to_w
    flat = [np.zeros(q.size) for _ in range(4)]
    calls: dict[str, Callable[[int], object]] = {
        ELEMENT_FORCES: lambda k: repeat_element_forces(k, q, p.tables),
        FORCES: lambda k: repeat_forces(k, q, p.tables, work),
        TANGENTS: lambda k: repeat_tangents(k, q, p.tables, buffer),
        FACTORIZATION: lambda k: repeat_factorization(k, mass, p, np.empty((0, 2)), blocks),
        BLOCK_SWEEP: lambda k: repeat_sweeps(k, blocks, np.zeros_like(q), work),
        ACCELERATIONS: partial(_scalars, p, split_factors(chain)),
        UPDATE: lambda k: repeat_update(k, *flat, explicit.Numbers(1, 1, 1e-3, 0.5, 0.5)),
    }
    if variant.quadrature not in ("-", "full"):  # the same for every quadrature
        del calls[UPDATE], calls[BLOCK_SWEEP]
    return {name: repeated(call, n, effort.stretch) for name, call in calls.items()}


def _scalars(p: Parts, factors: SplitFactors, repeats: int) -> None:
    repeat_scalars(repeats, p, factors)


def step_samplers(
    variant: Variant, n: int, effort: Effort, runs: dict[str, list[Solution]]
) -> dict[str, Sampler]:
    """Samplers of whole steps of a clamped beam under gravity."""
    scene: Scene = row_of_beams(1, n)
    options = variant.options()
    per_sample = 2e5 if variant is SHEAR else 4e5  # elements times steps: some 20 ms
    explicit_steps, implicit_steps = round(effort.steps * per_sample / n), round(200 * effort.steps)
    fast = explicit_run(scene, n, explicit_steps, stable_step(scene, n, options), **options)
    slow = implicit_run(scene, n, implicit_steps, IMPLICIT_DT, **options)
    return {
        EXPLICIT: marched(lambda: solve(scene, fast), n, runs[EXPLICIT]),
        IMPLICIT: marched(lambda: solve(scene, slow), n, runs[IMPLICIT]),
    }
