"""Outputs of a run: what steps keep, and the solution made of it."""

import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from anctmm.integrators.starting import rests
from anctmm.integrators.state import State
from anctmm.integrators.turning import Turning, count_turns, turning_of
from anctmm.kernels.announcing import compiling
from anctmm.kernels.by_address import by_address
from anctmm.kernels.options import part
from anctmm.model.rigid_bodies import PointMass
from anctmm.model.topology import turning_bodies
from anctmm.results.checks.divergence import STRETCH_LIMIT, checked
from anctmm.results.fields import HermiteField, RigidField, beam_field
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status
from anctmm.system.acting import connector_energy
from anctmm.system.body_meshes import BeamMesh, MassMesh, RigidMesh
from anctmm.system.calls import (
    drive_power,
    drive_work,
    kinetic_energy,
    power,
    strain_energy,
    subtract_damping,
    work_done,
)
from anctmm.system.elastic import Elements
from anctmm.system.forces import set_reactions
from anctmm.system.system import System
from anctmm.system.tables import Inputs, Tables

Array = NDArray[np.float64]


BodyField = HermiteField | RigidField


@by_address
class Output(NamedTuple):
    """What steps fill, for kernels.

    Parameters
    ----------
    series : ndarray, shape (3, outputs, rows, nodes)
        Coordinates, velocities and accelerations.
    energy : ndarray, shape (outputs, 4)
        Kinetic and strain energy, work, and the part of it that damping does, J.
    work : ndarray, shape (2,)
        Work until now, and that of damping.
    angles : ndarray, shape (outputs, turning bodies)
    turning : Turning
    memory : ndarray, shape (4, rows, nodes)
        At the last step: forces of drives on driven vectors, damping forces of materials, and the coordinates of both.
    drive : ndarray, shape (3, signals)
        Memory of `drive_work`.
    """

    series: Array
    energy: Array
    work: Array
    angles: Array
    turning: Turning
    memory: Array
    drive: Array


class Record:
    """Room for the outputs of a run.

    Parameters
    ----------
    system : System
    t : ndarray, shape (outputs,)
        Times of all outputs, s; of statics load factors.
    start : Solution, optional
        The equilibrium that the motion starts from.
    """

    def __init__(self, system: System, t: Array, start: Solution | None = None) -> None:
        self.system, self.t, self.start = system, t, start
        rows, nodes = system.mesh.rows, system.mesh.nodes
        turning = turning_of(system)
        self.out = Output(
            np.zeros((3, len(t), rows, nodes)), np.zeros((len(t), 4)), np.zeros(2),
            np.zeros((len(t), len(turning.angle))), turning, np.zeros((4, rows, nodes)),
            np.zeros((3, 1 + len(system.signals))),
        )  # fmt: skip
        self.started: tuple[float, float] = _clocks()
        self.ended: tuple[float, float] | None = None

    def restart(self) -> None:
        """Start the clocks."""
        self.started = _clocks()

    def stop(self) -> None:
        """Stop the clocks: no more steps are taken."""
        self.ended = _clocks()

    def fields(self, count: int, static: bool = False) -> dict[str, BodyField]:
        """Motion of each body at the first outputs."""
        mesh, found = self.system.mesh, dict[str, BodyField]()
        counted = dict(zip(turning_bodies(self.system.scene), self.out.angles[:count].T.copy(), strict=False))
        for name, series in mesh.by_body(self.out.series[: 1 if static else None, :count]).items():
            body = mesh.bodies[name]
            turns = self.start is not None and mesh.dim == 2 and not isinstance(body, MassMesh)
            turned = self.start.whole_turns.of_nodes(name)[-1:] if turns and self.start is not None else None
            found[name] = field_of(body, series, None if static else counted.get(name), turned)
        return found

    def solution(self, count: int, status: Status, state: State | None, steps: int) -> Solution:
        """The solution with the first outputs, checked."""
        ended = self.ended or _clocks()
        cpu, wall = (now - then for now, then in zip(ended, self.started, strict=True))
        system, out = self.system, self.out
        q = out.series[0, :count]
        kinetic, strain, work, damping = out.energy[:count].T.copy()
        dead = system.tables.dead
        potential = np.array([np.sum((system.mesh.reference - one) * dead) for one in q]).reshape(-1)
        counts = (0, 1) if state is None else (int(state.counts[0]), int(state.counts[1]))
        found = Solution(
            solver="anctmm",
            scene=system.scene,
            run=system.run,
            t=self.t[:count].copy(),
            fields=self.fields(count),
            energy=Energy(kinetic, strain, potential, work, 0.0 - damping),
            cost=Cost(cpu, wall, steps, *counts),
            status=status,
            dofs=system.numbering.unknowns,
        )
        return checked(found, rests=rests(system, self.start))


