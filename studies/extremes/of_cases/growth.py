"""How a tiny disturbance grows, and until when two solvers can be compared."""

from dataclasses import dataclass, replace
from math import isfinite, log, nan
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from anctmm.model.bodies import Beam
from anctmm.model.drives import Pulse
from anctmm.model.scene import Force, Point, Scene
from anctmm.results.solution import Solution
from studies.engine.pictures import Picture
from studies.engine.storage.files import file_name
from studies.engine.tables import Table
from studies.extremes.of_cases.base import Base, apart
from studies.extremes.parts import Part
from studies.report.plots import DASHES, PALETTE, legend_below, picture

Array = NDArray[np.float64]
#: Size of the disturbance at the end of an undisturbed free flight, of the largest displacement.
DISTURBANCE = 1e-10
#: Part of the motion that the push lasts; window in which its size is taken to be that of the start.
PUSH, FIRST = 0.02, (0.05, 0.15)
#: Distance below which a push has left no trace, as where drives hold the probes: rounding says how it grows.
TRACE = 1e-3 * DISTURBANCE
#: Distance up to which two solvers' histories are taken to be the same motion.
SAME = 1e-6
OURS, PEER = "anctmm", "global-dae"


@dataclass(frozen=True)
class Push:
    """A short force.

    Parameters
    ----------
    force : (float, float)
        Largest, N.
    duration : float
        s.
    """

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


def disturbed(base: Base, displacement: float) -> Scene:
    """The scene with a short push at all probes, which moves all of its mass by DISTURBANCE of a displacement, m."""
    scene, duration = base.case.scene, base.case.duration
    force = 2.0 * DISTURBANCE * displacement * _mass(scene) / (PUSH * duration**2) / len(base.case.probes)
    push = Push((0.8 * force, 0.6 * force), PUSH * duration)
    return replace(scene, loads=(*scene.loads, *(Force(probe, push) for probe in base.case.probes)))


@dataclass(frozen=True)
class Grown:
    """What became of a disturbance, or of the difference of two solvers.

    Parameters
    ----------
    label : str
    t, distance : ndarray, shape (n,)
        s; of the largest displacement.
    status : str
    """

    label: str
    t: Array
    distance: Array
    status: str

    @property
    def start(self) -> float:
        """Largest distance in the first window."""
        inside = (self.t >= FIRST[0] * self.t[-1]) & (self.t <= FIRST[1] * self.t[-1])
        return float(self.distance[inside].max(initial=0.0))

    @property
    def end(self) -> float:
        """Largest distance in the last tenth."""
        return float(self.distance[self.t >= 0.9 * self.t[-1]].max(initial=0.0))

    @property
    def growth(self) -> float:
        """How many times larger it is at the end than in the first window; NaN where nothing is left of it there."""
        return self.end / self.start if self.start > TRACE else nan

    @property
    def rate(self) -> float:
        """Of exponential growth between the two windows, 1/s."""
        growth = self.growth
        return log(growth) / (0.85 * float(self.t[-1])) if growth > 0.0 else nan

    @property
    def until(self) -> float:
        """First time at which the distance exceeds SAME, s; the end where it never does."""
        over = np.flatnonzero(self.distance > SAME)
        return float(self.t[over[0]] if over.size else self.t[-1])


