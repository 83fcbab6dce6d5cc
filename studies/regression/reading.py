"""What a task finds: its run, and the few numbers of it that are stored."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

import anctmm as at
from anctmm.errors import AnctmmError, UnsupportedError
from anctmm.model.connectors import RotationalSpring
from anctmm.results.metrics import common_times
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from anctmm.solvers.foreign_code import contained
from anctmm.solvers.registry import Solver
from studies.engine.refinement import turned_in_place
from studies.regression.history import History, label, samples
from studies.regression.readable import SOLVERS as READABLE
from studies.regression.scenes import Motion, Read, Static, Task, motions_of, settings_of

Array = NDArray[np.float64]
#: Heads of columns with their values, (n,) each.
Columns = Iterator[tuple[str, Array]]

#: Part of the largest frequency below which growth rates are rounding.
GROWING = 1e-9
#: Fractions of a beam at which section forces are read.
SECTIONS = (0.3, 0.8)


def answered(task: Task) -> tuple[Status, History | None]:
    """How the run of a task ended, and its history; None where it did not end as it must.

    Beside the statuses of solutions: "absent" where there is no such solver, "refused" where it raised one of
    `anctmm.errors`, "failed" where it raised anything else.
    """
    try:
        for run in motions_of(task.run):
            solver_of(task.solver, run)
    except AnctmmError as error:
        return Status("absent", str(error)), None
    try:
        with contained(), threadpool_limits(limits=1):
            status, history = _run(task)
    except AnctmmError as error:
        lacks = isinstance(error, UnsupportedError) and task.ends == "ok"
        status = Status("unsupported" if lacks else "refused", f"{type(error).__name__}: {error}")
        history = History(samples("t (s)"), ending=f"refused, {type(error).__name__}")
    except Exception as error:  # one broken solver must not end a check
        return Status("failed", f"{type(error).__name__}: {error}"), None
    if history is None or status.code != task.ends:
        return status, None
    return status, replace(history, settings=settings_of(task.run))


def _run(task: Task) -> tuple[Status, History | None]:
    """The same of a run that raises whatever it raises."""
    run, what = task.run, getattr(task.run, "what", "")
    if isinstance(run, Read) and what == "modes":
        return Status(), History(pd.DataFrame(dict(_modes(task, run))).rename_axis("mode"))
    solutions = [solution_of(task, one) for one in motions_of(run)]
    status = next((s.status for s in solutions if not s.status.ok), Status())
    if status.code != task.ends:
        return status, None
    found = solutions[0]
    if what == "compared with":
        comparison = at.compare(found, solutions[1], task.probes)
        errors = np.array([comparison.error, comparison.largest, *comparison.by_probe.values()])
        return status, History(pd.DataFrame({label("relative error"): errors}).rename_axis("probe"))
    columns = _forces(found) if what == "forces" else _motion(task, found)
    return status, _history(motions_of(run)[0], found, columns)


def solver_of(name: str, run: Motion) -> Solver:
    """The solver that does a run; AnctmmError if it is not registered, cannot be loaded or has no statics."""
    solver = READABLE[name] if name in READABLE else registry.solver(name)
    return registry.static_of(name, solver) if isinstance(run, Static) else solver


def solution_of(task: Task, run: Motion) -> Solution:
    """The solution of a run by the solver of a task; raises whatever the solver raises."""
    solve = solver_of(task.solver, run)
    if isinstance(run, Static):
        return solve(task.scene, run.discretisation, load_steps=run.load_steps)
    if getattr(task.run, "what", "") != "start=rest":
        return solve(task.scene, run)
    still = Static(run.mesh, run.element, run.quadrature, run.newton_tolerance)
    return solve(task.scene, run, start=solver_of(task.solver, still)(task.scene, still.discretisation))


def _history(run: Motion, found: Solution, columns: Columns) -> History:
    """Samples at the times wanted; a solver may take more of them (load steps), or end early."""
    if isinstance(run, Static):
        axis, times = "load factor", np.linspace(0.0, 1.0, run.load_steps + 1)
    else:
        axis, times = "t (s)", run.times(run.output_steps)
    named = ((name, getattr(found.status, name)) for name in ("step", "body", "element"))
    words = [found.status.code, *(f"{name} {value}" for name, value in named if value is not None)]
    ending = "" if found.status.ok else ", ".join(words)
    if len(found.t) < 2:  # a run that ended before its first output has only a status
        return History(samples(axis), ending=ending)
    mine, _ = common_times(found.t, times)
    frame = samples(axis, found.t[mine], ((head, series[mine]) for head, series in columns))
    return History(frame, found.cost.newton_iterations, ending)


def _motion(task: Task, found: Solution) -> Columns:
    """Displacements of the probes, angles of those that turn in place, and the energies that the solver gives."""
    for probe in task.probes:
        body, key = found.scene.probe(probe)
        where = f"{body} at {key if isinstance(key, str) else f'{key:g}'}"
        yield from _vector("displacement", where, found.displacement(probe))
        angle = turned_in_place(found, probe)  # displacements and energies do not tell its sense
        if angle is not None:
            yield label("angle", where), angle
    energy = found.energy
    yield from _given("kinetic energy", energy.kinetic)
    yield from _given("strain energy", energy.strain)
    yield from _given("potential energy", energy.potential)
    yield from _given("work", energy.work)


def _vector(quantity: str, where: str, series: Array) -> Columns:
    for direction, values in zip("xy", series.T, strict=True):
        yield label(quantity, f"{where} {direction}"), values


def _given(quantity: str, series: Array) -> Columns:
    """An energy, unless it is zero throughout (kinetic in statics) or the solver does not give it."""
    if np.any(series != 0.0) and np.isfinite(series).all():
        yield label(quantity), series


def _forces(found: Solution) -> Columns:
    """Reactions of joints, section forces of flexible beams, tensions of connectors: of a run saved and loaded."""
    with TemporaryDirectory() as folder:
        found = at.load(found.save(Path(folder) / "run.npz"), found.scene)
    assert found.run
    kinds = {name: kind for name, (_, kind) in found.run.of(found.scene).items()}
    for k, joint in enumerate(found.scene.joints):
        where, reaction = f"joint {k} {type(joint).__name__}", found.reaction(joint)
        yield from _vector("reaction", where, reaction[:, :2])
        yield label("reaction moment", where), reaction[:, 2]
    for beam in found.scene.beams:
        for fraction in () if kinds[beam.name] == "rigid" else SECTIONS:
            where, force = f"{beam.name} at {fraction:g}", found.section_force((beam.name, fraction))
            yield label("section force", f"N {where}"), force[:, 0]
            yield label("section force", f"Q {where}"), force[:, 1]
            yield label("section moment", where), force[:, 2]
    for k, connector in enumerate(found.scene.connectors):
        quantity = "spring moment" if isinstance(connector, RotationalSpring) else "tension"
        yield label(quantity, f"connector {k}"), found.tension(connector)
    yield from _given("dissipated energy", found.energy.dissipated)


def _modes(task: Task, read: Read) -> Columns:
    """Six natural modes about the equilibrium, or in a steady spin."""
    (run,) = read.runs
    assert isinstance(run, Static)
    rest = None if read.spin else solution_of(task, run)
    found = at.modes(task.scene, run.discretisation, count=6, about=rest, spin=read.spin)
    yield label("frequency"), found.frequencies
    if np.abs(found.growth_rates).max() > GROWING * np.abs(found.frequencies).max():
        yield label("growth rate"), found.growth_rates
