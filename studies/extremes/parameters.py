"""Ratios of stiffness, slenderness, incompressibility: static equilibria against closed forms, by several methods."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.integrators.statics import solve_static
from anctmm.model.scene import Beam, Clamp, Force, Material, Scene, Weld
from anctmm.model.sections import Rectangle
from anctmm.results.solution import Solution
from reference import global_dae
from reference.exact import poisson_locking_factor, timoshenko_tip_deflection
from studies.benchmark.direct import Direct, stiffness_matrices
from studies.benchmark.length import tangent_solve
from studies.engine.runner import Runner
from studies.engine.tables import Table
from studies.extremes.parts import EPS, Job, Part, Row, off, rows_of, worst
from studies.report.plots import PALETTE, Picture, legend_below, picture

#: Height of the square section, m, and Young's modulus of the soft, Pa.
HEIGHT, E, DENSITY = 0.01, 1e7, 1000.0
SECTION = Rectangle(HEIGHT, HEIGHT)
ELEMENTS = 8
#: Tip load as P L²/(E I): so small that the beam is linear to 1e-12.
LOAD = 1e-6
RIGHT_TO = LOAD**2
RATIOS = (1.0, 1e3, 1e6, 1e9)
SLENDERNESS = (1.0, 10.0, 1e2, 1e3, 1e4, 1e5)
POISSON = (0.0, 0.1, 0.3, 0.45, 0.49, 0.499, 0.4999)
NEWTON, RECURSION, INVERTED, CHOLESKY, GLOBAL = ROADS = (
    "ANC-TMM statics",
    "one solve by the recursion",
    "the same with inverted blocks",
    "one solve by banded Cholesky",
    "global statics, sparse LU",
)
RATIO, SLENDER, NU = "stiffness ratio", "slenderness l/h", "Poisson's ratio"
#: A method with fewer correct digits than these has lost them.
KEPT = 1e-2


@dataclass(frozen=True)
class Bar:
    """A beam under a small tip force with the tip's deflection that theory predicts.

    Parameters
    ----------
    what : str
    value : float
        Of the parameter.
    element : str
    scene : Scene
    predicted : float
        m.
    theory : str
    uncertainty : float
        Of the prediction, relative.
    rounding : float
        What rounding of the stiffness alone may change, relative.
    """

    what: str
    value: float
    element: str
    scene: Scene
    predicted: float
    theory: str
    uncertainty: float
    rounding: float

    def rows(self) -> list[Row]:
        """One row for each method."""
        options: dict[str, Any] = {"mesh": ELEMENTS, "element": self.element}
        chain = Chain(self.scene, Discretisation(**options))
        q, load = chain.bodies.reference(), chain.dead_load
        roads: dict[str, Callable[[], tuple[float, str]]] = {
            NEWTON: lambda: _tip(solve_static(self.scene, **options)),
            RECURSION: lambda: (float(tangent_solve(chain, q, load)[1, -1]), "ok"),
            INVERTED: lambda: (by_inverted_blocks(chain), "ok"),
            CHOLESKY: lambda: (float(Direct(chain).solve_tangent(q, load)[1, -1]), "ok"),
            GLOBAL: lambda: _tip(global_dae.solve_static(self.scene, **options)),
        }
        return [self._row(road, *_tried(roads[road])) for road in ROADS]

    def _row(self, road: str, tip: float, status: str) -> Row:
        difference = off(tip, self.predicted)
        if status == "ok" and not abs(difference) < KEPT:
            status = "digits lost"
        return {
            "what": self.what, "value": self.value, "element": self.element, "elements": ELEMENTS, "road": road,
            "measured": tip, "predicted": self.predicted, "difference": difference, "rounding": self.rounding,
            "theory": self.theory, "reference": "closed form", "uncertainty": self.uncertainty, "status": status,
        }  # fmt: skip


def by_inverted_blocks(chain: Chain) -> float:
    """Tip's deflection by the recursion as usually written, D ← K_OO − K_OI (D + K_II)⁻¹ K_IO from a clamp on."""
    rows = chain.bodies.rows
    blocks = stiffness_matrices(chain.bodies, chain.bodies.reference())
    D = np.zeros((rows, rows))
    for e, K in enumerate(blocks):
        inboard, coupling, outboard = K[:rows, :rows], K[rows:, :rows], K[rows:, rows:]
        D = outboard - coupling @ np.linalg.inv(D + inboard) @ coupling.T if e else outboard
    return float((np.linalg.inv(D) @ chain.dead_load[:, -1])[1])


def _tried(road: Callable[[], tuple[float, str]]) -> tuple[float, str]:
    try:
        return road()
    except np.linalg.LinAlgError as error:
        return float("nan"), f"failed: {error}"


def _tip(rest: Solution) -> tuple[float, str]:
    name = rest.scene.beams[-1].name
    return float(rest.displacement(f"{name}.end")[-1, 1]), str(rest.status)


