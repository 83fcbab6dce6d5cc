"""Scenes that move."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

import anctmm as at
from anctmm.errors import SolverError
from anctmm.results.solution import Solution
from studies.gallery.drawing import BLUE, FAINT, GREEN, RED, at_times, bodies, note, path, plane
from studies.gallery.entry import Entry, Number, Script
from studies.report.plots import INK, legend_below

GRAVITY = 9.81


def run(script: Script, **options: Any) -> Solution:
    """The motion of a script's case.

    Raises
    ------
    SolverError
        If it does not end well.
    """
    case = script.case
    found = at.solve(case.scene, t_end=case.duration, output_dt=case.interval, **options)
    if not found.status.ok:
        raise SolverError(f"{script.name}: {found.status}")
    return found


# --- soft pendulum -----------------------------------------------------------------------------------------


def energy(script: Script, found: Solution) -> Number:
    largest = float(np.abs(found.energy.balance).max() / np.abs(found.energy.potential).max())
    return Number(
        "largest change of the total energy, relative to the largest potential energy",
        "",
        largest,
        0.0,
        1e-3,
        "energy is conserved",
    )


def draw_pendulum(figure: Figure, script: Script, found: Solution) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1.35, 1.0])
    bodies(left, found, at_times(found, np.arange(0.0, 0.91, 0.075)))
    path(left, found.position("bar.end"))
    plane(left, "every 0.075 s, the last one dark")
    parts = found.energy
    for series, label, colour in (
        (parts.kinetic, "kinetic", BLUE),
        (parts.strain, "strain", GREEN),
        (parts.potential, "weight", RED),
    ):
        right.plot(found.t, series, color=colour, label=label)
    right.plot(found.t, parts.kinetic + parts.strain + parts.potential, color=INK, lw=1.0, label="sum")
    right.set(xlabel="t (s)", ylabel="energy (J)", title="energies")
    legend_below(figure, [right], columns=4)


# --- engine ------------------------------------------------------------------------------------------------


def pin_force(script: Script, found: Solution) -> Number:
    crank, rod, speed = script["CRANK"], script["ROD"], script["SPEED"]
    top = script["START"] / 2.0 + 6.0 * np.pi / speed  # the third time that the crank points to the piston
    force = -np.interp(top, found.t, found.reaction(script["pin"])[:, 0])
    known = script["MASS"] * crank * speed**2 * (1.0 + crank / rod)
    source = "m r ω² (1 + r/l), rigid bars"
    return Number("pull of the rod at the dead centre", "N", float(force), known, 0.02 * known, source)


def rigid_force(script: Script, angle: np.ndarray) -> np.ndarray:
    """What a rigid rod exerts on the piston at constant speed, N: mass times acceleration."""
    r, rod, speed = script["CRANK"], script["ROD"], script["SPEED"]
    root = np.sqrt(rod**2 - (r * np.sin(angle)) ** 2)
    bent = r**2 * np.cos(2.0 * angle) / root + (r**2 * np.sin(2.0 * angle)) ** 2 / (4.0 * root**3)
    return np.asarray(-script["MASS"] * speed**2 * (r * np.cos(angle) + bent))


def draw_engine(figure: Figure, script: Script, found: Solution) -> None:
    upper, lower = figure.subplots(2, 1, height_ratios=[1.0, 1.25])
    speed, start = script["SPEED"], script["START"]
    turns = speed * (found.t - start / 2.0)
    shown = [int(np.abs(turns - 4.0 * np.pi - a).argmin()) for a in np.linspace(0.0, 0.9 * np.pi, 6)]
    bodies(upper, found, shown)
    path(upper, found.position("crank.end")[turns > 4.0 * np.pi])
    plane(upper, "half a turn at 300 rad/s, the last position dark")
    steady = turns > 2.0 * np.pi
    angle = np.degrees(turns[steady]) - 360.0
    lower.plot(angle, rigid_force(script, turns[steady]), color="#f0b48a", lw=4.5, label="rigid bars, exact")
    force = found.reaction(script["pin"])[steady, 0]
    lower.plot(angle, force, color=BLUE, lw=1.2, label="flexible bars")
    lower.set(xlabel="crank angle (°)", ylabel="force on the piston (N)", xticks=np.arange(0, 721, 90))
    legend_below(figure, [lower])


# --- straight line -----------------------------------------------------------------------------------------


def line(script: Script, found: Solution) -> Number:
    x = found.position("CB.start")[:, 0]
    known = (script["ARM"] ** 2 - script["SIDE"] ** 2) / (2.0 * script["CRANK"])
    worst = float(x[np.abs(x - known).argmax()])
    return Number(
        "x of the guided point, where it is farthest off", "m", worst, known, 1e-9, "inversion at a circle"
    )


def draw_line(figure: Figure, script: Script, found: Solution) -> None:
    axes = figure.subplots()
    bodies(axes, found, at_times(found, [0.0, 0.5, 1.0]))
    path(axes, found.position("CB.start"), lw=2.4, ls="-")
    path(axes, found.position("AE.end"), lw=1.4, color=GREEN)
    plane(axes, "start, middle and end, which is dark")
    note(axes, 1.13, 0.0, "a straight line", color=RED, rotation=90, va="center", ha="left")
    note(axes, -0.09, -0.1, "a circle\nthrough the hinge", color=GREEN, va="top", ha="right")


# --- thrown triangle ---------------------------------------------------------------------------------------


def center_of_mass(found: Solution) -> np.ndarray:
    """Of equal beams, (n, 2), m: Simpson's rule is exact for cubic elements."""
    elements = 4
    fractions = np.linspace(0.0, 1.0, 2 * elements + 1)
    weights = np.tile([2.0, 4.0], elements + 1)[:-1] / (6.0 * elements)
    weights[[0, -1]] /= 2.0
    each = [np.einsum("k,nkx->nx", weights, found.position(name, fractions)) for name in found.fields]
    return np.mean(each, axis=0)


