"""A million steps, a hundred turns of the crank: what drifts."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import pi
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.integrators.stability import highest_frequency, zhai_limit
from anctmm.model.drives import Quintic
from anctmm.model.scene import Clamp, Scene
from anctmm.results.fields import HermiteField
from anctmm.results.solution import Solution
from anctmm.solve import solve
from reference import global_dae
from studies.engine.runner import Runner
from studies.engine.tables import Table
from studies.extremes.parts import EPS, Job, Part, Row, rows_of, worst
from studies.report.plots import PALETTE, Picture, legend_below, picture
from studies.scenes import cantilever_fall, four_bar

Array = NDArray[np.float64]

MILLION, QUICK_STEPS = 1_000_000, 20_000
OUTPUTS = 500
#: Parts of the largest stable step.
FRACTIONS = (0.1, 0.2, 0.4, 0.7)
#: Gravity of the two motions, of 9.81 m/s²: a swing of a hundredth is nearly linear, the full one cracks like a whip.
MOTIONS = {"small swing": 0.001, "wild swing": 1.0}
IMPLICIT_DT = 1e-4
MESH = {"crank": 2, "coupler": 8, "follower": 2}
PINS = (("crank", "coupler"), ("coupler", "follower"))
OURS, PROJECTED, FREE = "anctmm", "global DAE, projected", "global DAE, not stabilised"


# --- energy ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Swing:
    """A cantilever of eight elements that swings under gravity for so many steps."""

    motion: str
    element: str
    integrator: str
    fraction: float
    radius: float
    steps: int

    @property
    def label(self) -> str:
        """Tells it from every other."""
        return (
            f"energy, {self.motion}, {self.element}, {self.integrator}, {self.fraction:g} of the limit, "
            f"ρ∞ {self.radius:g}, {self.steps} steps"
        )

    def rows(self) -> list[Row]:
        """Its energy error in the first and the last tenth."""
        base = cantilever_fall().scene
        scene = replace(base, gravity=(0.0, MOTIONS[self.motion] * base.gravity[1]))
        probe = Discretisation(mesh=8, element=self.element, dt=1e-3)
        limit = zhai_limit(0.5, 0.5) / highest_frequency(Chain(scene, probe))
        dt = self.fraction * limit if self.integrator == "zhai" else IMPLICIT_DT
        found = solve(
            scene, mesh=8, element=self.element, integrator=self.integrator, dt=dt, t_end=self.steps * dt,
            output_dt=self.steps // OUTPUTS * dt, spectral_radius=self.radius, newton_tolerance=1e-12,
        )  # fmt: skip
        error = np.abs(found.energy.balance) / found.energy.kinetic.max()
        tenth = max(1, len(error) // 10)
        first, last = float(error[:tenth].max()), float(error[-tenth:].max())
        symplectic = self.integrator == "zhai"
        return [{
            "motion": self.motion, "element": self.element, "integrator": self.integrator,
            "of_limit": self.fraction if symplectic else np.nan,
            "spectral_radius": np.nan if symplectic else self.radius,
            "dt": dt, "steps": self.steps, "t_end": self.steps * dt, "first_tenth": first, "measured": last,
            "predicted": first if symplectic else np.nan,
            "theory": "symplectic: as in the first tenth" if symplectic else "none",
            "reference": "energy at the start", "uncertainty": EPS * self.steps**0.5, "status": str(found.status),
            "history": (found.t, error),
        }]  # fmt: skip


def swings(quick: bool) -> list[Swing]:
    """All runs."""
    steps = QUICK_STEPS if quick else MILLION
    explicit = [
        Swing(motion, element, "zhai", fraction, 1.0, steps)
        for motion in MOTIONS
        for element in ("cable", "shear")
        for fraction in (FRACTIONS[2:3] if quick else FRACTIONS)
    ]
    implicit = [
        Swing(motion, "cable", "generalized-alpha", np.nan, radius, steps)
        for motion in MOTIONS
        for radius in ((0.9,) if quick else (1.0, 0.9))
    ]
    return explicit + implicit


# --- joints and drive -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Turning:
    """The four-bar's crank turned so often in so long, by one solver."""

    solver: str
    integrator: str
    element: str
    turns: int
    duration: float
    dt: float

    @property
    def drive(self) -> Quintic:
        """Of the crank."""
        return Quintic(turn=2.0 * pi * self.turns, duration=self.duration)

    @property
    def steps(self) -> int:
        """Number of steps."""
        return round(self.duration / self.dt)

    @property
    def label(self) -> str:
        """Tells it from every other."""
        return f"{self.turns} turns in {self.duration:g} s, {self.steps} steps, {self.solver}, {self.element}"

    def scene(self) -> Scene:
        """The four-bar with this drive."""
        base = four_bar().scene
        return replace(base, joints=(Clamp("crank.start", angle=self.drive), *base.joints[1:]))

    def solve(self) -> Solution:
        """Its motion."""
        options: dict[str, Any] = {
            "mesh": MESH, "element": self.element, "integrator": self.integrator, "dt": self.dt,
            "t_end": self.duration, "output_dt": self.steps // OUTPUTS * self.dt,
        }  # fmt: skip
        solvers: dict[str, Callable[[], Solution]] = {
            OURS: lambda: solve(self.scene(), **options),
            PROJECTED: lambda: global_dae.solve(self.scene(), stabilization="projection", **options),
            FREE: lambda: global_dae.solve(self.scene(), stabilization="none", **options),
        }
        return solvers[self.solver]()

    def rows(self) -> list[Row]:
        """What its joints and its drive have drifted by."""
        found = self.solve()
        gaps = np.max([_gap(found, one, two) for one, two in PINS], axis=0)
        drive = _off_drive(found, self.drive)
        predicted = self.predicted_drift()
        return [{
            "solver": self.solver, "integrator": self.integrator, "element": self.element, "turns": self.turns,
            "dt": self.dt, "steps": self.steps, "gap": float(gaps.max()), "predicted_gap": 0.0,
            "measured": float(drive.max()), "predicted": float(predicted.max()),
            "theory": "truncation of the integrated drive" if self.solver == FREE else "prescribed",
            "reference": "θ(t)", "uncertainty": EPS,
            "balance": float(np.abs(found.energy.balance).max() / found.energy.kinetic.max()),
            "status": str(found.status), "history": (found.t, drive, gaps, predicted),
        }]  # fmt: skip

    def predicted_drift(self) -> Array:
        """How far the crank's direction is off at the outputs if its acceleration is integrated, not prescribed.

        Where Φ q̈ = b̈(t) holds at each step, Φ q follows the integrator's own recursion on b̈, whatever the rest does.
        """
        if self.solver != FREE:
            return np.zeros(1)
        h, n = self.dt, np.arange(self.steps + 1)
        theta, rate, acceleration = self.drive(n * (self.duration / self.steps))
        direction = np.exp(1.0j * theta)
        a = (1.0j * acceleration - rate**2) * direction
        before = np.concatenate([a[:1], a[:-1]])
        v = 1.0j * rate[0] * direction[0] + h * np.concatenate(
            [[0.0], np.cumsum(1.5 * a - 0.5 * before)[:-1]]
        )
        way = h * v + h * h * (a - 0.5 * before)
        q = direction[0] + np.concatenate([[0.0], np.cumsum(way)[:-1]])
        return np.asarray(np.abs(q - direction)[:: self.steps // OUTPUTS])


def turnings(quick: bool) -> list[Turning]:
    """All runs: a million explicit steps of the crank by every solver, and a hundred turns by implicit ones."""
    many = (1, 0.4) if quick else (10, 20.0)
    runs = [Turning(solver, "zhai", "cable", *many, 2e-5) for solver in (OURS, PROJECTED, FREE)]
    turns, duration = (2, 20.0) if quick else (100, 1000.0)
    runs += [Turning(OURS, "generalized-alpha", e, turns, duration, 1e-3) for e in ("cable", "shear")]
    return runs


def _gap(found: Solution, one: str, two: str) -> Array:
    """Largest distance along an axis between the two ends of a pin, at each output, m."""
    return np.asarray(np.abs(found.position(one, 1.0) - found.position(two, 0.0)).max(axis=1))


def _off_drive(found: Solution, drive: Quintic) -> Array:
    """Distance of the crank's gradient from the direction prescribed, at each output."""
    field = found.fields["crank"]
    assert isinstance(field, HermiteField)
    theta = drive(found.t)[0]
    gradient = field.coordinates[:, 0, 1]
    return np.asarray(np.hypot(gradient[:, 0] - np.cos(theta), gradient[:, 1] - np.sin(theta)))


# --- the part -------------------------------------------------------------------------------------------------


def time(quick: bool, runner: Runner) -> Part:
    """Drift of energy, joints and drive."""
    energy = rows_of(
        [Job(s.label, {"motion": s.motion}, partial(Swing.rows, s)) for s in swings(quick)], runner
    )
    joints = rows_of(
        [Job(t.label, {"solver": t.solver}, partial(Turning.rows, t)) for t in turnings(quick)], runner
    )
    tables = (
        Table("extremes_energy", "Energy over many steps", _frame(energy), (
            "A cantilever of eight elements swings under 9.81 m/s² (wild) or a thousandth of it (small). first_tenth, "
            "measured: largest energy error in the first and the last tenth of the run, of its largest kinetic energy.",
            "Zhai's integrator with ψ = φ = ½ is Störmer and Verlet's: symplectic, and its energy error is bounded "
            "where steps are short against the frequencies that occur; a wild swing raises them on the way.",
        )),
        Table("extremes_joints", "Joints and drive over many steps and turns", _frame(joints), (
            "The four-bar, 2/8/2 elements. gap (m): of the pins' two ends; measured: distance of the crank's "
            "direction at its clamp from the one prescribed; balance: energy error, of the largest kinetic energy.",
            "predicted: 0 where positions are prescribed; where only accelerations are, the integrator's own recursion "
            "applied to the drive's acceleration.",
        )),
    )  # fmt: skip
    learned = (_energy_learned(tables[0].frame), _joints_learned(tables[1].frame))
    return Part(tables, (_energy_picture(energy), _joints_picture(joints)), learned)


def _frame(rows: list[Row]) -> pd.DataFrame:
    return pd.DataFrame([{k: v for k, v in row.items() if k != "history"} for row in rows])


def _energy_learned(frame: pd.DataFrame) -> str:
    explicit = frame[frame["integrator"] == "zhai"]
    small, wild = (explicit[explicit["motion"] == motion] for motion in MOTIONS)
    calm, worst_wild = worst(small, "measured"), worst(wild, "measured")
    best_wild = wild.loc[wild["element"] == worst_wild["element"], "measured"].min()
    damped = worst(
        frame[(frame["integrator"] == "generalized-alpha") & (frame["spectral_radius"] < 1.0)], "measured"
    )
    return (
        f"Energy: after {calm['steps']:,} explicit steps of a small swing its error is {calm['measured']:.0e} of the "
        f"kinetic energy at worst, {calm['first_tenth']:.0e} in the first tenth: no drift. In a wild swing it grows to "
        f"{worst_wild['measured']:.0e} with {worst_wild['element']} elements at {worst_wild['of_limit']:g} of the "
        f"limit and stays at {best_wild:.0e} with the shortest step; generalized-α with ρ∞ = "
        f"{damped['spectral_radius']:g} takes {100 * damped['measured']:.0f} % of the energy in {damped['t_end']:g} s."
    )


def _joints_learned(frame: pd.DataFrame) -> str:
    ours = frame[frame["solver"] == OURS]
    free = worst(frame[frame["solver"] == FREE], "measured")
    longest = worst(ours, "turns")
    said = "nothing" if ours["gap"].max() == 0.0 else f"{ours['gap'].max():.0e} m"
    driven = "nothing" if ours["measured"].max() == 0.0 else f"{ours['measured'].max():.0e}"
    return (
        f"Drift: in {longest['turns']} turns of the crank and {ours['steps'].max():,} steps the pins of ANC–TMM open "
        f"by {said} and its drive is off by {driven}; the global DAE without stabilisation opens its pins by "
        f"{free['gap']:.0e} m and loses its drive by {free['measured']:.1e} in {free['steps']:,} steps, as its own "
        f"recursion predicts ({free['predicted']:.1e}), and with projection by no more than rounding."
    )


def _energy_picture(rows: list[Row]) -> Picture:
    whole = [row for row in rows if "history" in row]

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, motion in zip(panels, MOTIONS, strict=True):
            for row in whole:
                if row["motion"] == motion:
                    _energy_line(axes, row)
            axes.set(yscale="log", xlabel="part of the run", title=motion)
        panels[0].set_ylabel("energy error, of the kinetic energy")
        legend_below(figure, list(panels), 3)

    steps = max((row["steps"] for row in whole), default=0)
    caption = (
        f"Energy error over {steps:,} steps (largest so far). Explicit steps of a small swing keep their energy; a "
        "wild one accumulates errors, the fewer the shorter the steps; ρ∞ < 1 takes energy by design."
    )
    return picture("extremes_energy", caption, draw, (7.6, 4.4))


def _energy_line(axes: Any, row: Row) -> None:
    t, error = row["history"]
    if row["integrator"] == "zhai":
        label = f"{row['element']}, explicit, {row['of_limit']:g} of the limit"
        shade = FRACTIONS.index(row["of_limit"])
        colour, dash = (
            PALETTE[0 if row["element"] == "cable" else 1],
            ((0, (1, 1.5)), (0, (3, 1.5)), (0, (6, 1.5)), "-")[shade],
        )
    else:
        label = f"cable, implicit, ρ∞ = {row['spectral_radius']:g}"
        colour, dash = PALETTE[2 if row["spectral_radius"] == 1.0 else 3], "-"
    axes.plot(
        t / t[-1],
        np.maximum.accumulate(np.maximum(error, 1e-16)),
        color=colour,
        linestyle=dash,
        label=label,
        linewidth=1.3,
    )


def _joints_picture(rows: list[Row]) -> Picture:
    free = next((row for row in rows if row.get("solver") == FREE and "history" in row), None)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        if free is not None:
            t, drive, gaps, predicted = free["history"]
            axes.plot(
                t, drive, color=PALETTE[1], linewidth=3.0, alpha=0.6, label="drive (rad), not stabilised"
            )
            axes.plot(t, predicted, color=PALETTE[7], linewidth=1.0, label="drive (rad), theory")
            axes.plot(t, gaps, color=PALETTE[3], label="pins (m), not stabilised")
        axes.set(yscale="log", xlabel="t (s)", ylabel="drift")
        axes.legend()

    caption = (
        "Drift of the four-bar's constraints in the global DAE without stabilisation. With projection it is rounding; "
        "in ANC–TMM there is none to be drawn: both are zero."
    )
    return picture("extremes_joints", caption, draw, (6.4, 3.6))