def two_beams(element: str, ratio: float, soft_inside: bool) -> Bar:
    """Two welded beams of 1 m, one `ratio` times stiffer than the other."""
    inner, outer = (E, E * ratio) if soft_inside else (E * ratio, E)
    bodies = (
        Beam("inner", (0.0, 0.0), (1.0, 0.0), SECTION, Material(inner, DENSITY)),
        Beam("outer", (1.0, 0.0), (2.0, 0.0), SECTION, Material(outer, DENSITY)),
    )
    I = SECTION.second_moment  # noqa: E741
    force = LOAD * E * I
    joints = (Clamp("inner.start"), Weld("inner.end", "outer.start"))
    scene = Scene("two beams", bodies, joints, (Force("outer.end", (0.0, force)),))
    # piecewise quadratic shear elements miss l³/12 of each element's share
    lost = 0.25 / ELEMENTS**2 if element == "shear" else 0.0
    exact = force / I * ((1.0 - lost) / (3.0 * outer) + (7.0 - lost) / (3.0 * inner))
    if element == "shear":
        exact += 2.0 * force / SECTION.area * (1.0 / inner + 1.0 / outer)
    slender = 1.0 / (ELEMENTS * HEIGHT)
    return Bar(
        f"{RATIO}, {'soft' if soft_inside else 'stiff'} inside", ratio, element, scene, exact,
        "P/I (1/3E₂ + 7/3E₁)" + (" less l³/12, with shear" if element == "shear" else ""),
        RIGHT_TO if element == "cable" else HEIGHT**2,
        EPS * 12.0 * slender**2 * ELEMENTS**2 * (ratio if soft_inside else 1.0),
    )  # fmt: skip


def slender_beam(element: str, slenderness: float) -> Bar:
    """A cantilever whose elements are so many times longer than high."""
    return _cantilever(SLENDER, slenderness, element, slenderness, 0.0)


def locked_beam(element: str, poisson: float) -> Bar:
    """A cantilever of some Poisson's ratio."""
    return _cantilever(NU, poisson, element, 100.0, poisson)


def _cantilever(what: str, value: float, element: str, slenderness: float, poisson: float) -> Bar:
    length = ELEMENTS * slenderness * HEIGHT
    material = Material(E, DENSITY, poisson)
    EI = E * SECTION.second_moment
    force = LOAD * EI / length**2
    body = Beam("beam", (0.0, 0.0), (length, 0.0), SECTION, material)
    scene = Scene("cantilever", (body,), (Clamp("beam.start"),), (Force("beam.end", (0.0, force)),))
    rounding = EPS * 12.0 * slenderness**2 * ELEMENTS**2
    if element == "cable":
        exact = timoshenko_tip_deflection(length, force, EI, np.inf)
        return Bar(what, value, element, scene, exact, "PL³/3EI", RIGHT_TO, rounding)
    factor = poisson_locking_factor(poisson)
    # c' must follow a linear d, so that curvature is constant in an element: of PL³/3EI, 1/(4n²) is missing
    stiffness = EI * factor / (1.0 - 0.25 / ELEMENTS**2)
    exact = timoshenko_tip_deflection(length, force, stiffness, material.lame[1] * SECTION.area)
    theory = "(1 − 1/(4n²)) PL³/3EI" + (" / locking" if poisson else "") + " + PL/GA"
    held = (HEIGHT / length) ** 2 * factor
    return Bar(what, value, element, scene, exact, theory, held, rounding * factor)


def bars(quick: bool) -> list[Bar]:
    """All beams."""
    every = 2 if quick else 1  # of a quick run every second, the last among them
    return [
        *(
            two_beams(e, r, inside)
            for e in ("cable", "shear")
            for inside in (False, True)
            for r in RATIOS[every - 1 :: every]
        ),
        *(slender_beam(e, s) for e in ("cable", "shear") for s in SLENDERNESS[every - 1 :: every]),
        *(locked_beam(e, nu) for e in ("cable", "shear") for nu in (POISSON[::3] if quick else POISSON)),
    ]


def parameters(quick: bool, runner: Runner) -> Part:
    """Static equilibria over ratios of stiffness, slendernesses and Poisson's ratios."""
    jobs = [
        Job(f"{b.what} {b.value:g}, {b.element}", {"what": b.what, "value": b.value}, partial(Bar.rows, b))
        for b in bars(quick)
    ]
    frame = pd.DataFrame(rows_of(jobs, runner))
    notes = (
        f"Clamped beams of {ELEMENTS} elements (two of as many in the ratio's rows) under a tip force of "
        f"PL²/EI = {LOAD:g}; measured: the tip's deflection, m. uncertainty: of the theory, relative.",
        "rounding: what rounding the entries of the stiffness may change, eps · 12 (l/h)² n², times the ratio where "
        "the soft beam carries the stiff one; nothing that solves with that matrix can be better in general.",
        "A shear element's curvature is constant, since its linear director cannot follow more: of PL³/3EI the part "
        "1/(4n²) is missing, besides Poisson locking; that it is held by the clamp adds what is left, of the order "
        "of (h/L)².",
    )
    table = Table("extremes_parameters", "Stiff beside soft, slender, nearly incompressible", frame, notes)
    return Part((table,), (_picture(frame),), tuple(_learned(frame)))