def flight(script: Script, found: Solution) -> Number:
    height = float(center_of_mass(found)[-1, 1])
    t = found.t[-1]
    known = 0.26 / 3.0 + 4.0 * t - GRAVITY * t**2 / 2.0
    return Number("height of the centre of mass after 0.8 s", "m", height, known, 1e-5, "y₀ + v t − g t²/2")


def draw_triangle(figure: Figure, script: Script, found: Solution) -> None:
    axes = figure.subplots()
    bodies(axes, found, at_times(found, np.arange(0.0, 0.81, 0.1)))
    path(axes, center_of_mass(found))
    plane(axes, "every 0.1 s, the last one dark; dashes: the centre of mass")


# --- motor -------------------------------------------------------------------------------------------------


def holding(script: Script, found: Solution) -> Number:
    arm, load = script["arm"], script["load"]
    middle = found.position("arm", np.linspace(0.0, 1.0, 41))[-1, :, 0].mean()
    mass = arm.section.area * arm.material.density * at.distance(arm.start, arm.end)
    known = GRAVITY * (load.mass * found.position("load.center")[-1, 0] + mass * middle)
    moment = -float(found.tension(script["motor"])[-1])
    source = "moment of the weights about the hinge"
    return Number("moment of the motor at the end", "N m", moment, float(known), 5e-3 * known, source)


def draw_arm(figure: Figure, script: Script, found: Solution) -> None:
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.1])
    bodies(left, found, at_times(found, [0.0, 0.15, 0.3, 0.45, 0.6, 0.8, 1.1, 2.5]))
    path(left, found.position("load.center"))
    plane(left, "0, 0.15, 0.3 … 2.5 s")
    right.plot(found.t, -found.tension(script["motor"]), color=BLUE, lw=1.4)
    for limit in (-script["LIMIT"], script["LIMIT"]):
        right.axhline(limit, color=RED, lw=1.1, ls=(0, (4, 2)))
    note(right, 2.5, script["LIMIT"] - 0.5, "its limit", color=RED, ha="right", va="top")
    right.set(xlabel="t (s)", ylabel="moment of the motor (N m)", title="moment")


# --- car ---------------------------------------------------------------------------------------------------


def bounce(script: Script, found: Solution) -> Number:
    modes = at.modes(script.case.scene, count=2)
    undamped = modes.frequencies / np.sqrt(1.0 - modes.damping**2)
    springs = script["front"].stiffness + script["rear"].stiffness
    known = float(np.sqrt(springs / script["car"].mass) / (2.0 * np.pi))
    return Number(
        "frequency of the bounce, without dampers", "Hz", float(undamped.min()), known, 1e-7,
        "√((k₁ + k₂)/m)/2π, as k₁ a = k₂ b",
    )  # fmt: skip


