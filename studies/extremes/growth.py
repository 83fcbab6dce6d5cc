"""Growth of a tiny disturbance, and the time until which two solvers can be compared."""

from dataclasses import dataclass, replace
from math import isfinite, log, nan
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from anctmm.model.bodies import Beam
from anctmm.model.drives import Pulse
from anctmm.model.scene import Force, Point, Scene
from anctmm.results.solution import Solution
from studies.engine.files import file_name
from studies.engine.pictures import Picture
from studies.engine.tables import Table
from studies.extremes.base import Array, Base, Part, Row, apart
from studies.report.plots import DASHES, PALETTE, legend_below, picture

#: Size of the disturbance at the end of an undisturbed free flight, of the largest displacement.
DISTURBANCE = 1e-10
#: Part of the motion that the push lasts; window in which its size is taken to be that of the start.
PUSH, FIRST = 0.02, (0.05, 0.15)
#: Difference below which a push has left no trace, as where drives hold the probes.
TRACE = 1e-3 * DISTURBANCE
#: Difference up to which two solvers' histories are taken to be the same motion.
SAME = 1e-6


@dataclass(frozen=True)
class Push:
    """A short force: the largest, N, and its duration, s."""

    force: Point
    duration: float

    def __call__(self, t: Any) -> Any:
        """Force at a time, N."""
        size = Pulse(amplitude=1.0, duration=self.duration)(t)
        return self.force[0] * size, self.force[1] * size

    @property
    def breaks(self) -> tuple[float, float]:
        """Begin and end, s."""
        return (0.0, self.duration)


@dataclass(frozen=True)
class Grown:
    """Difference of two runs over time.

    Parameters
    ----------
    label : str
    t, difference : ndarray, shape (n,)
        s; of the largest displacement.
    status : str
    """

    label: str
    t: Array
    difference: Array
    status: str

    @property
    def start(self) -> float:
        """The largest in the first window."""
        inside = (self.t >= FIRST[0] * self.t[-1]) & (self.t <= FIRST[1] * self.t[-1])
        return float(self.difference[inside].max(initial=0.0))

    @property
    def end(self) -> float:
        """The largest in the last tenth."""
        return float(self.difference[self.t >= 0.9 * self.t[-1]].max(initial=0.0))

    @property
    def growth(self) -> float:
        """How many times larger it is at the end than in the first window; NaN without a trace there."""
        return self.end / self.start if self.start > TRACE else nan

    @property
    def rate(self) -> float:
        """Of exponential growth between the two windows, 1/s."""
        return log(self.growth) / (0.85 * float(self.t[-1])) if self.growth > 0.0 else nan

    @property
    def until(self) -> float:
        """First time at which it exceeds SAME, s; the end where it never does."""
        over = np.flatnonzero(self.difference > SAME)
        return float(self.t[over[0]] if over.size else self.t[-1])


def disturbed(base: Base, displacement: float) -> Scene:
    """The scene with a short push at all probes, which moves all of its mass by DISTURBANCE of a displacement, m."""
    scene, duration = base.case.scene, base.case.duration
    force = 2.0 * DISTURBANCE * displacement * _mass(scene) / (PUSH * duration**2) / len(base.case.probes)
    push = Push((0.8 * force, 0.6 * force), PUSH * duration)
    return replace(scene, loads=(*scene.loads, *(Force(probe, push) for probe in base.case.probes)))


def growth(base: Base) -> tuple[Part, float]:
    """Rows of one case, and the factor by which its motion makes a disturbance larger."""
    ours = base.plain()
    moved = max(np.linalg.norm(ours.displacement(p), axis=1).max(initial=0.0) for p in base.case.probes)
    pushed = replace(base.trial, scene=disturbed(base, float(moved) or base.case.scene.length))
    found = [_grown(f"push, {base.trial.solver}", ours, base.run(pushed, "disturbed"), base)]
    pair = None
    if base.peer:
        peer = base.run(replace(base.trial, solver=base.peer), base.peer)
        disturbed_peer = base.run(replace(pushed, solver=base.peer), f"{base.peer}, disturbed")
        found.append(_grown(f"push, {base.peer}", peer, disturbed_peer, base))
        pair = _grown(f"{base.trial.solver} and {base.peer}", ours, peer, base)
    every = [*found, *([pair] if pair else [])]
    larger = found[0].growth if found[0].growth > 1.0 else 1.0
    table = Table("growth", "How a disturbance grows", pd.DataFrame([_row(base, g, larger) for g in every]), (
        f"A push of {PUSH:.0%} of the motion moves the probes by some {DISTURBANCE:g} of the largest displacement. "
        "first, "
        "last: largest difference between 5 and 15 % of the motion, and in its last tenth. rate: of exponential growth "
        f"between them; a steady drift grows by 7. comparable_until: when the difference exceeds {SAME:g}; the end of "
        "the motion where it never does. uncertainty: rounding at most, as much larger as the push became.",
    ))  # fmt: skip
    return Part(table, _finding(base, found, pair), (_picture(base, every),)), larger


def _grown(label: str, plain: Solution, other: Solution, base: Base) -> Grown:
    bad = next((s for s in (plain, other) if not s.status.ok), None)
    if bad is not None or len(plain.t) < 2:
        return Grown(label, np.zeros(1), np.zeros(1), str((bad or plain).status))
    return Grown(label, *apart(plain, other, base.case), "ok")


def _row(base: Base, grown: Grown, larger: float) -> Row:
    about = base.row(grown.label)
    if grown.status != "ok":
        return about | {"status": grown.status}
    pushed = grown.label.startswith("push")
    return about | {
        "first": grown.start, "last": grown.end, "growth": grown.growth if pushed else nan,
        "rate": grown.rate if pushed else nan, "comparable_until": grown.until,
        "uncertainty": base.rounding * (1.0 if pushed else larger), "status": "ok",
    }  # fmt: skip


def _finding(base: Base, found: list[Grown], pair: Grown | None) -> str:
    if found[0].status != "ok":
        return f"{base.case.name}, disturbance: {found[0].status}."
    grows = [
        f"grows {g.growth:.2g} times ({g.label})" if isfinite(g.growth) else f"leaves no trace ({g.label})"
        for g in found if g.status == "ok"
    ]  # fmt: skip
    text = f"{base.case.name}: a disturbance of {DISTURBANCE:g} {', '.join(grows)}"
    if pair is None or pair.status != "ok":
        return f"{text}."
    until = "over all of it" if pair.difference.max() <= SAME else f"until {pair.until:.3g} s"
    return f"{text}. {pair.label} differ by {pair.end:.0e} at the end: the motion can be compared {until}."


def _picture(base: Base, every: list[Grown]) -> Picture:
    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, grown in enumerate(g for g in every if g.status == "ok"):
            there = grown.difference > 0.0
            axes.plot(
                grown.t[there],
                grown.difference[there],
                color=PALETTE[k],
                linestyle=DASHES[k],
                label=grown.label,
            )
        axes.set(yscale="log", xlabel="t (s)", ylabel="difference / largest displacement")
        legend_below(figure, [axes], 3)

    caption = f"{base.case.name}: growth of a push of {DISTURBANCE:g} by each solver, and their difference."
    return picture(f"growth_{file_name(base.case.name)}", caption, draw, (6.8, 3.6))


def _mass(scene: Scene) -> float:
    """Of all bodies, kg."""
    return sum(
        body.material.density * body.section.area * body.length if isinstance(body, Beam) else body.mass
        for body in scene.bodies
    )