def _clocks() -> tuple[float, float]:
    """Processor and wall time, s, which stand still while a kernel is compiled."""
    return time.process_time() - compiling.cpu_seconds, time.perf_counter() - compiling.seconds


def field_of(mesh: object, series: Array, angle: Array | None, turned: Array | None = None) -> BodyField:
    """Motion of a body from coordinates and rates, (1 or 3, outputs, nodes, vectors, dim)."""
    q, *rates = series
    v, a = rates or (None, None)
    match mesh:
        case BeamMesh():
            return beam_field(mesh.kind, mesh.body, q, v, a, turned, angle)
        case RigidMesh():
            return _rigid_field(mesh, q, v, a, turned, angle)
    body = mesh.body  # type: ignore[attr-defined]
    if isinstance(body, PointMass):
        whole: Any = [None if x is None else _beside(x, k) for k, x in enumerate((q, v, a))]
        return RigidField(whole[0], {}, whole[1], whole[2], turned, angle)
    flat: Any = [None if x is None else x.reshape(len(x), 4, 3) for x in (q, v, a)]
    axes: Array = mesh.axes  # type: ignore[attr-defined]
    arms = {key: tuple((axes @ body.arm(key)).tolist()) for key in body.points}
    return RigidField(flat[0], arms, flat[1], flat[2], axes=tuple(map(tuple, axes.tolist())))


def _beside(x: Array, order: int) -> Array:
    """Coordinates of a point mass, (outputs, 1, 1, dim), with those of a vector that does not turn."""
    other = np.zeros_like(x[:, 0, 0])
    other[:, 0] = 1.0 if order == 0 else 0.0
    return np.stack([x[:, 0, 0], other], axis=1)


def _rigid_field(mesh: RigidMesh, *series: Array | None) -> HermiteField | RigidField:
    """Motion of a rigid body, or of a bar as of a beam of one element."""
    q, v, a, turned, angle = series
    if hasattr(mesh.body, "section"):
        ends = [mesh.position(k) for k in (0, 1)]
        angle_of = float(mesh.body.angle)
        c, s = np.cos(angle_of), np.sin(angle_of)
        along = {k: A @ np.array([[c, -s], [s, c]]) for k, A in mesh.direction().items()}
        parts = [
            np.stack([_at(x, ends[0]), _at(x, along), _at(x, ends[1]), _at(x, along)], axis=1)
            if x is not None
            else None
            for x in (q, v, a)
        ]
        shaped = [None if x is None else x.reshape(len(x), 2, 2, 2) for x in parts]
        return HermiteField(shaped[0], mesh.body.length, shaped[1], shaped[2], turned, angle)  # type: ignore[arg-type]
    center, turn = mesh.point(mesh.center), mesh.direction()
    parts = [None if x is None else np.stack([_at(x, center), _at(x, turn)], axis=1) for x in (q, v, a)]
    arms = {key: mesh.body.arm(key) for key in mesh.body.points}
    return RigidField(parts[0], arms, parts[1], parts[2], turned, angle)  # type: ignore[arg-type]


def _at(x: Array, form: dict[int, Array]) -> Array:
    """A vector of a body of one node from its coordinates, (outputs, 1, vectors, dim)."""
    return np.asarray(sum(x[:, 0, k] @ A.T for k, A in form.items()))


@part
def keep(place: int, space: tuple[int, ...], tables: Tables, state: State, out: Output) -> None:
    """Keep the state as an output."""
    for k in range(state.q.shape[0]):
        for i in range(state.q.shape[1]):
            out.series[0, place, k, i] = state.q[k, i]
            out.series[1, place, k, i] = state.v[k, i]
            out.series[2, place, k, i] = state.w[k, i]
    out.energy[place, 0] = kinetic_energy(space, tables, state.v, state.scratch)
    out.energy[place, 1] = strain_energy(tables, state.q) + connector_energy(tables.acting)
    out.energy[place, 2], out.energy[place, 3] = out.work[0], out.work[1]
    for n in range(len(out.turning.angle)):
        out.angles[place, n] = out.turning.angle[n]