def _learned(frame: pd.DataFrame) -> list[str]:
    return [_ratio_learned(frame), _slender_learned(frame), _poisson_learned(frame)]


def _ratio_learned(frame: pd.DataFrame) -> str:
    mine = frame[frame["what"].str.startswith(RATIO) & (frame["road"] == NEWTON)]
    most = mine[mine["value"] == mine["value"].max()]
    held, carried = (most[most["what"].str.contains(f"{kind} inside")] for kind in ("stiff", "soft"))
    cable, shear = (
        carried[carried["element"] == element].to_dict("records")[0] for element in ("cable", "shear")
    )
    return (
        f"Stiffness: at a ratio of {cable['value']:.0e} a soft beam on a stiff one is at rest to "
        f"{abs(worst(held, 'difference')['difference']):.0e} of theory; a stiff one on a soft one with "
        f"cables is {_said(cable)}, with shear elements {_said(shear)}."
    )


def _slender_learned(frame: pd.DataFrame) -> str:
    last = frame[
        (frame["what"] == SLENDER) & (frame["value"] == frame.loc[frame["what"] == SLENDER, "value"].max())
    ]
    roads = {
        (element, road): worst(last[(last["element"] == element) & (last["road"] == road)], "difference")
        for element in ("cable", "shear")
        for road in ROADS
    }
    every = frame[(frame["what"] == SLENDER) & (frame["element"] == "shear") & (frame["road"] == INVERTED)]
    lost = every.loc[every["status"] == "digits lost", "value"].min()
    return (
        f"Slenderness: at l/h = {roads['shear', NEWTON]['value']:.0e} cables are {_said(roads['cable', NEWTON])} and "
        f"shear elements {_said(roads['shear', NEWTON])}; one solve by the recursion leaves "
        f"{abs(roads['shear', RECURSION]['difference']):.0e}, as banded Cholesky does "
        f"({abs(roads['shear', CHOLESKY]['difference']):.0e}): both eliminate component by component. Products with "
        f"inverted blocks, whose condition is (l/h)², lose twice as many digits: all that count from {lost:.0e} on."
    )


def _poisson_learned(frame: pd.DataFrame) -> str:
    mine = frame[(frame["what"] == NU) & (frame["road"] == NEWTON)]
    shear, cable = mine[mine["element"] == "shear"], mine[mine["element"] == "cable"]
    last = worst(shear, "value")
    return (
        f"Poisson: at ν = {last['value']:g} shear elements bend {poisson_locking_factor(last['value']):.0f} times too "
        f"stiffly, as (1 − ν)/((1 + ν)(1 − 2ν)) predicts, to {abs(worst(shear, 'difference')['difference']):.0e} for "
        f"every ν; cables do not know ν ({abs(worst(cable, 'difference')['difference']):.0e})."
    )


def _said(row: dict[Any, Any]) -> str:
    if str(row["status"]).startswith("ok"):
        return f"right to {abs(row['difference']):.0e}"
    return f"{str(row['status']).split(':')[0]}, as its status says"


def _picture(frame: pd.DataFrame) -> Picture:
    panels = (
        (f"{RATIO}, soft inside", "E₂/E₁, the stiff on the soft"),
        (SLENDER, "slenderness of an element l/h"),
    )

    def draw(figure: Figure) -> None:
        grid = figure.subplots(2, 2, sharey=True, sharex="col")
        for line, element in zip(grid, ("cable", "shear"), strict=True):
            for axes, (what, label) in zip(line, panels, strict=True):
                _draw(axes, frame[(frame["what"] == what) & (frame["element"] == element)], element)
                axes.set_xlabel(label if element == "shear" else "")
            line[0].set_ylabel("off theory, relative")
        legend_below(figure, list(grid.ravel()), 3)

    caption = (
        "The tip's deflection at rest against theory. One solve by the recursion keeps as many digits as banded "
        "Cholesky and as rounding (dotted) allows; Newton's corrections win some back. With inverted blocks "
        "shear elements would lose them all."
    )
    return picture("extremes_parameters", caption, draw, (7.6, 5.6))


def _draw(axes: Axes, rows: pd.DataFrame, element: str) -> None:
    for i, road in enumerate(ROADS):
        mine = rows[rows["road"] == road].sort_values("value")
        axes.plot(
            mine["value"], mine["difference"].abs().clip(1e-16, 2.0), "osX^D"[i], linestyle="-", label=road,
            color=PALETTE[(0, 4, 3, 2, 1)[i]], markerfacecolor="none", markersize=7.5 - i, linewidth=1.1,
        )  # fmt: skip
    mine = rows[rows["road"] == NEWTON].sort_values("value")
    axes.plot(
        mine["value"],
        mine["rounding"].clip(upper=2.0),
        ":",
        color=PALETTE[7],
        label="rounding of the stiffness",
    )
    axes.set(xscale="log", yscale="log", title=f"{element} elements", ylim=(1e-16, 5.0))
