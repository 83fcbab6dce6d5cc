"""Extremes of a case: steps, elements, places, stiffness, loads and time."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil, isinf, nan
from typing import Any

import numpy as np

from anctmm.errors import AnctmmError
from anctmm.model.bodies import Beam
from anctmm.model.scene import Scene
from anctmm.results.metrics import EPS
from anctmm.results.solution import Solution
from studies.engine.other_numbers import Change, Changed
from studies.engine.trials import EXPLICIT, MARGIN, Trial, explicit_limit
from studies.extremes.base import NOT_RUN, Base, Part, Row, apart, energy_error, good, paths, size_of

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
#: Names of tables with their titles and notes.
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


def _beyond(rows: Sequence[Row]) -> str:
    """End of a sentence: the first factor that has no answer."""
    bad = next((row for row in rows if row["status"] != "ok"), None)
    return f"; {bad['factor']:g} times: {bad['status']}" if bad else ""


def steps(base: Base) -> Part:
    """The largest stable explicit step, and how near to it a fixed step can go over the motion."""
    plain = replace(base.trial, integrator=EXPLICIT, options=(("check_stability", False),))
    limit, interval = explicit_limit(plain) / MARGIN, base.case.interval
    if isinf(limit):
        return base.part(*STABLE, [base.row("does not apply: nothing vibrates, or no explicit run")], "")

    def variant(factor: float) -> Trial:  # with a step that divides the interval of output
        return replace(plain, dt=interval / max(ceil(interval / (factor * limit) - 0.5), 1))

    def measured(trial: Trial, run: Solution) -> Row:
        error = float(apart(base.found.solution, run, base.case).max())
        return {"stable_dt": limit, "dt": trial.dt, "error": error, "reference_error": base.found.error,
                "balance": energy_error(run)}  # fmt: skip

    rows = base.swept("explicit", FRACTIONS, variant, measured)
    held = [row["factor"] for row in good(rows) if row["balance"] < 1.0]
    ran = [row["factor"] for row in rows if not row["status"].startswith(NOT_RUN)]
    text = f"the largest stable explicit step is {1e3 * limit:.3g} ms"
    text += f"; a fixed step of {max(held):.2f} of it holds over the motion" if held else ""
    text += f", one of {min(lost):.2f} does not" if (lost := set(ran) - set(held)) else ""
    return base.part(*STABLE, rows, text)


def elements(base: Base) -> Part:
    """The first steps on meshes four times finer each, and the difference to another solver."""
    rows = list(_finer(base)) if base.case.scene.beams else [base.row("does not apply: no beam")]
    known = [row["to_peer"] for row in good(rows) if row["to_peer"] == row["to_peer"]]
    text = f"runs hold up to {max((row['dofs'] for row in good(rows)), default=0)} coordinates"
    text += f"; {base.peer} differs by {max(known):.0e} at most" if known else ""
    text += "" if rows[-1]["status"] == "ok" else f"; beyond: {rows[-1]['status']}"
    return base.part(*MANY, rows, text)


def _finer(base: Base) -> Iterator[Row]:
    case, before = base.case, None
    trial = replace(base.trial, options=(("newton_tolerance", NEWTON),))
    if not case.static:
        trial = replace(trial, t_end=STEPS * trial.dt, output_dt=trial.dt)
    while trial.elements <= MOST[base.quick]:
        run = base.run(trial, f"{trial.elements} elements")
        about: Row = {"elements": trial.elements, "dofs": run.dofs}
        if not run.status.ok:
            yield base.row(run.status, **about)
            return
        yield base.row(
            **about,
            to_coarser=nan if before is None else float(apart(before, run, case).max()),
            us_per_element_step=1e6 * run.cost.cpu_s / trial.elements / max(run.cost.steps, 1),
            to_peer=_to_peer(base, trial, run),
            uncertainty=(EPS * STEPS**1.5 + NEWTON * STEPS) * case.scene.length / size_of(paths(run, case)),
        )
        before, trial = run, replace(trial, mesh=tuple(4 * n for n in trial.mesh))


def _to_peer(base: Base, trial: Trial, run: Solution) -> float:
    if not base.peer or trial.elements > MOST_OF_PEER:
        return nan
    peer = base.run(replace(trial, solver=base.peer), f"{base.peer}, {trial.elements} elements")
    return float(apart(run, peer, base.case).max()) if peer.status.ok else nan


def places(base: Base, growth: float) -> Part:
    """The case far from the origin: only rounding may change the answer."""
    rows = [base.row(**_moved(base, far, growth)) for far in FAR[base.quick]]
    worst = max((row["difference"] for row in good(rows)), default=nan)
    return base.part(*PLACES, rows, f"far from the origin results differ by {worst:.0e} at most")


def _moved(base: Base, far: float, growth: float) -> Row:
    case, length = base.case, base.case.scene.length
    plain, place = base.run(base.trial, "refined run"), (far * length, 0.5 * far * length)
    try:
        trial = replace(base.trial, scene=Change(place).scene(case.scene))
    except AnctmmError as error:  # a part of a user's own kind
        return {"lengths": far, "status": f"does not apply: {error}"}
    moved = base.run(trial, "far from the origin")
    if not (plain.status.ok and moved.status.ok):
        return {"lengths": far, "status": (moved if plain.status.ok else plain).status}
    digits = (float(np.hypot(*place)) + length) / size_of(paths(plain, case))
    difference = float(apart(plain, moved, case).max())
    return {"lengths": far, "difference": difference, "predicted": base.rounding * max(growth, 1.0) * digits}


def stiffness(base: Base) -> Part:
    """Stiffer and stiffer beams: the case must converge to rigid bars."""
    case, scene = base.case, base.case.scene
    if not scene.beams:
        return base.part(*STIFFNESS, [base.row("does not apply: no beam")], "")
    rigid = base.run(replace(base.trial, element="rigid", mesh=(1,) * len(scene.beams)), "rigid bars")
    size = size_of(paths(base.found.solution, case))

    def stiffer(b: Any, factor: float) -> Any:
        return replace(b, material=replace(b.material, E=factor * b.material.E)) if isinstance(b, Beam) else b

    def variant(factor: float) -> Trial:
        bodies = tuple(stiffer(b, factor) for b in scene.bodies)
        return replace(base.trial, scene=replace(scene, bodies=bodies))

    def measured(trial: Trial, run: Solution) -> Row:
        return {"difference": float(apart(rigid, run, case, size).max()), "uncertainty": base.found.error}

    rows = [base.row(f"does not apply: with all beams rigid {rigid.status}")]
    if rigid.status.ok:
        rows = base.swept("stiffness", STIFFER[base.quick], variant, measured)
    by = [f"{r['difference']:.1g} with {r['factor']:g} times its modulus" for r in good(rows)]
    text = f"the result differs from that of rigid bars by {by[0]}, and by {by[-1]}" if by else ""
    return base.part(*STIFFNESS, rows, text)


def loads(base: Base) -> Part:
    """Larger and larger loads on the same mesh and by the same step."""

    def variant(factor: float) -> Trial:
        return replace(base.trial, scene=_loaded(base.case.scene, factor))

    def measured(trial: Trial, run: Solution) -> Row:
        return {"largest": size_of(paths(run, base.case))}

    rows = base.swept("loads", LOADS[base.quick], variant, measured)
    held = max((row["factor"] for row in good(rows)), default=0.0)
    return base.part(*LOADED, rows, f"runs hold up to {held:g} times the loads{_beyond(rows)}")


def _loaded(scene: Scene, factor: float) -> Scene:
    def times(value: Any) -> Any:
        if callable(value):
            return Changed(value, times)
        return tuple(map(times, value)) if isinstance(value, tuple | list) else factor * value

    scaled = (replace(load, value=times(load.value)) for load in scene.loads)
    return replace(scene, loads=tuple(scaled), gravity=times(scene.gravity))


def time(base: Base) -> Part:
    """Longer and longer motions by the same step: drift of the energy."""

    def variant(factor: float) -> Trial:
        return replace(base.trial, t_end=factor * base.case.duration, output_dt=factor * base.case.interval)

    def measured(trial: Trial, run: Solution) -> Row:
        return {"t_end": trial.t_end, "steps": run.cost.steps, "balance": energy_error(run)}

    rows = base.swept("time", LONGER[base.quick], variant, measured)
    last = (good(rows) or [{"steps": 0, "balance": nan}])[-1]
    text = f"over {last['steps']} steps the energy error is {last['balance']:.1g} of the kinetic one"
    return base.part(*TIME, rows, text + _beyond(rows))