@part
def count_work(
    space: tuple[int, ...],
    tables: Tables,
    state: State,
    moving: bool,
    inputs: Inputs,
    n: int,
    out: Output,
) -> None:
    """Count the work of a step that ends at the state, by the trapezoidal rule; none yet unless `moving`."""
    if len(tables.acting.kind) + len(tables.acting.load_kind) > 0:
        work_done(space, tables, moving, state.q, inputs, n, out.work)
    if inputs.signals.shape[1] > 1 and len(tables.rows.at) > 0:
        out.work[0] += drive_work(tables, state.q, inputs.signals[n], moving, out.drive)
    driven, dim = tables.driven, len(space)
    if len(driven.node) > 0:
        set_reactions(space, tables, state.q, state.v, state.w, inputs, n, state.scratch)
        for x in range(len(driven.node)):
            i, a = driven.node[x], driven.component[x]
            for k in range(a, a + dim):
                if moving:
                    mean = 0.5 * (state.scratch[k, i] + out.memory[0, k, i])
                    out.work[0] += mean * (state.q[k, i] - out.memory[2, k, i])
                out.memory[0, k, i], out.memory[2, k, i] = state.scratch[k, i], state.q[k, i]
    if tables.damped[1] != 0:
        _damping_work(space, tables, state, moving, out)


@part
def stage_power(
    space: tuple[int, ...],
    tables: Tables,
    state: State,
    inputs: Inputs,
    n: int,
    out: Array,
) -> None:
    """Power at a state of all that does work beside energies, and of damping, W, in out, (2,)."""
    out[0] = out[1] = 0.0
    power(space, tables, state.q, state.v, inputs, n, out)
    if inputs.signals.shape[1] > 1 and len(tables.rows.at) > 0:
        out[0] += drive_power(tables, state.q, inputs.signals[n])
    driven, dim = tables.driven, len(space)
    if len(driven.node) > 0:
        set_reactions(space, tables, state.q, state.v, state.w, inputs, n, state.scratch)
        for x in range(len(driven.node)):
            i, a = driven.node[x], driven.component[x]
            for k in range(a, a + dim):
                out[0] += state.scratch[k, i] * state.v[k, i]
    if tables.damped[1] != 0:
        state.scratch[:] = 0.0
        subtract_damping(space, tables, state.q, state.v, state.scratch)
        lost = 0.0
        for k in range(state.q.shape[0]):
            for i in range(state.q.shape[1]):
                lost += state.scratch[k, i] * state.v[k, i]
        out[0] += lost
        out[1] += lost


@part
def _damping_work(space: tuple[int, ...], tables: Tables, state: State, moving: bool, out: Output) -> None:
    """Count the work of damping forces of materials: their mean times the displacement.

    The power lost, integrated in time, would count a motion that dies out within a step many times over.
    """
    state.scratch[:] = 0.0
    subtract_damping(space, tables, state.q, state.v, state.scratch)
    for k in range(state.q.shape[0]):
        for i in range(state.q.shape[1]):
            if moving:
                mean = 0.5 * (state.scratch[k, i] + out.memory[1, k, i])
                done = mean * (state.q[k, i] - out.memory[3, k, i])
                out.work[0] += done
                out.work[1] += done
            out.memory[1, k, i], out.memory[3, k, i] = state.scratch[k, i], state.q[k, i]


@part
def too_large(elements: Elements, q: Array, dim: int, limit: float) -> bool:
    """Whether a gradient of a beam is larger than the limit, or not a number."""
    for b in range(len(elements.first)):
        first = elements.first[b]
        for k in range(dim, elements.vectors[b] * dim):
            for i in range(first, first + elements.number[b] + 1):
                if not abs(q[k, i]) <= limit:
                    return True
    return False


@part
def keep_due(step, last, stride, space, tables, state, out):  # type: ignore[no-untyped-def]
    """Count turns to the state of a fixed step, and keep it if an output is due; False if a gradient is too large."""
    count_turns(out.turning, state.q)
    if step % stride != 0 and step != last:
        return True
    if too_large(tables.elements, state.q, len(space), STRETCH_LIMIT):
        return False
    keep(step // stride if step % stride == 0 else len(out.energy) - 1, space, tables, state, out)
    return True
