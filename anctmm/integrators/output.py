"""Output of a run: coordinates and energies at the output steps, and how the run ended."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple, assert_never

import numpy as np
from numpy.typing import NDArray

from anctmm.discretise.assembly import Tables, kinetic_energy, strain_energy
from anctmm.discretise.chain import Chain
from anctmm.discretise.discretisation import Discretisation
from anctmm.discretise.kept_chains import light, once
from anctmm.discretise.turning import angles_by_body
from anctmm.elements.kinds import kind_of
from anctmm.errors import PropertyError
from anctmm.forces.connectors import Connectors, connectors_energy
from anctmm.integrators.turn_count import TurnCount, new_count, put_angles
from anctmm.jit.announcing import compiling
from anctmm.jit.by_address import by_address
from anctmm.jit.compiling import embedded, kernel, separate
from anctmm.kernels.pacing import paced, part_by_part
from anctmm.model.bodies import Beam, Body
from anctmm.model.rigid_bodies import PointMass, RigidBody
from anctmm.model.topology import turning_bodies
from anctmm.results.checks.divergence import checked
from anctmm.results.ended_early import HistoryError, Interrupted, broken_off, interruption
from anctmm.results.fields import HermiteField, RigidField, beam_field
from anctmm.results.solution import Cost, Energy, Solution
from anctmm.results.status import Status

Array = NDArray[np.float64]

#: Seconds that a step takes for each node, about.
STEP = 2e-6
#: Outputs up to which their times are kept for other scenes.
FEW = 4096
#: Coordinates that are looked at together after a run.
TOGETHER = 1 << 17


@by_address
class Output(NamedTuple):
    """What kernels fill: coordinates, velocities and accelerations, (outputs, rows, nodes), kinetic and strain energy,
    work and the part of it that damping does, (outputs, 4), and both done until now, (2,); angles of the bodies whose
    turns are counted, (outputs, bodies), and their turns until now.
    """

    q: Array
    v: Array
    a: Array
    energy: Array
    work: Array
    angles: Array
    turns: TurnCount


@dataclass
class Record:
    """Room for a run's output, filled by the kernels.

    Parameters
    ----------
    chain : Chain
    outputs : int, optional
        Number of outputs; those of the discretisation without it.
    """

    chain: Chain
    outputs: int | None = None
    #: Coordinates, velocities and accelerations, (3, n, rows, nodes).
    series: Array = field(init=False)
    energy: Array = field(init=False)
    #: Angles of the bodies whose turns are counted in the steps, (n, bodies), rad.
    angles: Array = field(init=False)
    #: Angles of the sections at nodes since the undeformed scene, (k, nodes), at the first k outputs, where counted.
    turned: Array | None = field(init=False, default=None)
    started: tuple[float, float] = field(init=False)
    ended: tuple[float, float] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.resize(self.outputs or len(light(self.chain, output_times)))

    def resize(self, n: int) -> None:
        """Make room for n outputs, none of which is filled."""
        self.series = np.empty((3, n, self.chain.bodies.rows, self.chain.bodies.nodes))
        self.energy = np.zeros((n, 4))
        self.angles = np.zeros((n, len(turning_bodies(self.chain.scene))))

    @property
    def q(self) -> Array:
        """Coordinates, (n, rows, nodes)."""
        return self.series[0]

    def arrays(self) -> Output:
        """What kernels fill, before the first step."""
        q, v, a = self.series
        return Output(q, v, a, self.energy, np.zeros(2), self.angles, new_count(self.chain))

    def start(self) -> None:
        """Start the clocks."""
        self.started, self.ended = _clocks(), None

    def stop(self) -> None:
        """Stop the clocks: no more steps are taken."""
        self.ended = _clocks()

    def fields(self, kept: int, static: bool = False) -> dict[str, HermiteField | RigidField]:
        """Motion of each body at the first `kept` outputs."""
        chain, series = self.chain, self.series[: 1 if static else None, :kept]
        cut, turned, angles = chain.run.of(chain.scene), self._turned(), dict[str, Array]()
        before = {} if turned is None else angles_by_body(chain, turned[:kept])
        if not static:
            angles = dict(zip(turning_bodies(chain.scene), self.angles[:kept].T.copy(), strict=True))
        fields = {}
        for name, (q, *rates) in chain.by_body(series).items():
            v, a = rates or (None, None)
            body = chain.scene.body(name)
            fields[name] = field_of(body, cut, q, v, a, before.get(name), angles.get(name))
        return fields

    def solution(
        self,
        kept: int,
        status: Status,
        steps: int,
        iterations: int = 0,
        factorizations: int = 1,
        t: Array | None = None,
    ) -> Solution:
        """The solution with the first `kept` outputs that are valid, at the times of the discretisation or,
        for statics, at the load factors `t`.
        """
        ended = self.ended or _clocks()
        cpu, wall = ended[0] - self.started[0], ended[1] - self.started[1]
        chain = self.chain
        q, static = self.q[:kept], t is not None
        fields = self.fields(kept, static)
        kinetic, strain, work, damping = self.energy[:kept].T
        potential = _potential(q, light(chain, _reference), chain.dead_load)
        found = Solution(
            solver="anctmm",
            scene=chain.scene,
            run=chain.run,
            t=light(chain, output_times)[:kept].copy() if t is None else t,
            fields=fields,
            energy=Energy(kinetic, strain, potential, work, 0.0 - damping),
            cost=Cost(cpu, wall, steps, iterations, factorizations),
            status=status,
            dofs=once(chain, _dofs),
            static=static,
        )
        rests = chain.start is not None and chain.start.rests
        return checked(found, static=static, rests=rests)

    def _turned(self) -> Array | None:
        """Angles of sections where they are counted: by statics, and where a motion starts from an equilibrium."""
        start = self.chain.start
        return self.turned if start is None else start.turned[None]


def _clocks() -> tuple[float, float]:
    """Processor and wall time, s, which stand still while a kernel is compiled."""
    return time.process_time() - compiling.cpu_seconds, time.perf_counter() - compiling.seconds


def output_times(chain: Chain) -> Array:
    """Times of all outputs, s."""
    few = chain.run.steps // chain.run.stride <= FEW
    return (_kept_times if few else _times)(chain.run)


def _times(run: Discretisation) -> Array:
    return run.times(run.output_steps)


#: The same, for one scene after another.
_kept_times = lru_cache(maxsize=16)(_times)


def _reference(chain: Chain) -> Array:
    return chain.bodies.reference()


def field_of(
    body: Body,
    cut: Mapping[str, tuple[int, str]],
    q: Array,
    v: Array | None,
    a: Array | None,
    turned: Array | None = None,
    start_angle: Array | None = None,
) -> HermiteField | RigidField:
    """Motion of a body, cut as `Discretisation.of` says, from coordinates and rates, (outputs, nodes, vectors, 2).

    turned, start_angle: as of the fields.
    """
    match body:
        case Beam():
            return beam_field(kind_of(cut[body.name][1]), body, q, v, a, turned, start_angle)
        case RigidBody():
            arms = {key: body.arm(key) for key in body.points}
            v, a = (None if x is None else x[:, 0] for x in (v, a))
            return RigidField(q[:, 0], arms, v, a, turned, start_angle)
        case PointMass():
            v, a = (None if x is None else _standing(x, 0.0) for x in (v, a))
            return RigidField(_standing(q, 1.0), {}, v, a, turned, start_angle)
    assert_never(body)


def _standing(series: Array, x: float) -> Array:
    """Coordinates of a point mass, (outputs, 1, 1, 2), with those of a vector (x, 0), (outputs, 2, 2)."""
    return np.stack([series[:, 0, 0], np.tile([x, 0.0], (len(series), 1))], axis=1)


def _dofs(chain: Chain) -> int:
    return chain.dofs


def _potential(q: Array, reference: Array, dead: Array) -> Array:
    """Potential energy of constant forces, J, at each of the coordinates, (outputs, rows, nodes)."""
    found, size = np.empty(len(q)), max(1, TOGETHER // reference.size)
    for first in range(0, len(q), size):
        moved = reference - q[first : first + size]
        found[first : first + size] = moved.reshape(len(moved), -1) @ dead.ravel()
    return found


def worst_element(chain: Chain, size: Array) -> tuple[str, int | None]:
    """Body and element next to the node of the largest (or first not finite) of sizes, (nodes,)."""
    bad = np.flatnonzero(~np.isfinite(size))
    return chain.element_at(int(bad[0]) if bad.size else int(np.argmax(size)))


def gradient_size(q: Array) -> Array:
    """Largest gradient component of each node, (nodes,)."""
    return np.abs(q[2:]).max(axis=0)


def run_batches(
    chain: Chain, width: int, one: Callable[[int, int], int], so_far: Callable[[int, Status, int], Solution]
) -> int:
    """Take the steps of a run in batches that Ctrl-C can come between.

    Parameters
    ----------
    chain : Chain
    width : int
        Numbers tabulated for each step.
    one : callable
        Takes the steps of a range; the step that failed, or −1.
    so_far : callable
        (outputs kept, status, steps) → solution.

    Returns
    -------
    int
        The step that failed, or −1.

    Raises
    ------
    Interrupted, HistoryError
        With the history until then.
    """
    run, failed = chain.run, -1

    def until(step: int) -> tuple[float, Callable[[Status], Solution]]:
        """Time of a step that is not taken, and the solution of those before it."""
        when, kept = float(run.times(np.array([step]))[0]), 1 + (step - 1) // run.stride
        return when, lambda status: so_far(kept, status, step)

    def part(begin: int, end: int) -> None:
        nonlocal failed
        failed = failed if failed >= 0 else one(begin, end)

    for begin, end in paced(run.steps + 1, STEP * chain.bodies.nodes, width):
        try:
            part(begin, end)
        except KeyboardInterrupt:
            when, found = until(begin)
            raise Interrupted(found(interruption(when))) from None
        except PropertyError as error:  # of a load or a drive
            # the first that fails, not one far ahead
            step, own = part_by_part(part, begin, end, PropertyError)
            when, found = until(step)
            if failed < 0:
                raise HistoryError(found(broken_off(own or error, when))) from error
        if failed >= 0:
            return failed
    return -1


@kernel
def too_large(q: Array, limit: float) -> bool:
    """Whether a gradient is larger than the limit, or not a number."""
    for k in range(2, q.shape[0]):
        for i in range(q.shape[1]):
            if not abs(q[k, i]) <= limit:
                return True
    return False


@embedded
def add_work(out, done):  # type: ignore[no-untyped-def]
    """Count work that was done, J, all and that of damping."""
    out.work[0] += done[0]
    out.work[1] += done[1]


@separate
def keep(
    step: int,
    stride: int,
    q: Array,
    v: Array,
    a: Array,
    tables: Tables,
    connectors: Connectors | None,
    out: Output,
) -> None:
    """Keep the state of an output step; the last step of a run has the last place."""
    place = step // stride if step % stride == 0 else len(out.q) - 1
    for k in range(q.shape[0]):  # a loop: assigning a whole array compiles seconds longer
        for i in range(q.shape[1]):
            out.q[place, k, i], out.v[place, k, i], out.a[place, k, i] = q[k, i], v[k, i], a[k, i]
    out.energy[place, 0] = kinetic_energy(v, tables.first, tables.masses)
    out.energy[place, 1] = strain_energy(tables.formulations, q, tables.first, tables.kinds, tables.constants)
    out.energy[place, 1] += connectors_energy(connectors)
    out.energy[place, 2], out.energy[place, 3] = out.work[0], out.work[1]
    put_angles(q, out.turns, out.angles[place])
