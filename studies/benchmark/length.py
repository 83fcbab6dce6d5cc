"""Cost and memory against length, up to two million coordinates, and what a direct solver finds there."""

import gc
import sys
import tracemalloc
from collections.abc import Callable, Sequence
from ctypes import CDLL
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from anctmm.discretise.assembly import elastic_forces
from anctmm.discretise.chain import Chain
from anctmm.forces.loads import no_loads
from anctmm.model.scene import Force, Scene
from anctmm.recursion import riccati
from anctmm.results.solution import Solution
from anctmm.solve import solve, solve_static
from studies.benchmark.direct import Direct, mass_matrices, stiffness_matrices
from studies.benchmark.kernels import accelerations_of
from studies.engine.measuring.clock import Effort, Samples, between, figures, ratio, sampled_in_turn
from studies.engine.measuring.setting import (
    CABLES,
    MATERIAL,
    SECTION,
    SHEAR,
    Variant,
    explicit_run,
    implicit_run,
    on_supports,
    rolled_up,
    row_of_beams,
    stable_step,
)
from studies.engine.measuring.timing import undisturbed
from studies.engine.tables import Table

Array = NDArray[np.float64]

#: The paper's element has six coordinates a node: the last length has 2,000,010 of them.
SHEAR_LENGTHS = (10, 100, 1000, 10_000, 100_000, 333_334)
CABLE_LENGTHS = (10, 100, 1000, 10_000, 100_000, 500_000)
#: What others are compared with.
BASE = 1000
#: Step of the implicit runs, s.
IMPLICIT_DT = 1e-3
#: The influence of an end falls by 2 − √3 from span to span.
FEW_SPANS = 61
#: Length of the clamped beam, m.
CLAMPED_LENGTH = 2.0
#: Elements from which on the process grows by what a run needs; the memory of shorter runs is there already.
RESIDENT_FROM = 300_000
#: Bodies and elements of each of the pinned chain.
PINNED = (1000, 333)


