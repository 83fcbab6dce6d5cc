"""Extremes of a case: steps, elements, units and places, stiffness, loads and time."""

from collections.abc import Iterator
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
    first_bad,
    good,
    part,
    paths,
    size_of,
)

#: Fixed explicit steps tried, as parts of the stability limit at the start.
FRACTIONS = (0.5, 0.9, 0.99, 1.05, 1.3)
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
    "to a per cent. of_limit: the step over it. error: largest difference to the refined run, of the largest "
    "displacement. balance: largest energy error over the largest kinetic energy.",
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


def steps(base: Base) -> Part:
    """The largest stable explicit step, and how near to it a fixed step can go over the motion."""
    trial = replace(base.trial, integrator=EXPLICIT, options=(("check_stability", False),))
    limit = explicit_limit(base.case, trial.by_body, element=trial.element) / MARGIN
    title = "Explicit steps near the stability limit"
    if isinf(limit):
        rows = [base.row("does not apply: nothing vibrates, or no explicit run")]
        text = f"{base.case.name}, explicit steps: {rows[0]['status']}."
        return part("stable_step", title, rows, NOTES["stable_step"], text)
    rows = [_stepped(base, trial, fraction, limit) for fraction in FRACTIONS]
    held = [row["of_limit"] for row in good(rows) if row["balance"] < 1.0]
    lost = [row["of_limit"] for row in rows if row["of_limit"] not in held]
    text = f"{base.case.name}: the largest stable explicit step is {1e3 * limit:.3g} ms"
    text += f"; a fixed step of {max(held):.2f} of it holds over the motion" if held else ""
    text += f", one of {min(lost):.2f} does not" if lost else ""
    return part("stable_step", title, rows, NOTES["stable_step"], f"{text}.")


def _stepped(base: Base, trial: Trial, fraction: float, limit: float) -> Row:
    """A run by an explicit step near a fraction of the limit (s) that divides the interval of output."""
    interval, found = base.case.interval, base.found
    dt = interval / max(ceil(interval / (fraction * limit) - 0.5), 1)
    about = {"stable_dt": limit, "reference": found.label, "reference_error": found.error, "dt": dt}
    about["of_limit"] = dt / limit
    trial = replace(trial, dt=dt)
    if trial.work > MOST_WORK:
        return base.row(f"not run: {trial.work:.1e} elements times steps", **about)
    run = base.run(trial, f"explicit, {dt:.3g} s")
    if not run.status.ok:
        return base.row(str(run.status), **about)
    error = float(apart(found.solution, run, base.case).max())
    return base.row(**about, error=error, balance=energy_error(run))


def elements(base: Base) -> Part:
    """The first steps on meshes four times finer each, and the difference to another solver."""
    name = base.case.name
    rows = list(_finer(base)) if base.case.scene.beams else [base.row("does not apply: no beam")]
    complete, bad = good(rows), first_bad(rows)
    if complete:
        known = [row["to_peer"] for row in complete if row["to_peer"] == row["to_peer"]]
        text = f"{name}: runs hold up to {max(row['dofs'] for row in complete)} coordinates"
        text += f"; {base.peer} differs by {max(known):.0e} at most" if known else ""
        text += f"; beyond: {bad['status']}" if bad else ""
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
        about = {"elements": trial.elements, "dofs": run.dofs}
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
    """The case far from the origin and in other units: only rounding may change the answer.

    Parameters
    ----------
    base : Base
    growth : float
        Factor by which the motion makes a small disturbance larger.
    """
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
        except ResultError:  # joints whose forces equilibrium alone does not determine
            continue
        n = min(len(here), len(there))
        gap = max(gap, float(np.abs(here[:n] - there[:n]).max(initial=0.0)))
        largest = max(largest, float(np.abs(here[:n]).max(initial=0.0)))
    return gap / largest if largest > 0.0 else nan


