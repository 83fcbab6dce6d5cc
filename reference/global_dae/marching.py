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
        self.length = max(1.0, system.layout.scene.length)
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
        record, kept = Record(system.layout), list[int]()
        start = process_time(), perf_counter()
        n = 0

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
            return so_far(failed_step(system.layout, failure, n, float(times[n]), self.advice), n - 1)
        except KeyboardInterrupt:
            raise Interrupted(so_far(interruption(float(times[max(n - 1, 0)])), n - 1)) from None
        except PropertyError as error:  # of a load, a drive or a law
            raise HistoryError(so_far(broken_off(error, float(times[max(n - 1, 0)])), n - 1)) from error
        return so_far(Status(), run.steps)


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
    """Outputs of a run."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.turns = layout, Turns(layout)
        self.states: list[tuple[Array, ...]] = []

    def count_turns(self, q: Array) -> None:
        """Add the rotations since the last call."""
        self.turns.count(q[None])

    def keep(self, q: Array, v: Array, a: Array, energies: Array) -> None:
        """One more output."""
        self.states.append((q, v, a, energies, self.turns.angles))

    def solution(
        self, solver: str, t: Array, cost: Cost, status: Status, *, static: bool = False
    ) -> Solution:
        """The answer as far as it goes."""
        size = self.layout.size
        widths = (size, size, size, 5, len(self.turns.names))
        columns = list(zip(*self.states, strict=True)) or [()] * len(widths)
        q, v, a, energies, angles = (
            np.array(x).reshape(-1, w) if w else np.zeros((len(x), 0))
            for x, w in zip(columns, widths, strict=True)
        )
        turned = None if static else dict(zip(self.turns.names, angles.T, strict=True))
        return answer(self.layout, solver, t, (q,) if static else (q, v, a), energies, cost, status, turned)


def answer(
    layout: Layout, solver: str, t: Array, series: Sequence[Array], energies: Array, cost: Cost, status: Status,
    turned: dict[str, Array] | None,
) -> Solution:  # fmt: skip
    """The solution, as far as checks find nothing wrong.

    Parameters
    ----------
    series : sequence of ndarray, each (n, size)
        Coordinates and, of motions, velocities and accelerations.
    energies : ndarray, shape (n, 5)
    turned : mapping from body to its angles, (n,), or None
        Of motions; without them the solution is static.
    """
    fields = fields_of(layout, series)
    for name, angle in (turned or {}).items():
        fields[name] = replace(fields[name], start_angle=angle.copy())  # type: ignore[type-var]
    static, energy = turned is None, Energy(*energies.T.copy())
    found = Solution(
        solver, layout.scene, layout.run, t, fields, energy, cost, status, layout.size, static=static
    )
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
        r, turns = (x[:, at : at + 2] for x in series), isinstance(solid, RigidBody)
        still = [
            np.tile([float(k == 0), 0.0], (n, 1)) for k in range(len(series))
        ]  # a point mass does not turn
        t = (x[:, at + 2 : at + 4] for x in series) if turns else still
        pairs = list(zip(r, t, strict=True))
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
