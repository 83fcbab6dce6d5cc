"""Scenes at rest."""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq
from scipy.special import ellipk, ellipkinc

import anctmm as at
from anctmm.errors import SolverError
from anctmm.results.solution import Solution
from reference.exact import Catenary
from studies.gallery.drawing import BLUE, FAINT, GREEN, RED, bodies, note, plane
from studies.gallery.entry import Entry, Number, Script
from studies.report.plots import INK


def rest(scene: at.Scene, **options: Any) -> Solution:
    """Equilibria of a scene.

    Raises
    ------
    SolverError
        If the search does not end well.
    """
    found = at.solve_static(scene, **options)
    if not found.status.ok:
        raise SolverError(f"{scene.name}: {found.status}")
    return found


# --- catenary ----------------------------------------------------------------------------------------------


def exact_catenary(script: Script) -> Catenary:
    area, fibre = script["round_"].area, script["fibre"]
    return Catenary((80.0, 0.0), 100.0, 9.81 * fibre.density * area, fibre.E * area)


def sag(script: Script, found: Solution) -> Number:
    lowest = float(found.position("left.end")[-1, 1])
    known = float(exact_catenary(script).position(0.5)[1])
    source = "extensible catenary, Irvine 1981, section 2.3"
    return Number("lowest point, y", "m", lowest, known, 2e-3, source)


def draw_catenary(figure: Figure, script: Script, found: Solution) -> None:
    axes = figure.subplots()
    bodies(axes, found, [0, len(found.t) - 1], ("#a9cfe8", BLUE))
    exact = exact_catenary(script)
    axes.plot(
        *np.transpose([exact.position(x) for x in np.linspace(0.0, 1.0, 21)]),
        "o",
        color=RED,
        ms=4.5,
        mfc="none",
        zorder=5,
    )
    plane(axes)
    note(axes, 27.0, -30.0, "as drawn", color="#5a9cc8", ha="right", va="center")
    note(axes, 40.0, -21.0, "at rest; circles: exact", color=BLUE, ha="center", va="bottom")


# --- column ------------------------------------------------------------------------------------------------

PUSHES = (0.05, 0.01, 0.001)


def tip_angle(force: float, lean: float) -> float:
    """Angle of an elastica's tip to a force that leans from the axis, rad: K(k) − F(φ, k) = √(F L²/EI)."""

    def excess(angle: float) -> float:
        k = np.sin(angle / 2.0)
        return float(ellipk(k**2) - ellipkinc(np.arcsin(np.sin(lean / 2.0) / k), k**2) - np.sqrt(force))

    return float(brentq(excess, lean * (1.0 + 1e-9), 3.1))


def buckle(script: Script) -> dict[float, Solution]:
    return {push: rest(script["column"](push), mesh=32, path="arclength") for push in PUSHES}


def bend(script: Script, found: dict[float, Solution]) -> Number:
    push, load = PUSHES[0], 1.1
    lean = float(np.arctan2(push, load))
    known = np.degrees(tip_angle(np.pi**2 / 4.0 * np.hypot(push, load), lean) - lean)
    value = -float(np.degrees(found[push].angle("column.end")[-1]))
    return Number(
        "turn of the tip", "°", value, float(known), 1e-2, "Euler's elastica, by elliptic integrals"
    )


def draw_column(figure: Figure, script: Script, found: dict[float, Solution]) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[0.8, 1.2])
    largest = found[PUSHES[0]]
    turns = -np.degrees(largest.angle("column.end"))
    bodies(left, largest, [int(np.abs(turns - a).argmin()) for a in (0.0, 15.0, 30.0, 45.0, turns[-1])])
    plane(left, "shapes")
    for (push, path_of), colour in zip(found.items(), (BLUE, GREEN, FAINT), strict=True):
        angle = -np.degrees(path_of.angle("column.end"))
        right.plot(angle, 1.1 * path_of.t, color=colour, label=f"{100.0 * push:g} %")
    perfect = np.radians(np.linspace(0.01, 62.0, 60))
    right.plot(
        np.degrees(perfect), (2.0 * ellipk(np.sin(perfect / 2.0) ** 2) / np.pi) ** 2, color=RED,
        ls=(0, (4, 2)), lw=1.2, label="none, exact",
    )  # fmt: skip
    right.set(
        xlabel="turn of the tip (°)",
        ylabel="load / Euler's force",
        ylim=(0.0, 1.2),
        title="path of equilibria",
    )
    right.legend(loc="lower right", labelspacing=0.25, title="push aside / Euler's force")


# --- snap-through ------------------------------------------------------------------------------------------


def load_of(script: Script, height: Any) -> Any:
    """Load that holds the top of two bars at a height, N."""
    span, rise = script["SPAN"], script["RISE"]
    stiffness = script["wood"].E * script["section"].area
    return 2.0 * stiffness * height * (1.0 / np.hypot(span, height) - 1.0 / np.hypot(span, rise))