def growth(base: Base) -> tuple[Part, float]:
    """Rows of one case, and the factor by which its motion makes a disturbance larger."""
    ours, peer = base.plain(), base.run(replace(base.trial, solver=PEER), f"{PEER}, undisturbed")
    moved = float(
        max(np.linalg.norm(ours.displacement(p), axis=1).max(initial=0.0) for p in base.case.probes)
    )
    scene = disturbed(base, moved or base.case.scene.length)
    found = []
    for solver, plain in ((OURS, ours), (PEER, peer)):
        pushed = base.run(replace(base.trial, solver=solver, scene=scene), f"{solver}, disturbed")
        found.append(_grown(f"push, {solver}", plain, pushed, base))
    pair = _grown(f"{OURS} and {PEER}", ours, peer, base)
    larger = found[0].growth if found[0].growth > 1.0 else 1.0
    rows = [
        *(_row(base, grown, 1.0, "no push") for grown in found),
        _row(base, pair, larger, "each other"),
    ]
    table = Table("growth", "How a disturbance grows", pd.DataFrame(rows), (
        f"disturbance: a push of {PUSH:.0%} of the motion moves the probes by some {DISTURBANCE:g} of the largest "
        "displacement. first, last: largest distance between 5 and 15 % of the motion, and in its last tenth, at the "
        "probes, of the largest displacement. rate: of exponential growth between them; a steady drift grows by 7. "
        f"Of a push that leaves less than {TRACE:g}, as where drives hold the probes, no growth is told.",
        f"comparable_until: when the distance exceeds {SAME:g}; the end of the motion where it never does.",
        "uncertainty: of a distance; what rounding may do at most, as much larger as the push became.",
    ))  # fmt: skip
    return Part((table,), (_picture(base, [*found, pair]),), (_learned(base, found, pair),)), larger


def _grown(label: str, plain: Solution, other: Solution, base: Base) -> Grown:
    bad = next((s for s in (plain, other) if not s.status.ok), None)
    if bad is not None or len(plain.t) < 2:
        return Grown(label, np.zeros(1), np.zeros(1), str((bad or plain).status))
    return Grown(label, *apart(plain, other, base.case), "ok")


def _row(base: Base, grown: Grown, larger: float, reference: str) -> dict[str, Any]:
    about = base.row(grown.label)
    if grown.status != "ok":
        return about | {"status": grown.status}
    rounding = base.rounding
    pair = grown.label.startswith(OURS)
    return about | {
        "first": grown.start, "last": grown.end, "growth": nan if pair else grown.growth,
        "rate": nan if pair else grown.rate,
        "comparable_until": grown.until,
        "reference": reference, "uncertainty": rounding * larger, "status": "ok",
    }  # fmt: skip


def _learned(base: Base, found: list[Grown], pair: Grown) -> str:
    """A sentence."""
    name = base.case.name
    if found[0].status != "ok":
        return f"{name}, disturbance: {found[0].status}."
    text = f"{name}: a disturbance of {DISTURBANCE:g} {_grows(found[0])}"
    text += (
        f"; by {PEER} it {_grows(found[1])}" if found[1].status == "ok" else f"; {PEER}: {found[1].status}"
    )
    if pair.status != "ok":
        return f"{text}."
    until = "over all of it" if pair.distance.max() <= SAME else f"until {pair.until:.3g} s"
    return (
        f"{text}. {OURS} and {PEER} differ by {pair.end:.0e} at the end: the motion can be compared {until}."
    )


def _grows(grown: Grown) -> str:
    """What a disturbance does, in words."""
    return f"grows {grown.growth:.2g} times" if isfinite(grown.growth) else "leaves no trace at the probes"


def _picture(base: Base, every: list[Grown]) -> Picture:
    shown = [grown for grown in every if grown.status == "ok"]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, grown in enumerate(shown):
            there = grown.distance > 0.0
            axes.plot(
                grown.t[there], grown.distance[there], color=PALETTE[k], linestyle=DASHES[k], label=grown.label
            )  # fmt: skip
        axes.set(
            yscale="log", xlabel="t (s)", ylabel="distance / largest displacement",
            title=f"What becomes of a push of {DISTURBANCE:g}",
        )  # fmt: skip
        legend_below(figure, [axes], 3)

    caption = f"{base.case.name}: what becomes of a push of {DISTURBANCE:g} by two solvers, and how far they are apart."
    return picture(f"growth_{file_name(base.case.name)}", caption, draw, (6.8, 3.6))


def _mass(scene: Scene) -> float:
    """Of all bodies, kg."""
    return sum(
        body.material.density * body.section.area * body.length if isinstance(body, Beam) else body.mass
        for body in scene.bodies
    )
