"""Beams rolled into two circles, large swings, inverted elements: what is exact, converges, or can be compared."""

from dataclasses import dataclass, replace
from functools import partial
from math import log2, pi
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.integrators import zhai as explicit
from anctmm.integrators.stability import highest_frequency, zhai_limit
from anctmm.integrators.statics import solve_static
from anctmm.model.drives import Quintic
from anctmm.model.scene import Beam, Clamp, Material, Pin, Probe, Scene
from anctmm.model.sections import Rectangle
from anctmm.results.fields import HermiteField
from anctmm.results.metrics import history_error
from anctmm.results.solution import Solution
from anctmm.solve import solve
from reference.exact import moment_arc
from studies.engine.runner import Runner
from studies.engine.tables import Table
from studies.extremes.march import DISTURBANCE, ChainAt, disturbed
from studies.extremes.parts import EPS, Job, Part, Row, rows_of, worst
from studies.extremes.places import HERE
from studies.report.plots import INK, PALETTE, Picture, legend_below, picture
from studies.scenes import (
    FOUR_BAR_PROBES,
    LENGTH,
    MATERIAL,
    SECTION,
    cantilever_end_moment,
    cantilever_fall,
    four_bar,
    four_bar_moment,
)

Array = NDArray[np.float64]

# --- two circles ----------------------------------------------------------------------------------------------

TWO_CIRCLES = 4.0 * pi
ROLLED = {"cable": (4, 8, 16, 32, 64, 128, 256), "shear": (16, 32, 64, 128, 256, 512)}
QUICK_ROLLED = {"cable": (16, 32, 64), "shear": (64, 128)}
LOAD_STEPS = 16


def rolled(element: str, elements: int) -> list[Row]:
    """A cantilever under 4πEI/L: distance of its nodes from two full circles, of its length."""
    rest = solve_static(
        cantilever_end_moment(TWO_CIRCLES).scene, mesh=elements, element=element, load_steps=LOAD_STEPS
    )
    EI = MATERIAL.E * SECTION.second_moment
    field = rest.fields["beam"]
    assert isinstance(field, HermiteField)
    nodes = field.coordinates[-1, :, 0]
    exact = [
        moment_arc(LENGTH, EI, TWO_CIRCLES * EI / LENGTH, s) for s in np.linspace(0.0, 1.0, elements + 1)
    ]
    height = (12.0 * SECTION.second_moment / SECTION.area) ** 0.5
    curved = (height * TWO_CIRCLES / LENGTH) ** 2
    return [{
        "element": element, "elements": elements, "degrees_of_an_element": 720.0 / elements,
        "measured": float(np.linalg.norm(nodes - np.array(exact), axis=1).max() / LENGTH), "predicted": 0.0,
        "theory": "two circles", "reference": "closed form",
        "uncertainty": EPS if element == "cable" else curved, "status": str(rest.status), "nodes": nodes,
    }]  # fmt: skip


# --- comparable or not ----------------------------------------------------------------------------------------

#: A disturbance that has grown by this is no longer that of the mesh or of rounding alone.
LOST = 1e3
#: Step of the implicit runs, the same on all meshes: what differs is the mesh.
DT = 5e-4
#: Part of the largest stable step in explicit runs.
FRACTION = 0.3
OUTPUTS = 240