def draw_car(figure: Figure, script: Script, found: Solution) -> None:
    upper, lower = figure.subplots(2, 1, height_ratios=[1.0, 1.1])
    speed, height, long = script["SPEED"], script["HEIGHT"], script["LONG"]
    road = np.linspace(-2.0, 14.5, 500)
    inside = (road > 2.0) & (road < 2.0 + long)
    bump = np.where(inside, height * (1.0 - np.cos(2.0 * np.pi * (road - 2.0) / long)) / 2.0, 0.0)
    scale = 5.0  # heights, to be seen
    upper.fill_between(road, -0.35, scale * bump, color="#d5d5da", lw=0)
    upper.plot(road, scale * bump, color=INK, lw=1.0)
    for t, colour in zip((0.17, 0.56, 0.95, 1.34), ("#6fb0dc", BLUE, "#00558a", "#003a5c"), strict=True):
        k = at_times(found, [t])[0]
        ends = []
        for place, axle in (("rear", -script["REAR"]), ("front", script["FRONT"])):
            x = speed * found.t[k] + axle
            y = 0.9 + scale * (found.position(f"car.{place}")[k, 1] - 0.4)
            ground = scale * float(np.interp(x, road, bump))
            upper.plot([x, x], [ground, y], color=colour, lw=1.0)
            upper.plot(x, ground + 0.12, "o", color=colour, ms=5)
            ends.append((x, y))
        upper.plot(*np.transpose(ends), color=colour, lw=3.2, solid_capstyle="round")
    upper.set(
        ylim=(-0.35, 1.9), xlim=(-2.0, 14.5), title="four positions (heights five times as large)", yticks=[]
    )
    upper.grid(visible=False)
    upper.tick_params(labelbottom=False)
    upper.spines["left"].set_visible(False)
    for place, axle, colour in (("front", script["FRONT"], BLUE), ("rear", -script["REAR"], RED)):
        rise = 1e3 * (found.position(f"car.{place}")[:, 1] - 0.4)
        lower.plot(speed * found.t + axle, rise, color=colour, label=f"{place} of the body")
    lower.plot(road, 1e3 * bump, color=FAINT, lw=1.0, label="road")
    lower.set(xlabel="x along the road (m)", ylabel="height (mm)", xlim=(-2.0, 14.5))
    lower.legend(loc="upper right", labelspacing=0.2)


# --- crane -------------------------------------------------------------------------------------------------


def offset(found: Solution) -> np.ndarray:
    """How far the load is ahead of the trolley, (n,), m."""
    return np.asarray((found.position("load.center") - found.position("rope.start"))[:, 0])


def swing(script: Script, found: Solution) -> Number:
    after = found.t > 3.0 * script["PERIOD"]
    left = float(np.abs(offset(found)[after & (found.t > found.t[-1] - script["PERIOD"] / 2.0)]).max())
    return Number(
        "swing of the load at the end",
        "m",
        left,
        0.0,
        2e-3,
        "none after a whole period, by the pendulum's equation",
    )


def draw_crane(figure: Figure, script: Script, found: Solution) -> None:
    upper, lower = figure.subplots(2, 1, height_ratios=[1.45, 1.0])
    period = script["PERIOD"]
    bodies(upper, found, at_times(found, period * np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0])))
    path(upper, found.position("load.center"))
    upper.plot(*found.position("rope.start").T, color=INK, lw=2.2, zorder=1)
    plane(upper, "every half period; the load's way dashed")
    lower.axhline(0.0, color=FAINT, lw=0.8)
    for start in (0.0, period, 2.0 * period, 3.0 * period):
        lower.axvline(start, color=FAINT, lw=0.8, ls=(0, (4, 2)))
    lower.plot(found.t, 1e3 * offset(found), color=BLUE)
    for middle, text in ((0.5, "speeds up"), (1.5, "rolls on"), (2.5, "brakes"), (3.5, "stands")):
        lower.text(middle * period, 640.0, text, ha="center", va="bottom", fontsize=8.5)
    lower.set(xlabel="t (s)", ylabel="load ahead (mm)", ylim=(-600, 600), xlim=(0.0, found.t[-1]))


# --- blade -------------------------------------------------------------------------------------------------