@dataclass(frozen=True)
class Long:
    """A row of beams at one length, with the integrator that runs it."""

    variant: Variant
    integrator: str
    bodies: int
    elements: int

    @property
    def count(self) -> int:
        """Elements of all bodies."""
        return self.bodies * self.elements

    @property
    def label(self) -> str:
        """As the table of samples calls it."""
        return f"{self.variant.label}, {self.integrator}, {self.bodies} × {self.elements}"

    @property
    def scene(self) -> Scene:
        """The scene."""
        return row_of_beams(self.bodies, self.elements)

    def runner(self) -> Callable[[int], Solution]:
        """A call that does so many steps."""
        scene, options = self.scene, self.variant.options()
        if self.integrator == "zhai":
            dt = stable_step(scene, self.elements, options)
            return lambda steps: solve(scene, explicit_run(scene, self.elements, steps, dt, **options))
        return lambda steps: solve(scene, implicit_run(scene, self.elements, steps, IMPLICIT_DT, **options))

    @property
    def steps(self) -> int:
        """Steps of a run: of an implicit one as many at every length, since Newton's iterations change with time.

        Explicit ones of long chains take longer than the memory that a run asks for, which varies by tens of ms.
        """
        return max(40, min(20_000, round(3e5 / self.count))) if self.integrator == "zhai" else 8

    @property
    def again(self) -> int:
        """Pairs of runs of a sample: short ones are repeated until they last some milliseconds."""
        return max(1, min(10, 20_000 // self.count)) if self.integrator != "zhai" else 1


def length_costs(effort: Effort, samples: Samples) -> Table:
    """Time and memory of an element against length, explicit and implicit, and of a chain of a thousand pins."""
    rows = []
    for variant in (SHEAR, CABLES[0]):
        for integrator in ("zhai", "generalized-alpha"):
            rows += _lengths(variant, integrator, effort, samples)
    notes = (
        f"Clamped rows under gravity, elements of one size: a longer chain is longer, not finer. Implicit steps "
        f"are {IMPLICIT_DT:g} s. All lengths of one element and integrator were run in turn.",
        "ns: CPU time of an element and step, by the difference of a run and one three times as long, so that "
        f"start-up and output are left out; ratio: to {BASE} elements, of the same round.",
        "ns_iteration: of an element and Newton iteration, factorizations included; ratio_iteration: to that of "
        f"{BASE} elements. Newton's iterations are not the same at all lengths, as its tolerance is relative to them.",
        "bytes: peak of all arrays alive during a run, set-up included, less the stored output, of an element "
        "(counted by tracemalloc); rss: growth of the process at its peak, of an element, if the system reports it.",
        "build_s: scene, chain, arrays and the solution's fields: a run's CPU time outside its steps.",
    )
    return Table("length", "Cost against length", pd.DataFrame(rows), notes)


def _lengths(variant: Variant, integrator: str, effort: Effort, samples: Samples) -> list[dict[str, Any]]:
    lengths = SHEAR_LENGTHS if variant is SHEAR else CABLE_LENGTHS
    contestants = [Long(variant, integrator, 1, n) for n in lengths[: 4 if effort.quick else None]]
    if variant is SHEAR:
        bodies, elements = PINNED
        contestants.append(Long(variant, integrator, *((100, 33) if effort.quick else (bodies, elements))))
    seen: dict[str, list[Solution]] = {c.label: [] for c in contestants}
    samplers = {c.label: between(c.runner(), c.steps, c.count, seen[c.label], c.again) for c in contestants}
    found = sampled_in_turn(f"length, {variant.label}, {integrator}", samplers, effort.rounds, samples)
    base = found[next(c.label for c in contestants if c.elements == BASE)]
    rows = [_row(c, found[c.label], base, seen[c.label]) for c in contestants]
    one = next(row["ns_iteration"] for row in rows if row["elements"] == BASE)
    return [row | {"ratio_iteration": row["ns_iteration"] / one} for row in rows]


def _row(long: Long, values: list[float], base: list[float], seen: list[Solution]) -> dict[str, Any]:
    short, whole = (s.cost for s in seen)
    steps = whole.steps - short.steps
    iterations = (whole.newton_iterations - short.newton_iterations) / max(steps, 1)
    shown = figures(values)
    return {
        "element": long.variant.element,
        "integrator": long.integrator,
        "bodies": long.bodies,
        "elements": long.count,
        "coordinates": seen[1].dofs,
        **shown,
        "ratio": ratio(values, base),
        "newton_per_step": iterations if iterations else np.nan,
        "factorizations_per_step": (whole.factorizations - short.factorizations) / steps
        if iterations
        else np.nan,
        "ns_iteration": shown["ns"] / iterations if iterations else np.nan,
        **memory(long),
        "status": str(seen[1].status),
    }


def memory(long: Long) -> dict[str, float]:
    """Peak of a short run beside its stored output, bytes of an element, and the time to build it, s."""
    with undisturbed():
        gc.collect()
        _give_back()
        resident = _peak_resident(reset=True)
        start = process_time()
        solution = long.runner()(2)
        build = process_time() - start - solution.cost.cpu_s
        grown = _peak_resident() - resident
        tracemalloc.start()
        solution = long.runner()(2)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    stored = sum(3 * f.coordinates.nbytes for f in solution.fields.values())  # type: ignore[attr-defined]
    rss = (grown - stored) / long.count if long.count >= RESIDENT_FROM else float("nan")
    return {"bytes": (peak - stored) / long.count, "rss": rss, "build_s": build}


def _give_back() -> None:
    """Give freed memory back to the system, where its C library can, so that growth is seen."""
    trim = getattr(CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)


def _peak_resident(reset: bool = False) -> float:
    """Largest resident memory so far, bytes, since the last reset; NaN if the system does not report it."""
    try:
        if reset:
            Path("/proc/self/clear_refs").write_text("5")
        lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
        return 1024.0 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    except (OSError, StopIteration):
        return float("nan")


# --- accuracy at length --------------------------------------------------------------------------------------


def direct_checks(effort: Effort, samples: Samples) -> Table:
    """Accelerations, and statics on supports, against a banded direct solver."""
    long = 5000 if effort.quick else SHEAR_LENGTHS[-1]
    bodies, elements = (50, 33) if effort.quick else PINNED
    spans, of = (100, 10) if effort.quick else (5000, 66)
    rows = [
        acceleration_check(row_of_beams(1, long), long, SHEAR),
        acceleration_check(row_of_beams(bodies, elements), elements, SHEAR),
        acceleration_check(row_of_beams(1, 3 * long // 2), 3 * long // 2, CABLES[0]),
        support_check(spans, of, SHEAR),
        support_check(spans, of, CABLES[0]),
    ]
    for row in rows:
        samples.keep("direct", f"{row['what']}, {row['element']}, {row['elements']}", [row["ns"]])
    notes = (
        "difference: largest |x − x_direct| / largest |x_direct|, the worst of all coordinate rows; direct: "
        "LAPACK's banded Cholesky (solveh_banded) on the assembled matrix.",
        "accelerations: of a row of beams rolled into a circle, in the split and in the block form. "
        "tangent: one solve with K_T at the equilibrium.",
        f"sag: relative difference of the middle span's, at the equilibrium found by solve_static, to that in a "
        f"beam of {FEW_SPANS} spans, far enough from its ends for their influence to fade below rounding.",
        "ns, ns_direct: CPU time of an element to factorize and solve (one sample): of the recursion, element matrices "
        "included; of LAPACK alone. ns_assembly: what the direct solver's element matrices and their band take before, "
        "in NumPy, which a compiled program would do faster.",
    )
    return Table("direct", "Against a banded direct solver, at length", pd.DataFrame(rows), notes)


def acceleration_check(scene: Scene, mesh: int, variant: Variant) -> dict[str, Any]:
    """Accelerations of a rolled-up row by the recursion, in both forms, and by a banded solver."""
    chain = Chain(scene, implicit_run(scene, mesh, 1, IMPLICIT_DT, **variant.options()))
    q, bodies = rolled_up(chain), chain.bodies
    direct, elastic = Direct(chain), np.empty_like(q)
    elastic_forces(
        bodies.formulations, q, bodies.first, bodies.kinds, bodies.constants, bodies.buffer(), elastic
    )
    load = chain.dead_load - elastic
    accelerations_of(chain, q, split=True)  # compiles
    begin = process_time()
    ours = accelerations_of(chain, q, split=True)
    times = [begin, process_time()]
    band = direct.band(mass_matrices(bodies))
    times.append(process_time())
    theirs = direct.solve(band, load)
    times.append(process_time())
    blocks = accelerations_of(chain, q, split=False)
    worst = max(difference(ours, theirs, chain), difference(blocks, theirs, chain))
    return _check("accelerations", variant, chain, worst, times)


def support_check(spans: int, elements: int, variant: Variant) -> dict[str, Any]:
    """Equilibrium of a continuous beam, its sag, and a solve with its tangent."""
    scene, options = on_supports(spans, elements), variant.options()
    solve_static(on_supports(3, elements), mesh=elements, **options)  # compiles
    rest = solve_static(scene, mesh=elements, **options)
    few = solve_static(on_supports(FEW_SPANS, elements), mesh=elements, **options)
    chain = Chain(scene, implicit_run(scene, elements, 1, IMPLICIT_DT, **options))
    q = chain.bodies.flat([rest.fields[m.body.name].coordinates[-1] for m in chain.bodies.meshes])  # type: ignore[attr-defined]
    tangent_solve(chain, q, chain.dead_load)  # compiles, and fills in what the chain finds once
    on_few = Chain(few.scene, chain.run).bodies
    stiffness_matrices(on_few, on_few.reference())
    begin = process_time()
    ours = tangent_solve(chain, q, chain.dead_load)
    times = [begin, process_time()]
    direct = Direct(chain)
    band = direct.band(stiffness_matrices(chain.bodies, q))
    times.append(process_time())
    theirs = direct.solve(band, chain.dead_load)
    times.append(process_time())
    row = _check("tangent on supports", variant, chain, difference(ours, theirs, chain), times, rest)
    row["sag"] = abs(_sag(rest, spans // 2) / _sag(few, FEW_SPANS // 2) - 1.0)
    return row


def digits(effort: Effort) -> Table:
    """Where the statics of a clamped beam loses its digits: nodes are cubic, so that all else is exact."""
    rows = [clamped_digits(4**k) for k in range(1, 6 if effort.quick else 9)]
    notes = (
        "A clamped beam of 2 m cut into ever shorter cable elements under a tip force of P L²/(E I) = 1e-6: "
        "error of the tip's deflection against P L³/(3 E I), which cubic elements reach at any mesh.",
        "static: solve_static (Newton's corrections repeat until they no longer fall); recursion, banded: one "
        "linear solve by the Riccati recursion, and by LAPACK's banded Cholesky, of the same matrix.",
        "limit: machine epsilon times the fourth power of the number of elements, the matrix's condition number.",
    )
    return Table("digits", "Where statics loses its digits", pd.DataFrame(rows), notes)


def clamped_digits(elements: int) -> dict[str, Any]:
    """Errors of the tip's deflection of a clamped beam of so many elements."""
    row = row_of_beams(1, elements, element_length=CLAMPED_LENGTH / elements)
    EI = MATERIAL.E * SECTION.second_moment
    force = 1e-6 * EI / CLAMPED_LENGTH**2
    exact = force * CLAMPED_LENGTH**3 / (3.0 * EI)
    scene = Scene(row.name, row.bodies, row.joints, (Force("beam0.end", (0.0, force)),))
    chain = Chain(scene, implicit_run(scene, elements, 1, IMPLICIT_DT))
    q = chain.bodies.reference()
    rest = solve_static(scene, mesh=elements)
    try:
        deflection = Direct(chain).solve_tangent(q, chain.dead_load)[1, -1]
    except np.linalg.LinAlgError:  # rounding has made the matrix indefinite
        deflection = np.nan
    return {
        "elements": elements,
        "error_static": abs(float(rest.displacement("beam0.end")[-1, 1]) / exact - 1.0),
        "error_recursion": abs(float(tangent_solve(chain, q, chain.dead_load)[1, -1]) / exact - 1.0),
        "error_banded": abs(float(deflection) / exact - 1.0),
        "limit": float(np.finfo(float).eps) * float(elements) ** 4,
        "newton_iterations": rest.cost.newton_iterations,
        "status": str(rest.status),
    }


def tangent_solve(chain: Chain, q: Array, load: Array) -> Array:
    """x of K_T(q) x = load by the recursion, (rows, nodes)."""
    bodies = chain.bodies
    factors = riccati.block_factors(chain)
    none = no_loads(bodies)
    riccati.factorize(q, bodies.tables(), riccati.links(chain), 0.0, 1.0, none, np.empty((0, 2)), factors)
    return riccati.solve(factors, load)


def difference(ours: Array, theirs: Array, chain: Chain) -> float:
    """Largest |ours − theirs| / largest |theirs| of every pair of rows, over what is not known beforehand."""
    free = ~chain.prescribed
    worst = 0.0
    for k in range(0, len(ours), 2):
        pair = slice(k, k + 2)
        size = np.abs(theirs[pair][free[pair]]).max()
        worst = max(worst, float(np.abs(ours[pair] - theirs[pair])[free[pair]].max() / size))
    return worst


def _check(
    what: str, variant: Variant, chain: Chain, worst: float, times: Sequence[float],
    rest: Solution | None = None,
) -> dict[str, Any]:  # fmt: skip
    n = int(chain.bodies.elements.sum())
    ns, ns_assembly, ns_direct = 1e9 * np.diff(times) / n
    return {
        "what": what,
        "element": variant.element,
        "bodies": len(chain.bodies.meshes),
        "elements": n,
        "coordinates": chain.dofs,
        "difference": worst,
        "sag": np.nan,
        "ns": ns,
        "ns_direct": ns_direct,
        "ns_assembly": ns_assembly,
        "newton_iterations": rest.cost.newton_iterations if rest else np.nan,
        "cpu_s": rest.cost.cpu_s if rest else np.nan,
        "status": str(rest.status) if rest else "ok",
    }


def _sag(rest: Solution, span: int) -> float:
    name = f"beam{span}"
    return float(rest.position(name, 0.5)[-1, 1])
