"""Time marching shared by all integrators: outputs, cost and status."""

from collections.abc import Sequence
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
from anctmm.results.status import Status, in_short
from reference.global_dae.layout import Layout
from reference.global_dae.system import Account, System

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Failure(Exception):
    """A step that failed: the reason, the correction or acceleration that shows where, and residuals (N)."""

    def __init__(self, why: str, change: Array | None = None, residuals: Sequence[float] = ()) -> None:
        super().__init__(why)
        self.change, self.residuals = change, tuple(residuals)


@dataclass
class State:
    """Coordinates, velocities, accelerations, multipliers and parameters of the drives at a step."""

    q: Array
    v: Array
    a: Array
    mu: Array
    p: Array


class Marcher:
    """A system marched in time; integrators fill in `begin` and `step`."""

    advice = ""

    def __init__(self, system: System) -> None:
        self.system, self.run = system, system.layout.run
        self.newton_iterations, self.factorizations = 0, 0
        self.account = Account(system)

    def begin(self) -> State:
        """The state at t = 0."""
        raise NotImplementedError

    def step(self, state: State, t: float) -> State:
        """The next step, which leads to time t."""
        raise NotImplementedError

    @np.errstate(over="ignore", invalid="ignore")  # a run that diverges says so by its status
    def march(self, solver: str) -> Solution:
        """To the end, or as far as it goes."""
        system, run = self.system, self.run
        wanted, times = set(run.output_steps.tolist()), run.times(np.arange(run.steps + 1))
        record, kept = Record(system), list[int]()
        start = process_time(), perf_counter()
        status, n = Status(), 0

        def so_far(status: Status, steps: int) -> Solution:
            spent = process_time() - start[0], perf_counter() - start[1]
            cost = Cost(*spent, steps, self.newton_iterations, self.factorizations)
            return record.solution(solver, times[kept], cost, status)

        try:
            state = self.begin()
            for n in range(run.steps + 1):
                t = float(times[n])
                state = self.step(state, t) if n else state
                self.account.add(state.q, state.v, t, state.p, state.mu)
                record.count_turns(state.q)
                if n in wanted:
                    energies = system.energies(state.q, state.v, t, self.account)
                    record.keep(state.q, state.v, state.a, energies)
                    kept.append(n)
        except Failure as failure:
            status = failed_step(system.layout, failure, n, float(times[n]), self.advice)
            return so_far(status, n - 1)
        except KeyboardInterrupt:
            raise Interrupted(so_far(interruption(float(times[max(n - 1, 0)])), n - 1)) from None
        except PropertyError as error:  # of a load, a drive or a law
            raise HistoryError(so_far(broken_off(error, float(times[max(n - 1, 0)])), n - 1)) from error
        return so_far(status, run.steps)


def failed_step(layout: Layout, failure: Failure, n: int, t: float, advice: str) -> Status:
    """The status of a run whose step n, at t (s), failed."""
    where, body, element = "", None, None
    if failure.change is not None:
        sizes = np.where(np.isfinite(failure.change), np.abs(failure.change), np.inf)
        body, element = layout.owner(int((sizes / layout.unit).argmax()))
        where = f", body {body!r}" + (f", element {element}" if element is not None else "")
    history = f", residuals {in_short(failure.residuals)} N" if failure.residuals else ""
    message = f"{failure} at t = {t:.6g} s (step {n}){where}{history}: {advice}"
    return Status("diverged", message, t, n, body, element, failure.residuals)


class Record:
    """Outputs of a run, and the rotations of bodies, which are summed over all steps because of whole turns."""

    def __init__(self, system: System) -> None:
        layout = system.layout
        self.layout = layout
        self.states: list[tuple[Array, ...]] = []
        self.turning = turning_bodies(layout.scene)
        self.places = turning_coordinates(layout, self.turning)
        self.last = layout.reference[self.places]
        self.angles = np.zeros(len(self.places))

    def count_turns(self, q: Array) -> None:
        """Add the rotations since the last call, each less than half a turn."""
        now = q[self.places]
        (x, y), (u, v) = self.last.T, now.T
        self.angles = self.angles + np.arctan2(x * v - y * u, x * u + y * v)
        self.last = now

    def keep(self, q: Array, v: Array, a: Array, energies: Array) -> None:
        """One more output."""
        self.states.append((q, v, a, energies, self.angles))

    def solution(
        self, solver: str, t: Array, cost: Cost, status: Status, *, static: bool = False
    ) -> Solution:
        """The answer as far as it goes."""
        size, count = self.layout.size, len(self.turning)
        series = list(zip(*self.states, strict=True)) or [()] * 5
        widths = (size, size, size, 5, count)
        q, v, a, energies, angles = (
            np.array(x).reshape(len(self.states), w) for x, w in zip(series, widths, strict=True)
        )
        rates = () if static else (v, a)
        named = None if static else (self.turning, angles)
        return answer(self.layout, solver, t, (q, *rates), energies, cost, status, named)


