"""Extremes of a case: steps, elements, units and places, stiffness, loads and time."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import ceil, isinf, nan
from typing import Any

import numpy as np

from anctmm.errors import AnctmmError, ResultError
from anctmm.model.bodies import Beam
from anctmm.model.scene import Scene
from anctmm.results.metrics import EPS
from anctmm.results.solution import Solution
from studies.engine.meshes import MARGIN, explicit_limit
from studies.engine.other_numbers import Change, Changed
from studies.engine.refinement import EXPLICIT
from studies.engine.trials import Trial
from studies.extremes.base import (
    MOST_WORK,
    Base,
    Part,
    Row,
    apart,
    energy_error,
    good,
    part,
    paths,
    size_of,
)

#: Fixed explicit steps tried, as parts of the stability limit at the start.
FRACTIONS = (0.5, 0.9, 0.99, 1.05, 1.3)
#: Beginning of the status of what would take too long.
NOT_RUN = "not run"
#: Elements at most, by whether the run is quick; of the other solver. Steps of each run, Newton's tolerance of it.
MOST, MOST_OF_PEER = {False: 20_000, True: 1_000}, 1_000
STEPS, NEWTON = 10, 1e-10
#: Distances from the origin, in lengths of the scene.
FAR = {False: (1e2, 1e4, 1e6), True: (1e6,)}
UNITS = {
    "mm, t, s": Change(1e3, 1e-3, 1.0),
    "µm, µg, ms": Change(1e6, 1e9, 1e3),
    "powers of two": Change(2.0**10, 2.0**-7, 2.0**5),
}
#: Factors of Young's modulus, by whether the run is quick; of the loads; of the duration.
STIFFER = {False: (1e-2, 1.0, 1e2, 1e4, 1e6), True: (1.0, 1e2, 1e4)}
LOADS = {False: (1.0, 2.0, 4.0, 8.0, 16.0), True: (1.0, 4.0)}
LONGER = {False: (1, 10, 100), True: (1, 10)}
NOTES = {
    "stable_step": "stable_dt (s): 2/ω_max (less with damping) of the undeformed scene, by the solver's own refusal, "
    "to a per cent. factor: the step over it, before it divides the interval of output. error: largest difference to "
    "the refined run, of the largest displacement. balance: largest energy error over the largest kinetic energy.",
    "many_elements": f"The first {STEPS} steps of the refined run (an equilibrium whole). to_coarser: largest "
    f"difference to the mesh before. to_peer: to another solver on the same mesh, up to {MOST_OF_PEER} elements: "
    "rounding of both. uncertainty: Newton's tolerance, and rounding of coordinates.",
    "units": "difference: largest at the probes to the same run in m, kg, s at its own place, over the largest "
    "displacement; predicted: at most, by rounding of each step, which the motion makes larger as it does a "
    "disturbance. reactions: the same of forces of joints. In units that are powers of two only exponents change. Laws "
    "of springs are functions in SI units: scenes with them are moved, and not computed in other units.",
    "stiffness": "factor: of Young's modulus of all beams, on the refined mesh and by the refined step. difference: to "
    "rigid bars at the probes, over the largest displacement of the case; it must fall until only the errors of mesh "
    "and step (uncertainty) are left.",
    "loads": "factor: of all loads and of gravity, on the refined mesh and by the refined step; drives stay. largest: "
    "displacement of the probes, m.",
    "time": "factor: of the duration, by the refined step. balance: largest energy error over the largest kinetic "
    "energy.",
}


def _swept(
    base: Base,
    what: str,
    factors: Sequence[float],
    variant: Callable[[float], Trial],
    measured: Callable[[Trial, Solution], Row],
) -> list[Row]:
    """A row for each factor: what is measured of its variant, or why there is nothing."""
    rows = []
    for factor in factors:
        trial = variant(factor)
        if trial.work > MOST_WORK:
            rows.append(base.row(f"{NOT_RUN}: {trial.work:.1e} elements times steps", factor=factor))
            continue
        run = base.run(trial, f"{what}, {factor:g}")
        found = measured(trial, run) if run.status.ok else {}
        rows.append(base.row(str(run.status), factor=factor, **found))
    return rows


def _beyond(rows: Sequence[Row]) -> str:
    """End of a sentence: the first factor that has no answer."""
    bad = next((row for row in rows if row["status"] != "ok"), None)
    return f"; {bad['factor']:g} times: {bad['status']}." if bad else "."


def steps(base: Base) -> Part:
    """The largest stable explicit step, and how near to it a fixed step can go over the motion."""
    plain = replace(base.trial, integrator=EXPLICIT, options=(("check_stability", False),))
    limit = explicit_limit(base.case, plain.by_body, element=plain.element) / MARGIN
    interval, title = base.case.interval, "Explicit steps near the stability limit"
    if isinf(limit):
        rows = [base.row("does not apply: nothing vibrates, or no explicit run")]
        text = f"{base.case.name}, explicit steps: {rows[0]['status']}."
        return part("stable_step", title, rows, NOTES["stable_step"], text)

    def measured(trial: Trial, run: Solution) -> Row:
        error = float(apart(base.found.solution, run, base.case).max())
        return {"stable_dt": limit, "dt": trial.dt, "error": error, "reference_error": base.found.error,
                "balance": energy_error(run)}  # fmt: skip

    def variant(factor: float) -> Trial:  # with a step that divides the interval of output
        return replace(plain, dt=interval / max(ceil(interval / (factor * limit) - 0.5), 1))

    rows = _swept(base, "explicit", FRACTIONS, variant, measured)
    held = [row["factor"] for row in good(rows) if row["balance"] < 1.0]
    ran = [row for row in rows if not row["status"].startswith(NOT_RUN)]
    lost = [row["factor"] for row in ran if row["factor"] not in held]
    text = f"{base.case.name}: the largest stable explicit step is {1e3 * limit:.3g} ms"
    text += f"; a fixed step of {max(held):.2f} of it holds over the motion" if held else ""
    text += f", one of {min(lost):.2f} does not" if lost else ""
    return part("stable_step", title, rows, NOTES["stable_step"], f"{text}.")


def elements(base: Base) -> Part:
    """The first steps on meshes four times finer each, and the difference to another solver."""
    name = base.case.name
    rows = list(_finer(base)) if base.case.scene.beams else [base.row("does not apply: no beam")]
    complete, bad = good(rows), [row for row in rows if row["status"] != "ok"]
    if complete:
        known = [row["to_peer"] for row in complete if row["to_peer"] == row["to_peer"]]
        text = f"{name}: runs hold up to {max(row['dofs'] for row in complete)} coordinates"
        text += f"; {base.peer} differs by {max(known):.0e} at most" if known else ""
        text += f"; beyond: {bad[0]['status']}" if bad else ""
    else:
        text = f"{name}, many elements: {rows[-1]['status']}"
    return part("many_elements", "Many elements", rows, NOTES["many_elements"], f"{text}.")


def _finer(base: Base) -> Iterator[Row]:
    case, before = base.case, None
    trial = replace(base.trial, options=(("newton_tolerance", NEWTON),))
    if not case.static:
        trial = replace(trial, t_end=STEPS * trial.dt, output_dt=trial.dt)
    while trial.elements <= MOST[base.quick]:
        run = base.run(trial, f"{trial.elements} elements")
        about: Row = {"elements": trial.elements, "dofs": run.dofs}
        if not run.status.ok:
            yield base.row(str(run.status), **about)
            return
        size = case.scene.length / size_of(paths(run, case))
        yield base.row(
            **about,
            to_coarser=nan if before is None else float(apart(before, run, case).max()),
            us_per_element_step=1e6 * run.cost.cpu_s / trial.elements / max(run.cost.steps, 1),
            to_peer=_to_peer(base, trial, run),
            uncertainty=(EPS * STEPS**1.5 + NEWTON * STEPS) * size,
        )
        before, trial = run, replace(trial, mesh=tuple(4 * n for n in trial.mesh))


def _to_peer(base: Base, trial: Trial, run: Solution) -> float:
    if not base.peer or trial.elements > MOST_OF_PEER:
        return nan
    peer = base.run(replace(trial, solver=base.peer), f"{base.peer}, {trial.elements} elements")
    return float(apart(run, peer, base.case).max()) if peer.status.ok else nan


def places(base: Base, growth: float) -> Part:
    """The case far from the origin and in other units: only rounding may change the answer."""
    plain, length = base.run(base.trial, "refined run"), base.case.scene.length
    away = {
        f"{far:.0e} lengths from the origin": Change(place=(far * length, 0.5 * far * length))
        for far in FAR[base.quick]
    }
    rows = [_changed(base, plain, name, change, growth) for name, change in {**UNITS, **away}.items()]
    complete = good(rows)
    text = f"{base.case.name}, units and place: {rows[0]['status']}."
    if complete:
        worst = max(complete, key=lambda r: r["difference"])
        same = "; in units that are powers of two not one bit differs"
        bits = same if any(r["same_bits"] for r in complete) else ""
        text = f"{base.case.name}, units and place: results differ by {worst['difference']:.0e} at most "
        text += f"({worst['value']}){bits}."
    return part("units", "Other units, and far from the origin", rows, NOTES["units"], text)


def _changed(base: Base, plain: Solution, value: str, units: Change, growth: float) -> Row:
    case, s = base.case, units.second
    moves = units.place != (0.0, 0.0)
    if not moves and any(connector.law is not None for connector in case.scene.connectors):
        return base.row("does not apply: a spring has a law in SI units", value=value)
    try:
        trial = replace(base.trial, scene=units.scene(case.scene))
    except AnctmmError as error:  # a part of a user's own kind
        return base.row(f"does not apply: {error}", value=value)
    trial = replace(trial, dt=trial.dt * s, t_end=trial.t_end * s, output_dt=trial.output_dt * s)
    moved = base.run(trial, value)
    if not (plain.status.ok and moved.status.ok):
        return base.row(str((moved if plain.status.ok else plain).status), value=value)
    far = float(np.hypot(*units.place)) + case.scene.length
    rounding = base.rounding * max(growth, 1.0) * far / size_of(paths(plain, case))
    return base.row(
        value=value,
        difference=float(apart(plain, moved, case, units.metre).max()),
        predicted=0.0 if units.exact else rounding,
        reactions=_of_joints(plain, moved) if moves else nan,
        same_bits=bool(np.array_equal(paths(plain, case), paths(moved, case) / units.metre)),
    )


def _of_joints(plain: Solution, moved: Solution) -> float:
    """Largest difference of forces of joints of two runs, over the largest force; NaN where none is known."""
    gap, largest = 0.0, 0.0
    for one, other in zip(plain.scene.joints, moved.scene.joints, strict=True):
        try:
            here, there = plain.reaction(one)[:, :2], moved.reaction(other)[:, :2]
        except ResultError:  # of a solver that keeps no accelerations
            continue
        n = min(len(here), len(there))
        gap = max(gap, float(np.abs(here[:n] - there[:n]).max(initial=0.0)))
        largest = max(largest, float(np.abs(here[:n]).max(initial=0.0)))
    return gap / largest if largest > 0.0 else nan


def stiffness(base: Base) -> Part:
    """Stiffer and stiffer beams: the case must converge to rigid bars."""
    name, case, rows = base.case.name, base.case, [base.row("does not apply: no beam")]
    if case.scene.beams:
        ones = (1,) * len(case.scene.beams)
        rigid = base.run(replace(base.trial, element="rigid", mesh=ones), "rigid bars")
        size = size_of(paths(base.found.solution, case))

        def measured(trial: Trial, run: Solution) -> Row:
            difference = float(apart(rigid, run, case, size=size).max())
            return {"difference": difference, "uncertainty": base.found.error}

        why = "the scene is a mechanism" if rigid.status.code == "singular" else str(rigid.status)
        rows = [base.row(f"does not apply: with all beams rigid {why}")]
        if rigid.status.ok:
            stiffer = lambda f: replace(base.trial, scene=_stiffened(case.scene, f))  # noqa: E731
            rows = _swept(base, "stiffness", STIFFER[base.quick], stiffer, measured)
    known, text = good(rows), f"{name}, stiffness: {rows[0]['status']}."
    if known:
        by = [f"{r['difference']:.1g} with {r['factor']:g} times its modulus" for r in (known[0], known[-1])]
        text = f"{name}, stiffness: the result differs from that of rigid bars by {by[0]}, and by {by[1]}."
    return part("stiffness", "Stiffer and stiffer", rows, NOTES["stiffness"], text)


def _stiffened(scene: Scene, factor: float) -> Scene:
    def body(b: Any) -> Any:
        return replace(b, material=replace(b.material, E=factor * b.material.E)) if isinstance(b, Beam) else b

    return replace(scene, bodies=tuple(map(body, scene.bodies)))


def loads(base: Base) -> Part:
    """Larger and larger loads on the same mesh and by the same step."""

    def variant(factor: float) -> Trial:
        return replace(base.trial, scene=_loaded(base.case.scene, factor))

    def measured(trial: Trial, run: Solution) -> Row:
        return {"largest": size_of(paths(run, base.case))}

    rows = _swept(base, "loads", LOADS[base.quick], variant, measured)
    held = max((row["factor"] for row in good(rows)), default=0.0)
    text = f"{base.case.name}: runs hold up to {held:g} times the loads{_beyond(rows)}"
    return part("loads", "Larger and larger loads", rows, NOTES["loads"], text)


def _loaded(scene: Scene, factor: float) -> Scene:
    def times(value: Any) -> Any:
        if callable(value):
            return Changed(value, times)
        return tuple(map(times, value)) if isinstance(value, tuple | list) else factor * value

    scaled = (replace(load, value=times(load.value)) for load in scene.loads)
    return replace(scene, loads=tuple(scaled), gravity=times(scene.gravity))


def time(base: Base) -> Part:
    """Longer and longer motions by the same step: drift of the energy."""
    case = base.case

    def variant(factor: float) -> Trial:
        return replace(base.trial, t_end=factor * case.duration, output_dt=factor * case.interval)

    def measured(trial: Trial, run: Solution) -> Row:
        return {"t_end": trial.t_end, "steps": run.cost.steps, "balance": energy_error(run)}

    rows = _swept(base, "time", LONGER[base.quick], variant, measured)
    last = (good(rows) or [{"steps": 0, "balance": nan}])[-1]
    text = f"{case.name}: over {last['steps']} steps the energy error is {last['balance']:.1g} of the kinetic one"
    return part("time", "Longer and longer motions", rows, NOTES["time"], text + _beyond(rows))