@dataclass(frozen=True)
class Motion:
    """A scene with its probes, its length in time, and meshes: coarse, fine, finest (the reference)."""

    name: str
    scene: Scene
    probes: tuple[Probe, ...]
    t_end: float
    meshes: tuple[Any, ...]

    def rows(self) -> list[Row]:
        """Growth of a disturbance, and the mesh error as long as that leaves it comparable."""
        t, growth = self.growth()
        beyond = np.flatnonzero(growth > LOST)
        horizon = float(t[beyond[0]]) if beyond.size else self.t_end
        coarse, fine, finest = (self.implicit(mesh) for mesh in self.meshes)
        status = next((str(s.status) for s in (coarse, fine, finest) if not s.status.ok), "ok")
        known = finest.t <= horizon * (1.0 + EPS * len(finest.t))
        return [{
            "scene": self.name, "t_end": self.t_end, "growth": float(growth.max()), "comparable_until": horizon,
            "verdict": f"not comparable beyond t = {horizon:.3g} s" if beyond.size else "comparable to the end",
            "rate": _rate(t, growth) if beyond.size else np.nan,
            "measured": self.error(coarse, finest, known), "whole_run": self.error(coarse, finest, known | True),
            "elements": _label(self.meshes[0]), "reference": f"cables {_label(self.meshes[2])}, same step",
            "uncertainty": self.error(fine, finest, known), "status": status, "history": (t, growth),
        }]  # fmt: skip

    def growth(self) -> tuple[Array, Array]:
        """Times, and how many times a random disturbance of the start has grown by then, by two explicit runs."""
        run = Discretisation(mesh=self.meshes[0], integrator="zhai", dt=1e-3, t_end=1e-3)
        chain = Chain(self.scene, run)
        dt = FRACTION * zhai_limit(0.5, 0.5) / highest_frequency(chain)
        stride = max(1, round(self.t_end / OUTPUTS / dt))
        dt = self.t_end / (OUTPUTS * stride)
        run = replace(run, dt=dt, t_end=self.t_end, output_dt=stride * dt)
        q = chain.bodies.reference()
        one, two = (explicit.integrate(ChainAt(self.scene, run, at)) for at in (q, disturbed(chain, q)))
        count = min(len(one.t), len(two.t))
        away = [
            np.linalg.norm(one.position(*place)[:count] - two.position(*place)[:count], axis=1)
            for place in map(self.scene.probe, self.probes)
        ]
        return one.t[:count], np.max(away, axis=0) / (DISTURBANCE * chain.length)

    def implicit(self, mesh: Any) -> Solution:
        """The motion by generalized-α on a mesh."""
        return solve(
            self.scene, mesh=mesh, dt=DT, t_end=self.t_end, output_dt=20 * DT, newton_tolerance=1e-11
        )

    def error(self, found: Solution, reference: Solution, known: NDArray[np.bool_]) -> float:
        """The largest error over the probes at those of the outputs that are known, as everywhere in the studies."""
        if len(found.t) < len(reference.t) or not reference.status.ok:
            return float("nan")
        return max(
            history_error(found.displacement(p)[known], reference.displacement(p)[known]) for p in self.probes
        )


