"""Growth of a tiny disturbance, and the time until which two solvers can be compared."""

from dataclasses import replace
from math import isfinite, log, nan

import numpy as np
from matplotlib.figure import Figure

from anctmm.model.bodies import Beam
from anctmm.model.case import Case
from anctmm.model.drives import History, Pulse
from anctmm.model.scene import Force, Scene
from anctmm.results.metrics import Array
from anctmm.results.solution import Solution
from studies.engine.files import file_name
from studies.engine.study import Picture
from studies.extremes.base import Base, Part, Row, apart, good, largest
from studies.report.plots import DASHES, legend_below, picture

#: Size of the disturbance at the end of an undisturbed free flight, of the largest displacement.
DISTURBANCE = 1e-10
#: Part of the motion that the push lasts; window in which its size is taken to be that of the start.
PUSH, FIRST = 0.02, (0.05, 0.15)
#: Difference below which a push has left no trace, as where drives hold the probes.
TRACE = 1e-3 * DISTURBANCE
#: Difference up to which two solvers' histories are taken to be the same motion.
SAME = 1e-6
GROWTH = (
    "growth", "How a disturbance grows",
    f"A push of {PUSH:.0%} of the motion moves the probes by some {DISTURBANCE:g} of the largest displacement. first, "
    "last: largest difference between 5 and 15 % of the motion, and in its last tenth. rate: of exponential growth "
    f"between them. comparable_until: when the difference exceeds {SAME:g}. uncertainty: rounding at most.",
)  # fmt: skip


def growth(base: Base) -> tuple[Part, float]:
    """Rows of one case, and the factor by which its motion makes a disturbance larger."""
    case, trial = base.case, base.trial
    ours = base.run(trial, "refined run")
    pushed = replace(trial, scene=_disturbed(case, largest(ours, case)))
    pairs = {f"push, {trial.solver}": (ours, base.run(pushed, "disturbed"))}
    if base.peer:
        peer = base.run(replace(trial, solver=base.peer), base.peer)
        pairs[f"push, {base.peer}"] = peer, base.run(replace(pushed, solver=base.peer), "disturbed")
        pairs[f"{trial.solver} and {base.peer}"] = ours, peer
    rows: list[Row] = []
    whole: dict[str, Array] = {}
    for what, solutions in pairs.items():
        bad = [solution.status for solution in solutions if not solution.status.ok]
        if not bad:
            whole[what] = apart(*solutions, case)
        grown = {} if bad else _grown(ours.t, whole[what])
        rows.append(base.row(bad[0] if bad else "ok", what=what, **grown))
    larger = max(1.0, good(rows)[0]["growth"] if good(rows) else 1.0)  # also of NaN
    for row in good(rows):
        row["uncertainty"] = base.rounding * (1.0 if row["what"].startswith("push") else larger)
    return base.part(*GROWTH, rows, _finding(rows), _picture(case.name, ours, whole)), larger


def _grown(t: Array, difference: Array) -> Row:
    """Size of a difference at the start and at the end of a motion, and its growth."""
    inside = (t >= FIRST[0] * t[-1]) & (t <= FIRST[1] * t[-1])
    first = float(difference[inside].max(initial=0.0))
    last = float(difference[t >= 0.9 * t[-1]].max(initial=0.0))
    ratio = last / first if first > TRACE else nan
    over = np.flatnonzero(difference > SAME)
    return {
        "first": first, "last": last, "growth": ratio,
        "rate": log(ratio) / (0.85 * float(t[-1])) if ratio > 0.0 else nan,
        "comparable_until": float(t[over[0]] if over.size else t[-1]),
    }  # fmt: skip


def _disturbed(case: Case, displacement: float) -> Scene:
    """The scene with a short push at all probes, which moves all of its mass by DISTURBANCE of a displacement, m."""
    scene, duration = case.scene, PUSH * case.duration
    beams = sum(b.material.density * b.section.area * b.length for b in scene.beams)
    mass = beams + sum(b.mass for b in scene.bodies if not isinstance(b, Beam))
    force = 2.0 * DISTURBANCE * displacement * mass * PUSH / duration**2 / len(case.probes)
    pulse = Pulse(amplitude=force, duration=duration)
    push = History(lambda t: (0.8 * pulse(t), 0.6 * pulse(t)), breaks=(0.0, duration))
    return replace(scene, loads=(*scene.loads, *(Force(probe, push) for probe in case.probes)))


def _finding(rows: list[Row]) -> str:
    first, pair = rows[0], rows[-1]
    if first["status"] != "ok":
        return f"a disturbance: {first['status']}"
    grows = f"grows {first['growth']:.2g} times" if isfinite(first["growth"]) else "leaves no trace"
    text = f"a disturbance of {DISTURBANCE:g} {grows}"
    if pair["status"] != "ok" or pair is first:
        return text
    until = f"the motion can be compared until {pair['comparable_until']:.3g} s"
    return f"{text}; {pair['what']} differ by {pair['last']:.0e} at the end: {until}"


def _picture(name: str, ours: Solution, whole: dict[str, Array]) -> Picture:
    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, (what, difference) in enumerate(whole.items()):
            seen = difference > 0.0
            axes.plot(ours.t[: len(seen)][seen], difference[seen], linestyle=DASHES[k], label=what)
        axes.set(yscale="log", xlabel="t (s)", ylabel="difference / largest displacement")
        legend_below(figure, [axes])

    caption = f"{name}: growth of a push of {DISTURBANCE:g} by each solver, and their difference."
    return picture(f"growth_{file_name(name)}", caption, draw, (6.8, 3.6))
