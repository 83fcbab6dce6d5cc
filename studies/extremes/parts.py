"""Extremes of a case: steps, elements, units and places, stiffness, loads and time."""

from collections.abc import Iterator
from dataclasses import replace
from math import ceil, inf, isinf, nan
from typing import Any

import numpy as np
import pandas as pd

from anctmm.errors import ResultError
from anctmm.model.bodies import Beam
from anctmm.model.case import Case
from anctmm.model.scene import Scene
from anctmm.results.metrics import EPS
from anctmm.results.solution import Solution
from studies.engine.meshes import MARGIN, explicit_limit
from studies.engine.other_numbers import Change
from studies.engine.tables import Table
from studies.engine.trials import Trial
from studies.extremes.base import Base, Part, Row, apart, good, paths, size_of

#: Fixed explicit steps tried, as parts of the stability limit at the start.
FRACTIONS = (0.5, 0.9, 0.99, 1.05, 1.3)
#: Elements times steps of a run at most.
MOST_WORK = 4e6
#: Elements at most, by whether the run is quick; of the other solver. Steps of each run, Newton's tolerance of it.
MOST, MOST_OF_PEER = {False: 20_000, True: 1_000}, 1_000
STEPS, NEWTON = 10, 1e-10
#: Distances from the origin, in lengths of the scene.
FAR = (1e2, 1e4, 1e6)
UNITS = {
    "mm, t, s": Change(1e3, 1e-3, 1.0),
    "µm, µg, ms": Change(1e6, 1e9, 1e3),
    "powers of two": Change(2.0**10, 2.0**-7, 2.0**5),
}
#: Factors of Young's modulus, by whether the run is quick; of the loads; of the duration.
STIFFER = {False: (1e-2, 1.0, 1e2, 1e4, 1e6), True: (1.0, 1e2, 1e4)}
LOADS = {False: (1.0, 2.0, 4.0, 8.0, 16.0), True: (1.0, 4.0)}
LONGER = {False: (1, 10, 100), True: (1, 10)}


def steps(base: Base) -> Part:
    """The largest stable explicit step, and how near to it a fixed step can go over the motion."""
    trial = replace(base.trial, integrator="zhai", options=(("check_stability", False),))
    limit = explicit_limit(base.case, trial.by_body, element=trial.element) / MARGIN
    about = {"stable_dt": limit, "reference": base.found.label, "reference_error": base.found.error}
    if isinf(limit):
        rows = [base.row("explicit step", status="does not apply: nothing vibrates, or no explicit run")]
    else:
        rows = [base.row("explicit step", **about, **_stepped(base, trial, f, limit)) for f in FRACTIONS]
    table = Table("stable_step", "Explicit steps near the stability limit", pd.DataFrame(rows), (
        "stable_dt (s): 2/ω_max (less with damping) of the undeformed scene, by the solver's own refusal, to a per "
        "cent. of_limit: the step over it. error: largest difference to the refined run, of the largest displacement. "
        "balance: largest energy error over the largest kinetic energy.",
    ))  # fmt: skip
    held = [row["of_limit"] for row in good(rows) if row["balance"] < 1.0]
    lost = [row["of_limit"] for row in rows if "of_limit" in row and row["of_limit"] not in held]
    text = f"{base.case.name}: the largest stable explicit step is {1e3 * limit:.3g} ms"
    text += f"; a fixed step of {max(held):.2f} of it holds over the motion" if held else ""
    text += f", one of {min(lost):.2f} does not" if lost else ""
    return Part(
        table, f"{text}." if limit < inf else f"{base.case.name}, explicit steps: {rows[0]['status']}."
    )


def _stepped(base: Base, trial: Trial, fraction: float, limit: float) -> Row:
    """A run by an explicit step near a fraction of the limit (s) that divides the interval of output."""
    interval = base.case.interval
    dt = interval / max(ceil(interval / (fraction * limit) - 0.5), 1)
    about = {"dt": dt, "of_limit": dt / limit}
    trial = replace(trial, dt=dt)
    if trial.work > MOST_WORK:
        return about | {"status": f"not run: {trial.work:.1e} elements times steps"}
    run = base.run(trial, f"explicit, {dt:.3g} s")
    if not run.status.ok:
        return about | {"status": str(run.status)}
    kinetic = float(np.max(run.energy.kinetic, initial=0.0)) or 1.0
    error = float(apart(base.found.solution, run, base.case)[1].max())
    return about | {
        "error": error,
        "balance": float(np.abs(run.energy.balance).max()) / kinetic,
        "status": "ok",
    }


