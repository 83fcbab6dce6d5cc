"""What a task finds: its run, and the few numbers of it that are stored."""

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from threadpoolctl import threadpool_limits

import anctmm as at
from anctmm.errors import AnctmmError, PluginError, ResultError, UnknownSolverError, shown
from anctmm.model.connectors import RotationalSpring
from anctmm.model.rigid_bodies import RigidBody
from anctmm.model.scene import Beam, Probe
from anctmm.results.metrics import common_times, rounding_at
from anctmm.results.solution import Solution
from anctmm.results.status import Status
from anctmm.solvers import registry
from anctmm.solvers.foreign_code import contained
from studies.regression.history import History, label
from studies.regression.readable import SOLVERS as READABLE
from studies.regression.scenes import (
    ARC_LENGTH,
    Compared,
    Forces,
    Frequencies,
    FromRest,
    Motion,
    StartVelocities,
    Static,
    Task,
    motions_of,
)

Array = NDArray[np.float64]
#: Heads of columns with their values, (n,) each.
Columns = Iterator[tuple[str, Array]]

ENERGIES = {
    "kinetic": "kinetic energy", "strain": "strain energy", "potential": "potential energy", "work": "work",
}  # fmt: skip
#: Angle, rad, below which a place at rest does not turn.
TURNED = 1e-6
#: Part of the largest frequency below which growth rates are rounding.
GROWING = 1e-9
#: Fractions of a beam at which section forces are read.
SECTIONS = (0.3, 0.8)


def answered(task: Task) -> tuple[Status, History | None]:
    """Run a task.

    Returns
    -------
    Status
        How it ended: "absent" where its solver is not installed, "refused" where another of `anctmm.errors` was
        raised, "failed" where anything else was.
    History or None
        None where it did not end as it must.
    """
    try:
        with contained(), threadpool_limits(limits=1):
            status, history = _run(task)
    except (PluginError, UnknownSolverError) as error:
        return Status("absent", str(error)), None
    except AnctmmError as error:
        status = Status("refused", f"{type(error).__name__}: {error}")
        history = _empty("t (s)", f"refused, {type(error).__name__}")
    except Exception as error:  # one broken solver must not end a check
        return Status("failed", f"{type(error).__name__}: {error}"), None
    return status, history if status.code == task.ends else None


def _empty(axis: str, ending: str) -> History:
    """Of a run without outputs."""
    return History.of(np.empty(0), axis, {}, 0, ending)


def _run(task: Task) -> tuple[Status, History | None]:
    """How the run of a task ended, and its history; None where it did not end as it must."""
    run = task.run
    if isinstance(run, StartVelocities):
        return Status(), _table("body", _velocities(at.consistent_velocities(task.scene)))
    if isinstance(run, Frequencies):
        return Status(), _table("mode", _modes(task, run))
    solutions = [solution_of(task, one) for one in motions_of(run)]
    status = next((s.status for s in solutions if not s.status.ok), Status())
    if status.code != task.ends:
        return status, None
    found = solutions[0]
    if isinstance(run, Compared):
        return status, _table("probe", _comparison(task, *solutions))
    if isinstance(run, Static) and run.path == ARC_LENGTH:
        return status, _table("limit point", _limits(task, found))
    columns = _forces(_saved(found)) if isinstance(run, Forces) else _motion(task, found)
    return status, _history(motions_of(run)[0], found, columns)


def solution_of(task: Task, run: Motion) -> Solution:
    """The solution of a run by the solver of a task; raises whatever the solver raises."""
    name, options = task.solver, dict(task.options)
    solver = READABLE[name] if name in READABLE else registry.solver(name)
    if isinstance(run, Static):
        options |= {} if run.path == "load" else {"path": run.path}
        static = registry.static_of(name, solver)
        answer: Any = static(task.scene, run.discretisation, load_steps=run.load_steps, **options)
    else:
        if isinstance(task.run, FromRest):
            still = Static(run.mesh, run.element, run.quadrature, run.newton_tolerance)
            options["start"] = registry.static_of(name, solver)(task.scene, still.discretisation)
        answer = solver(task.scene, run, **options)
    if not isinstance(answer, Solution):
        raise TypeError(f"solver {name!r} answers {shown(answer)}; a Solution is needed")
    return answer


# --- histories of a motion -----------------------------------------------------------------------------------


def _history(run: Motion, found: Solution, columns: Columns) -> History:
    """Samples at the times wanted; a solver may take more of them (load steps), or end early."""
    axis, status = "load factor" if isinstance(run, Static) else "t (s)", found.status
    parts = {"step": status.step, "body": status.body, "element": status.element}
    words = [status.code, *(f"{k} {v}" for k, v in parts.items() if v is not None)]
    ending = "" if status.ok else ", ".join(words)
    if len(found.t) < 2:  # a run that ended before its first output has only a status
        return _empty(axis, ending)
    times = (
        np.linspace(0.0, 1.0, run.load_steps + 1) if isinstance(run, Static) else run.times(run.output_steps)
    )
    mine, _ = common_times(found.t, times)
    values = {head: series[mine] for head, series in columns}
    return History.of(found.t[mine], axis, values, found.cost.newton_iterations, ending)


