"""The (ψ, φ) plane of Zhai's integrator: where steps are stable at all, and up to which."""

from functools import partial
from math import inf, sqrt
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from anctmm.discretise.discretisation import Discretisation
from anctmm.integrators.stability import zhai_limit
from studies.engine.runner import Runner
from studies.engine.tables import Table
from studies.extremes.march import GROWN, equilibrium, grows, largest_stable
from studies.extremes.parts import Job, Part, Row, off, rows_of, worst
from studies.extremes.step import Setting, frequencies
from studies.report.plots import INK, PALETTE, Picture, picture

Array = NDArray[np.float64]

GRID = (0.0, 0.25, 0.4, 0.5, 0.6, 0.75, 1.0, 1.5)
QUICK_GRID = (0.4, 0.5, 0.75)
#: Steps a disturbance is given to grow in.
STEPS = 20_000
WIDTH = 1e-3
SETTING = Setting("(ψ, φ)", elements=2)


def spectral_radius(psi: float, phi: float, omega: Array) -> Array:
    """Largest |λ| of a step of q̈ = −ω²q, with Ω = hω; eq. 38 of Rong (2014) with q, v and the a before as the state.

    λ³ − 2λ² + λ + Ω² [(½ + ψ) λ² + (½ + φ − 2ψ) λ + ψ − φ] = 0.
    """
    s, n = omega**2, len(omega)
    companion = np.zeros((n, 3, 3))
    companion[:, 1, 0] = companion[:, 2, 1] = 1.0
    companion[:, 0, 0] = 2.0 - s * (0.5 + psi)
    companion[:, 0, 1] = -1.0 - s * (0.5 + phi - 2.0 * psi)
    companion[:, 0, 2] = -s * (psi - phi)
    return np.maximum(np.abs(np.linalg.eigvals(companion)).max(axis=1), np.finfo(float).tiny)


def limit(psi: float, phi: float) -> float:
    """Largest Ω up to which every Ω is stable, by Jury's conditions on the cubic above; 0 where there is none.

    |λ| < 1 needs Ω² (2ψ − φ) < 2 (a root at −1) and φ − ½ + Ω² (ψ − φ)(½ + φ) > 0 (a pair on the circle). For φ = ½
    the latter asks for ψ ≥ ½, for φ < ½ it fails at every small Ω.
    """
    if phi < 0.5 or (phi == 0.5 and psi < 0.5):
        return 0.0
    bounds = [inf]
    if 2.0 * psi > phi:
        bounds.append(2.0 / (2.0 * psi - phi))
    if psi < phi:
        bounds.append((phi - 0.5) / ((phi - psi) * (0.5 + phi)))
    return sqrt(min(bounds))


def plane_row(psi: float, phi: float) -> list[Row]:
    """The measured limit of one pair, times ω_max, beside its theories."""
    scene = SETTING.scene
    run = Discretisation(mesh=SETTING.elements, integrator="zhai", psi=psi, phi=phi, dt=1.0, t_end=1.0)
    q = equilibrium(scene, run)
    omega = frequencies(scene, run, q)
    fastest = float(omega[-1])
    guess = 2.0 / fastest
    measured = fastest * largest_stable(lambda h: grows(scene, run, q, STEPS, h), guess, WIDTH)
    finite = fastest * largest_stable(
        lambda h: bool((STEPS * np.log(spectral_radius(psi, phi, h * omega)) > np.log(GROWN)).any()),
        guess,
        WIDTH,
    )
    exact = limit(psi, phi)
    return [{
        "psi": psi, "phi": phi, "measured": measured, "predicted": finite, "difference": off(measured, finite),
        "limit": exact, "difference_limit": off(measured, exact) if exact > 0.0 else measured,
        "solver_allows": zhai_limit(psi, phi), "theory": "spectral radius over the steps; Jury",
        "reference": "roots of the characteristic polynomial", "uncertainty": WIDTH, "status": "ok",
    }]  # fmt: skip


def plane(quick: bool, runner: Runner) -> Part:
    """The measured limit of every pair of parameters."""
    grid = QUICK_GRID if quick else GRID
    jobs = [
        Job(f"ψ = {psi:g}, φ = {phi:g}", {"psi": psi, "phi": phi}, partial(plane_row, psi, phi))
        for psi in grid
        for phi in grid
    ]
    frame = pd.DataFrame(rows_of(jobs, runner))
    notes = (
        f"Limits as Ω = Δt ω_max, on a clamped beam of two cables. measured: no ten-thousandfold growth of a "
        f"disturbance in {STEPS} steps. predicted: the largest Ω at which the spectral radii of all modes over so many "
        "steps say the same; limit: for any number of steps.",
        "Where limit is 0 every step is unstable, and what is measured is only the step below which growth is too "
        "slow to be seen. solver_allows: what the solver's own check lets pass (0: refused).",
    )
    table = Table("extremes_plane", "The (ψ, φ) plane", frame, notes)
    return Part((table,), (_picture(frame),), (_learned(frame),))


def _learned(frame: pd.DataFrame) -> str:
    stable = frame[frame["limit"] > 0.0]
    away = abs(worst(stable, "difference")["difference"])
    best = worst(stable, "measured")
    off_diagonal = stable[stable["psi"] != stable["phi"]]
    refused = stable[stable["solver_allows"] == 0.0]
    said = (
        f"; the solver's check refuses {len(refused)} of these pairs all the same: safe, but stricter than need be"
        if len(refused)
        else ""
    )
    return (
        f"(ψ, φ): stable are the pairs with φ > ½, or φ = ½ and ψ ≥ ½, up to Δt ω_max = √(2/(2ψ − φ)) or, for ψ < φ, "
        f"√((φ − ½)/((φ − ψ)(φ + ½))), whichever is less: "
        f"measured in {len(stable)} pairs, "
        f"{len(off_diagonal)} of them with ψ ≠ φ, to {100 * away:.2g} % of what theory says of "
        f"as many steps{said}. None is better than ψ = {best['psi']:g}, φ = {best['phi']:g} "
        f"with {best['measured']:.4g}."
    )


def _picture(frame: pd.DataFrame) -> Picture:
    values = sorted(frame["psi"].unique())

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for line in frame.to_dict("records"):
            _cell(axes, values.index(line["psi"]), values.index(line["phi"]), line)
        axes.set_xticks(range(len(values)), [f"{v:g}" for v in values])
        axes.set_yticks(range(len(values)), [f"{v:g}" for v in values])
        axes.set(xlabel="ψ", ylabel="φ", xlim=(-0.5, len(values) - 0.5), ylim=(-0.5, len(values) - 0.5))
        axes.grid(False)
        axes.tick_params(length=0)

    caption = (
        "Largest stable Δt ω_max over (ψ, φ): measured, and below it the theory. A cross: unstable at every step. "
        "The circle's size shows the limit."
    )
    return picture("extremes_plane", caption, draw, (6.4, 4.8))


def _cell(axes: Axes, x: int, y: int, line: dict[Any, Any]) -> None:
    if line["limit"] == 0.0:
        axes.plot(x, y, "x", color="#7f7f87", markersize=6)
        return
    axes.plot(x, y, "o", color=PALETTE[4], markersize=18.0 * line["limit"], alpha=0.45, markeredgewidth=0)
    axes.text(x, y + 0.04, f"{line['measured']:.3f}", ha="center", va="bottom", fontsize=7.5, color=INK)
    axes.text(x, y - 0.04, f"{line['limit']:.3f}", ha="center", va="top", fontsize=7.5, color=INK)
