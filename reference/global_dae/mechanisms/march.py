"""Time marching shared by both integrators: output, cost and status."""

from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from anctmm.elements.kinds import kind_of
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
from reference.global_dae.mechanisms.layout import Layout
from reference.global_dae.mechanisms.system import Account, System
from reference.global_dae.turning import Ints, not_turned, turn, with_angles

Array = NDArray[np.float64]


class Failure(Exception):
    """A step that failed: the reason, the correction or acceleration that shows where, and residuals (N)."""

    def __init__(self, why: str, change: Array | None, residuals: tuple[float, ...] = ()) -> None:
        super().__init__(why)
        self.change, self.residuals = change, residuals


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
        self.newton_iterations, self.factorizations = 0, 1

    def begin(self) -> State:
        """The state at t = 0."""
        raise NotImplementedError

    def step(self, state: State, n: int, t: float) -> State:
        """The step that leads to number n."""
        raise NotImplementedError

    def start(self, q: Array, v: Array, p: Array) -> Array:
        """Velocities that fit joints and drives, with the least change of the coordinates' rates."""
        c = self.system.constraints
        if not c.count:
            return v
        J = c.jacobian(q, p)
        return np.asarray(v - np.linalg.lstsq(J, J @ v + c.rate(q, p), rcond=1e-12)[0])

    def march(self, solver: str) -> Solution:
        """To the end, or as far as it goes."""
        system, run = self.system, self.run
        wanted = run.output_steps
        record = Record(system, len(wanted))
        system.restart()
        self.account = Account(system)
        self.begin()  # compiles
        system.restart()
        self.account = Account(system)
        state = self.begin()
        start = process_time(), perf_counter()
        status, taken = Status(), 0
        times = run.times(np.arange(run.steps + 1))

        def so_far(status: Status) -> Solution:
            cost = Cost(
                process_time() - start[0], perf_counter() - start[1], taken,
                self.newton_iterations, self.factorizations,
            )  # fmt: skip
            return record.solution(solver, times[wanted[: record.count]], cost, status)

        try:
            for n in range(run.steps + 1):
                t = float(times[n])
                if n > 0:
                    try:
                        state = self.step(state, n, t)
                    except Failure as failure:
                        status = self._failed(failure, n, t)
                        break
                self.account.add(state.q, state.v, t, state.p, state.mu)
                turn(state.q, record.turned)
                if n == wanted[record.count]:
                    energies = system.energies(state.q, state.v, t, self.account)
                    record.keep(state.q, state.v, state.a, energies)
                taken = n
        except KeyboardInterrupt:
            raise Interrupted(so_far(interruption(float(times[taken])))) from None
        except PropertyError as error:  # of a load, a drive or a law
            raise HistoryError(so_far(broken_off(error, float(times[taken])))) from error
        return so_far(status)

    def _failed(self, failure: Failure, n: int, t: float) -> Status:
        where, body, element = "", None, None
        if failure.change is not None:
            sizes = np.where(np.isfinite(failure.change), np.abs(failure.change), np.inf)
            body, element = self.system.layout.owner(int(sizes.argmax()))
            where = f", body {body!r}" + (f", element {element}" if element is not None else "")
        history = f", residuals {in_short(failure.residuals)} N" if failure.residuals else ""
        message = f"{failure} at t = {t:.6g} s (step {n}){where}{history}: {self.advice}"
        return Status("diverged", message, t, n, body, element, failure.residuals)


class Record:
    """Outputs of a run."""

    def __init__(self, system: System, count: int) -> None:
        self.system, self.count = system, 0
        self.q, self.v, self.a = np.zeros((3, count, system.size))
        self.energies = np.zeros((count, 5))
        self.turning = turning_bodies(system.layout.scene)
        self.turned = not_turned(_turning(system.layout, self.turning), system.layout.reference)
        self.angles = np.zeros((count, len(self.turning)))

    def keep(self, q: Array, v: Array, a: Array, energies: Array) -> None:
        """One more output."""
        k = self.count
        self.q[k], self.v[k], self.a[k], self.energies[k] = q, v, a, energies
        self.angles[k] = self.turned.angles
        self.count += 1

    def solution(
        self, solver: str, t: Array, cost: Cost, status: Status, *, static: bool = False
    ) -> Solution:
        """The answer as far as it goes."""
        layout, n = self.system.layout, self.count
        fields = fields_of(layout, self.q[:n], *(() if static else (self.v[:n], self.a[:n])))
        if not static:
            fields = with_angles(fields, self.turning, self.angles[:n])
        energy = Energy(*(column.copy() for column in self.energies[:n].T))
        found = Solution(
            solver, layout.scene, layout.run, t, fields, energy, cost, status, layout.size, static=static
        )
        return checked(found, static=static)


def fields_of(layout: Layout, q: Array, *rates: Array) -> dict[str, Field]:
    """Motion of every body from coordinates and, of motions, velocities and accelerations, (n, size)."""
    series, found = (q, *rates), dict[str, Field]()
    bending = [_nodal(layout, x) for x in series]
    for body in layout.scene.bodies:
        if body.name in bending[0]:
            assert isinstance(body, Beam)
            first, *others = (nodal[body.name] for nodal in bending)
            found[body.name] = beam_field(kind_of(layout.cut[body.name][1]), body, first, *others)
        elif isinstance(body, Beam):
            first, *others = (_bar(layout, body, x) for x in series)
            found[body.name] = HermiteField(first, body.length, *others)
        else:
            points = {key: body.arm(key) for key in body.points} if isinstance(body, RigidBody) else {}
            first, *others = (_vectors(layout, body, x, k == 0) for k, x in enumerate(series))
            found[body.name] = RigidField(first, points, *others)
    return found


def _turning(layout: Layout, names: list[str]) -> Ints:
    """Coordinates of the vectors that turn with the starts of bodies, (names, 2)."""
    bodies = [layout.scene.body(name) for name in names]
    places = [Place(body, 0.0 if isinstance(body, Beam) else CENTER) for body in bodies]
    return np.array([layout.direction(place).at for place in places], dtype=np.int64).reshape(-1, 2)


def _nodal(layout: Layout, q: Array) -> dict[str, Array]:
    """(n, nodes, vectors, 2) of every beam that bends."""
    if layout.beams is None:
        return {}
    flat = np.zeros((len(q), layout.beams.size))
    flat[:, layout.numbers] = q[:, : layout.bending]
    return layout.beams.bodies.by_body(flat.reshape(len(q), layout.beams.bodies.rows, -1))


def _vectors(layout: Layout, body: RigidBody | PointMass, x: Array, places: bool) -> Array:
    """r and t, or their rates, of a rigid body, (n, 2, 2); a point mass does not turn."""
    at = layout.first[body.name]
    if isinstance(body, RigidBody):
        return x[:, at : at + 4].reshape(-1, 2, 2)
    still = np.tile([1.0 if places else 0.0, 0.0], (len(x), 1))
    return np.stack([x[:, at : at + 2], still], axis=1)


def _bar(layout: Layout, beam: Beam, x: Array) -> Array:
    """Both ends of a beam of element "rigid" with their gradients, (n, 2, 2, 2)."""
    at, body = layout.first[beam.name], layout.rigid[beam.name]
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