def _motion(task: Task, found: Solution) -> Columns:
    """Displacements of the probes, angles of those that turn in place, and the energies that the solver gives.

    An energy that is zero throughout (kinetic in statics) or that the solver does not give is left out.
    """
    for probe in task.probes:
        body, key = found.scene.probe(probe)
        where = f"{body} at {key if isinstance(key, str) else f'{key:g}'}"
        yield from _vector("displacement", where, found.displacement(probe))
        if (angle := _turned_in_place(found, probe)) is not None:
            yield label("angle", where), angle
    for name, quantity in ENERGIES.items():
        series = getattr(found.energy, name)
        if np.any(series != 0.0) and np.isfinite(series).all():
            yield label(quantity), series


def _turned_in_place(found: Solution, probe: Probe) -> Array | None:
    """Angle of a place that rests and turns, such as an axle, rad; displacements and energies do not tell its sense."""
    way = np.linalg.norm(found.displacement(probe), axis=1).max(initial=0.0)
    if way > rounding_at(found, probe):
        return None
    try:
        angle = found.angle(probe)
    except ResultError:
        return None
    return angle if np.abs(angle).max(initial=0.0) > TURNED else None


def _vector(quantity: str, where: str, series: Array) -> Columns:
    for direction, values in zip("xy", series.T, strict=True):
        yield label(quantity, f"{where} {direction}"), values


# --- what users read besides -----------------------------------------------------------------------------------


def _saved(found: Solution) -> Solution:
    """The solution after it has been written and read."""
    with TemporaryDirectory() as folder:
        path = found.save(Path(folder) / "run.npz")
        return at.load(path, found.scene)


def _forces(found: Solution) -> Columns:
    """Reactions of all joints, section forces of the flexible beams, tensions of all connectors."""
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
        turning = isinstance(connector, RotationalSpring)
        quantity = "spring moment" if turning else "tension"
        yield label(quantity, f"connector {k}"), found.tension(connector)
    lost = found.energy.dissipated
    if np.any(lost != 0.0) and np.isfinite(lost).all():
        yield label("dissipated energy"), lost


def _limits(task: Task, found: Solution) -> Columns:
    """Load factors at the limit points of a path and at its end, with the displacements of the probes there.

    Where the path's points lie depends on rounding; a cubic spline over the length of the path does not.
    """
    moved = np.column_stack([found.displacement(probe) for probe in task.probes])
    moved_by = np.linalg.norm(np.diff(moved, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(moved_by)])
    load = CubicSpline(length, found.t)
    turns = [s for s in load.derivative().roots(extrapolate=False) if 0.0 < s < length[-1]]
    places = np.array([*turns, length[-1]])
    yield label("load factor"), load(places)
    for probe in task.probes:
        where = " at ".join(map(str, found.scene.probe(probe)))
        yield from _vector("displacement", where, CubicSpline(length, found.displacement(probe))(places))


def _modes(task: Task, run: Frequencies) -> Columns:
    rest = solution_of(task, run.run) if run.at_rest else None
    found = at.modes(task.scene, run.run.discretisation, count=run.count, about=rest, spin=run.spin)
    yield label("frequency"), found.frequencies
    if np.abs(found.growth_rates).max() > GROWING * np.abs(found.frequencies).max():
        yield label("growth rate"), found.growth_rates


def _velocities(scene: at.Scene) -> Columns:
    """Of each body at its start or centre, and its spin; of a beam that of the line between its ends."""
    velocities, spins = [], []
    for body in scene.bodies:
        if isinstance(body, Beam):
            start, end = (np.array(body.velocity(f)) if body.velocity else np.zeros(2) for f in (0.0, 1.0))
            along = np.subtract(body.end, body.start) / body.length
            velocities.append(start)
            spins.append((along[0] * (end - start)[1] - along[1] * (end - start)[0]) / body.length)
        else:
            velocities.append(np.array(body.velocity))
            spins.append(body.spin if isinstance(body, RigidBody) else 0.0)
    yield from _vector("velocity", "of the body", np.array(velocities))
    yield label("spin", "of the body"), np.array(spins)


def _comparison(task: Task, one: Solution, other: Solution) -> Columns:
    found = at.compare(one, other, task.probes)
    yield label("relative error"), np.array([found.error, found.largest, *found.by_probe.values()])


def _table(axis: str, columns: Columns) -> History:
    """A history whose samples are numbered."""
    values = dict(columns)
    return History.of(np.arange(float(len(next(iter(values.values()))))), axis, values)
