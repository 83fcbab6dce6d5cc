"""Chains of 1 to 333,334 elements: correct digits of the accelerations by each method."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.linalg import eigvalsh
from scipy.sparse.linalg import splu

from anctmm.discretise.assembly import elastic_forces
from anctmm.discretise.chain import Chain
from anctmm.model.scene import Pin, Scene
from anctmm.recursion import riccati
from anctmm.recursion.transfer import (
    FREE,
    PINNED,
    Passage,
    Row,
    accelerations_plain,
    accelerations_riccati,
    element_transfer,
)
from reference.global_dae.model import Model, kkt, typical
from studies.benchmark.kernels import accelerations_of
from studies.engine.measuring.setting import CABLES, SHEAR, Variant, implicit_run, rolled_up, row_of_beams
from studies.engine.runner import Runner
from studies.engine.tables import Table
from studies.extremes.double_double import Double, minus_products, plus
from studies.extremes.parts import EPS, Job, Part, rows_of
from studies.report.plots import PALETTE, Picture, legend_below, picture

Array = NDArray[np.float64]

LENGTHS = (*range(1, 13), 16, 32, 100, 1000, 10_000, 100_000, 333_334)
#: The readable recursion walks in Python; the longest chain is that of the paper's element alone.
LONGEST = {"shear": LENGTHS[-1], "cable": 100_000}
QUICK_LENGTHS = (*range(1, 11), 32, 1000)
#: Lengths of the plain product: beyond them nothing is left of its digits.
PLAIN_UP_TO = 16
PLAIN, PAPER, CONDENSED, SPLIT, SPARSE = ROADS = (
    "plain product",
    "Riccati, the paper's partition",
    "Riccati, forces by accelerations",
    "the same in scalar blocks",
    "global sparse LU",
)
#: What Riccati must stay below at every length.
BOUND = 1e-12
#: Corrections of the reference.
CORRECTIONS = 4


@dataclass(frozen=True)
class Problem:
    """Accelerations of a rolled-up beam, pinned at its start, of so many elements."""

    variant: Variant
    elements: int

    @cached_property
    def chain(self) -> Chain:
        """The beam as ANC-TMM sees it."""
        row = row_of_beams(1, self.elements)
        scene = Scene("long", row.bodies, (Pin("beam0.start"),), gravity=row.gravity)
        return Chain(scene, implicit_run(scene, self.elements, 1, 1e-3, **self.variant.options()))

    @cached_property
    def q(self) -> Array:
        """Coordinates, (rows, nodes)."""
        return rolled_up(self.chain)

    @cached_property
    def load(self) -> Array:
        """Gravity less elastic forces, (rows, nodes): the loads for every method."""
        b, f = self.chain.bodies, np.empty_like(self.q)
        elastic_forces(b.formulations, self.q, b.first, b.kinds, b.constants, b.buffer(), f)
        return self.chain.dead_load - f

    @property
    def mass(self) -> Array:
        """Scalar mass of an element, (2k, 2k)."""
        return self.chain.bodies.meshes[0].element.mass

    # --- methods ---

    def by(self, road: str) -> Array:
        """Accelerations, (rows, nodes), by one method."""
        roads: dict[str, Callable[[], Array]] = {
            PLAIN: lambda: _real(accelerations_plain(self.readable)),
            PAPER: lambda: _real(accelerations_riccati(self.readable)),
            CONDENSED: lambda: riccati.solve(riccati.mass_factors(self.chain), self.load),
            SPLIT: lambda: accelerations_of(self.chain, self.q, split=True),
            SPARSE: lambda: self.solved(self.load),
        }
        return roads[road]()

    @property
    def readable(self) -> Row:
        """The same for the readable methods: U is that of every element, loads enter at an element's node I."""
        k, load = len(self.load) // 2, self.load[::2] + 1.0j * self.load[1::2]
        zero = np.zeros(k)
        U, _ = element_transfer(self.mass, zero, zero)
        M12, M22 = self.mass[:k, k:], self.mass[k:, k:]
        first = np.linalg.solve(M12, load[:, :-1])
        T = np.concatenate([first, M22 @ first])
        T[k:, -1] -= load[:, -1]
        passages = [Passage(U, t) for t in np.ascontiguousarray(T.T)]
        return Row(k, passages, PINNED, FREE, (zero, zero))

    @cached_property
    def _model(self) -> Model:
        return Model.of(self.chain.scene, self.chain.run)

    @cached_property
    def _factors(self) -> Any:
        m = self._model
        return splu(kkt(m.scalar_mass, m.complex_constraints.real, typical(m.scalar_mass)))

    def solved(self, load: Array) -> Array:
        """By sparse LU of the global matrix with multipliers."""
        numbers, k = self._model.numbers, len(load) // 2
        right = np.zeros((self._factors.shape[0], 2))
        for c in range(2):
            right[numbers[:k], c] = load[c::2]
        x, out = self._factors.solve(right), np.empty_like(load)
        for c in range(2):
            out[c::2] = x[numbers[:k], c]
        return out

    # --- reference ---

    @cached_property
    def exact(self) -> tuple[Double, float]:
        """The solution to twice the digits, and its own uncertainty: iterative refinement.

        Residuals of the given matrix and load are summed in pairs of numbers (some 32 digits); corrections come from
        the sparse LU. What is left is at most the last correction.
        """
        x: Double = (self.solved(self.load), np.zeros_like(self.load))
        last = np.inf
        for _ in range(CORRECTIONS):
            correction = self.solved(self._residual(x))
            x = plus(x, correction)
            last = max(
                np.abs(correction[k]).max() / np.abs(x[0][k]).max()
                for k in range(len(self.load))
                if x[0][k].any()
            )
        return x, float(last)

    def _residual(self, x: Double) -> Array:
        """Load less inertia, (rows, nodes), 0 where the acceleration is known."""
        k, m = len(self.load) // 2, self.mass
        rows: list[Array] = []
        for row in range(2 * k):
            i, c = divmod(row, 2)
            total: Double = (self.load[row].copy(), np.zeros_like(self.load[row]))
            for j in range(k):
                value = (x[0][2 * j + c], x[1][2 * j + c])
                for here, there, factor in (
                    (np.s_[:-1], np.s_[:-1], m[i, j]),
                    (np.s_[:-1], np.s_[1:], m[i, k + j]),
                    (np.s_[1:], np.s_[:-1], m[k + i, j]),
                    (np.s_[1:], np.s_[1:], m[k + i, k + j]),
                ):
                    part = (total[0][here], total[1][here])
                    part = minus_products(part, factor, (value[0][there], value[1][there]))
                    total[0][here], total[1][here] = part
            rows.append(total[0] + total[1])
        out = np.array(rows)
        out[self.chain.prescribed] = 0.0
        return out

    def error(self, road: str) -> float:
        """Largest |a − a_ref| of a component over the largest |a_ref| of its kind, the worst of r and gradients."""
        exact, _ = self.exact
        with np.errstate(all="ignore"):
            try:
                found = self.by(road)
            except np.linalg.LinAlgError:  # the plain product has become singular
                return float("inf")
            away = np.abs((found - exact[0]) - exact[1])
        free, worst = ~self.chain.prescribed, 0.0
        for k in range(0, len(away), 2):
            pair = np.s_[k : k + 2]
            size = np.abs(exact[0][pair][free[pair]]).max()
            worst = max(worst, float(away[pair][free[pair]].max() / size))
        return worst