def elements(base: Base) -> Part:
    """The first steps on meshes four times finer each, and the difference to another solver."""
    case = base.case
    rows = (
        list(_finer(base))
        if case.scene.beams
        else [base.row("many elements", status="does not apply: no beam")]
    )
    table = Table("many_elements", "Many elements", pd.DataFrame(rows), (
        f"The first {STEPS} steps of the refined run (an equilibrium whole). to_coarser: largest difference to the "
        f"mesh before. to_peer: to {base.peer or 'another solver'} on the same mesh, up to {MOST_OF_PEER} elements: "
        "rounding of both. uncertainty: Newton's tolerance, and rounding of coordinates.",
    ))  # fmt: skip
    complete = good(rows)
    if not complete:
        return Part(table, f"{case.name}, many elements: {rows[-1]['status']}.")
    known = [row["to_peer"] for row in complete if row["to_peer"] == row["to_peer"]]
    text = f"{case.name}: runs hold up to {max(row['dofs'] for row in complete)} coordinates"
    text += f"; {base.peer} differs by {max(known):.0e} at most" if known else ""
    bad = next((row["status"] for row in rows if row["status"] != "ok"), "")
    return Part(table, f"{text}{f'; beyond: {bad}' if bad else ''}.")


def _finer(base: Base) -> Iterator[Row]:
    case, before = base.case, None
    trial = replace(base.trial, options=(("newton_tolerance", NEWTON),))
    if not case.static:
        trial = replace(trial, t_end=STEPS * trial.dt, output_dt=trial.dt)
    while trial.elements <= MOST[base.quick]:
        run = base.run(trial, f"{trial.elements} elements")
        about = base.row("many elements", elements=trial.elements, dofs=run.dofs)
        if not run.status.ok:
            yield about | {"status": str(run.status)}
            return
        coarser = nan if before is None else float(apart(before, run, case)[1].max())
        rate = 1e6 * run.cost.cpu_s / trial.elements / max(run.cost.steps, 1)
        size = case.scene.length / size_of(paths(run, case))
        yield about | {
            "to_coarser": coarser, "us_per_element_step": rate, "to_peer": _to_peer(base, trial, run),
            "uncertainty": (EPS * STEPS**1.5 + NEWTON * STEPS) * size, "status": "ok",
        }  # fmt: skip
        before, trial = run, replace(trial, mesh=tuple(4 * n for n in trial.mesh))


def _to_peer(base: Base, trial: Trial, run: Solution) -> float:
    if not base.peer or trial.elements > MOST_OF_PEER:
        return nan
    peer = base.run(replace(trial, solver=base.peer), f"{base.peer}, {trial.elements} elements")
    return float(apart(run, peer, base.case)[1].max()) if peer.status.ok else nan


def places(base: Base, growth: float) -> Part:
    """The case far from the origin and in other units: only rounding may change the answer.

    Parameters
    ----------
    base : Base
    growth : float
        Factor by which the motion makes a small disturbance larger.
    """
    plain = base.plain()
    rows = [_changed(base, plain, name, change, growth) for name, change in UNITS.items()]
    for far in FAR[-1:] if base.quick else FAR:
        away = Change(place=(far * base.case.scene.length, 0.5 * far * base.case.scene.length))
        rows.append(_changed(base, plain, f"{far:.0e} lengths from the origin", away, growth))
    table = Table("units", "Other units, and far from the origin", pd.DataFrame(rows), (
        "difference: largest at the probes to the same run in m, kg, s at its own place, over the largest "
        "displacement; "
        "predicted: at most, by rounding of each step, which the motion makes larger as it does a disturbance. "
        "reactions: the same of forces of joints. In units that are powers of two only exponents change. Laws of "
        "springs are functions in SI units: scenes with them are moved, and not computed in other units.",
    ))  # fmt: skip
    complete = good(rows)
    if not complete:
        return Part(table, f"{base.case.name}, units and place: {rows[0]['status']}.")
    worst = max(complete, key=lambda r: r["difference"])
    bits = (
        "; in units that are powers of two not one bit differs"
        if any(r["same_bits"] for r in complete)
        else ""
    )
    return Part(
        table,
        f"{base.case.name}, units and place: results differ by {worst['difference']:.0e} at most "
        f"({worst['value']}){bits}.",
    )


