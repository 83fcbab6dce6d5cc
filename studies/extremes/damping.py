"""The largest stable explicit step of damped beams."""

from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from anctmm.integrators.stability import step_limit
from anctmm.model.scene import Beam, Clamp, Force, Material, Scene
from anctmm.model.sections import Rectangle
from studies.engine.runner import Runner
from studies.engine.tables import Table
from studies.extremes.march import equilibrium, grows, largest_stable
from studies.extremes.parts import Job, Part, Row, off, rows_of, worst
from studies.extremes.step import DENSITY, LENGTH, MANY_STEPS, PULL, WIDTH, Setting, frequencies
from studies.report.plots import INK, PALETTE, Picture, picture

Array = NDArray[np.float64]

#: Damping ratios ζ = τω/2 of the fastest mode.
RATIOS = (0.0, 0.01, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
QUICK_RATIOS = (0.1, 1.0)
PSIS = (0.5, 1.0)
WIDTH_OF_BISECTION = 2e-4
#: A spectral radius above 1 by no more than this is rounding.
ROUNDING = 1e-9


def damped_beam(setting: Setting, damping: float) -> Scene:
    """The beam of the study of steps, in tension, with some Kelvin-Voigt damping, s."""
    section = Rectangle(WIDTH, LENGTH / setting.slenderness)
    material = Material(setting.E, DENSITY, damping=damping)
    body = Beam("beam", (0.0, 0.0), (LENGTH, 0.0), section, material)
    pull = Force("beam.end", (PULL * setting.E * section.area, 0.0))
    return Scene("damped beam", (body,), (Clamp("beam.start"),), (pull,))


def spectral_radius(psi: float, phi: float, omega: Array, rate: Array) -> Array:
    """Largest |λ| of a step of q̈ = −ω²q − cq̇, with Ω = hω and hc; the state is q, hv and h² times the a before."""
    s, n = omega**2, len(omega)
    step = np.zeros((n, 3, 3))
    now = np.stack([-s, -rate, np.zeros(n)], axis=1)  # h² a
    step[:, 0] = [1.0, 1.0, -psi] + (0.5 + psi) * now
    step[:, 1] = [0.0, 1.0, -phi] + (1.0 + phi) * now
    step[:, 2] = now
    return np.asarray(np.abs(np.linalg.eigvals(step)).max(axis=1))


def damped_rows(element: str, psi: float, ratio: float) -> list[Row]:
    """The measured limit beside two theories."""
    setting = Setting("damping", element, psi=psi)
    run = setting.run
    free = damped_beam(setting, 0.0)
    q = equilibrium(free, run)
    omega = frequencies(free, run, q)
    fastest = float(omega[-1])
    tau = 2.0 * ratio / fastest
    scene = damped_beam(setting, tau)
    predicted = step_limit(psi, psi, fastest, tau * fastest**2)
    measured = largest_stable(
        lambda h: grows(scene, run, q, MANY_STEPS, h), 1.02 * predicted, WIDTH_OF_BISECTION
    )
    radius = largest_stable(
        lambda h: bool(spectral_radius(psi, psi, h * omega, h * tau * omega**2).max() > 1.0 + ROUNDING),
        1.02 * predicted,
        1e-6,
    )
    return [{
        "element": element, "psi": psi, "damping_ratio": ratio, "tau": tau, "omega_max": fastest, "measured": measured,
        "predicted": predicted, "difference": off(measured, predicted), "spectral_radius": radius,
        "measured_omega": measured * fastest, "predicted_omega": predicted * fastest,
        "theory": "½ψ(hω)² + (½ + φ)hc = 1", "reference": "spectral radius of a step, all modes",
        "uncertainty": WIDTH_OF_BISECTION + abs(off(radius, predicted)), "status": "ok",
    }]  # fmt: skip


def damping(quick: bool, runner: Runner) -> Part:
    """Measured limits over damping."""
    jobs = [
        Job(
            f"damping, {element}, ψ {psi:g}, ζ {ratio:g}",
            {"element": element, "psi": psi, "damping_ratio": ratio},
            partial(damped_rows, element, psi, ratio),
        )
        for element in ("cable", "shear")
        for psi in (PSIS[:1] if quick else PSIS)
        for ratio in (QUICK_RATIOS if quick else RATIOS)
    ]
    frame = pd.DataFrame(rows_of(jobs, runner))
    notes = (
        "The beam of the table of steps with Kelvin-Voigt damping τ; damping_ratio: ζ = τω/2 of its fastest mode. "
        "measured, predicted, spectral_radius: largest stable step, s; with _omega times ω_max.",
        "predicted: where a step turns the fastest mode's sign; spectral_radius: the largest step at which no mode's "
        "matrix of a step (q, v and the acceleration before) has an eigenvalue beyond 1.",
    )
    table = Table("extremes_damping", "Largest stable step with damping", frame, notes)
    return Part((table,), (_picture(frame),), (_learned(frame),))


def _learned(frame: pd.DataFrame) -> str:
    sound = frame[frame["status"] == "ok"]
    least = worst(sound, "difference")
    one = sound[(sound["damping_ratio"] == 1.0) & (sound["psi"] == 0.5)].to_dict("records")[0]
    return (
        f"Damping: Kelvin–Voigt damping lowers Δt ω_max to {one['measured_omega']:.3f} at ζ = 1 of the fastest mode "
        f"(theory {one['predicted_omega']:.3f}); over {len(sound)} dampings, elements and ψ the limit is that of "
        f"½ψ(hω)² + (½ + φ)hc = 1 to {100 * abs(least['difference']):.2f} %."
    )


def _picture(frame: pd.DataFrame) -> Picture:
    sound = frame[frame["status"] == "ok"]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        kinds: list[dict[Any, Any]] = sound.drop_duplicates(["element", "psi"]).to_dict("records")
        for i, kind in enumerate(kinds):
            mine = sound[(sound["element"] == kind["element"]) & (sound["psi"] == kind["psi"])]
            axes.plot(
                mine["damping_ratio"], mine["measured_omega"], "os^D"[i], color=PALETTE[i], markerfacecolor="none",
                markersize=8.0 - i, linestyle="",
                label=f"{kind['element']}, ψ = φ = {kind['psi']:g}",
            )  # fmt: skip
        ratios = np.linspace(0.0, float(sound["damping_ratio"].max()), 400)
        for psi in sorted(sound["psi"].unique()):
            theory = [step_limit(psi, psi, 1.0, 2.0 * ratio) for ratio in ratios]
            axes.plot(ratios, theory, color=INK, linewidth=0.9, label="_" if psi > 0.5 else "theory")
        axes.set_xscale("symlog", linthresh=0.01)
        axes.set(
            xlabel="damping ratio of the fastest mode", ylabel="largest stable Δt ω_max", ylim=(0.0, None)
        )
        axes.legend()

    caption = "Largest stable explicit step with Kelvin–Voigt damping, measured (markers) on theory (lines)."
    return picture("extremes_damping", caption, draw, (6.4, 3.6))