#: Speeds of the diagram, rad/s, and the dimensionless speed of the published number.
SPEEDS, SPEED = np.linspace(0.0, 120.0, 25), 5.0


def turn(script: Script) -> tuple[Solution, at.Campbell]:
    return run(script, mesh=8, dt=2.5e-3), at.campbell(script.case.scene, SPEEDS, mesh=8, count=3)


def flap(script: Script, found: Any) -> Number:
    blade = script["blade"]
    bending = blade.material.E * blade.section.second_moment
    unit = float(np.sqrt(bending / (blade.material.density * blade.section.area)))
    lag = at.modes(script.case.scene, mesh=24, count=1, spin=SPEED * unit).frequencies[0]
    value = float(np.hypot(2.0 * np.pi * lag / unit, SPEED))
    return Number(
        "flap frequency at the dimensionless speed 5", "", value, 6.4495, 2e-4,
        "Wright et al. 1982, J. Appl. Mech. 49, 197–202",
    )  # fmt: skip


def draw_blade(figure: Figure, script: Script, found: Any) -> None:
    motion, diagram = found
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.15])
    bodies(left, motion, at_times(motion, np.arange(0.0, 0.51, 0.05)))
    plane(left, "spin-up, every 0.05 s")
    for k, (line, colour) in enumerate(zip(diagram.frequencies.T, (BLUE, RED, GREEN), strict=True), 1):
        right.plot(diagram.speeds, line, color=colour)
        note(right, 4.0, line[0] + 2.5, f"mode {k}", color=colour, va="bottom")
    for order in (1, 2, 3, 4):
        right.plot(SPEEDS, order * SPEEDS / (2.0 * np.pi), ":", color=FAINT, lw=1.0)
        note(right, 121.0, order * SPEEDS[-1] / (2.0 * np.pi), f"{order}×", color=FAINT, va="center")
    right.set(
        xlabel="speed (rad/s)", ylabel="frequency (Hz)", title="frequencies", ylim=(0, None), xlim=(0, 132)
    )


MOTIONS = (
    Entry(
        "soft_pendulum", "Soft pendulum",
        "A bar of soft rubber falls from the horizontal. It bends strongly, and its total energy is conserved.",
        lambda script: run(script, mesh=12, dt=2.5e-3), energy, draw_pendulum,
    ),
    Entry(
        "slider_crank", "Engine",
        "A crank, a connecting rod and a piston. The reaction of the piston's pin is, at constant speed, close to "
        "the known one of rigid bars.",
        lambda script: run(script, mesh={"crank": 2, "rod": 4}, dt=5e-5), pin_force, draw_engine, 4.2,
    ),
    Entry(
        "straight_line", "Straight line",
        "Peaucellier's linkage: three loops of bars turn the circle of a crank into a straight line. "
        "Here the bars are rigid.",
        lambda script: run(script, mesh=1, element="rigid", dt=1e-2), line, draw_line, 3.8,
    ),
    Entry(
        "thrown_triangle", "Thrown triangle",
        "A closed frame of three soft bars flies and turns. "
        "However it deforms, its centre of mass follows a parabola.",
        lambda script: run(script, mesh=4, dt=2e-3), flight, draw_triangle,
    ),
    Entry(
        "motor_arm", "Arm with a motor",
        "A user-defined law, three lines of Python, is a motor with feedback and a limited moment. "
        "The arm stays below its target because of its weight.",
        lambda script: run(script, mesh=4, dt=1e-3), holding, draw_arm,
    ),
    Entry(
        "half_car", "Car on a bump",
        "A rigid body on two springs with dampers, whose free lengths follow the road. "
        "The number is a natural frequency of the same scene.",
        lambda script: run(script, dt=5e-3), bounce, draw_car, 4.0,
    ),
    Entry(
        "gantry_crane", "Crane",
        "A load on a rope of steel. A trolley that speeds up during exactly one period of the pendulum "
        "leaves no swing.",
        lambda script: run(script, mesh=4, dt=1e-2), swing, draw_crane, 4.6,
    ),
    Entry(
        "rotating_blade", "Rotating blade",
        "A thin blade lags as it is brought to speed. Rotation makes it stiffer: its frequencies rise with the speed, "
        "and cross multiples of it (dots), where it resonates.",
        turn, flap, draw_blade,
    ),
)  # fmt: skip
