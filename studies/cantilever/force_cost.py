"""What a force of the shear element costs: by quadrature, and by the paper's invariant matrices."""

from collections.abc import Callable
from time import process_time_ns
from typing import Any

import numba
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from anctmm.elements import shear_kernel
from anctmm.elements.force_blocks import BLOCK
from anctmm.elements.invariants import InvariantShearElement
from anctmm.elements.shear import ShearElement
from studies.engine.measuring.timing import undisturbed
from studies.engine.runner import Runner
from studies.engine.tables import Table
from studies.scenes import four_bar

Array = NDArray[np.float64]
ELEMENTS = 64
#: Shortest stretch that is timed, s: well above the clock's grain.
STRETCH = 0.02


@numba.njit
def _by_invariants(nodal: Array, linear: Array, cubic: Array, repeats: int, out: Array) -> None:
    """K(q) q of every element, as `InvariantShearElement.force` does it, compiled."""
    products = np.empty(36)
    for _ in range(repeats):
        for e in range(nodal.shape[0] - 1):
            q = nodal[e : e + 2].copy().reshape(6, 2)
            for k in range(6):
                for l in range(6):  # noqa: E741
                    products[6 * k + l] = q[k, 0] * q[l, 0] + q[k, 1] * q[l, 1]
            for i in range(6):
                fx = fy = 0.0
                for j in range(6):
                    stiffness = linear[i, j]
                    for m in range(36):
                        stiffness += cubic[i, j, m] * products[m]
                    fx += stiffness * q[j, 0]
                    fy += stiffness * q[j, 1]
                out[e, i, 0], out[e, i, 1] = fx, fy


@numba.njit
def _by_quadrature(q: Array, constants: Array, repeats: int, out: Array) -> None:
    for _ in range(repeats):
        shear_kernel.forces(q, 0, q.shape[1] - 1, constants, out)


def force_cost(runner: Runner, rounds: int) -> Table:
    """Time per element of both evaluations, compiled and as they stand in the readable modules."""
    samples = runner.remember(f"force evaluations, {rounds} rounds", lambda: _measure(rounds))
    lines = []
    for (evaluation, form), found in samples.items():
        median = float(np.median(found))
        lines.append({
            "evaluation": evaluation, "form": form, "ns_per_element": median,
            "spread": (max(found) - min(found)) / median, "repeats": len(found),
            "ratio": median / float(np.median(samples["quadrature, 5 points", form])),
        })  # fmt: skip
    notes = (
        f"Medians of rounds in turn, {ELEMENTS} elements of the four-bar's coupler, CPU time on one thread. "
        "The compiled quadrature is the solvers' kernel; the compiled invariants are the same algebra in "
        "loops.",
        "Both give the same force to rounding (tested). The invariant matrices cost 1332 multiplications an "
        "element before the products, which is why the solvers do not use them.",
    )
    return Table(
        "force_cost", "Shear force: invariant matrices beside quadrature", pd.DataFrame(lines), notes
    )


def evaluations() -> dict[tuple[str, str], Callable[[int], Array]]:
    """(evaluation, form) → a call that repeats it and gives the forces, (elements, 6, 2)."""
    element = ShearElement.of(four_bar().scene.beam("coupler"), ELEMENTS)
    invariant = InvariantShearElement(element)
    nodal = _bent(element.l)
    q = np.ascontiguousarray(nodal.reshape(len(nodal), 6).T)
    linear, cubic = invariant.matrices
    buffer, out = np.zeros(12 * BLOCK), np.empty((ELEMENTS, 6, 2))
    constants = shear_kernel.constants(element)

    def compiled_quadrature(repeats: int) -> Array:
        _by_quadrature(q, constants, repeats, buffer)
        return buffer.reshape(2, 3, 2, -1)[..., :ELEMENTS].transpose(3, 0, 1, 2).reshape(-1, 6, 2)

    def compiled_invariants(repeats: int) -> Array:
        _by_invariants(nodal, linear, cubic, repeats, out)
        return out

    def readable(of: Any) -> Callable[[int], Array]:
        pairs = [nodal[e : e + 2].reshape(6, 2) for e in range(ELEMENTS)]
        return lambda repeats: [np.array([of.force(p) for p in pairs]) for _ in range(repeats)][-1]

    return {
        ("quadrature, 5 points", "compiled"): compiled_quadrature,
        ("invariant matrices", "compiled"): compiled_invariants,
        ("quadrature, 5 points", "readable"): readable(element),
        ("invariant matrices", "readable"): readable(invariant),
    }


def _bent(l: float) -> Array:  # noqa: E741
    """Nodes along an arc with a little stretch and shear, (nodes, 3, 2)."""
    angle = np.linspace(0.0, 1.0, ELEMENTS + 1)
    tangent = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    normal = np.stack([-np.sin(angle + 0.02), np.cos(angle + 0.02)], axis=1)
    place = np.cumsum(1.01 * l * tangent, axis=0)
    return np.stack([place, 1.01 * tangent, 0.99 * normal], axis=1)


def _measure(rounds: int) -> dict[tuple[str, str], list[float]]:
    calls = evaluations()
    with undisturbed():
        repeats = {name: _enough(call) for name, call in calls.items()}
        samples: dict[tuple[str, str], list[float]] = {name: [] for name in calls}
        for _ in range(rounds):
            for name, call in calls.items():
                samples[name].append(_time(call, repeats[name]) / (repeats[name] * ELEMENTS))
    return samples


def _enough(call: Callable[[int], Array]) -> int:
    """Repeats that take at least STRETCH, after a first call that compiles."""
    call(1)
    repeats = 1
    while _time(call, repeats) < 1e9 * STRETCH:
        repeats *= 2
    return repeats


def _time(call: Callable[[int], Array], repeats: int) -> float:
    start = process_time_ns()
    call(repeats)
    return float(process_time_ns() - start)