def limit(script: Script, found: Solution) -> Number:
    span, whole = script["SPAN"], float(np.hypot(script["SPAN"], script["RISE"]))
    bar = (span**2 * whole) ** (1.0 / 3.0)  # length of a bar where the load is the largest
    known = float(load_of(script, np.sqrt(bar**2 - span**2)))
    first = int(found.t.argmin())
    value = script["LOAD"] * float(found.t[:first].max())
    return Number(
        "load at which they snap", "N", value, known, 1e-6 * known, "largest of 2 EA y (1/l − 1/l₀)"
    )


def draw_snap(figure: Figure, script: Script, found: Solution) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.2])
    y = found.position("left.end")[:, 1]
    chosen = [int(np.abs(y - h).argmin()) for h in (0.1, 0.057, 0.0, -0.057, y[-1])]
    bodies(left, found, chosen)
    left.set(xlabel="x (m)", ylabel="y (m), four times as large", title="five equilibria", ylim=(-0.15, 0.15))
    left.set_aspect(4.0)
    load = 1e-3 * script["LOAD"] * found.t
    stable = np.asarray(found.stable)
    right.axhline(0.0, color=FAINT, lw=0.8)
    right.plot(1e3 * y, np.where(stable, load, np.nan), color=BLUE, lw=2.2, label="stable")
    right.plot(1e3 * y, np.where(stable, np.nan, load), color=BLUE, lw=1.3, ls=":", label="unstable")
    heights = np.linspace(y[-1], 0.1, 19)
    right.plot(
        1e3 * heights, 1e-3 * load_of(script, heights), "o", color=RED, ms=4, mfc="none", label="exact"
    )
    right.invert_xaxis()
    right.set(xlabel="height of the top (mm)", ylabel="load (kN)", title="path of equilibria")
    right.legend(loc="upper center", labelspacing=0.25, bbox_to_anchor=(0.56, 1.0))


# --- bridge ------------------------------------------------------------------------------------------------


def chord(script: Script, found: Solution) -> Number:
    value = 1e-3 * float(found.section_force(("bottom1", 0.5))[-1, 0])
    known = 1e-3 * 2.0 * script["LOAD"] / np.sqrt(3.0)
    return Number(
        "force in the middle bar below", "kN", value, float(known), 1e-3 * known, "a cut through three bars"
    )


def draw_bridge(figure: Figure, script: Script, found: Solution) -> None:
    axes = figure.subplots()
    forces = {bar: 1e-3 * float(found.section_force((bar, 0.5))[-1, 0]) for bar in script["bars"]}
    most = max(map(abs, forces.values()))
    shades = mpl.colors.LinearSegmentedColormap.from_list("sign", [RED, "#c8c8ce", BLUE])
    for bar, (start, end) in script["bars"].items():
        (x0, y0), (x1, y1) = start, end
        axes.plot(
            [x0, x1], [y0, y1], color=shades(0.5 + 0.5 * forces[bar] / most), lw=5.0, solid_capstyle="round"
        )
        shown = f"{forces[bar]:+.1f}".replace("-", "−") if abs(forces[bar]) > 0.05 else "0"
        note(axes, 0.5 * (x0 + x1), 0.5 * (y0 + y1), shown, ha="center", va="center")
    for places in (script["below"], script["above"]):
        axes.plot(*np.transpose(places), "o", color=INK, ms=5, zorder=5)
    for x, y in script["below"][1:3]:
        axes.annotate(
            "20 kN", (x, y - 0.12), (x, y - 0.95), ha="center", va="top", fontsize=8.5,
            arrowprops={"arrowstyle": "<|-", "color": INK, "lw": 1.2},
        )  # fmt: skip
    axes.plot(0.0, -0.12, "^", color=INK, ms=9)
    axes.plot(6.0, -0.12, "o", color=INK, ms=8, mfc="none")
    plane(axes, "forces in the bars (kN): pulled +, pushed −")
    axes.set_aspect("equal", adjustable="box")
    axes.set(ylim=(-1.35, 2.1), xlim=(-0.6, 6.6))


EQUILIBRIA = (
    Entry(
        "catenary", "Catenary",
        "Two straight halves of a rope, drawn as a V, have almost no stiffness against their weight. "
        "The stabilised search finds the catenary.",
        lambda script: rest(script.case.scene, mesh=16), sag, draw_catenary,
    ),
    Entry(
        "column", "Column",
        "A slender column bends little below Euler's load, and strongly above it. "
        "The smaller the lateral load, the sharper the transition.",
        buckle, bend, draw_column,
    ),
    Entry(
        "snap_through", "Snap-through",
        "Two bars carry a load until they snap through. The arc-length method follows the whole path, "
        "and says which of its equilibria are stable.",
        lambda script: rest(script.case.scene, mesh=1, path="arclength"), limit, draw_snap,
    ),
    Entry(
        "bridge", "Bridge",
        "Eleven bars with pins, up to four at one place. Their section forces are those of the method of joints.",
        lambda script: rest(script.case.scene, mesh=1), chord, draw_bridge, 3.0,
    ),
)  # fmt: skip
