"""What moves: crank angle, joint 4, coupler deflection and configurations (Figs. 5 to 8 of Rong 2014)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from anctmm.results.solution import Solution
from studies.report.plots import (
    INK,
    PALETTE,
    Picture,
    endings,
    histories,
    legend_below,
    picture,
)
from studies.scenes import CRANK_TURN

Array = NDArray[np.float64]
FRACTIONS = np.linspace(0.0, 1.0, 41)


def chord_offset(solution: Solution, body: str) -> Array:
    """Distance of a body's midpoint from the chord of its ends, positive to the left, (n,), m."""
    start, middle, end = (solution.position(body, f) for f in (0.0, 0.5, 1.0))
    chord, arm = end - start, middle - start
    return (chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0]) / np.linalg.norm(chord, axis=1)  # type: ignore[no-any-return]


def chord_angle(solution: Solution, body: str) -> Array:
    """Direction of a body's chord, unwrapped, (n,), rad."""
    chord = solution.position(body, 1.0) - solution.position(body, 0.0)
    return np.unwrap(np.arctan2(chord[:, 1], chord[:, 0]))


def axis_at(solution: Solution, body: str, index: int) -> tuple[Array, Array]:
    """Axis of a body at an output time, x and y."""
    points = np.array([solution.position(body, f)[index] for f in FRACTIONS])
    return points[:, 0], points[:, 1]


def crank_angle(solution: Solution) -> Picture:
    """Fig. 5: the crank's angle and what its bending adds to the clamp's."""
    angle, (driven, _, _) = chord_angle(solution, "crank"), CRANK_TURN(solution.t)

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        left.plot(solution.t, np.degrees(angle), color=PALETTE[0], linewidth=2.2, label="crank's chord")
        left.plot(
            solution.t, np.degrees(driven), color=INK, linestyle=(0, (4, 2)), linewidth=1, label="clamp θ(t)"
        )
        left.set(xlabel="time (s)", ylabel="angle (°)", title="Crank angle", yticks=range(0, 361, 90))
        left.legend(loc="upper left")
        right.plot(solution.t, 1e3 * (angle - driven), color=PALETTE[0])
        right.set(xlabel="time (s)", ylabel="chord − clamp (mrad)", title="What the crank's bending adds")

    caption = (
        "Crank angle over time (Fig. 5 of the paper, which does not print its drive: the clamp's history here "
        "is an assumption). Right: the angle of the crank's chord less that of its clamp."
    )
    return picture("crank_angle", caption, draw, (7.2, 3.2))


def joint(solutions: Mapping[str, Solution]) -> Picture:
    """Fig. 6: joint 4, coupler to follower."""
    paths = {label: (s.t, s.position("coupler", 1.0)) for label, s in solutions.items()}
    reference, cut = list(paths.values())[-1][1], endings(solutions)

    def draw(figure: Figure) -> None:
        axes = figure.subplots(2, 2)
        for k, name in enumerate("xy"):
            curves = {label: (t, p[:, k]) for label, (t, p) in paths.items()}
            histories(axes[0, k], curves, "", f"{name} (m)", f"Joint 4: {name}", cut)
            away = {
                label: (t, 1e3 * (p[:, k] - reference[: len(p), k]))
                for label, (t, p) in paths.items()
                if len(p) == len(reference) or (label in cut and len(p) < len(reference))
            }
            histories(axes[1, k], away, "time (s)", f"{name} − {name} of reference (mm)", cut=cut)
        legend_below(figure, [axes[0, 0]], columns=2)

    caption = "Position of joint 4 (Fig. 6 of the paper), and below its distance from the reference, in mm."
    return picture("joint_4", caption, draw, (7.2, 5.2))


def deflection(solutions: Mapping[str, Solution]) -> Picture:
    """Fig. 7: the coupler's midpoint off its chord."""
    curves = {label: (s.t, 1e3 * chord_offset(s, "coupler")) for label, s in solutions.items()}

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        cut = endings(solutions)
        histories(axes, curves, "time (s)", "offset of midpoint from chord (mm)", "Coupler deflection", cut)
        legend_below(figure, [axes], columns=2)

    caption = "Offset of the coupler's midpoint from the chord of its ends (Fig. 7 of the paper)."
    return picture("coupler_deflection", caption, draw, (7.2, 3.8))
