"""Far from the origin, tiny, huge, soft and hard: only rounding may change the answer."""

from dataclasses import dataclass
from functools import partial
from math import sqrt

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from anctmm.model.scene import Beam, Clamp, Material, Pin, Scene
from anctmm.model.sections import Section
from anctmm.results.solution import Solution
from anctmm.solve import solve
from studies.engine.runner import Runner
from studies.engine.tables import Table
from studies.extremes.parts import EPS, Job, Part, Row, rows_of, worst
from studies.report.plots import PALETTE, Picture, picture

HEIGHT, E, DENSITY, GRAVITY = 0.02, 1e7, 1000.0, 9.81
STEPS, ELEMENTS = {"zhai": 8000, "generalized-alpha": 800}, 4
DURATION = 0.4
OUTPUTS = 20
PLACES = (1.0, 1e2, 1e4, 1e6)
#: Powers of two of metre, kilogram and second.
UNITS = ((-20, 0, 0), (10, 0, 0), (-20, -30, -10), (10, 7, 5), (-30, 30, 17))
#: Size, m, and Young's modulus, Pa, at equal density: no powers of two.
SIZES = ((1e-6, 1e3), (1e-6, 1e12), (1e-3, 1e6), (1e3, 1e3), (1e3, 1e12))
FAR, TWOS, TENS = "far from the origin", "units by powers of two", "size and stiffness"


@dataclass(frozen=True)
class Measure:
    """Units and place of the scene: it is the same motion in all of them.

    Parameters
    ----------
    metre, kilogram, second : float
        Of one unit of length, mass and time.
    place : float
        Distance from the origin along both axes, in units of length.
    """

    metre: float = 1.0
    kilogram: float = 1.0
    second: float = 1.0
    place: float = 0.0

    def scene(self) -> Scene:
        """Two pinned beams, the first clamped, that fall under gravity."""
        m, pascal = self.metre, self.kilogram / (self.metre * self.second**2)
        section = Section(HEIGHT**2 * m**2, HEIGHT**4 / 12.0 * m**4, HEIGHT**6 / 80.0 * m**6)
        material = Material(E * pascal, DENSITY * self.kilogram / m**3)
        x = self.place
        ends = [((x + a) * m, (x + b) * m) for a, b in ((0.0, 0.0), (0.625, 0.75), (1.25, 0.0))]
        bodies = tuple(
            Beam(n, a, b, section, material) for n, a, b in zip("ab", ends[:-1], ends[1:], strict=True)
        )
        joints = (Clamp("a.start"), Pin("a.end", "b.start"))
        return Scene("falling pair", bodies, joints, gravity=(0.0, -GRAVITY * m / self.second**2))

    def run(self, element: str, integrator: str) -> Solution:
        """Its motion."""
        steps = STEPS[integrator]
        dt = DURATION / steps * self.second
        return solve(
            self.scene(), mesh=ELEMENTS, element=element, integrator=integrator, dt=dt, t_end=steps * dt,
            output_dt=steps // OUTPUTS * dt, newton_tolerance=1e-13,
        )  # fmt: skip


HERE = Measure()


def compared(what: str, value: str, measure: Measure, element: str, integrator: str) -> list[Row]:
    """How far the motion is from that at the origin in metres, kilograms and seconds."""
    base, moved = HERE.run(element, integrator), measure.run(element, integrator)
    u, v = base.displacement("b.end"), moved.displacement("b.end") / measure.metre
    whole = len(u) == len(v)
    size = float(np.abs(u).max())
    steps = STEPS[integrator]
    # every step rounds the coordinates once, by up to half a unit of their last place: these errors walk at random
    exact = what == TWOS
    walk = EPS * max(measure.place, 1.0) * sqrt(steps / 12.0) / size
    predicted, theory = (0.0, "exponents only") if exact else (walk, "eps · coordinate · √(steps/12)")
    if integrator != "zhai" and not exact:
        predicted, theory = float("nan"), "-"
    return [{
        "what": what, "value": value, "place": measure.place, "element": element,
        "integrator": integrator, "steps": steps,
        "measured": float(np.abs(u - v).max()) / size if whole else float("nan"),
        "same_bits": bool(whole and np.array_equal(u, v)),
        "predicted": predicted, "theory": theory,
        "reference": "the same at the origin, in m, kg, s", "uncertainty": EPS * sqrt(steps / 12.0) / size,
        "status": str(moved.status) if base.status.ok else str(base.status),
    }]  # fmt: skip


