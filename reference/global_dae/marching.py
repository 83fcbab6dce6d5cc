"""Time marching shared by all integrators: outputs, cost and status."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from anctmm.errors import PropertyError
from anctmm.model.bodies import Beam
from anctmm.model.places import Place
from anctmm.model.rigid_bodies import CENTER, PointMass, RigidBody
from anctmm.model.topology import turning_bodies
from anctmm.results.checks.divergence import checked
from anctmm.results.ended_early import HistoryError, Interrupted, broken_off, interruption
from anctmm.results.fields import Field, HermiteField, RigidField, beam_field
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from reference.global_dae.forces import Effort
from reference.global_dae.layout import Layout
from reference.global_dae.saddle import Failure, Nearest, Saddle
from reference.global_dae.system import System

Array = NDArray[np.float64]

#: Corrections of a step at most; misfit of constraints, of the scene's length, that has failed, and that is rounding.
ITERATIONS, MISSED, ROUNDING = 40, 1e-9, 1e-14


@dataclass
class State:
    """Coordinates, velocities, accelerations, multipliers and parameters of the drives at a step."""

    q: Array
    v: Array
    a: Array
    mu: Array
    p: Array


class Marcher:
    """A system marched in time; integrators fill in `step`."""

    advice = ""

    def __init__(self, system: System) -> None:
        self.system, self.run = system, system.run
        self.newton_iterations, self.factorizations = 0, 0
        self.length = max(1.0, system.layout.scene.length)
        self.work = np.zeros(2)
        self.before: tuple[Effort, Effort, float] | None = None

    def begin(self) -> State:
        """The state at t = 0: velocities that fit joints and drives, and [M Jᵀ; J 0] [q̈; μ] = [f; γ]."""
        system, c = self.system, self.system.constraints
        q, v, p = system.layout.reference.copy(), system.layout.velocity, c.parameters(0.0)
        J = c.jacobian(q, p)
        v = v - Nearest(J)(J @ v + c.rate(q, p))
        force = system.force(q, v, 0.0) + system.beams.damping(q, v)
        self.factorizations += 1
        return State(q, v, *Saddle(system.mass, J).solve(force, c.right(q, v, p)), p)

    def step(self, state: State, t: float) -> State:
        """The next step, which leads to time t."""
        raise NotImplementedError

    @np.errstate(over="ignore", invalid="ignore")  # a run that diverges says so by its status
    def march(self, solver: str) -> Solution:
        """To the end, or as far as it goes."""
        system, run = self.system, self.run
        wanted, times = set(run.output_steps.tolist()), run.times(np.arange(run.steps + 1))
        record, n = Record(system.layout, solver), 0

        def so_far(status: Status) -> Solution:
            done = run.steps if status.ok else n - 1
            return record.solution(status, done, self.newton_iterations, self.factorizations)

        with ended_early(so_far, lambda: float(times[max(n - 1, 0)])):
            try:
                state = self.begin()
                for n in range(run.steps + 1):
                    t = float(times[n])
                    state = self.step(state, t) if n else state
                    self.add_work(state, t)
                    angles = record.turns.count(state.q[None])
                    if n in wanted:
                        energies = system.energies(state.q, state.v, t, self.work)
                        record.keep(times[n : n + 1], (state.q, state.v, state.a), energies, angles)
            except Failure as failure:
                return so_far(failed_step(system.layout, failure, n, float(times[n]), self.advice))
        return so_far(Status())

    def add_work(self, s: State, t: float) -> None:
        """Add the work of the step that leads here, and of its damping, by the trapezoidal rule."""
        now = *self.system.efforts(s.q, s.v, t, s.p, s.mu), float(self.system.beams.damping(s.q, s.v) @ s.v)
        if self.before is not None:
            *before, power = self.before
            lost = 0.5 * self.run.exact_dt * (power + now[2])
            for k, (old, new) in enumerate(zip(before, now[:2], strict=True)):
                self.work[k] += 0.5 * (old.forces + new.forces) @ (new.values - old.values) + lost
        self.before = now

    def projected(
        self, q: Array, v: Array, p: Array, metric: Callable[[Array], Saddle], allowed: float = MISSED
    ) -> tuple[Array, Array]:
        """Positions, by Newton's corrections, and velocities on the constraints, the nearest in a metric."""
        c = self.system.constraints
        for _ in range(ITERATIONS):
            gap = c.value(q, p)
            if not np.isfinite(gap).all():
                raise Failure("constraints are not finite")
            if np.abs(gap).max() <= ROUNDING * self.length:
                break
            q = q - metric(q).closest(gap)
        self.check_position(q, p, allowed)
        return q, v - metric(q).closest(c.jacobian(q, p) @ v + c.rate(q, p))

    def check_position(self, q: Array, p: Array, allowed: float) -> None:
        """Raise Failure where positions do not fit the constraints: some contradict each other."""
        if not np.abs(self.system.constraints.value(q, p)).max(initial=0.0) <= allowed * self.length:
            raise Failure("joints and drives leave the bodies no admissible position")


@contextmanager
def ended_early(so_far: Callable[[Status], Solution], time: Callable[[], float]) -> Iterator[None]:
    """Hand over what was found where Ctrl-C, a load, a drive or a law ends a run."""
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(so_far(interruption(time()))) from None
    except PropertyError as error:
        raise HistoryError(so_far(broken_off(error, time()))) from error