def stiffness(base: Base) -> Part:
    """Stiffer and stiffer beams: the case must converge to rigid bars."""
    name, rows = base.case.name, [base.row("does not apply: no beam")]
    if base.case.scene.beams:
        ones = (1,) * len(base.case.scene.beams)
        rigid = base.run(replace(base.trial, element="rigid", mesh=ones), "rigid bars")
        why = "the scene is a mechanism" if rigid.status.code == "singular" else str(rigid.status)
        failed = [base.row(f"does not apply: with all beams rigid {why}")]
        rows = list(_stiffer(base, rigid)) if rigid.status.ok else failed
    known, text = good(rows), f"{name}, stiffness: {rows[0]['status']}."
    if known:
        soft, stiff = (
            f"{row['difference']:.1g} with {row['factor']:g} times its modulus" for row in (known[0], known[-1])
        )  # fmt: skip
        text = f"{name}, stiffness: the result differs from that of rigid bars by {soft}, and by {stiff}."
    return part("stiffness", "Stiffer and stiffer", rows, NOTES["stiffness"], text)


def _stiffer(base: Base, rigid: Solution) -> Iterator[Row]:
    size = size_of(paths(base.found.solution, base.case))
    for factor in STIFFER[base.quick]:
        stiff = replace(base.trial, scene=_stiffened(base.case.scene, factor))
        run = base.run(stiff, f"{factor:g} times as stiff")
        if not run.status.ok:
            yield base.row(str(run.status), factor=factor)
            continue
        gap = float(apart(rigid, run, base.case, size=size).max())
        yield base.row(factor=factor, difference=gap, uncertainty=base.found.error)


def _stiffened(scene: Scene, factor: float) -> Scene:
    def body(b: Any) -> Any:
        return replace(b, material=replace(b.material, E=factor * b.material.E)) if isinstance(b, Beam) else b

    return replace(scene, bodies=tuple(map(body, scene.bodies)))


def loads(base: Base) -> Part:
    """Larger and larger loads on the same mesh and by the same step."""
    rows = []
    for factor in LOADS[base.quick]:
        loaded = replace(base.trial, scene=_loaded(base.case.scene, factor))
        run = base.run(loaded, f"{factor:g} times the load")
        size = size_of(paths(run, base.case)) if run.status.ok else nan
        rows.append(base.row(str(run.status), factor=factor, largest=size))
    held, bad = [row["factor"] for row in good(rows)], first_bad(rows)
    text = f"{base.case.name}: runs hold up to {max(held, default=0.0):g} times the loads"
    text += f"; {bad['factor']:g} times: {bad['status']}" if bad else ""
    return part("loads", "Larger and larger loads", rows, NOTES["loads"], f"{text}.")


def _loaded(scene: Scene, factor: float) -> Scene:
    def times(value: Any) -> Any:
        if callable(value):
            return Changed(value, times)
        return tuple(times(x) for x in value) if isinstance(value, tuple) else factor * np.asarray(value)

    scaled = (replace(load, value=_plain(times(load.value))) for load in scene.loads)
    return replace(scene, loads=tuple(scaled), gravity=tuple(factor * g for g in scene.gravity))


def _plain(value: Any) -> Any:
    """Numbers of a constant load as floats."""
    if callable(value):
        return value
    return tuple(map(float, value)) if isinstance(value, tuple) else float(value)


def time(base: Base) -> Part:
    """Longer and longer motions by the same step: drift of the energy."""
    rows = []
    for factor in LONGER[base.quick]:
        trial = replace(base.trial, t_end=factor * base.case.duration, output_dt=factor * base.case.interval)
        about = {"factor": factor, "t_end": trial.t_end, "steps": factor * base.steps}
        if trial.work > MOST_WORK:
            rows.append(base.row(f"not run: {trial.work:.1e} elements times steps", **about))
            continue
        run = base.run(trial, f"{factor} times as long")
        balance = energy_error(run) if run.status.ok else nan
        rows.append(base.row(str(run.status), **about, balance=balance))
    last = (good(rows) or [{"steps": 0, "balance": nan}])[-1]
    text = f"{base.case.name}: over {last['steps']} steps the energy error is {last['balance']:.1g} of the kinetic one"
    bad = first_bad(rows)
    text += f"; {bad['factor']} times as long: {bad['status']}" if bad else ""
    return part("time", "Longer and longer motions", rows, NOTES["time"], f"{text}.")
