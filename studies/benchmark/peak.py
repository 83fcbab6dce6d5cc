"""Arithmetic of the kernels, counted, and the rate they reach beside the core's own multiply-add peak."""

from collections.abc import Callable, Mapping
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.elements.dispatch import KERNELS
from anctmm.elements.force_blocks import BLOCK
from anctmm.elements.tangent_blocks import TANGENT_BUFFER
from anctmm.integrators import zhai as explicit
from anctmm.jit.compiling import kernel
from anctmm.jit.deferred import Deferred
from anctmm.recursion import accelerations, riccati
from anctmm.recursion.split import split_factors
from studies.benchmark.kernels import (
    ACCELERATIONS,
    BLOCK_SWEEP,
    ELEMENT_FORCES,
    EXPLICIT,
    FACTORIZATION,
    TANGENTS,
    UPDATE,
    parts,
)
from studies.engine.measuring.clock import Effort, Samples, figures, records, repeated, sampled_in_turn
from studies.engine.measuring.setting import VARIANTS, Variant, bent_arc, implicit_run, row_of_beams
from studies.engine.tables import Table

Array = NDArray[np.float64]

#: Numbers that stay in the first-level cache, and multiply-adds done with each between load and store.
LANES, DEGREE = 512, 16
#: Numbers of the memory measurement, far more than any cache holds (quick: a quarter).
STREAM = 2**24


class Counted:
    """A number that counts what is done with it: additions, multiplications, divisions and roots."""

    tally = 0

    def __init__(self, value: float) -> None:
        self.value = float(value)

    def _with(self, other: Any, value: Callable[[float, float], float]) -> "Counted":
        Counted.tally += 1
        return Counted(value(self.value, float(other)))

    def __float__(self) -> float:
        return self.value

    def __add__(self, other: Any) -> "Counted":
        return self._with(other, lambda a, b: a + b)

    def __sub__(self, other: Any) -> "Counted":
        return self._with(other, lambda a, b: a - b)

    def __rsub__(self, other: Any) -> "Counted":
        return self._with(other, lambda a, b: b - a)

    def __mul__(self, other: Any) -> "Counted":
        return self._with(other, lambda a, b: a * b)

    def __truediv__(self, other: Any) -> "Counted":
        return self._with(other, lambda a, b: a / b if b else np.inf)

    def __rtruediv__(self, other: Any) -> "Counted":
        return self._with(other, lambda a, b: b / a if a else np.inf)

    def __neg__(self) -> "Counted":
        return Counted(-self.value)  # a sign costs nothing: it is part of the next operation

    def __pow__(self, other: int) -> "Counted":
        return self._with(other, lambda a, b: a**b)

    def __gt__(self, other: Any) -> bool:
        return self.value > float(other)

    def __lt__(self, other: Any) -> bool:
        return self.value < float(other)

    __radd__, __rmul__ = __add__, __mul__


def _root(x: Any) -> Any:
    Counted.tally += 1
    return Counted(float(x) ** 0.5)


def readable(function: Any, known: dict[int, Any] | None = None) -> Any:
    """A compiled kernel as plain Python, and all that it calls."""
    known = {} if known is None else known
    own = isinstance(function, FunctionType) and function.__module__.startswith("anctmm")
    if not isinstance(function, Deferred) and not own:
        return function
    if id(function) in known:
        return known[id(function)]
    source = getattr(function, "py_func", function)
    names = dict(source.__globals__)
    plain = FunctionType(source.__code__, names, source.__name__, source.__defaults__, source.__closure__)
    known[id(function)] = plain
    for name in names.keys() & set(source.__code__.co_names):
        names[name] = _root if name == "sqrt" else _readable_inside(names[name], known)
    return plain


def _readable_inside(value: Any, known: dict[int, Any]) -> Any:
    """The same of what holds kernels: a module, or a table of such."""
    if isinstance(value, ModuleType) and value.__name__.startswith("anctmm"):
        return SimpleNamespace(**{k: readable(v, known) for k, v in vars(value).items()})
    if isinstance(value, Mapping):
        return {k: _readable_inside(v, known) for k, v in value.items()}
    return readable(value, known)


def counted(array: Array) -> Any:
    """An array of counting numbers."""
    return np.array([Counted(x) for x in np.ravel(array)], dtype=object).reshape(np.shape(array))


def operations(function: Any, *arguments: Any) -> int:
    """Additions, multiplications, divisions and roots that a kernel does with counted arguments."""
    plain, Counted.tally = readable(function), 0
    plain(*arguments)
    return Counted.tally


def kernel_operations(variant: Variant) -> dict[str, int]:
    """Operations of one more element in each kernel: those of three elements less those of two."""
    two, three = (_operations(variant, n) for n in (2, 3))
    return {name: three[name] - two[name] for name in two}