def growth(variant: Variant) -> float:
    """Largest eigenvalue of an element's transfer matrix: what a plain product grows by from element to element."""
    m = Problem(variant, 1).mass
    zero = np.zeros(len(m) // 2)
    scale = 1.0 / np.sqrt(np.diag(m))
    return float(np.abs(np.linalg.eigvals(element_transfer(m * np.outer(scale, scale), zero, zero)[0])).max())


def condition(variant: Variant, elements: int = 64) -> float:
    """Condition number of the mass of a free chain, scaled to a unit diagonal; it does not depend on length."""
    m = Problem(variant, 1).mass
    k = len(m) // 2
    M = np.zeros((k * (elements + 1), k * (elements + 1)))
    for e in range(elements):
        M[k * e : k * e + 2 * k, k * e : k * e + 2 * k] += m
    scale = 1.0 / np.sqrt(np.diag(M))
    values = eigvalsh(M * np.outer(scale, scale))
    return float(values[-1] / values[0])


def coupling(variant: Variant) -> float:
    """Condition number of the mass that couples an element's two nodes: every transfer matrix holds its inverse."""
    m = Problem(variant, 1).mass
    k, scale = len(m) // 2, 1.0 / np.sqrt(np.diag(m))
    return float(np.linalg.cond((m * np.outer(scale, scale))[:k, k:]))


def length(quick: bool, runner: Runner) -> Part:
    """Errors of every method at every length."""
    variants = (SHEAR, CABLES[0])
    jobs = [
        Job(f"{n} elements, {v.element}", {"element": v.element, "elements": n}, partial(_rows, v, n))
        for v in variants
        for n in (QUICK_LENGTHS if quick else LENGTHS)
        if n <= LONGEST[v.element]
    ]
    frame = pd.DataFrame(rows_of(jobs, runner))
    rates = [_rate(frame, v) for v in variants]
    notes = (
        "A beam of elements of 20 mm, rolled into a circle of 1 m, pinned at its start; every method has the same "
        "matrix and the same loads. measured: largest |a − a_ref| over the largest |a_ref|, the worst of positions and "
        "gradients.",
        "predicted: of the plain product the rounding of a number times the n-th power of the largest eigenvalue of an "
        "element's transfer matrix, no more than 1; of the others rounding times the condition of what is inverted, "
        "scaled to a unit diagonal: the mass, or, in the paper's partition, the mass that couples two nodes. Neither "
        "depends on length.",
        "reference: iterative refinement of the sparse solution with residuals summed in pairs of numbers "
        "(double-double, about 32 digits); uncertainty: its last correction, relative.",
        f"The plain product is not tried beyond {PLAIN_UP_TO} elements, where no digit is left.",
    )
    table = Table("extremes_length", "Digits kept against length", frame, notes)
    return Part((table,), (_picture(frame),), (_learned(frame, rates),))


def _rows(variant: Variant, elements: int) -> list[dict[str, Any]]:
    problem = Problem(variant, elements)
    _, uncertainty = problem.exact
    loss, rows = growth(variant), []
    for road in ROADS:
        if road == PLAIN and elements > PLAIN_UP_TO:
            continue
        measured = problem.error(road)
        plain = road == PLAIN
        kappa = coupling(variant) if road == PAPER else condition(variant)
        rows.append({
            "element": variant.element, "elements": elements, "road": road, "measured": measured,
            "predicted": min(1.0, EPS * loss**elements) if plain else EPS * kappa,
            "theory": f"eps · {loss:.2f}^n" if plain else f"eps · {kappa:.3g}",
            "reference": "double-double refinement", "uncertainty": uncertainty,
            "status": "ok" if measured < BOUND else "no digit left" if not measured < 0.1 else "digits lost",
        })  # fmt: skip
    return rows


def _rate(frame: pd.DataFrame, variant: Variant) -> tuple[str, float, float]:
    """Element, measured growth of the plain product's error from element to element, and its theory."""
    mine = frame[
        (frame["element"] == variant.element) & (frame["road"] == PLAIN) & frame["elements"].between(3, 8)
    ]
    slope = np.polyfit(mine["elements"].to_numpy(float), np.log(mine["measured"].to_numpy(float)), 1)[0]
    return variant.element, float(np.exp(slope)), growth(variant)


def _learned(frame: pd.DataFrame, rates: list[tuple[str, float, float]]) -> str:
    plain = frame[(frame["road"] == PLAIN) & (frame["status"] == "no digit left")]
    ours = frame[frame["road"].isin((PAPER, CONDENSED, SPLIT))]
    sparse = frame[frame["road"] == SPARSE]
    said = " and ".join(
        f"{found:.0f} with {element} elements (theory {theory:.2f})" for element, found, theory in rates
    )
    return (
        f"Length: the error of the plain product of transfer matrices grows by {said} from element to element and has "
        f"lost all digits at {plain['elements'].min()} elements, while Riccati in every partition stays below "
        f"{ours['measured'].max():.1e} from 1 to {ours['elements'].max():,} elements, as global sparse LU does "
        f"({sparse['measured'].max():.1e}): it loses nothing with length."
    )


def _picture(frame: pd.DataFrame) -> Picture:
    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, element in zip(panels, ("shear", "cable"), strict=True):
            _draw(axes, frame[frame["element"] == element], element)
        panels[0].set_ylabel("relative error of accelerations")
        legend_below(figure, list(panels), 3)

    caption = (
        "Error of the accelerations against the number of elements. The plain product loses 16 digits in nine "
        "elements, as the eigenvalue of its matrices says (dotted); Riccati in any partition keeps them at any length."
    )
    return picture("extremes_length", caption, draw, (7.6, 4.2))


def _draw(axes: Axes, frame: pd.DataFrame, element: str) -> None:
    for i, road in enumerate(ROADS):
        mine = frame[frame["road"] == road]
        axes.plot(
            mine["elements"], mine["measured"].clip(1e-17, 1e3), label=road, color=PALETTE[(1, 0, 2, 4, 7)[i]],
            marker="o^sDv"[i], markersize=3.5 + 0.5 * (len(ROADS) - i), markerfacecolor="none", linewidth=1.1,
        )  # fmt: skip
    plain = frame[frame["road"] == PLAIN]
    axes.plot(
        plain["elements"], plain["predicted"], ":", color=PALETTE[1], label="theory of the plain product"
    )
    axes.set(xscale="log", yscale="log", xlabel="elements", title=f"{element} elements", ylim=(2e-17, 1e2))


def _real(a: NDArray[Any]) -> Array:
    """Components, (rows, nodes), from a readable method's complex vectors."""
    out = np.empty((2 * len(a), a.shape[1]))
    out[::2], out[1::2] = a.real, a.imag
    return out