def places(quick: bool, runner: Runner) -> Part:
    """Motions that differ only by place and units."""
    measures: list[tuple[str, str, Measure]] = [
        (FAR, f"{x:g} m", Measure(place=x)) for x in (PLACES[-1:] if quick else PLACES)
    ]
    measures += [
        (TWOS, f"2^{a} m, 2^{b} kg, 2^{c} s", Measure(2.0**a, 2.0**b, 2.0**c))
        for a, b, c in (UNITS[2:3] if quick else UNITS)
    ]
    measures += [
        (TENS, f"{size:g} m, {stiff:g} Pa", Measure(size, size**3, size * sqrt(E / stiff)))
        for size, stiff in (SIZES[1:2] if quick else SIZES)
    ]
    jobs = [
        Job(
            f"{what}, {value}, {element}, {i}",
            {"what": what, "value": value},
            partial(compared, what, value, m, element, i),
        )
        for what, value, m in measures
        for element in ("cable", "shear")
        for i in STEPS
    ]
    frame = pd.DataFrame(rows_of(jobs, runner))
    notes = (
        f"Two pinned beams fall for {DURATION:g} s; measured: largest difference of the tip's displacement to that of "
        "the same scene at the origin in m, kg and s, over its largest.",
        "predicted, of explicit runs: each step rounds a coordinate by no more than half a unit of its last place, at "
        "random. Implicit steps (Newton's tolerance is 1e-13) add what this does to their velocities, which are "
        "differences of positions over a step.",
        "By powers of two only exponents change, and the histories are the same bit by bit.",
    )
    table = Table("extremes_places", "Far away, tiny, huge, soft and hard", frame, notes)
    return Part((table,), (_picture(frame),), tuple(_learned(frame)))


def _learned(frame: pd.DataFrame) -> list[str]:
    twos, tens, far = (frame[frame["what"] == what] for what in (TWOS, TENS, FAR))
    furthest = worst(far[far["integrator"] == "zhai"], "measured")
    decimal = worst(tens, "measured")
    return [
        f"Place: {furthest['place']:.0e} m from the origin an explicit run differs by {furthest['measured']:.0e} of "
        f"its way after {furthest['steps']} steps, where rounding coordinates predicts {furthest['predicted']:.0e}.",
        f"Units: changed by powers of two they change no bit in {int(twos['same_bits'].sum())} of {len(twos)} "
        f"histories; from 1e-6 to 1e3 m and from 1e3 to 1e12 Pa results scale to {decimal['measured']:.0e} at worst "
        f"({decimal['integrator']}, {decimal['element']}).",
    ]


def _picture(frame: pd.DataFrame) -> Picture:
    far = frame[(frame["what"] == FAR)].sort_values("place")

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        kinds = far.drop_duplicates(["element", "integrator"])
        for i, kind in enumerate(kinds.to_dict("records")):
            element, integrator = str(kind["element"]), str(kind["integrator"])
            mine = far[(far["element"] == element) & (far["integrator"] == integrator)]
            axes.plot(
                mine["place"], mine["measured"], "os^D"[i], color=PALETTE[i], markerfacecolor="none",
                label=f"{element}, {integrator}",
            )  # fmt: skip
        known = far[far["predicted"] > 0.0].drop_duplicates("place")
        axes.plot(known["place"], known["predicted"], ":", color=PALETTE[7], label="theory, zhai")
        axes.set(
            xscale="log", yscale="log", xlabel="distance from the origin (m)", ylabel="relative difference"
        )
        axes.legend()

    caption = (
        "A motion of a metre far from the origin: its difference to the same motion at the origin, and what rounding "
        "coordinates once a step predicts."
    )
    return picture("extremes_places", caption, draw, (6.4, 3.6))
