"""Run of an Exudyn model at its best settings, and its history: shared by both Exudyn peers.

One thread, fixed steps, a sparse solver that keeps its pattern, no files, internal sensors. The time is that of
`SolveDynamic` or `SolveStatic` alone, without building and assembling the model.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import DiscretisationError, shown
from anctmm.model.connectors import Spring
from anctmm.model.drives import Pulse, Quintic
from anctmm.model.joints import drive_of
from anctmm.model.scene import Beam, Clamp, Scene, Torque, checked_scene
from anctmm.results.solution import Cost
from anctmm.results.status import Status
from anctmm.solvers.foreign_code import raise_interruption
from anctmm.validation import has_length, one_of, positive
from reference.adapters import Adapter, Answer
from reference.exudyn.forces import add_connector, add_load
from reference.exudyn.joints import add_joint, needs_equations, refuse_guides
from reference.exudyn.model import FAILED, Beams, Model, load_exudyn, rigid_field, silence

Array = NDArray[np.float64]

#: What both peers lack: explicit steps, whose constraints Exudyn mistreats; all clamps and welds hold the stretch; the
#: stability of equilibria, as its tangent leaves out torques on cables and the curvature of constraints.
LACKS = frozenset({"zhai", "esdirk", "free-stretch", "own-joints", "energy", "stability"})
#: Newton tolerances of the residual, relative and absolute (N), the latter where round-off allows it.
#: Exudyn's own, 1e-8 and 1e-10, lie under round-off for 128 elements and for the four-bar.
TOLERANCES = (1e-7, 1e-9)
#: Those of statics, tried in turn: self-weight on fine meshes misses the first. None: what rounding leaves.
STATIC_TOLERANCES = ((1e-10, 1e-10), (1e-9, 1e-10), (1e-8, 1e-10), (1e-8, None))
#: Least step of the load of mechanisms: constraints' curvature is not in Exudyn's tangent, tiny steps do not help.
LEAST_LOAD_STEP = 1e-4
#: Coordinates from which on the sparse solver is the faster one, in motion and in statics.
SPARSE_FROM, SPARSE_STATIC = 45, 20
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


def python_callbacks(scene: Scene) -> bool:
    """Whether Exudyn calls Python in its steps: for laws, equations of ours, and histories that it cannot compile."""
    springs = (
        c.law is not None or callable(c.length if isinstance(c, Spring) else c.angle)
        for c in scene.connectors
    )
    loads = (
        callable(x.value) and not (isinstance(x, Torque) and type(x.value) is Pulse) for x in scene.loads
    )
    drives = (
        drive_of(j) is not None and not (isinstance(j, Clamp) and type(j.angle) is Quintic)
        for j in scene.joints
    )
    return any((*springs, *loads, *drives, *(needs_equations(scene, j) for j in scene.joints)))


@dataclass
class ExudynAdapter(Adapter):
    """A scene in Exudyn with one kind of beams, of which a class says all that `reference.exudyn.model.Beams` has.

    `tolerances` are Newton's, of the residual: relative to the first one of a step, and absolute, N; by default 1e-7,
    and 1e-9 or what rounding leaves, if that is more. `newton`, one of `NEWTON`, is that of motions.
    """

    tolerances: Any = None
    newton: str = "modified"

    title: ClassVar[str] = "a model in Exudyn"
    packages: ClassVar[tuple[str, ...]] = ("exudyn",)
    memory: ClassVar[tuple[float, float]] = (4_700.0, 90.0)

    def __post_init__(self) -> None:
        one_of("newton", self.newton, NEWTON)
        self.counts = {name: count for name, (count, _) in self.run.of(checked_scene(self.scene)).items()}
        if self.tolerances is not None and not has_length(self.tolerances, (2,)):
            raise DiscretisationError(
                f"tolerances are {shown(self.tolerances)}; a pair is needed: relative, and absolute (N), greater than 0"
            )
        named = zip(("relative", "absolute"), self.tolerances or (), strict=False)
        bounds = tuple(positive(f"{name} tolerance", x, DiscretisationError) for name, x in named)
        self.tolerances = bounds or None

    @property
    def beams(self) -> Beams:
        """Itself, as its class completes it."""
        return cast(Beams, self)

    def length(self, body: Beam) -> float:
        """Length of each of a body's elements, m."""
        return body.length / self.counts[body.name]

    def check(self) -> None:
        """Refuse guides that Exudyn does not have."""
        refuse_guides(self.scene)

    def build(self) -> Model:
        """The model, assembled."""
        exu = load_exudyn()
        with silence(exu):
            model = Model(exu, self.scene, self.beams, self.run, self.static)
            for joint in self.scene.joints:
                add_joint(model, joint)
            for connector in self.scene.connectors:
                add_connector(model, connector)
            for load in self.scene.loads:
                add_load(model, load)
            model.assemble()
        return model

    def march(self, model: Model) -> Answer:
        """Motion, or equilibria; statics are tried with one pair of tolerances after another."""
        if not self.static:
            return self._motion(model)
        message: str | None = ""
        for k, (relative, absolute) in enumerate([self.tolerances] if self.tolerances else STATIC_TOLERANCES):
            model = self.build() if k else model
            bounds = relative, absolute or self.roundoff()
            message, spent = self._solved(model, model.mbs.SolveStatic, self.settings(model, bounds))
            if message is None:
                break
        t = model.output_times()
        reached = float(t[-1])
        status = Status()
        if message is not None:
            message = f"Exudyn found no equilibrium beyond load factor {reached:.6g}: {message}"
            status = Status("failed", f"{message}; try more load_steps, and hold every body", reached)
        return self._answer(model, t, spent, status)

    def _motion(self, model: Model) -> Answer:
        run, bounds = self.run, self.tolerances or (TOLERANCES[0], max(TOLERANCES[1], self.roundoff()))
        message, spent = self._solved(model, model.mbs.SolveDynamic, self.settings(model, bounds))
        expected, t = run.times(run.output_steps), model.output_times()
        rows = min(len(t), len(expected))
        late = np.flatnonzero(np.abs(t[:rows] - expected[:rows]) > 1e-6 * np.diff(expected).min())
        rows = int(late[0]) if late.size else rows
        it = model.mbs.sys["dynamicSolver"].it
        steps, status = it.currentStepIndex - 1, Status()
        if message is not None or steps != run.steps or rows != len(expected):
            why = (
                message
                or f"Exudyn took {steps} steps for {run.steps} and wrote {rows} of {len(expected)} rows"
            )
            least, time = self.roundoff(), float(it.currentTime)
            why = f"{why} (t = {time:.6g} s); a smaller dt may help, or an absolute tolerance above {least:.1g} N"
            status = Status("failed", why, time, steps)
        return self._answer(model, expected[:rows], spent, status)

    def roundoff(self) -> float:
        """Estimate of the residual's norm that rounding leaves, N; below it Newton was seen not to converge.

        Positions in a scene of extent R are known to εR, which an interval of length l between nodes answers with
        a force of (EA/l + 12EI/l³) εR.
        """
        ends: list[Any] = [end for beam in self.scene.beams for end in (beam.start, beam.end)]
        ends += [b.position_at(k) for b in self.scene.bodies if not isinstance(b, Beam) for k in b.keys]
        extent = float(np.hypot(*np.ptp(np.array(ends), axis=0)))
        squares = sum(connector.stiffness**2 for connector in self.scene.connectors)
        for body in self.scene.beams:
            intervals = len(self.beams.reference(body)) - 1
            l, E = body.length / intervals, body.material.E  # noqa: E741
            squares += (
                intervals * (E * (body.section.area / l + 12.0 * body.section.second_moment / l**3)) ** 2
            )
        return float(2.0 * np.finfo(float).eps * extent * np.sqrt(squares))

    def _solved(self, model: Model, solve: Any, settings: Any) -> tuple[str | None, tuple[float, float]]:
        """Reason of a failure, CPU and wall time of the solver alone, s."""
        message, exu = None, model.exu
        with silence(exu):
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
                lines = [line for line in str(error).splitlines() if "[Python file" not in line]
                message = " ".join(" ".join(lines).split())
            spent = process_time() - cpu, perf_counter() - wall
        if FAILED:
            raise FAILED[0]
        return message, spent

    def settings(self, model: Model, tolerances: tuple[float, float]) -> Any:
        """Exudyn's settings of a run with these tolerances of Newton's iteration."""
        exu, run = model.exu, self.run
        settings = exu.SimulationSettings()
        settings.solution.file.write = settings.solution.restart.write = False
        settings.parallel.numberOfThreads = 1
        kinds = exu.LinearSolverType
        sparse = model.mbs.systemData.ODE2Size() >= (SPARSE_STATIC if self.static else SPARSE_FROM)
        settings.linearSolver.solverType = kinds.EigenSparse if sparse else kinds.EigenDense
        settings.linearSolver.reuseAnalyzedPattern = True
        # in statics below every load step: all of them are kept
        settings.solution.sensors.writePeriod = 1e-9 if self.static else run.stride * run.t_end / run.steps
        newton = (settings.staticSolver if self.static else settings.timeIntegration).newton
        newton.relativeTolerance, newton.absoluteTolerance = tolerances
        if self.static:
            settings.staticSolver.numberOfLoadSteps = int(self.load_steps)
            if self.scene.connectors or len(self.scene.beams) < len(self.scene.bodies):
                settings.staticSolver.minimumStepSize = LEAST_LOAD_STEP
            return settings
        time = settings.timeIntegration
        time.endTime, time.numberOfSteps, time.adaptiveStep = run.t_end, run.steps, False
        time.solverType = exu.DynamicSolverType.GeneralizedAlpha
        newton.useModifiedNewton = self.newton != "full"
        newton.modifiedNewtonJacUpdatePerStep = self.newton == "each-step"
        time.generalizedAlpha.spectralRadius = run.spectral_radius
        return settings

    def _answer(self, model: Model, t: Array, spent: tuple[float, float], status: Status) -> Answer:
        it = model.mbs.sys["staticSolver" if self.static else "dynamicSolver"].it if len(t) else None
        counts = (
            (0, 0, 0) if it is None else (it.currentStepIndex - 1, it.newtonStepsCount, it.newtonJacobiCount)
        )
        fields = {}
        for name, (q, *rates) in model.rows().items():
            body = self.scene.body(name)
            q, rates = q[: len(t)], [x[: len(t)] for x in rates]
            beam = isinstance(body, Beam)
            fields[name] = self.beams.field(body, q, rates) if beam else rigid_field(body, q, rates)  # type: ignore[arg-type]
        return Answer(t, fields, Cost(*spent, *counts), status, model.mbs.systemData.ODE2Size())