def failed_step(layout: Layout, failure: Failure, n: int, t: float, advice: str) -> Status:
    """The status of a run whose step n, at t (s), failed."""
    where, body, element = "", None, None
    if failure.change is not None:
        sizes = np.where(np.isfinite(failure.change), np.abs(failure.change), np.inf)
        body, element = layout.owner(int((sizes / layout.unit).argmax()))
        where = f", body {body!r}" + (f", element {element}" if element is not None else "")
    return Status("diverged", f"{failure} at t = {t:.6g} s (step {n}){where}: {advice}", t, n, body, element)


class Turns:
    """Rotations of bodies, which are summed over all steps because of whole turns."""

    def __init__(self, layout: Layout) -> None:
        self.names = turning_bodies(layout.scene)
        bodies = [layout.scene.body(name) for name in self.names]
        places = [Place(body, 0.0 if isinstance(body, Beam) else CENTER) for body in bodies]
        self.at = np.array([layout.direction(place).at for place in places], dtype=np.int64).reshape(-1, 2)
        self.last, self.angles = layout.reference[self.at], np.zeros(len(self.at))

    def count(self, states: Array) -> Array:
        """Angles after each of several steps, (n, bodies), rad: in each a body turns by less than half a turn."""
        now = states[:, self.at]
        (x, y), (u, v) = (np.moveaxis(z, 2, 0) for z in (np.concatenate([self.last[None], now[:-1]]), now))
        found = self.angles + np.cumsum(np.arctan2(x * v - y * u, x * u + y * v), axis=0)
        self.last, self.angles = now[-1], found[-1]
        return np.asarray(found)


class Record:
    """Outputs of a run and its clocks, which start with it."""

    def __init__(self, layout: Layout, solver: str) -> None:
        self.layout, self.solver, self.turns = layout, solver, Turns(layout)
        self.widths = layout.size, layout.size, layout.size, 5, len(self.turns.names)
        self.times: list[Array] = []
        self.parts: list[list[Array]] = [[np.zeros((0, width))] for width in self.widths]
        self.start = process_time(), perf_counter()

    def keep(self, t: Array, series: Sequence[Array], energies: Array, angles: Array) -> None:
        """More outputs, (n,): coordinates and their rates, (n, size), energies, (n, 5), and angles, (n, bodies)."""
        self.times.append(t)
        for part, new, width in zip(self.parts, (*series, energies, angles), self.widths, strict=True):
            part.append(np.reshape(new, (len(t), width)).copy())

    def solution(
        self, status: Status, steps: int, iterations: int, factorizations: int, static: bool = False
    ) -> Solution:
        """The answer as far as it goes, and as far as checks find nothing wrong."""
        spent = process_time() - self.start[0], perf_counter() - self.start[1]
        cost = Cost(*spent, max(steps, 0), iterations, factorizations)
        *series, energies, angles = map(np.concatenate, self.parts)
        fields = fields_of(self.layout, series[:1] if static else series)
        for name, angle in zip(self.turns.names, angles.T, strict=True):
            if not static:
                fields[name] = replace(fields[name], start_angle=angle.copy())  # type: ignore[type-var]
        t, layout = np.concatenate([np.zeros(0), *self.times]), self.layout
        found = Solution(
            self.solver, layout.scene, layout.run, t, fields, Energy(*energies.T.copy()), cost, status,
            layout.size, static=static,
        )  # fmt: skip
        return checked(found, static=static)


def fields_of(layout: Layout, series: Sequence[Array]) -> dict[str, Field]:
    """Motion of every body from coordinates and, of motions, velocities and accelerations, (n, size)."""
    found, n = dict[str, Field](), len(series[0])
    for body in layout.scene.bodies:
        if (mesh := layout.meshes.get(body.name)) is not None:
            own = (x[:, mesh.own].reshape(n, mesh.elements + 1, mesh.vectors, 2) for x in series)
            found[body.name] = beam_field(mesh.kind, mesh.body, *own)
            continue
        solid, at = layout.rigid[body.name], layout.first[body.name]
        pairs = []
        for k, x in enumerate(series):
            still = np.tile([float(k == 0), 0.0], (n, 1))  # a point mass does not turn
            pairs.append(
                (x[:, at : at + 2], x[:, at + 2 : at + 4] if isinstance(solid, RigidBody) else still)
            )
        if isinstance(body, Beam):
            assert isinstance(solid, RigidBody)
            first, *others = (_bar(body, solid, *pair) for pair in pairs)
            found[body.name] = HermiteField(first, body.length, *others)
        else:
            points = {} if isinstance(body, PointMass) else {key: body.arm(key) for key in body.points}
            first, *others = (np.stack(pair, axis=1) for pair in pairs)
            found[body.name] = RigidField(first, points, *others)  # type: ignore[arg-type]
    return found


def _bar(beam: Beam, bar: RigidBody, r: Array, t: Array) -> Array:
    """Both nodes of a rigid bar, (n, 2, 2, 2)."""
    normal = np.stack([-t[:, 1], t[:, 0]], axis=1)
    dx, dy = (np.array(beam.end) - beam.start) / beam.length
    arms = (bar.arm(key) for key in ("start", "end"))
    nodes = [np.stack([r + u * t + w * normal, dx * t + dy * normal], axis=1) for u, w in arms]
    return np.stack(nodes, axis=1)
