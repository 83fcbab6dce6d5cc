"""Run of an Exudyn model at its best settings, its time and its history: shared by both Exudyn peers.

One thread, fixed steps, a sparse solver that keeps its pattern, no files, internal sensors. The time is that of
`SolveDynamic` or `SolveStatic` alone, without building and assembling the model.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter, process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.discretisation import INTEGRATORS, Discretisation, parts_of_load
from anctmm.discretise.memory import check_memory
from anctmm.elements.kinds import check_kinds
from anctmm.errors import DiscretisationError, UnsupportedError, shown, unknown_kind, unknown_option
from anctmm.model.drives import tabulate
from anctmm.model.joints import unknown_joint
from anctmm.model.loads import LOADS, load_text, width_of
from anctmm.model.needs import not_offered, refuse
from anctmm.model.scene import (
    Beam,
    Clamp,
    Force,
    LineLoad,
    Load,
    Pin,
    Prismatic,
    Scene,
    Slider,
    Torque,
    Weld,
    checked_scene,
)
from anctmm.results.checks.acting import ends_of
from anctmm.results.checks.divergence import checked
from anctmm.results.checks.mechanisms import is_mechanism
from anctmm.results.ended_early import nothing
from anctmm.results.fields import Field
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from anctmm.solvers.foreign_code import raise_interruption
from anctmm.validation import is_pair, one_of, positive
from reference.exudyn.histories import FAILED
from reference.exudyn.mechanisms import reference_of, rigid_field
from reference.exudyn.model import Beams, Model, load_exudyn, silence
from reference.exudyn.stability import stability_status

Array = NDArray[np.float64]

#: Newton tolerances of the residual, relative and absolute (N), the latter where round-off allows it.
#: Exudyn's own, 1e-8 and 1e-10, lie under round-off for 128 elements and for the four-bar.
TOLERANCES = (1e-7, 1e-9)
#: Those of statics, tried in turn: self-weight on fine meshes misses the first. None: what rounding leaves.
STATIC_TOLERANCES = ((1e-10, 1e-10), (1e-9, 1e-10), (1e-8, 1e-10), (1e-8, None))
#: Least step of the load of mechanisms.
LEAST_LOAD_STEP = 1e-4
#: Bytes that a model takes for each coordinate, and its sensors and their history for each at an output, as measured.
MEMORY, KEPT = 4_700.0, 90.0
#: Kinds of element that a discretisation may name; the models use their own instead.
ELEMENTS = ("cable", "shear")
#: Coordinates from which on the sparse solver is the faster one, as measured.
SPARSE_FROM = {"generalized-alpha": 45, "static": 20, "zhai": 65}
#: When Newton's iteration takes a new tangent: where it converges too slowly, at the start of each step, or always.
NEWTON = ("modified", "each-step", "full")
#: What was the cheapest somewhere, over mesh, step and tolerance, on both base scenes: looser tolerances, and a new
#: tangent each step or always where steps are long. Of `anctmm.solvers.capabilities.Offer`.
CHOICES: tuple[Mapping[str, Any], ...] = (
    {},
    {"tolerances": (1e-5, 1e-7)},
    {"tolerances": (1e-3, 1e-5)},
    {"tolerances": (1e-5, 1e-7), "newton": "each-step"},
    {"tolerances": (1e-3, 1e-5), "newton": "each-step"},
    {"tolerances": (1e-3, 1e-5), "newton": "full"},
)


@dataclass(frozen=True)
class History:
    """What the sensors have kept: absolute coordinates, velocities and, if known, accelerations by body,
    (n, nodes, width), and the multipliers of the driven coordinates.
    """

    t: Array
    coordinates: dict[str, Array]
    velocities: dict[str, Array]
    accelerations: dict[str, Array]
    multipliers: list[Array]

    def rates(self, body: str) -> list[Array]:
        """Velocities and, if known, accelerations of a body."""
        return [kept[body] for kept in (self.velocities, self.accelerations) if kept]


def check_room(scene: Scene, run: Discretisation, outputs: int | None = None) -> None:
    """Refuse what takes more memory than is free, before any model is built; `outputs` of a search for equilibria."""
    check_memory(checked_scene(scene), run, MEMORY, outputs=outputs, kept_each=KEPT)


def dynamics(
    beams: Beams,
    scene: Scene,
    run: Discretisation,
    tolerances: tuple[float, float] | None = None,
    newton: str = "modified",
) -> Solution:
    """Motion of a scene by Exudyn; a scene it cannot do gets a status that says why."""
    try:
        refuse(scene, beams.lacks, "a model in Exudyn", run.integrator)
    except UnsupportedError as why:
        return nothing(beams.solver, scene, run, Status("unsupported", str(why)))
    if tolerances is None:
        tolerances = TOLERANCES[0], max(TOLERANCES[1], roundoff(beams, scene))
    if not is_pair(tolerances):
        raise DiscretisationError(
            f"tolerances are {shown(tolerances)}; a pair is needed: relative, and absolute (N), greater than 0"
        )
    relative, absolute = (
        positive(f"{name} tolerance", value, DiscretisationError)
        for name, value in zip(("relative", "absolute"), tolerances, strict=True)
    )
    one_of("newton", newton, NEWTON)
    times = run.times(run.output_steps)
    loads = {k: _table(load, times) for k, load in enumerate(scene.loads) if callable(load.value)}
    try:
        check_kinds(run.of(scene), ELEMENTS, "a model in Exudyn", UnsupportedError)
        _check_integrator(scene, run)
        exu = load_exudyn()
    except UnsupportedError as why:
        return nothing(beams.solver, scene, run, Status("unsupported", str(why)))
    with silence(exu):
        model = Model(exu, scene, beams, run)
        if run.explicit:
            model.hold()
        model.assemble()
        settings = _settings(exu, model, run, (relative, absolute), newton)
        message, cpu, wall = _timed(exu, model.mbs.SolveDynamic, settings)
        history = _read(model, times)
    status = _verdict(model, run, history, message)
    it = model.mbs.sys["dynamicSolver"].it
    counts = (0, 1) if run.explicit else (it.newtonStepsCount, it.newtonJacobiCount)
    cost = Cost(cpu, wall, it.currentStepIndex - 1, *counts)
    return _solution(model, run, history, loads, cost, status)


def statics(beams: Beams, scene: Scene, run: Discretisation, load_steps: int) -> Solution:
    """Equilibrium of a scene by Exudyn, with loads and drives as they are at t = 0.

    The stability of the one under the whole load is looked at; the status says what is found, or that it is not known.
    """
    positive("load_steps", load_steps, DiscretisationError)
    load_steps = parts_of_load(load_steps)
    try:
        refuse(scene, beams.lacks, "a model in Exudyn", "statics")
        check_kinds(run.of(scene), ELEMENTS, "a model in Exudyn", UnsupportedError)
        exu = load_exudyn()
    except UnsupportedError as why:
        return nothing(beams.solver, scene, run, Status("unsupported", str(why)))
    for relative, absolute in STATIC_TOLERANCES:
        with silence(exu):
            model = Model(exu, scene, beams, static=True)
            model.assemble()
            tolerances = relative, absolute or roundoff(beams, scene)
            settings = _static_settings(exu, model, load_steps, tolerances)
            message, cpu, wall = _timed(exu, model.mbs.SolveStatic, settings)
            history = _read(model, None)
            status = Status() if message else stability_status(exu, model, float(history.t[-1]))
        if message is None:
            break
    it = model.mbs.sys["staticSolver"].it
    looser = (relative, absolute) != STATIC_TOLERANCES[0]
    if looser and message is None:
        used = f"Newton's tolerances {tolerances[0]:g}, {tolerances[1]:.1g} N"
        status = replace(status, message=f"{used}; {status.message}" if status.message else used)
    if message is not None:
        reached = float(history.t[-1])
        told = f"Exudyn found no equilibrium beyond load factor {reached:.6g}: {message}"
        status = Status("failed", f"{told}; try more load_steps, and hold every body", reached)
    cost = Cost(cpu, wall, it.currentStepIndex - 1, it.newtonStepsCount, it.newtonJacobiCount)
    return _solution(model, run, history, {}, cost, status)


def roundoff(beams: Beams, scene: Scene) -> float:
    """Estimate of the residual's norm that rounding leaves, N; below it Newton was seen not to converge.

    Positions in a scene of extent R are known to εR, which an interval of length l between nodes answers with
    a force of (EA/l + 12EI/l³) εR.
    """
    ends = np.array([body.position_at(key) for body in scene.bodies for key in ends_of(body)])
    extent = float(np.hypot(*np.ptp(ends, axis=0)))
    squares = sum(connector.stiffness**2 for connector in scene.connectors)
    for body in scene.beams:
        intervals = len(beams.reference(body)) - 1
        l, E = body.length / intervals, body.material.E  # noqa: E741
        squares += intervals * (E * (body.section.area / l + 12.0 * body.section.second_moment / l**3)) ** 2
    return float(2.0 * np.finfo(float).eps * extent * np.sqrt(squares))


def _check_integrator(scene: Scene, run: Discretisation) -> None:
    match run.integrator:
        case "generalized-alpha":
            return
        case "zhai":
            _check_explicit(scene, run)
        case "esdirk":
            raise UnsupportedError(
                f"integrator is {run.integrator!r}; Exudyn's implicit steps are of second order, and those of higher "
                f"order explicit and without constraints: 'generalized-alpha' is needed"
            )
        case _:
            raise unknown_option("integrator", run.integrator, INTEGRATORS)


def _check_explicit(scene: Scene, run: Discretisation) -> None:
    if (run.psi, run.phi) != (0.5, 0.5):
        raise UnsupportedError(
            f"Zhai's psi, phi are {run.psi!r}, {run.phi!r}; Exudyn has only VelocityVerlet, their case ½, ½"
        )
    for joint in scene.joints:
        match joint:
            case Clamp(angle=None) | Pin(ends=(_,)):
                pass
            case Clamp() | Pin() | Weld():
                raise UnsupportedError(
                    f"Exudyn's explicit solvers cannot do {joint!r}, an algebraic joint; "
                    f'use integrator="generalized-alpha", or a scene of single beams clamped, pinned or free'
                )
            case Slider() | Prismatic():
                raise not_offered(joint)
            case _:
                raise unknown_joint(joint)


def _common_settings(exu: Any, model: Model, solver: str) -> Any:
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.restart.write = False
    settings.parallel.numberOfThreads = 1
    kinds = exu.LinearSolverType
    sparse = model.mbs.systemData.ODE2Size() >= SPARSE_FROM[solver]
    settings.linearSolver.solverType = kinds.EigenSparse if sparse else kinds.EigenDense
    settings.linearSolver.reuseAnalyzedPattern = True
    return settings


def _settings(
    exu: Any, model: Model, run: Discretisation, tolerances: tuple[float, float], newton: str = "modified"
) -> Any:
    settings = _common_settings(exu, model, run.integrator)
    settings.solution.sensors.writePeriod = run.stride * run.t_end / run.steps
    time, kinds = settings.timeIntegration, exu.DynamicSolverType
    time.endTime, time.numberOfSteps, time.adaptiveStep = run.t_end, run.steps, False
    time.solverType = kinds.VelocityVerlet if run.explicit else kinds.GeneralizedAlpha
    time.newton.relativeTolerance, time.newton.absoluteTolerance = tolerances
    time.newton.useModifiedNewton = newton != "full"
    time.newton.modifiedNewtonJacUpdatePerStep = newton == "each-step"
    time.generalizedAlpha.spectralRadius = run.spectral_radius
    time.explicit.computeEndOfStepAccelerations = False
    return settings


def _static_settings(exu: Any, model: Model, load_steps: int, tolerances: tuple[float, float]) -> Any:
    settings = _common_settings(exu, model, "static")
    settings.solution.sensors.writePeriod = 1e-9  # below every load step: all of them are kept
    static = settings.staticSolver
    static.numberOfLoadSteps = int(load_steps)
    if is_mechanism(model.scene):  # constraints' curvature is not in Exudyn's tangent: tiny steps do not help
        static.minimumStepSize = LEAST_LOAD_STEP
    static.newton.relativeTolerance, static.newton.absoluteTolerance = tolerances
    return settings


def _timed(exu: Any, solve: Callable[[Any], Any], settings: Any) -> tuple[str | None, float, float]:
    """Reason of a failure, CPU and wall time of the solver alone, s."""
    message = None
    wall, cpu = perf_counter(), process_time()
    FAILED.clear()
    try:
        solve(settings)
    except Exception as error:
        raise_interruption(error)
        if FAILED:
            raise FAILED[0] from error
        if not isinstance(error, exu.SolverError):
            raise
        lines = str(error).splitlines()
        message = " ".join(" ".join(line for line in lines if "[Python file" not in line).split())
    return message, process_time() - cpu, perf_counter() - wall


def _read(model: Model, expected: Array | None) -> History:
    """Sensor rows at the expected times; all rows without them. Missing rows can only be the last."""
    stored = model.mbs.GetSensorStoredData
    data = {name: [[stored(s) for s in kind] for kind in kinds] for name, kinds in model.sensors.items()}
    t = next(iter(data.values()))[0][0][:, 0]
    if expected is not None:
        rows = min(len(t), len(expected))
        late = np.flatnonzero(np.abs(t[:rows] - expected[:rows]) > 1e-6 * np.diff(expected).min())
        rows = int(late[0]) if late.size else rows
        t = expected[:rows]
    kept: list[dict[str, Array]] = [
        {name: np.stack([s[: len(t), 1:] for s in kinds[k]], axis=1) for name, kinds in data.items()}
        for k in range(len(next(iter(data.values()))))
    ]
    for body in model.scene.bodies:
        kept[0][body.name] += model.beams.reference(body) if isinstance(body, Beam) else reference_of(body)
    q, v, a = (*kept, {}) if len(kept) == 2 else kept
    return History(t, q, v, a, [stored(sensor)[: len(t), 1] for *_, sensor in model.drives])


def _verdict(model: Model, run: Discretisation, history: History, message: str | None) -> Status:
    """How Exudyn says that a run has ended."""
    it = model.mbs.sys["dynamicSolver"].it
    steps, expected, rows = it.currentStepIndex - 1, len(run.output_steps), len(history.t)
    if message is None and steps == run.steps and rows == expected:
        return Status()
    time, least = float(it.currentTime), roundoff(model.beams, model.scene)
    why = message or f"Exudyn took {steps} steps for {run.steps} and wrote {rows} of {expected} rows"
    why = f"{why} (t = {time:.6g} s); a smaller dt may help, or an absolute tolerance above {least:.1g} N"
    return Status("failed", why, time, steps)


def _table(load: Load, t: Array) -> Array:
    """Values of a load of time, (n, numbers of a value)."""
    return tabulate(load_text(load), load.value, t, width_of(load))  # type: ignore[arg-type]


def _constant(load: Load) -> Array:
    """Value of a load that is held as at t = 0, (numbers of a value,)."""
    return _table(load, np.zeros(1))[0] if callable(load.value) else np.atleast_1d(load.value)


def _solution(
    model: Model, run: Discretisation, history: History, loads: dict[int, Array], cost: Cost, status: Status
) -> Solution:
    scene, beams = model.scene, model.beams
    fields: dict[str, Field] = {}
    for name, q in history.coordinates.items():
        body, rates = scene.body(name), [] if model.static else history.rates(name)
        fields[name] = beams.field(body, q, rates) if isinstance(body, Beam) else rigid_field(body, q, rates)
    with np.errstate(all="ignore"):  # Exudyn's explicit runs go on where they have diverged
        known = not is_mechanism(scene)  # of mechanisms energies are not read
        energy = _energy(model, history, loads) if known else Energy.unknown(len(history.t))
    found = Solution(
        beams.solver,
        scene,
        run,
        history.t,
        fields,
        energy,
        cost,
        status,
        model.mbs.systemData.ODE2Size(),
        static=model.static,
    )
    return checked(found, static=model.static, energies=known and _knows_work(scene, run))


def _knows_work(scene: Scene, run: Discretisation) -> bool:
    """Whether the work done is known as well as the motion: it is summed over the outputs, not over the steps."""
    turns = any(isinstance(joint, Clamp) and joint.angle is not None for joint in scene.joints)
    return run.stride == 1 or not (
        turns or any(callable(x.value) or isinstance(x, Torque) for x in scene.loads)
    )


def _energy(model: Model, history: History, tables: dict[int, Array]) -> Energy:
    """Energies of the kept history.

    The work of drives and of what varies in time is summed by the trapezoidal rule over the output times, so
    it is as exact as these are dense. What damping takes is not known: there `work` is NaN.
    """
    n, scene = len(history.t), model.scene
    kinetic, strain, potential, work = (np.zeros(n) for _ in range(4))
    for body in scene.beams:
        q, v = history.coordinates[body.name], history.velocities[body.name]
        T, U = model.beams.energies(body, q, v)
        kinetic += T
        strain += U
        potential -= np.einsum("tij,ij->t", q - q[:1], model.beams.weight(body))
    for k, load in enumerate(scene.loads):
        if isinstance(load, LineLoad):
            raise not_offered(load)
        body, side = scene.body_end(load.end)
        node = history.coordinates[body.name][:, -1 if side else 0]
        values = tables.get(k)
        match load:
            case Force():
                if values is None:
                    potential -= (node[:, :2] - node[:1, :2]) @ _constant(load)
                else:
                    work += _work(values, node[:, :2])
            case Torque():
                moment = np.full((n, 1), _constant(load)) if values is None else values
                work += _work(moment, model.beams.angle(node)[:, None])
            case _:
                raise unknown_kind("load", load, LOADS)
    for (name, number, index, _), multiplier in zip(model.drives, history.multipliers, strict=True):
        work += _work(-multiplier[:, None], history.coordinates[name][:, number, index, None])
    nan = np.full(n, np.nan)
    if model.static:
        return Energy(kinetic, strain, nan, nan)
    if any(body.material.damping for body in scene.beams):
        work = nan
    return Energy(kinetic, strain, potential, work)


def _work(force: Array, place: Array) -> Array:
    """∫ force · d(place) by the trapezoidal rule, (n,)."""
    work = np.zeros(len(place))
    mean = 0.5 * (force[1 : len(place)] + force[: len(place) - 1])
    work[1:] = np.cumsum((mean * np.diff(place, axis=0)).sum(axis=1))
    return work