def turning_coordinates(layout: Layout, names: Sequence[str]) -> Ints:
    """Coordinates of the vectors that turn with the starts of bodies, (names, 2)."""
    bodies = [layout.scene.body(name) for name in names]
    places = [Place(body, 0.0 if isinstance(body, Beam) else CENTER) for body in bodies]
    return np.array([layout.direction(place).at for place in places], dtype=np.int64).reshape(-1, 2)


def answer(
    layout: Layout,
    solver: str,
    t: Array,
    series: Sequence[Array],
    energies: Array,
    cost: Cost,
    status: Status,
    turned: tuple[Sequence[str], Array] | None,
) -> Solution:
    """The solution, as far as checks find nothing wrong.

    Parameters
    ----------
    series : sequence of ndarray, each (n, size)
        Coordinates and, of motions, velocities and accelerations.
    energies : ndarray, shape (n, 5)
    turned : bodies and their angles, (n, bodies), or None
        Of motions; without them the solution is static.
    """
    fields = fields_of(layout, series)
    for name, angle in zip(turned[0], turned[1].T, strict=True) if turned is not None else ():
        fields[name] = replace(fields[name], start_angle=angle.copy())  # type: ignore[type-var]
    static = turned is None
    energy = Energy(*(column.copy() for column in energies.T))
    found = Solution(
        solver, layout.scene, layout.run, t, fields, energy, cost, status, layout.size, static=static
    )
    return checked(found, static=static)


def fields_of(layout: Layout, series: Sequence[Array]) -> dict[str, Field]:
    """Motion of every body from coordinates and, of motions, velocities and accelerations, (n, size)."""
    found, n = dict[str, Field](), len(series[0])
    for body in layout.scene.bodies:
        if (mesh := layout.meshes.get(body.name)) is not None:
            own = (x[:, mesh.first : mesh.first + mesh.size].reshape(n, -1, mesh.vectors, 2) for x in series)
            found[body.name] = beam_field(mesh.kind, mesh.body, *own)
        elif isinstance(body, Beam):
            first, *others = (_bar(layout, body, x) for x in series)
            found[body.name] = HermiteField(first, body.length, *others)
        else:
            points = {key: body.arm(key) for key in body.points} if isinstance(body, RigidBody) else {}
            first, *others = (_vectors(layout, body, x, k == 0) for k, x in enumerate(series))
            found[body.name] = RigidField(first, points, *others)
    return found


def _vectors(layout: Layout, body: RigidBody | PointMass, x: Array, places: bool) -> Array:
    """r and t, or their rates, of a rigid body, (n, 2, 2); a point mass does not turn."""
    at = layout.first[body.name]
    if isinstance(body, RigidBody):
        return x[:, at : at + 4].reshape(-1, 2, 2)
    still = np.tile([1.0 if places else 0.0, 0.0], (len(x), 1))
    return np.stack([x[:, at : at + 2], still], axis=1)


def _bar(layout: Layout, beam: Beam, x: Array) -> Array:
    """Both nodes of a rigid bar, (n, 2, 2, 2)."""
    body, at = layout.rigid[beam.name], layout.first[beam.name]
    assert isinstance(body, RigidBody)
    r, t = x[:, at : at + 2], x[:, at + 2 : at + 4]
    normal = np.stack([-t[:, 1], t[:, 0]], axis=1)
    dx, dy = (np.array(beam.end) - beam.start) / beam.length
    gradient = dx * t + dy * normal
    nodes = []
    for key in ("start", "end"):
        u, w = body.arm(key)
        nodes.append(np.stack([r + u * t + w * normal, gradient], axis=1))
    return np.stack(nodes, axis=1)