def _operations(variant: Variant, n: int) -> dict[str, int]:
    scene = row_of_beams(1, n)
    chain = Chain(scene, implicit_run(scene, n, 1, 1e-3, **variant.options()))
    bodies, q = chain.bodies, counted(bent_arc(n + 1, chain.bodies.rows))
    p, zeros = parts(chain, q), counted(np.zeros(q.shape))
    t = p.tables._replace(buffer=counted(np.zeros(12 * BLOCK + 6)))
    of_kind: Any = KERNELS[int(bodies.kinds[0])]
    counts = {
        ELEMENT_FORCES: operations(of_kind.forces, q, 0, n, bodies.constants[0], t.buffer),
        TANGENTS: operations(
            of_kind.tangents, q, 0, n, bodies.constants[0], counted(np.zeros(TANGENT_BUFFER))
        ),
        ACCELERATIONS: operations(
            accelerations.by_scalars, t, p.clamps, split_factors(chain), q, zeros, zeros
        ),
        UPDATE: operations(
            explicit.update, *(counted(np.zeros(q.size)) for _ in range(4)), explicit.Numbers(1, 1, 1e-3, 0.5, 0.5)
        ),
        **_block_operations(chain, p, q),
    }  # fmt: skip
    return counts | {EXPLICIT: counts[ACCELERATIONS] + counts[UPDATE]}


def _block_operations(chain: Chain, p: Any, q: Any) -> dict[str, int]:
    empty = riccati.block_factors(chain)
    fields = {k: counted(v) for k, v in empty._asdict().items() if isinstance(v, np.ndarray)}
    factors = empty._replace(**fields)
    none = np.empty((0, 2))
    zeros = counted(np.zeros(q.shape))
    return {
        FACTORIZATION: operations(riccati.factorize, q, p.tables, p.links, 1e6, 1.0, p.loads, none, factors),
        BLOCK_SWEEP: operations(riccati.sweep, factors, zeros, zeros.copy()),
    }


# --- the core -------------------------------------------------------------------------------------------------


@kernel
def repeat_multiply_adds(repeats: int, x: Array, y: Array) -> None:
    """Four polynomials of degree DEGREE by Horner at each of many places: independent chains of multiply-adds."""
    for _ in range(repeats):
        for j in range(LANES):
            x0 = x[j]
            a = b = c = d = y[j]
            for _ in range(DEGREE):  # a constant number: unrolled, and all places of a vector at once
                a = a * x0 + 0.1
                b = b * x0 + 0.2
                c = c * x0 + 0.3
                d = d * x0 + 0.4
            y[j] = a + b + c + d


@kernel
def repeat_copy(repeats: int, x: Array, y: Array) -> None:
    """A scaled sum of two arrays: two loads and a store each."""
    for _ in range(repeats):
        for j in range(len(x)):
            y[j] = 0.5 * y[j] + x[j]


def rates(effort: Effort, samples: Samples, kernels: Table) -> Table:
    """Operations of each kernel and the rate it reaches, beside the core's peak measured here."""
    x, y = np.full(LANES, 0.3), np.zeros(LANES)
    big = STREAM // 4 if effort.quick else STREAM
    far = np.ones(big), np.zeros(big)
    samplers = {
        "multiply-add peak": repeated(
            lambda k: repeat_multiply_adds(k, x, y), 8.0 * LANES * DEGREE, effort.stretch
        ),
        "memory": repeated(lambda k: repeat_copy(k, *far), 24.0 * big, effort.stretch),
    }
    found = sampled_in_turn("peak", samplers, effort.rounds, samples)
    peak, memory = (figures(values) for values in found.values())
    core = {"kernel": "multiply-add peak", "element": "-", "quadrature": "-", "elements": np.nan}
    rows = [
        _rate(core, np.nan, np.nan, 1.0 / peak["ns"], peak),
        *_kernel_rates(kernels.frame, 1.0 / peak["ns"], peak),
    ]
    notes = (
        "operations: additions, multiplications, divisions and roots that one more element brings, counted by running "
        "the kernels' source on numbers that count (a division and a root as one each, a sign as none).",
        "gflops: operations over the measured time of the kernel at the most elements of the table of kernels; peak: "
        f"{4 * DEGREE} multiply-adds (two operations each), in four chains, between a load and a store, on {LANES} "
        "numbers in the first-level cache, vectorised by the same compiler.",
        f"Memory, for comparison: {1.0 / memory['ns']:.1f} GB/s in a scaled sum of arrays of {8e-6 * big:.0f} MB each.",
    )
    return Table("peak", "Arithmetic, and the distance to the core's peak", pd.DataFrame(rows), notes)


def _kernel_rates(frame: pd.DataFrame, peak: float, about: dict[str, float]) -> list[dict[str, Any]]:
    rows = []
    for variant in VARIANTS:
        counts = kernel_operations(variant)
        same = frame[(frame["element"] == variant.element) & (frame["quadrature"] == variant.quadrature)]
        for line in records(same[same["elements"] == same["elements"].max()]):
            if line["kernel"] in counts:
                rows.append(_rate(line, counts[line["kernel"]], line["ns"], peak, about))
    return rows


def _rate(
    line: dict[str, Any], count: float, ns: float, peak: float, about: dict[str, float]
) -> dict[str, Any]:
    rate = count / ns if np.isfinite(count) else peak
    return {
        **{name: line[name] for name in ("kernel", "element", "quadrature", "elements")},
        "operations": count,
        "ns": ns,
        "gflops": rate,
        "share_of_peak": rate / peak,
        "peak_spread": about["spread"],
        "repeats": about["repeats"],
        "status": "ok",
    }