def _changed(base: Base, plain: Solution, value: str, units: Change, growth: float) -> Row:
    case, trial = base.case, base.trial
    in_units = (units.metre, units.kilogram, units.second) != (1.0, 1.0, 1.0)
    about = base.row("units" if in_units else "place", value=value)
    if in_units and any(connector.law is not None for connector in case.scene.connectors):
        return about | {"status": "does not apply: a spring has a law in SI units"}
    if not case.static:
        s = units.second
        trial = replace(trial, dt=trial.dt * s, t_end=trial.t_end * s, output_dt=trial.output_dt * s)
    moved = base.run(replace(trial, scene=units.scene(case.scene)), value)
    if not (plain.status.ok and moved.status.ok):
        return about | {"status": str((moved if plain.status.ok else plain).status)}
    far = float(np.hypot(*units.place)) + case.scene.length
    rounding = base.rounding * max(growth, 1.0) * far / size_of(paths(plain, case))
    return about | {
        "difference": float(apart(plain, moved, case, units.metre)[1].max()),
        "predicted": 0.0 if units.exact else rounding, "reactions": nan if in_units else _of_joints(plain, moved),
        "same_bits": bool(np.array_equal(paths(plain, case), paths(moved, case) / units.metre)), "status": "ok",
    }  # fmt: skip


def _of_joints(plain: Solution, moved: Solution) -> float:
    """Largest difference of forces of joints of two runs, over the largest force; NaN where none is known."""
    apart_by, largest = 0.0, 0.0
    for one, other in zip(plain.scene.joints, moved.scene.joints, strict=True):
        try:
            here, there = plain.reaction(one)[:, :2], moved.reaction(other)[:, :2]
        except ResultError:  # joints whose forces equilibrium alone does not determine
            continue
        n = min(len(here), len(there))
        apart_by = max(apart_by, float(np.abs(here[:n] - there[:n]).max(initial=0.0)))
        largest = max(largest, float(np.abs(here[:n]).max(initial=0.0)))
    return apart_by / largest if largest > 0.0 else nan


def stiffness(base: Base) -> Part:
    """Stiffer and stiffer beams: the case must converge to rigid bars."""
    name = base.case.name
    if not base.case.scene.beams:
        rows = [base.row("stiffness", status="does not apply: no beam")]
    else:
        ones = (1,) * len(base.case.scene.beams)
        rigid = base.run(replace(base.trial, element="rigid", mesh=ones), "rigid bars")
        why = "the scene is a mechanism" if rigid.status.code == "singular" else str(rigid.status)
        rows = (
            list(_stiffer(base, rigid)) if rigid.status.ok
            else [base.row("stiffness", status=f"does not apply: with all beams rigid {why}")]
        )  # fmt: skip
    table = Table("stiffness", "Stiffer and stiffer", pd.DataFrame(rows), (
        "factor: of Young's modulus of all beams, on the refined mesh and by the refined step. difference: to rigid "
        "bars at the probes, over the largest displacement of the case; it must fall until only the errors of mesh and "
        "step (uncertainty) are left.",
    ))  # fmt: skip
    known = good(rows)
    if not known:
        return Part(table, f"{name}, stiffness: {rows[0]['status']}.")
    soft, stiff = (
        f"{row['difference']:.1g} with {row['factor']:g} times its modulus" for row in (known[0], known[-1])
    )
    return Part(
        table, f"{name}, stiffness: the result differs from that of rigid bars by {soft}, and by {stiff}."
    )