def _rate(t: Array, growth: Array) -> float:
    """Rate of exponential growth up to where it is lost, 1/s."""
    end = int(np.flatnonzero(growth > LOST)[0])
    rising = slice(max(1, end // 4), end + 1)
    return float(np.polyfit(t[rising], np.log(np.maximum(growth[rising], 1e-3)), 1)[0]) if end > 4 else np.nan


def _label(mesh: Any) -> str:
    return "/".join(str(n) for n in mesh.values()) if isinstance(mesh, dict) else str(mesh)


def _meshes(*coarse: int) -> tuple[dict[str, int], ...]:
    return tuple(
        dict(zip(("crank", "coupler", "follower"), (k * n for n in coarse), strict=True)) for k in (1, 2, 4)
    )


def motions(quick: bool) -> list[Motion]:
    """The base scenes, and those that are extremes of them."""
    base, bars = four_bar(), _meshes(2, 8, 2)
    fast = replace(
        base.scene, name="four-bar, T = 1 s",
        joints=(Clamp("crank.start", angle=Quintic(turn=2.0 * pi, duration=1.0)), *base.scene.joints[1:]),
    )  # fmt: skip
    heavy = replace(base.scene, name="four-bar with gravity", gravity=(0.0, -9.81))
    falling, fall, moment = HERE.scene(), cantilever_fall(), four_bar_moment()
    found = [
        Motion("four-bar, T = 1 s", fast, FOUR_BAR_PROBES, 1.4, bars),
        Motion("pair of pinned beams, falling", falling, ("b.end",), 4.0, (8, 16, 32)),
    ]
    if quick:
        return found
    return [
        Motion("four-bar", base.scene, base.probes, base.duration, bars),
        Motion("four-bar, moment", moment.scene, moment.probes, moment.duration, bars),
        Motion("falling cantilever", fall.scene, fall.probes, fall.duration, (8, 16, 32)),
        found[0],
        Motion("four-bar with gravity", heavy, FOUR_BAR_PROBES, base.duration, bars),
        found[1],
    ]


# --- inside out -----------------------------------------------------------------------------------------------

#: Speed of the end that is shot into its support, m/s, and outputs in the time it takes.
SPEED, FLIGHT_OUTPUTS = 1.0, 100


def inside_out(element: str, integrator: str) -> list[Row]:
    """A bar so soft that it flies: all its elements turn inside out when its end passes its start, at L/c."""
    soft = Material(E=1e-6, density=1.0)
    bar = Beam("bar", (0.0, 0.0), (1.0, 0.0), Rectangle(0.1, 0.1), soft, velocity=lambda s: (-SPEED * s, 0.0))
    interval = 1.0 / (SPEED * FLIGHT_OUTPUTS)
    found = solve(
        Scene("crushed", (bar,), (Pin("bar.start"),)), mesh=4, element=element, integrator=integrator,
        dt=interval / 10.0, t_end=2.0 / SPEED, output_dt=interval,
    )  # fmt: skip
    status = found.status
    sided = element == "shear"
    return [{
        "element": element, "integrator": integrator, "elements": 4,
        "measured": status.time if status.time is not None else np.nan, "predicted": 1.0 / SPEED if sided else np.nan,
        "theory": "L/c" if sided else "an axis has no sides", "body": status.body or "-",
        "where": "-" if status.element is None else str(status.element), "reference": "free flight",
        "uncertainty": interval, "status": str(status),
    }]  # fmt: skip


# --- the part -------------------------------------------------------------------------------------------------


def deformation(quick: bool, runner: Runner) -> Part:
    """Two circles, wild motions and inverted elements."""
    meshes = QUICK_ROLLED if quick else ROLLED
    circles = rows_of(
        [
            Job(f"two circles, {n} {e}", {"element": e, "elements": n}, partial(rolled, e, n))
            for e in meshes
            for n in meshes[e]
        ],
        runner,
    )
    moving = rows_of(
        [Job(f"growth, {m.name}", {"scene": m.name}, partial(Motion.rows, m)) for m in motions(quick)], runner
    )
    turned = rows_of(
        [
            Job(f"inside out, {e}, {i}", {"element": e, "integrator": i}, partial(inside_out, e, i))
            for e in ("shear", "cable")
            for i in ("zhai", "generalized-alpha")
        ],
        runner,
    )
    roll = _without(circles, "nodes")
    roll["order"] = _orders(roll)
    tables = (
        Table("extremes_rolled", "Rolled into two full circles", roll, (
            "An end moment of 4πEI/L; measured: the farthest node from the exact circle of two turns, of the length. "
            "order: from the mesh before, of half as many elements (theory: 4 of cables, 2 of shear elements).",
            "uncertainty: of shear elements (h/R)², as their Green's strains bend to a circle of another radius.",
        )),
        Table("extremes_growth", "What can be compared until when", _without(moving, "history"), (
            f"growth: how many times a random disturbance of 1e-10 of the start has grown, by two explicit runs; "
            f"beyond the time at which it passes {LOST:g} a difference says nothing of the mesh.",
            "measured: error of the mesh up to that time, as in the other studies; whole_run: the same to the end. "
            f"All runs are implicit with steps of {DT:g} s. uncertainty: of the next finer mesh.",
        )),
        Table("extremes_inside_out", "Elements turned inside out", _without(turned, ""), (
            "A bar of E = 1e-6 Pa is shot through its support at 1 m/s; measured (s): when the run says so, and where; "
            "uncertainty: the interval of output.",
        )),
    )  # fmt: skip
    learned = (_rolled_learned(roll), _growth_learned(tables[1].frame), _inside_learned(tables[2].frame))
    return Part(tables, (_rolled_picture(circles), _growth_picture(moving)), learned)


def _without(rows: list[Row], column: str) -> pd.DataFrame:
    return pd.DataFrame([{k: v for k, v in row.items() if k != column} for row in rows])


def _orders(roll: pd.DataFrame) -> list[float]:
    orders, before = [], None
    for row in roll.to_dict("records"):
        same = (
            before is not None
            and before["element"] == row["element"]
            and 2 * before["elements"] == row["elements"]
        )
        orders.append(log2(before["measured"] / row["measured"]) if same and before else float("nan"))
        before = row
    return orders


def _rolled_learned(roll: pd.DataFrame) -> str:
    cable = worst(roll[roll["element"] == "cable"], "elements")
    shear = worst(roll[roll["element"] == "shear"], "elements")
    return (
        f"Two circles: {cable['elements']} cables close them to {cable['measured']:.0e} of the length, converging with "
        f"order {cable['order']:.2f} (theory 4); {shear['elements']} shear elements to {shear['measured']:.0e}, where "
        f"their own strains may differ by {shear['uncertainty']:.0e}."
    )


def _growth_learned(frame: pd.DataFrame) -> str:
    calm = frame[frame["verdict"].str.startswith("comparable")]
    wild = frame[~frame["verdict"].str.startswith("comparable")]
    meshes = ", ".join(
        f"{row['measured']:.2g} ({row['scene']}, {row['elements']})" for row in calm.to_dict("records")
    )
    said = (
        f"Sensitivity: in {len(calm)} of {len(frame)} motions a disturbance of 1e-10 grows {calm['growth'].max():.0f} "
        f"times at most, so that errors are those of the mesh: {meshes}"
    )
    for row in wild.to_dict("records"):
        said += (
            f"; '{row['scene']}' is {row['verdict']} (growth {row['rate']:.1f}/s): its error is {row['measured']:.2g} "
            f"before and {row['whole_run']:.2g} over the whole run"
        )
    return said + "."


def _inside_learned(frame: pd.DataFrame) -> str:
    shear, cable = (frame[frame["element"] == element] for element in ("shear", "cable"))
    named = worst(shear, "measured")
    silent = (
        "is not noticed, as an axis has no sides" if cable["measured"].isna().all() else "is noticed, too"
    )
    return (
        f"Inside out: a shear element that turns inside out is named (element {named['where']} of {named['body']!r}) "
        f"at t = {named['measured']:.4g} s, predicted {named['predicted']:.4g} s; a cable that passes through "
        f"itself {silent}."
    )


def _rolled_picture(rows: list[Row]) -> Picture:
    whole = [row for row in rows if "nodes" in row]

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        turn = np.linspace(0.0, 2.0 * pi, 200)
        radius = LENGTH / TWO_CIRCLES
        left.plot(
            radius * np.sin(turn), radius * (1.0 - np.cos(turn)), color=INK, linewidth=0.8, label="exact"
        )
        cables = [row for row in whole if row["element"] == "cable" and row["measured"] < 0.2][:3]
        for i, row in enumerate(cables):
            left.plot(
                *row["nodes"].T, "os^"[i], color=PALETTE[i], markersize=4.0, label=f"{row['elements']} cables"
            )
        left.set(xlabel="x (m)", ylabel="y (m)")
        left.set_aspect("equal", adjustable="datalim")
        left.legend(fontsize=7.5, loc="center")
        for i, element in enumerate(("cable", "shear")):
            mine = [row for row in whole if row["element"] == element]
            right.plot(
                [r["elements"] for r in mine],
                [r["measured"] for r in mine],
                "os"[i] + "-",
                color=PALETTE[i],
                label=element,
            )
        right.set(
            xscale="log", yscale="log", xlabel="elements", ylabel="distance from the circle, of the length"
        )
        right.legend()

    caption = (
        "A beam rolled into two full circles by an end moment. Left: nodes of cables; those of a coarse mesh lie "
        "beside the circle. Right: the farthest node against the number of elements."
    )
    return picture("extremes_rolled", caption, draw, (7.6, 3.8))


def _growth_picture(rows: list[Row]) -> Picture:
    whole = [row for row in rows if "history" in row]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for i, row in enumerate(whole):
            t, growth = row["history"]
            axes.plot(
                t,
                np.maximum(growth, 1e-3),
                color=PALETTE[i % len(PALETTE)],
                label=row["scene"],
                linewidth=1.2,
            )
        axes.axhline(LOST, color=INK, linewidth=0.8, linestyle=(0, (2, 2)))
        axes.annotate(
            "not comparable above",
            (0.99, LOST),
            xycoords=("axes fraction", "data"),
            xytext=(0, 3),
            textcoords="offset points",
            ha="right",
            va="bottom",
            fontsize=7.5,
        )
        axes.set(yscale="log", xlabel="t (s)", ylabel="growth of a disturbance of 1e-10")
        legend_below(figure, [axes], 3)

    caption = (
        "How a random disturbance of 1e-10 grows. Where it stays below the line, a difference between meshes is an "
        "error of the mesh; beyond it, it is not."
    )
    return picture("extremes_growth", caption, draw, (7.0, 4.2))
