"""Limits of a case: explicit steps, disturbances, many elements, far places, stiffness, loads, time."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil, isfinite, isinf, log, nan
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from anctmm.model.bodies import Beam
from anctmm.model.case import Case
from anctmm.model.drives import History, Pulse
from anctmm.model.scene import Force, Scene
from anctmm.results.metrics import EPS, Array
from anctmm.results.solution import Solution
from studies.cases import assumptions_of
from studies.engine.files import file_name
from studies.engine.other_numbers import Change, changed
from studies.engine.runner import Runner
from studies.engine.study import Answer, Options, Picture, Result
from studies.engine.trials import EXPLICIT, MARGIN, Trial, explicit_limit
from studies.extremes.base import NOT_RUN, Base, Part, Row, apart, energy_error, good, largest
from studies.report.plots import DASHES, legend_below, picture

#: Fixed explicit steps tried, as parts of the stability limit at the start.
FRACTIONS = (0.5, 0.9, 0.99, 1.05, 1.3)
#: Elements at most, by whether the run is quick; of the other solver. Steps of each run, Newton's tolerance of it.
MOST, MOST_OF_PEER = {False: 20_000, True: 1_000}, 1_000
STEPS, NEWTON = 10, 1e-10
#: Distances from the origin, in lengths of the scene.
FAR = {False: (1e2, 1e4, 1e6), True: (1e6,)}
#: Factors of Young's modulus, by whether the run is quick; of the loads; of the duration.
STIFFER = {False: (1e-2, 1.0, 1e2, 1e4, 1e6), True: (1.0, 1e2, 1e4)}
LOADS = {False: (1.0, 2.0, 4.0, 8.0, 16.0), True: (1.0, 4.0)}
LONGER = {False: (1, 10, 100), True: (1, 10)}
#: Size of the disturbance at the end of an undisturbed free flight, of the largest displacement.
DISTURBANCE = 1e-10
#: Part of the motion that the push lasts; window in which its size is taken to be that of the start.
PUSH, FIRST = 0.02, (0.05, 0.15)
#: Difference below which a push has left no trace, as where drives hold the probes.
TRACE = 1e-3 * DISTURBANCE
#: Difference up to which two solvers' histories are taken to be the same motion.
SAME = 1e-6
#: Questions of the cards, by the table that answers them.
ASKED = {"stable_step": "how long may an explicit step be?", "growth": "until when can runs be compared?"}
#: Names of tables with their titles and notes.
GROWTH = (
    "growth", "How a disturbance grows",
    f"A push of {PUSH:.0%} of the motion moves the probes by some {DISTURBANCE:g} of the largest displacement. first, "
    "last: largest difference between 5 and 15 % of the motion, and in its last tenth. rate: of exponential growth "
    f"between them. comparable_until: when the difference exceeds {SAME:g}. uncertainty: rounding at most.",
)  # fmt: skip
STABLE = (
    "stable_step", "Explicit steps near the stability limit",
    "stable_dt (s): 2/ω_max (less with damping) of the undeformed scene. factor: the step over it. error: largest "
    "difference to the refined run, of the largest displacement. balance: largest energy error over the largest "
    "kinetic energy.",
)  # fmt: skip
MANY = (
    "many_elements", "Many elements",
    f"The first {STEPS} steps of the refined run (an equilibrium whole). to_coarser: largest difference to the mesh "
    f"before; to_peer: to another solver on the same mesh, up to {MOST_OF_PEER} elements. uncertainty: Newton's "
    "tolerance, and rounding of coordinates.",
)  # fmt: skip
PLACES = (
    "places", "Far from the origin",
    "lengths: distance from the origin in lengths of the scene. difference: to the same run at its own place, over the "
    "largest displacement; predicted: at most, by rounding of each step, which grows as a disturbance does.",
)  # fmt: skip
STIFFNESS = (
    "stiffness", "Stiffer and stiffer",
    "factor: of Young's modulus of all beams. difference: to rigid bars, over the largest displacement of the case; it "
    "must fall until only the errors of mesh and step (uncertainty) are left.",
)  # fmt: skip
LOADED = (
    "loads", "Larger and larger loads",
    "factor: of all loads and of gravity; drives stay. largest: displacement of the probes, m.",
)  # fmt: skip
TIME = (
    "time", "Longer and longer motions",
    "factor: of the duration. balance: largest energy error over the largest kinetic energy.",
)  # fmt: skip


def run(options: Options, runner: Runner) -> Result:
    """Run the study of a case; of an extreme that does not apply a row says why."""
    case = options.case
    base = Base.of(case, runner, options.quick)
    found = list(_parts(base))
    cards = [p for p in found if p.table.name in ASKED] or found[:1]
    return Result(
        name="extremes", title="Limits",
        question="How long may a step be, how does a disturbance grow, and what do many elements, far places, stiff "
        "beams, large loads and long times do to the answer?",
        findings=tuple(p.finding for p in found), assumptions=assumptions_of(case),
        tables=tuple(p.table for p in found), pictures=tuple(picture for p in found for picture in p.pictures),
        answers=tuple(Answer(f"{case.name}: {ASKED.get(p.table.name, 'limits?')}", "", p.finding) for p in cards),
        shown=tuple(p.table.name for p in found), good=base.plain.status.ok,
    )  # fmt: skip


def _parts(base: Base) -> Iterator[Part]:
    if not base.plain.status.ok:
        rows = [base.row(base.plain.status)]
        yield base.part("refined", "No refined run", "Of cables and implicit steps.", rows, "")
        return
    larger = 1.0
    if not base.case.static:
        grown, larger = growth(base)
        yield from (grown, steps(base), time(base))
    yield from (places(base, larger), elements(base), stiffness(base))
    if base.case.scene.loads or any(base.case.scene.gravity):
        yield loads(base)


def growth(base: Base) -> tuple[Part, float]:
    """Rows of one case, and the factor by which its motion makes a disturbance larger."""
    case, trial, ours = base.case, base.trial, base.plain
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
    return base.part(*GROWTH, rows, _grows(rows), _picture(case.name, ours, whole)), larger


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


def _grows(rows: list[Row]) -> str:
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


def steps(base: Base) -> Part:
    """The largest stable explicit step, and how near to it a fixed step can go over the motion."""
    plain = replace(base.trial, integrator=EXPLICIT, options={"check_stability": False})
    limit, interval = explicit_limit(plain) / MARGIN, base.case.interval
    if isinf(limit):
        return base.part(*STABLE, [base.row("does not apply: nothing vibrates, or no explicit run")], "")
    rows = base.swept(
        FRACTIONS,  # with steps that divide the interval of output
        lambda factor: replace(plain, dt=interval / max(ceil(interval / (factor * limit) - 0.5), 1)),
        lambda trial, run: {
            "stable_dt": limit, "dt": trial.dt, "error": float(apart(base.found.solution, run, base.case).max()),
            "reference_error": base.found.error, "balance": energy_error(run),
        },
    )  # fmt: skip
    held = [row["factor"] for row in good(rows) if row["balance"] < 1.0]
    ran = [row["factor"] for row in rows if not row["status"].startswith(NOT_RUN)]
    text = f"the largest stable explicit step is {1e3 * limit:.3g} ms"
    text += f"; a fixed step of {max(held):.2f} of it holds over the motion" if held else ""
    text += f", one of {min(lost):.2f} does not" if (lost := set(ran) - set(held)) else ""
    return base.part(*STABLE, rows, text)


def elements(base: Base) -> Part:
    """The first steps on meshes four times finer each, and the difference to another solver."""
    case, runs, plain = base.case, list[Solution](), replace(base.trial, options={"newton_tolerance": NEWTON})
    if not case.scene.beams:
        return base.part(*MANY, [base.row("does not apply: no beam")], "")
    if not case.static:
        plain = replace(plain, t_end=STEPS * plain.dt, output_dt=plain.dt)

    def measured(trial: Trial, run: Solution) -> Row:
        coarser, to_peer = runs[-1:], nan
        runs.append(run)
        if base.peer and trial.elements <= MOST_OF_PEER:
            peer = base.run(replace(trial, solver=base.peer), f"{base.peer}, {trial.elements} elements")
            to_peer = float(apart(run, peer, case).max()) if peer.status.ok else nan
        return {
            "dofs": run.dofs, "to_coarser": max((apart(before, run, case).max() for before in coarser), default=nan),
            "us_per_element_step": 1e6 * run.cost.cpu_s / trial.elements / max(run.cost.steps, 1), "to_peer": to_peer,
            "uncertainty": (EPS * STEPS**1.5 + NEWTON * STEPS) * case.scene.length / largest(run, case),
        }  # fmt: skip

    times = max(int(log(MOST[base.quick] / plain.elements, 4)), 0)  # that it is refined
    rows = base.swept(
        [4**k * plain.elements for k in range(times + 1)],
        lambda count: replace(plain, mesh=tuple(n * int(count) // plain.elements for n in plain.mesh)),
        measured, "elements",
    )  # fmt: skip
    known = [row["to_peer"] for row in good(rows) if row["to_peer"] == row["to_peer"]]
    text = f"runs hold up to {max((row['dofs'] for row in good(rows)), default=0)} coordinates"
    text += f"; {base.peer} differs by {max(known):.0e} at most" if known else ""
    return base.part(*MANY, rows, text + _beyond(rows, "elements", "elements"))


def places(base: Base, larger: float) -> Part:
    """The case far from the origin: only rounding may change the answer, and grow as a disturbance does."""
    case, length = base.case, base.case.scene.length
    predicted = base.rounding * larger * length / largest(base.plain, case)
    rows = base.swept(
        FAR[base.quick],
        lambda far: replace(base.trial, scene=Change((far * length, 0.5 * far * length)).scene(case.scene)),
        lambda trial, run: {"difference": float(apart(base.plain, run, case).max())}, "lengths",
    )  # fmt: skip
    for row in good(rows):
        most = predicted * (float(np.hypot(1.0, 0.5)) * row["lengths"] + 1.0)
        row |= {"predicted": most, "status": row.pop("status")}
    worst = max((row["difference"] for row in good(rows)), default=nan)
    return base.part(*PLACES, rows, f"far from the origin results differ by {worst:.0e} at most")


def stiffness(base: Base) -> Part:
    """Stiffer and stiffer beams: the case must converge to rigid bars."""
    case, scene = base.case, base.case.scene
    if not scene.beams:
        return base.part(*STIFFNESS, [base.row("does not apply: no beam")], "")
    rigid = base.run(replace(base.trial, element="rigid", mesh=(1,) * len(scene.beams)), "rigid bars")
    if not rigid.status.ok:
        return base.part(*STIFFNESS, [base.row(f"does not apply: with all beams rigid {rigid.status}")], "")
    size, uncertainty = largest(base.found.solution, case), base.found.error
    rows = base.swept(
        STIFFER[base.quick],
        lambda factor: replace(base.trial, scene=_stiffer(scene, factor)),
        lambda trial, run: {"difference": float(apart(rigid, run, case, size).max()), "uncertainty": uncertainty},
    )  # fmt: skip
    by = [f"{r['difference']:.1g} with {r['factor']:g} times its modulus" for r in good(rows)]
    text = f"the result differs from that of rigid bars by {by[0]}, and by {by[-1]}" if by else ""
    return base.part(*STIFFNESS, rows, text)


def _stiffer(scene: Scene, factor: float) -> Scene:
    def stiffer(b: Any) -> Any:
        return replace(b, material=replace(b.material, E=factor * b.material.E)) if isinstance(b, Beam) else b

    return replace(scene, bodies=tuple(map(stiffer, scene.bodies)))


def loads(base: Base) -> Part:
    """Larger and larger loads on the same mesh and by the same step."""
    rows = base.swept(
        LOADS[base.quick],
        lambda factor: replace(base.trial, scene=_loaded(base.case.scene, factor)),
        lambda trial, run: {"largest": largest(run, base.case)},
    )
    held = max((row["factor"] for row in good(rows)), default=0.0)
    return base.part(*LOADED, rows, f"runs hold up to {held:g} times the loads{_beyond(rows)}")


def _loaded(scene: Scene, factor: float) -> Scene:
    def times(value: Any) -> Any:
        if callable(value):
            return changed(value, times)
        return tuple(map(times, value)) if isinstance(value, tuple | list) else factor * value

    scaled = (replace(load, value=times(load.value)) for load in scene.loads)
    return replace(scene, loads=tuple(scaled), gravity=times(scene.gravity))


def time(base: Base) -> Part:
    """Longer and longer motions by the same step: drift of the energy."""
    end, interval = base.case.duration, base.case.interval
    rows = base.swept(
        LONGER[base.quick],
        lambda factor: replace(base.trial, t_end=factor * end, output_dt=factor * interval),
        lambda trial, run: {"t_end": trial.t_end, "steps": run.cost.steps, "balance": energy_error(run)},
    )
    last = (good(rows) or [{"steps": 0, "balance": nan}])[-1]
    text = f"over {last['steps']} steps the energy error is {last['balance']:.1g} of the kinetic one"
    return base.part(*TIME, rows, text + _beyond(rows))


def _beyond(rows: Sequence[Row], column: str = "factor", unit: str = "times") -> str:
    """End of a sentence: the first row that has no answer."""
    bad = next((row for row in rows if row["status"] != "ok"), None)
    return f"; {bad[column]:g} {unit}: {bad['status']}" if bad else ""