def _stiffer(base: Base, rigid: Solution) -> Iterator[Row]:
    size = size_of(paths(base.found.solution, base.case))
    for factor in STIFFER[base.quick]:
        run = base.run(
            replace(base.trial, scene=_stiffened(base.case.scene, factor)), f"{factor:g} times as stiff"
        )
        about = base.row("stiffness", factor=factor)
        if not run.status.ok:
            yield about | {"status": str(run.status)}
            continue
        gap = float(apart(rigid, run, base.case, size=size)[1].max())
        yield about | {"difference": gap, "uncertainty": base.found.error, "status": "ok"}


def _stiffened(scene: Scene, factor: float) -> Scene:
    def body(b: Any) -> Any:
        return replace(b, material=replace(b.material, E=factor * b.material.E)) if isinstance(b, Beam) else b

    return replace(scene, bodies=tuple(map(body, scene.bodies)))


def loads(base: Base) -> Part:
    """Larger and larger loads on the same mesh and by the same step."""
    rows = []
    for factor in LOADS[base.quick]:
        run = base.run(replace(base.trial, scene=_loaded(base.case, factor)), f"{factor:g} times the load")
        about = base.row("load", factor=factor, status=str(run.status))
        rows.append(about | ({"largest": size_of(paths(run, base.case))} if run.status.ok else {}))
    table = Table("loads", "Larger and larger loads", pd.DataFrame(rows), (
        "factor: of all loads and of gravity, on the refined mesh and by the refined step; drives stay. largest: "
        "displacement of the probes, m.",
    ))  # fmt: skip
    held = [row["factor"] for row in good(rows)]
    bad = next((row for row in rows if row["status"] != "ok"), None)
    text = f"{base.case.name}: runs hold up to {max(held, default=0.0):g} times the loads"
    return Part(table, f"{text}; {bad['factor']:g} times: {bad['status']}." if bad else f"{text}.")


def _loaded(case: Case, factor: float) -> Scene:
    def times(value: Any) -> Any:
        if callable(value):
            return _Times(value, factor)
        return tuple(factor * x for x in value) if isinstance(value, tuple) else factor * value

    scaled = (replace(load, value=times(load.value)) for load in case.scene.loads)
    g = case.scene.gravity
    return replace(case.scene, loads=tuple(scaled), gravity=(factor * g[0], factor * g[1]))


class _Times:
    """A history times a factor."""

    def __init__(self, history: Any, factor: float) -> None:
        self.history, self.factor = history, factor
        if (breaks := getattr(history, "breaks", None)) is not None:
            self.breaks = breaks

    def __call__(self, t: Any) -> Any:
        found = self.history(t)
        return (
            tuple(self.factor * np.asarray(x) for x in found)
            if isinstance(found, tuple)
            else self.factor * np.asarray(found)
        )


def time(base: Base) -> Part:
    """Longer and longer motions by the same step: drift of the energy."""
    rows = []
    for factor in LONGER[base.quick]:
        trial = replace(base.trial, t_end=factor * base.case.duration, output_dt=factor * base.case.interval)
        about = base.row("time", factor=factor, t_end=trial.t_end, steps=factor * base.steps)
        if trial.work > MOST_WORK:
            rows.append(about | {"status": f"not run: {trial.work:.1e} elements times steps"})
            continue
        run = base.run(trial, f"{factor} times as long")
        if run.status.ok:
            kinetic = float(np.max(run.energy.kinetic, initial=0.0)) or 1.0
            about |= {"balance": float(np.abs(run.energy.balance).max()) / kinetic}
        rows.append(about | {"status": str(run.status)})
    table = Table("time", "Longer and longer motions", pd.DataFrame(rows), (
        "factor: of the duration, by the refined step. balance: largest energy error over the largest kinetic energy.",
    ))  # fmt: skip
    last = (good(rows) or [{"steps": 0, "balance": nan}])[-1]
    text = f"{base.case.name}: over {last['steps']} steps the energy error is {last['balance']:.1g} of the kinetic one"
    bad = next((row for row in rows if row["status"] != "ok"), None)
    return Part(table, f"{text}; {bad['factor']} times as long: {bad['status']}." if bad else f"{text}.")
